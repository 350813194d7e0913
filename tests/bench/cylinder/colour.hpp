/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Colours of what is left, against what cameras that agree would see. */
#pragma once

#include <string>
#include <vector>

#include "truth_run.hpp"

namespace bench {

/** What is wrong with the cameras' colours. */
enum class ColourError {
  kNone,
  kGains,    ///< a factor up to 10 % for each camera and channel, on the pixels' values
  kLight,    ///< the same on light, before an sRGB curve
  kVignette, ///< as kGains, and pictures darken towards their corners, by 20 % there
};
const char *name_of (ColourError error);

struct ColourRow {
  std::string scene, noise, error, method;
  int views = 0;
  double pose_mm = 0, pose_deg = 0;
  double psnr_db = 0;      ///< of the points left, all channels, against the true colour
  double seam_levels = 0;  ///< step in colour between neighbours of two views, less the true one
  double seam_psnr_db = 0; ///< of the points within 10 mm of another view's
  double balance_ms = 0, filter_ms = 0, blend_ms = 0;
};

struct ColourJob {
  TruthJob truth;
  double width_m = 0; ///< of the blend; 0: its default
};

/** Runs winner and blend, without and with balance, on all that the job asks for, and prints it. */
rangecast::Status run_colour (const ColourJob &job, std::vector<ColourRow> &rows);

/** An array of objects, keys as in --help. */
rangecast::Status write_json (const std::string &path, const std::vector<ColourRow> &rows);

/** Draws the head half way between the first two cameras, whose gains are wrong: winner, winner
 *  with balance, blend with balance. */
rangecast::Status draw_colours (const ColourJob &job, const std::string &path);

} // namespace bench
