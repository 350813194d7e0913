/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <string>
#include <vector>

#include "truth.hpp"

namespace bench {

/** One line of the table: what was seen, and what a method made of it. */
struct TruthRow {
  std::string scene, noise, method;
  int views = 0;
  double pose_mm = 0, pose_deg = 0;
  Verdict verdict;
  double new_holes = 0, new_holes_6mm = 0; ///< uncovered, less what was uncovered before
  double ms = 0;                           ///< of the method, median
};

void print_header ();
void print_row (const TruthRow &row);

/** An array of objects, keys as in --help. */
rangecast::Status write_json (const std::string &path, const std::vector<TruthRow> &rows);

} // namespace bench
