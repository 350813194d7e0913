/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "lens.hpp"

#include <stop_token>

namespace rangecast {

/** Lenses and poses of all cameras and boards, which bundle adjustment refines. */
struct Bundle {
  std::vector<LensParameters> lenses;  ///< by camera
  std::vector<Pose> camera_from_first; ///< by camera; camera 0's is the identity
  std::vector<Pose> first_from_board;  ///< by frame, in camera 0's frame
};

struct BundleSettings {
  DistortionModel distortion = DistortionModel::kFive;
  double robust_px = 0; ///< threshold of the Huber loss, pixels; 0: least squares
};

/** Minimizes the reprojection error over lenses, camera poses and board poses (Ceres).
 *  @param frames  as many as bundle.first_from_board; those without sightings are ignored;
 * initially no corner may be behind its camera
 *  @param stop    ends it after the current iteration
 *  @return kBadValue if there is no solution, kInterrupted; bundle is then unspecified */
Status adjust_bundle (const BoardSpec &board, const std::vector<CalibrationFrame> &frames,
    const BundleSettings &settings, Bundle &bundle, std::stop_token stop = {});

} // namespace rangecast
