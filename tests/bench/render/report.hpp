/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <rangecast/base/status.hpp>
#include <string>
#include <vector>

#include "score.hpp"

namespace bench {

/** What one way of drawing came to at one angle. */
struct RenderRow {
  std::string scene, mode, depth; ///< scene: figure, model; depth: exact, stereo, noise
  int angle_deg = 0;
  std::uint64_t vertices = 0, triangles = 0, bytes = 0;
  double ms = 0, processor_ms = 0; ///< of a picture: by the clock; of all threads
  Score score;
};

void print_head ();
void print_row (const RenderRow &row);

/** Writes an array of objects, one a row: scene, mode, depth, angle_deg, vertices, triangles,
 *  bytes, ms, holes, spill, psnr_db, ssim, ssim_all, edge_px, edge95_px, seam, bad.
 *  @return kNotFound if the file cannot be written */
rangecast::Status write_json (const std::string &path, const std::vector<RenderRow> &rows);

} // namespace bench
