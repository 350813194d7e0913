/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "report.hpp"

#include <cstdio>
#include <fstream>

using rangecast::Status;
using rangecast::StatusCode;

namespace bench {

/* Of those that came through: it did nothing with packets that the kernel dropped in front of it.
 */
static double
us_per_packet (const Row &r)
{
  const double passed = r.packets_per_set * (1 - r.lost);
  return passed > 0 ? 1e3 * r.cpu_ms / passed : 0;
}

void
print_rows (const std::vector<Row> &rows)
{
  std::printf (
      "| what | views | viewers | packets/set | Mbit/s | CPU ms/set | CPU ms/view | CPU us/packet "
      "| RSS MiB | p50 ms | p99 ms | lost %% |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (const Row &r : rows)
    std::printf (
        "| %s | %d | %d | %.0f | %.1f | %.3f | %.3f | %.2f | %.1f | %.2f | %.2f | %.2f |\n",
        r.what.c_str (), r.views, r.viewers, r.packets_per_set, r.mbit_per_s, r.cpu_ms,
        r.cpu_ms / r.views, us_per_packet (r), r.rss_mib, r.p50_ms, r.p99_ms, 100 * r.lost);
  for (const Row &r : rows)
    if (r.sender_ms > 10)
      std::printf ("%s of %d views: the bench itself sent a frame set %.0f ms late\n",
          r.what.c_str (), r.views, r.sender_ms);
}

void
print_viewers (const std::vector<ViewerRow> &rows)
{
  if (rows.empty ())
    return;
  std::printf ("\n| views | decode ms/set | cylinder ms/set | draw ms/set | all ms/view |\n"
               "|---|---|---|---|---|\n");
  for (const ViewerRow &r : rows)
    std::printf ("| %d | %.2f | %.2f | %.2f | %.2f |\n", r.views, r.decode_ms, r.cylinder_ms,
        r.draw_ms, (r.decode_ms + r.cylinder_ms + r.draw_ms) / r.views);
}

Status
write_json (
    const std::string &path, const std::vector<Row> &rows, const std::vector<ViewerRow> &viewers)
{
  std::ofstream file (path);
  file << "{\n  \"rows\": [";
  const char *comma = "\n";
  for (const Row &r : rows) {
    file << comma << "    {\"what\": \"" << r.what << "\", \"views\": " << r.views
         << ", \"viewers\": " << r.viewers << ", \"packets_per_set\": " << r.packets_per_set
         << ", \"mbit_per_s\": " << r.mbit_per_s << ", \"cpu_ms\": " << r.cpu_ms
         << ", \"rss_mib\": " << r.rss_mib << ", \"p50_ms\": " << r.p50_ms
         << ", \"p99_ms\": " << r.p99_ms << ", \"lost\": " << r.lost
         << ", \"sender_ms\": " << r.sender_ms << "}";
    comma = ",\n";
  }
  file << "\n  ],\n  \"viewers\": [";
  comma = "\n";
  for (const ViewerRow &r : viewers) {
    file << comma << "    {\"views\": " << r.views << ", \"decode_ms\": " << r.decode_ms
         << ", \"cylinder_ms\": " << r.cylinder_ms << ", \"draw_ms\": " << r.draw_ms << "}";
    comma = ",\n";
  }
  file << "\n  ]\n}\n";
  if (!file.flush ())
    return {StatusCode::kNotFound, "--json " + path + ": cannot be written"};
  return {};
}

} // namespace bench
