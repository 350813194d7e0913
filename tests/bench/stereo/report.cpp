/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "report.hpp"

#include <cstdio>

using rangecast::Status;
using rangecast::StatusCode;

namespace bench {

static void
print_row (const Row &r, bool has_truth)
{
  std::printf ("%-56s %7.2f %%", r.matcher.c_str (), 100 * r.density);
  if (has_truth)
    std::printf (" %7.2f %% %7.2f %% %9.3f", 100 * r.bad1, 100 * r.bad2, r.median_px);
  else
    std::printf (" %9s %9s %9s", "-", "-", "-");
  std::printf (" %9.1f\n", r.ms);
}

void
print_rows (const std::vector<Row> &rows, bool has_truth)
{
  std::printf (
      "%-56s %9s %9s %9s %9s %9s\n", "matcher", "density", "bad-1.0", "bad-2.0", "median px", "ms");
  for (const Row &row : rows)
    print_row (row, has_truth);
}

Status
write_json (const std::string &path, const std::vector<Row> &rows, bool has_truth)
{
  const Status failed = {
      StatusCode::kNotFound, "--json " + path + ": cannot be written, expected a file to write"};
  std::FILE *file = std::fopen (path.c_str (), "w");
  if (!file)
    return failed;
  std::fputs ("[", file);
  for (std::size_t i = 0; i < rows.size (); i++) {
    const Row &r = rows[i];
    std::fprintf (file, "%s\n{\"matcher\": \"%s\", \"density\": %.6f, ", i ? "," : "",
        r.matcher.c_str (), r.density);
    if (has_truth)
      std::fprintf (file, "\"bad1\": %.6f, \"bad2\": %.6f, \"median_px\": %.6f, ", r.bad1, r.bad2,
          r.median_px);
    else
      std::fputs ("\"bad1\": null, \"bad2\": null, \"median_px\": null, ", file);
    std::fprintf (file, "\"ms\": %.4f}", r.ms);
  }
  std::fputs ("\n]\n", file);
  const bool written = !std::ferror (file);
  return std::fclose (file) == 0 && written ? Status{} : failed;
}

} // namespace bench
