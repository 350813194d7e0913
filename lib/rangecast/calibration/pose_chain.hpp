/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "bundle.hpp"

namespace rangecast {

/** Two cameras whose relative pose was estimated from the boards that both saw. */
struct CameraLink {
  int a = 0, b = 0; ///< cameras
  int frames = 0;   ///< that both saw
  Pose b_from_a;
};

/** Minimum number of common frames of two linked cameras. */
inline constexpr int kMinSharedFrames = 3;

/** Estimates initial poses of all cameras and boards from known lenses. Cameras are linked along a
 *  maximum spanning tree, weighted by the number of common boards. Method for a link:
 * cv::stereoCalibrate with fixed intrinsics.
 *  @param lenses  by camera; with poses of the boards
 *  @param[out] links  one less than the number of cameras
 *  @param stop  ends it before the next link
 *  @return kInterrupted, or kBadValue if no pose fits */
Status chain_cameras (const std::vector<CalibrationCamera> &cameras,
    const std::vector<CalibrationFrame> &frames, const BoardSpec &board,
    const std::vector<LensCalibration> &lenses, Bundle &bundle, std::vector<CameraLink> &links,
    const std::stop_token &stop = {});

/** @return kNotFound that names the groups of cameras without common boards */
Status check_linked (
    const std::vector<CalibrationCamera> &cameras, const std::vector<CalibrationFrame> &frames);

} // namespace rangecast
