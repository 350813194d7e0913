/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <optional>
#include <rangecast/overlap/cylinder_filter.hpp>
#include <string>
#include <vector>

#include "head.hpp"
#include "report.hpp"

namespace bench {

struct TruthJob {
  std::string model;             ///< empty: the built-in figure
  std::optional<unsigned> dress; ///< of the built-in figure; nothing: bare, then all of it
  std::string bunny, mesh;       ///< folder of range images, and the merged mesh; empty: the head
  int width = 320, height = 240;
  int views = 0;                      ///< 0: four and eight
  std::optional<DepthNoise> noise;    ///< nothing: all
  double pose_mm = -1, pose_deg = -1; ///< both negative: 0, 2 mm, 5 mm, 0.5 degrees
  int rounds = 5;
  rangecast::CylinderSettings settings; ///< of the filter
};

/** Every head that the job asks for. */
std::vector<HeadSettings> heads_of (const TruthJob &job);

/** Runs the filter and its peers on all that the job asks for, and prints the table. */
rangecast::Status run_truth (const TruthJob &job, std::vector<TruthRow> &rows);

/** The job's first frame set, filtered, as a picture. */
rangecast::Status run_picture (const TruthJob &job, const std::string &path);

} // namespace bench
