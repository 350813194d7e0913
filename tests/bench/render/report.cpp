/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "report.hpp"

#include <cinttypes>
#include <cstdio>

using rangecast::Status;
using rangecast::StatusCode;

namespace bench {

void
print_head ()
{
  std::printf ("%-7s %-7s %-14s %5s %8s %9s %9s %7s %7s %8s %8s %7s %8s %8s %6s %5s %7s %8s\n",
      "scene", "depth", "mode", "angle", "vertices", "triangles", "bytes", "ms", "CPU ms",
      "SSIM all", "holes", "edge px", "95 %", "PSNR dB", "SSIM", "seam", "bad", "spill");
}

void
print_row (const RenderRow &r)
{
  std::printf ("%-7s %-7s %-14s %5d %8" PRIu64 " %9" PRIu64 " %9" PRIu64
               " %7.2f %7.2f %8.4f %6.2f %% %7.2f %8.1f %8.2f %6.4f %5.3f %5.2f %% %6.2f %%\n",
      r.scene.c_str (), r.depth.c_str (), r.mode.c_str (), r.angle_deg, r.vertices, r.triangles,
      r.bytes, r.ms, r.processor_ms, r.score.ssim_all (), 100 * r.score.holes (),
      r.score.edge_px (), r.score.edge95_px (), r.score.psnr (), r.score.ssim (), r.score.seam (),
      100 * r.score.bad (), 100 * r.score.spill ());
  std::fflush (stdout);
}

Status
write_json (const std::string &path, const std::vector<RenderRow> &rows)
{
  const Status failed = {
      StatusCode::kNotFound, "--json " + path + ": cannot be written, expected a file to write"};
  std::FILE *file = std::fopen (path.c_str (), "w");
  if (!file)
    return failed;
  std::fputs ("[", file);
  for (std::size_t i = 0; i < rows.size (); i++) {
    const RenderRow &r = rows[i];
    std::fprintf (file,
        "%s\n{\"scene\": \"%s\", \"mode\": \"%s\", \"depth\": \"%s\", \"angle_deg\": %d, "
        "\"vertices\": %" PRIu64 ", \"triangles\": %" PRIu64 ", \"bytes\": %" PRIu64
        ", \"ms\": %.4f, \"holes\": %.6f, "
        "\"spill\": %.6f, \"psnr_db\": %.4f, \"ssim\": %.6f, \"ssim_all\": %.6f, \"edge_px\": "
        "%.4f, "
        "\"edge95_px\": %.4f, \"seam\": %.6f, \"bad\": %.6f}",
        i ? "," : "", r.scene.c_str (), r.mode.c_str (), r.depth.c_str (), r.angle_deg, r.vertices,
        r.triangles, r.bytes, r.ms, r.score.holes (), r.score.spill (), r.score.psnr (),
        r.score.ssim (), r.score.ssim_all (), r.score.edge_px (), r.score.edge95_px (),
        r.score.seam (), r.score.bad ());
  }
  std::fputs ("\n]\n", file);
  const bool written = !std::ferror (file);
  return std::fclose (file) == 0 && written ? Status{} : failed;
}

} // namespace bench
