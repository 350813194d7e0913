/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "observations.hpp"

namespace rangecast {

/** Position, size and tilt of a board in an image, scaled so that a difference of 0.1 is worth
 *  another image. */
struct BoardPlace {
  double x = 0, y = 0; ///< centre of the corners, 0 .. 1 of the image
  double size = 0;     ///< square root of the fraction of the image that the corners enclose
  double tilt_x = 0;   ///< sine of the angle by which the right end is tilted away from the camera
  double tilt_y = 0;   ///< the same for the lower end
};

/** @param corners  at least 4; tilt is computed with a guessed focal length */
[[nodiscard]] BoardPlace place_board (
    const BoardSpec &board, const std::vector<BoardCorner> &corners, int width, int height);

/** The part of its image in which a camera has seen the board. */
struct CameraCoverage {
  static constexpr int kColumns = 4, kRows = 3;

  int frames = 0;                             ///< frames kept in which this camera saw the board
  std::array<bool, kColumns * kRows> cells{}; ///< cells of the image with a corner, row-major
  bool tilted_left = false, tilted_right = false, tilted_up = false, tilted_down = false;
  bool distances = false; ///< boards of clearly different sizes

  /** Fraction of the required coverage, 0 .. 1. */
  [[nodiscard]] double share () const;
  [[nodiscard]] bool complete () const { return share () == 1; }
  /** What is missing, in words, e.g. "board at the top left of the image". */
  [[nodiscard]] std::vector<std::string> missing () const;
};

struct SelectionSettings {
  int max_frames = 100; ///< 3 .. 1000; then the most redundant frame but the first is replaced
  bool all = false;     ///< take every frame with a board, even moving and similar ones
};

/** The result for a frame. */
enum class FrameVerdict {
  kTaken,
  kNoBoard, ///< in no image
  kMoving,  ///< the board moved since the camera's previous image, or was not in it
  kBlurred, ///< edges are too wide
  kSimilar, ///< no camera sees it at a new place
};
inline constexpr int kFrameVerdicts = 5;

[[nodiscard]] std::string_view verdict_name (FrameVerdict verdict);

/** Selects frames in which the board is still, sharp, and at a new place, size or tilt. */
class FrameSelector {
public:
  void set (const BoardSpec &board, const SelectionSettings &settings);
  void clear ();

  /** @param cameras  all cameras; later calls may append more
   *  @param edge_widths  edge_width_px() of each sighting; empty: not evaluated
   *  @param time_ns  of the frame; motion is not evaluated between images a second or more apart
   *  @param has_image  whether there was an image, by camera; empty: of all cameras */
  FrameVerdict offer (const std::vector<CalibrationCamera> &cameras, CalibrationFrame frame,
      const std::vector<double> &edge_widths, std::uint64_t time_ns,
      const std::vector<bool> &has_image = {});

  [[nodiscard]] const std::vector<CalibrationFrame> &frames () const { return frames_; }
  [[nodiscard]] CameraCoverage coverage (const CalibrationCamera &camera, int index) const;

private:
  using Places = std::vector<std::pair<int, BoardPlace>>; // by camera
  struct LastImage {
    bool valid = false; // there was one
    std::uint64_t time_ns = 0;
    std::vector<BoardCorner> corners; // empty: without the board
  };

  [[nodiscard]] bool is_moving (const std::vector<CalibrationCamera> &cameras,
      const CalibrationFrame &frame, std::uint64_t time_ns) const;
  void record_images (
      const CalibrationFrame &frame, std::uint64_t time_ns, const std::vector<bool> &has_image);
  [[nodiscard]] double difference (const Places &places, std::size_t except) const;
  [[nodiscard]] bool is_new (const Places &places) const;
  FrameVerdict take (CalibrationFrame frame, Places places);

  BoardSpec board_;
  SelectionSettings settings_;
  std::vector<CalibrationFrame> frames_;
  std::vector<Places> places_;  // of frames_
  std::vector<LastImage> last_; // by camera
};

} // namespace rangecast
