/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "../geometry/rig.hpp"
#include "lens.hpp"
#include "world_frame.hpp"

#include <stop_token>

namespace rangecast {

struct CalibrationSettings {
  BoardSpec board;
  DistortionModel distortion = DistortionModel::kFive;
  int min_frames = 8; ///< each camera must have seen the board so often, 3 .. 1000
  WorldFrame world = WorldFrame::kCentre;
  double near_m = 0.3, far_m = 3; ///< written into all views; 0 < near < far
};

struct CameraReport {
  int camera = 0;
  int frames = 0;          ///< used
  double rms_px = 0;       ///< reprojection error in the end
  double alone_rms_px = 0; ///< of cv::calibrateCamera with this camera alone
};

/** Two cameras that saw boards together: all stereo pairs, and those that the poses were chained
 *  along. */
struct PairReport {
  int a = 0, b = 0;
  int frames = 0;           ///< that both saw
  double rms_px = 0;        ///< of both cameras in these frames
  double distance_m = 0;    ///< between the cameras
  double row_error_px = -1; ///< left and right: median |dy| after rectification; else -1
};

/** A board that does not fit, and was left out. */
struct DroppedBoard {
  std::uint64_t frame = 0; ///< CalibrationFrame::number
  int camera = 0;
  double rms_px = 0; ///< how badly
};

struct CalibrationResult {
  Rig rig;           ///< raw views, by view-id
  double rms_px = 0; ///< of all corners in all pictures
  int frames = 0;    ///< used
  std::vector<CameraReport> cameras;
  std::vector<PairReport> pairs;
  std::vector<DroppedBoard> dropped;
  std::vector<std::string> warnings; ///< what is odd although it may be
};

/** Whether the cameras make up views: a left one each, roles once, partners of the same size, and a
 *  board that can tell its ends apart where there is more than one.
 *  @return kBadValue or kBadSize that names the camera */
Status check_cameras (const std::vector<CalibrationCamera> &cameras, const BoardSpec &board);

/** From boards in pictures to a rig: each camera alone (cv::calibrateCamera), cameras chained along
 *  the boards that they share (cv::stereoCalibrate), then all lenses, cameras and boards together
 *  (bundle adjustment). Reprojection errors are the square root of the mean square distance.
 *  @param frames  boards at one moment each; corners by id, as BoardDetector gives them
 *  @param stop    ends it soon: between cameras, between pairs, in the adjustment
 *  @return one status that names the cameras and what was expected: too few frames, cameras that
 *  share no boards, left and right swapped, no solution; kInterrupted. Reentrant. */
Status calibrate_rig (const std::vector<CalibrationCamera> &cameras,
    std::vector<CalibrationFrame> frames, const CalibrationSettings &settings,
    CalibrationResult &result, std::stop_token stop = {});

} // namespace rangecast
