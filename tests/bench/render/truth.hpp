/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <rangecast/scene/scene.hpp>
#include <vector>

#include "frames.hpp"
#include "score.hpp"

namespace bench {

/** Of the pictures that are judged, pixels. */
inline constexpr int kWidth = 640, kHeight = 480;

/** Degrees off the nearest of four cameras at which there is a truth. */
inline constexpr int kAngles[] = {0, 20, 45};

/** Renders the scene, antialiased, from four places that many degrees off the nearest of four
 *  cameras that stand 90 degrees apart.
 *  @param settings  of the frame set; size, number of views and noise are not used
 *  @param cameras   exact frames of the same scene: what they see
 *  @param angle_deg one of kAngles */
rangecast::Status make_truth (rangecast::SceneSettings settings, const FrameSet &cameras,
    int angle_deg, std::vector<Shot> &shots, double time_s = kMoment);

} // namespace bench
