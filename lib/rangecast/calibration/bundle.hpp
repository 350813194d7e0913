/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "lens.hpp"

#include <stop_token>

namespace rangecast {

/** All cameras and all boards at once: what the bundle adjustment makes better. */
struct Bundle {
  std::vector<LensParameters> lenses;  ///< by camera
  std::vector<Pose> camera_from_first; ///< by camera; camera 0's is the identity
  std::vector<Pose> first_from_board;  ///< by frame, in camera 0's frame
};

struct BundleSettings {
  DistortionModel distortion = DistortionModel::kFive;
  bool refine_lenses = true; ///< false: only poses
  double robust_px = 0;      ///< Huber's loss beyond so many pixels; 0: plain squares
};

/** Moves lenses, cameras and boards so that the corners fall where they were seen (Ceres).
 *  @param frames  as many as bundle.first_from_board; those without sightings stay as they are;
 *  no corner may be behind its camera to begin with
 *  @param stop    ends it after the iteration that it is at
 *  @return kBadValue if there is no solution, kInterrupted; bundle is then unspecified */
Status adjust_bundle (const BoardSpec &board, const std::vector<CalibrationFrame> &frames,
    const BundleSettings &settings, Bundle &bundle, std::stop_token stop = {});

} // namespace rangecast
