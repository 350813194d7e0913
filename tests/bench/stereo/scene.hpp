/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <memory>
#include <rangecast/scene/scene.hpp>
#include <rangecast/stereo/stereo_depth.hpp>
#include <string>
#include <vector>

namespace bench {

/** What a matcher came to on rendered pictures, whose true depth is known. Shares are 0 to 1. */
struct SceneRow {
  std::string matcher;
  double found = 0;     ///< of the person's pixels
  double off_5cm = 0;   ///< of the valid pixels: further than 5 cm from the true surface
  double median_mm = 0; ///< of the absolute error, person's pixels
  double rms_px = 0;    ///< of the disparity, person's pixels less than 2 pixels off
  double cpu_ms = 0;    ///< least processor time of a pair, of all threads together
};

struct SceneJob {
  rangecast::SceneSettings scene; ///< one view is matched
  int frames = 20;
  int n_threads = 0; ///< of ours; 0: one per core
};

/** Matches pictures of the test scene as stereodepth does, whole and in the person's ROI alone,
 *  and with OpenCV's 3-way SGBM at the same settings. */
rangecast::Status run_scene (const SceneJob &job, std::vector<SceneRow> &rows);

void print_scene_rows (const std::vector<SceneRow> &rows);

} // namespace bench
