/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "observations.hpp"

namespace rangecast {

/** Where and how a board lies in a picture, each in a unit in which 0.1 is worth a new picture. */
struct BoardPlace {
  double x = 0, y = 0; ///< middle of the corners, 0 .. 1 of the picture
  double size = 0;     ///< square root of the share of the picture that the corners enclose
  double tilt_x = 0;   ///< of the board's right end away from the camera: sine of the angle
  double tilt_y = 0;   ///< of its lower end away
};

/** @param corners  at least 4; tilt is worked out with a guessed focal length */
[[nodiscard]] BoardPlace place_board (
    const BoardSpec &board, const std::vector<BoardCorner> &corners, int width, int height);

/** What a camera has seen of the board so far. */
struct CameraCoverage {
  static constexpr int kColumns = 4, kRows = 3;

  int frames = 0;                             ///< taken frames with a board in this picture
  std::array<bool, kColumns * kRows> cells{}; ///< cells of the picture that held a corner, by rows
  bool tilted_left = false, tilted_right = false, tilted_up = false, tilted_down = false;
  bool distances = false; ///< boards of clearly different size

  /** 0 .. 1: how much of all that is wanted is there. */
  [[nodiscard]] double share () const;
  [[nodiscard]] bool complete () const { return share () == 1; }
  /** What to do next, in words, e.g. "board at the top left of the picture". */
  [[nodiscard]] std::vector<std::string> missing () const;
};

struct SelectionSettings {
  int max_frames = 100; ///< 3 .. 1000; then the frame most like others, but the first, makes room
  bool all = false;     ///< every frame with a board, moving and similar ones too
};

/** What became of a frame. */
enum class FrameVerdict {
  kTaken,
  kNoBoard, ///< in no picture
  kMoving,  ///< the board moved since the frame before, or was not in it
  kBlurred, ///< its edges are wide
  kSimilar, ///< no camera sees it at a new place
};
inline constexpr int kFrameVerdicts = 5;

[[nodiscard]] std::string_view verdict_name (FrameVerdict verdict);

/** Picks frames in which boards stand still, are sharp, and lie otherwise than in those it has. */
class FrameSelector {
public:
  void set (const BoardSpec &board, const SelectionSettings &settings);
  void clear ();

  /** @param cameras  all of them; later calls may have more at the end
   *  @param edge_widths  of each sighting (see edge_width_px), or empty: not judged
   *  @param time_ns  of the frame; frames more than a second apart say nothing about motion */
  FrameVerdict offer (const std::vector<CalibrationCamera> &cameras, CalibrationFrame frame,
      const std::vector<double> &edge_widths, std::uint64_t time_ns);

  [[nodiscard]] const std::vector<CalibrationFrame> &frames () const { return frames_; }
  [[nodiscard]] CameraCoverage coverage (const CalibrationCamera &camera, int index) const;

private:
  using Places = std::vector<std::pair<int, BoardPlace>>; // by camera

  [[nodiscard]] bool is_moving (
      const std::vector<CalibrationCamera> &cameras, const CalibrationFrame &frame) const;
  [[nodiscard]] double difference (const Places &places, std::size_t except) const;
  [[nodiscard]] bool links_are_few (const CalibrationFrame &frame) const;
  FrameVerdict take (CalibrationFrame frame, Places places);

  BoardSpec board_;
  SelectionSettings settings_;
  std::vector<CalibrationFrame> frames_;
  std::vector<Places> places_; // of frames_
  CalibrationFrame last_;      // offered before
  std::uint64_t last_time_ns_ = 0;
  bool have_last_ = false;
};

} // namespace rangecast
