/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "stats.hpp"

#include <cstdio>

GstStructure *
RenderStats::to_structure () const
{
  return gst_structure_new ("application/x-striprender-stats", "frames", G_TYPE_UINT64, frames,
      "frame-sets", G_TYPE_UINT64, frame_sets, "repeated", G_TYPE_UINT64, repeated, "dropped",
      G_TYPE_UINT64, dropped, "points", G_TYPE_UINT64, points, "vertices", G_TYPE_UINT64, vertices,
      "triangles", G_TYPE_UINT64, triangles, "strips", G_TYPE_UINT64, strips, "isolated",
      G_TYPE_UINT64, isolated, "uploaded-bytes", G_TYPE_UINT64, uploaded_bytes, "uploaded-total",
      G_TYPE_UINT64, uploaded_total, "backend", G_TYPE_STRING, backend, nullptr);
}

namespace {

template <typename... Values>
void
print_line (std::string &line, const char *format, Values... values)
{
  char text[96];
  std::snprintf (text, sizeof text, format, values...);
  line = text;
}

} // namespace

bool
StatsText::update (const RenderStats &stats, std::size_t views, GstClockTime latency, gint64 now_us)
{
  const double seconds = double (now_us - last_us_) / G_USEC_PER_SEC;
  if (last_us_ >= 0 && seconds < 0.5)
    return false;
  const auto rate = [&] (guint64 now, guint64 before) { return double (now - before) / seconds; };
  if (last_us_ < 0)
    lines_[0] = "counting";
  else
    print_line (lines_[0], "%.1f frames/s of %.1f frame sets/s", rate (stats.frames, last_.frames),
        rate (stats.frame_sets, last_.frame_sets));
  print_line (lines_[1], "%" G_GUINT64_FORMAT " points of %u views", stats.points, guint (views));
  print_line (lines_[2], "%" G_GUINT64_FORMAT " triangles", stats.triangles);
  print_line (lines_[3], "drawn with backend %s", stats.backend);
  if (GST_CLOCK_TIME_IS_VALID (latency))
    print_line (lines_[4], "latency %.0f ms", double (latency) / GST_MSECOND);
  else
    lines_[4] = "not live";
  last_ = stats;
  last_us_ = now_us;
  return true;
}
