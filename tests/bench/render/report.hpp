/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <rangecast/status.hpp>
#include <string>
#include <vector>

namespace bench {

/** What one way of drawing came to at one angle. */
struct RenderRow {
  std::string mode, depth; ///< depth: exact, stereo, noise
  int angle_deg = 0;
  std::uint64_t vertices = 0, triangles = 0, bytes = 0;
  double ms = 0, processor_ms = 0; ///< of a picture: by the clock; of all threads
  double holes = 0, spill = 0;     ///< shares, 0 to 1
  double psnr_db = 0, ssim = 0;
};

void print_head ();
void print_row (const RenderRow &row);

/** Writes an array of objects, one a row: mode, depth, angle_deg, vertices, triangles, bytes, ms,
 *  holes, spill, psnr_db, ssim. @return kNotFound if the file cannot be written */
rangecast::Status write_json (const std::string &path, const std::vector<RenderRow> &rows);

} // namespace bench
