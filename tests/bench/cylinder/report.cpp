/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "report.hpp"

#include <cstdio>

using rangecast::Status;
using rangecast::StatusCode;

namespace bench {

void
print_header ()
{
  std::printf ("%-35s %-20s %8s %8s %8s %13s %13s %8s %9s %9s %7s %8s %8s\n", "scene", "method",
      "points", "removed", "doubles", "thick mm/95", "off mm/95", "open", "new holes", "at 6 mm",
      "strips", "isolated", "ms");
}

void
print_row (const TruthRow &r)
{
  char scene[64];
  std::snprintf (scene, sizeof scene, "%s, %d views, %s, %g mm %g deg", r.scene.c_str (), r.views,
      r.noise.c_str (), r.pose_mm, r.pose_deg);
  const Verdict &v = r.verdict;
  std::printf (
      "%-35s %-20s %8zu %6.1f %% %6.2f %% %6.2f %6.2f %6.2f %6.2f %6.2f %% %7.2f %% %7.2f %% %7zu "
      "%8zu %8.2f\n",
      scene, r.method.c_str (), v.points, 100 * v.removed, 100 * v.cells_double, v.thickness_mm,
      v.thickness95_mm, v.distance_mm, v.distance95_mm, 100 * v.uncovered, 100 * r.new_holes,
      100 * r.new_holes_6mm, v.strips, v.isolated, r.ms);
  std::fflush (stdout);
}

Status
write_json (const std::string &path, const std::vector<TruthRow> &rows)
{
  const Status failed = {
      StatusCode::kNotFound, "--json " + path + ": cannot be written, expected a file to write"};
  std::FILE *file = std::fopen (path.c_str (), "w");
  if (!file)
    return failed;
  std::fputs ("[", file);
  for (std::size_t i = 0; i < rows.size (); i++) {
    const TruthRow &r = rows[i];
    const Verdict &v = r.verdict;
    std::fprintf (file,
        "%s\n{\"scene\": \"%s\", \"views\": %d, \"noise\": \"%s\", \"pose_mm\": %g, "
        "\"pose_deg\": %g, \"method\": \"%s\", \"points\": %zu, \"removed\": %.6f, "
        "\"cells_double\": %.6f, \"thickness_mm\": %.4f, \"thickness95_mm\": %.4f, "
        "\"distance_mm\": %.4f, \"distance95_mm\": %.4f, \"uncovered\": %.6f, "
        "\"new_holes\": %.6f, \"uncovered_6mm\": %.6f, \"new_holes_6mm\": %.6f, "
        "\"strips\": %zu, \"isolated\": %zu, \"ms\": %.4f}",
        i ? "," : "", r.scene.c_str (), r.views, r.noise.c_str (), r.pose_mm, r.pose_deg,
        r.method.c_str (), v.points, v.removed, v.cells_double, v.thickness_mm, v.thickness95_mm,
        v.distance_mm, v.distance95_mm, v.uncovered, r.new_holes, v.uncovered_6mm, r.new_holes_6mm,
        v.strips, v.isolated, r.ms);
  }
  std::fputs ("\n]\n", file);
  const bool written = !std::ferror (file);
  return std::fclose (file) == 0 && written ? Status{} : failed;
}

} // namespace bench
