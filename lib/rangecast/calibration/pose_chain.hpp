/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "bundle.hpp"

namespace rangecast {

/** Two cameras that were put side by side by the boards that both saw. */
struct CameraLink {
  int a = 0, b = 0; ///< cameras
  int frames = 0;   ///< that both saw
  Pose b_from_a;
  double rms_px = 0; ///< of cv::stereoCalibrate with the lenses held
};

/** Frames that two cameras must share to be linked. */
inline constexpr int kFewestSharedFrames = 3;

/** First poses of all cameras and boards, from lenses that are known: each camera is linked to one
 *  that has its pose already, those with most boards in common first (a spanning tree of the
 *  greatest weight). Method for a link: cv::stereoCalibrate with fixed intrinsics.
 *  @param lenses  by camera; their poses of boards place the boards
 *  @param[out] links  one less than there are cameras
 *  @param stop  ends it before the next link
 *  @return kInterrupted, or kNotFound that names the cameras that share too few boards with the
 * others */
Status chain_cameras (const std::vector<CalibrationCamera> &cameras,
    const std::vector<CalibrationFrame> &frames, const BoardSpec &board,
    const std::vector<LensCalibration> &lenses, Bundle &bundle, std::vector<CameraLink> &links,
    const std::stop_token &stop = {});

/** @return kNotFound that names the groups of cameras that share no boards */
Status check_linked (
    const std::vector<CalibrationCamera> &cameras, const std::vector<CalibrationFrame> &frames);

} // namespace rangecast
