/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "../geometry/rig.hpp"
#include "lens.hpp"

#include <stop_token>

namespace rangecast {

/** Origin and orientation of the rig's world: right-handed, y up, metres. */
enum class WorldFrame {
  kCentre,    ///< origin at the point that the cameras look at, y is their mean up direction, the
              ///< first one on the +z side
  kFirstView, ///< origin in the first camera, which looks along -z
  kBoard, ///< origin in the centre of a board that lies on the floor, y is its normal towards the
          ///< cameras, z points towards the first camera
};

struct CalibrationSettings {
  BoardSpec board;
  DistortionModel distortion = DistortionModel::kFive;
  int min_frames = 8; ///< in which each camera must have seen the board, 3 .. 1000
  WorldFrame world = WorldFrame::kCentre;
  double near_m = 0.3, far_m = 3; ///< written into all views; 0 < near < far
};

struct CameraReport {
  int camera = 0;
  int frames = 0;          ///< used
  double rms_px = 0;       ///< final reprojection error
  double alone_rms_px = 0; ///< of cv::calibrateCamera for this camera alone
};

/** Two cameras with common boards: all stereo pairs, and the links of the pose chain. */
struct PairReport {
  int a = 0, b = 0;
  int frames = 0;           ///< that both cameras saw
  double rms_px = 0;        ///< of both cameras in these frames
  double distance_m = 0;    ///< between the cameras
  double row_error_px = -1; ///< median |dy| after rectification; -1 unless a stereo pair
};

/** A board that was rejected as an outlier. */
struct DroppedBoard {
  std::uint64_t frame = 0; ///< CalibrationFrame::number
  int camera = 0;
  double rms_px = 0; ///< reprojection error
};

struct CalibrationResult {
  Rig rig;           ///< raw views, by view-id
  double rms_px = 0; ///< of all corners in all images
  int frames = 0;    ///< used
  std::vector<CameraReport> cameras;
  std::vector<PairReport> pairs;
  std::vector<DroppedBoard> dropped;
  std::vector<std::string> warnings; ///< unusual but possible results
};

/** Checks that the cameras form views: each with one left camera, no role twice, partners of the
 * same size; and that the board is asymmetric if there are several cameras.
 *  @return kBadValue or kBadSize that names the camera */
Status check_cameras (const std::vector<CalibrationCamera> &cameras, const BoardSpec &board);

/** Calibrates a rig from boards in images: each camera alone (cv::calibrateCamera), initial poses
 * from common boards (cv::stereoCalibrate), then all lenses and poses together (bundle adjustment).
 *  Reprojection errors are RMS.
 *  @param frames  each of one moment; corners sorted by id, as BoardDetector returns them
 *  @param stop    is checked between cameras, between pairs, and during bundle adjustment
 *  @return an error that names the cameras and what was expected: too few frames, cameras without
 * common boards, left and right exchanged, no solution; or kInterrupted. Reentrant. */
Status calibrate_rig (const std::vector<CalibrationCamera> &cameras,
    std::vector<CalibrationFrame> frames, const CalibrationSettings &settings,
    CalibrationResult &result, std::stop_token stop = {});

} // namespace rangecast
