/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "board.hpp"

namespace rangecast {

/** The role of a camera in its view. */
enum class CameraRole {
  kLeft,  ///< the view's own camera; every view has one
  kRight, ///< the second camera of a stereo pair, on the left camera's +x side
  kThird, ///< a further camera beside it
};

[[nodiscard]] std::string_view role_name (CameraRole role);

/** A camera to calibrate. */
struct CalibrationCamera {
  std::string name; ///< for messages, e.g. a pad name
  int view_id = 0;  ///< 0 .. kMaxViews - 1
  CameraRole role = CameraRole::kLeft;
  int width = 0, height = 0; ///< pixels

  friend bool operator== (const CalibrationCamera &, const CalibrationCamera &) = default;
};

/** "sink_1 (view 0, right)" */
[[nodiscard]] std::string text_of (const CalibrationCamera &camera);

/** The board in the image of one camera. */
struct Sighting {
  int camera = 0; ///< index into the list of cameras
  std::vector<BoardCorner> corners;
};

/** The board at one moment, in the images of all cameras that saw it. */
struct CalibrationFrame {
  std::vector<Sighting> sightings; ///< at most one per camera
  std::uint64_t number = 0;        ///< the caller's number

  [[nodiscard]] const Sighting *find (int camera) const;
};

/** Number of frames in which both cameras saw the board, and at least 4 corners of it in common. */
[[nodiscard]] int shared_frames (const std::vector<CalibrationFrame> &frames, int a, int b);

/** Connected components of the cameras that saw the same boards.
 *  @param fewest_shared  number of frames that two linked cameras share at least
 *  @return the component of each camera, 0 for that of the first camera */
[[nodiscard]] std::vector<int> linked_groups (
    int cameras, const std::vector<CalibrationFrame> &frames, int fewest_shared);

} // namespace rangecast
