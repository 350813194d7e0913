/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "stats.hpp"

#include <algorithm>

static GstStructure *
make_pad_stats (const MuxPad &entry)
{
  return gst_structure_new ("pad", "received", G_TYPE_UINT64, entry.received, "matched",
      G_TYPE_UINT64, entry.matched, "late", G_TYPE_UINT64, entry.late, "out-of-step", G_TYPE_UINT64,
      entry.out_of_step, "left-out", G_TYPE_UINT64, entry.left_out, "skew", G_TYPE_INT64,
      gint64 (entry.last_skew), "state", G_TYPE_STRING, name_of (entry.state), "offset",
      G_TYPE_INT64, gint64 (entry.offset), nullptr);
}

GstStructure *
make_stats (const MuxPads &pads, const MuxCounters &sent)
{
  guint64 late = 0, out_of_step = 0, left_out = 0;
  for (const auto &entry : pads) {
    late += entry->late;
    left_out += entry->left_out;
    out_of_step += entry->out_of_step;
  }
  GstStructure *stats = gst_structure_new ("application/x-rangemux-stats", "frames", G_TYPE_UINT64,
      sent.frames, "complete", G_TYPE_UINT64, sent.complete, "incomplete", G_TYPE_UINT64,
      sent.frames - sent.complete, "dropped-late", G_TYPE_UINT64, late, "out-of-step",
      G_TYPE_UINT64, out_of_step, "left-out", G_TYPE_UINT64, left_out, nullptr);
  for (const auto &entry : pads) {
    GstStructure *of_pad = make_pad_stats (*entry);
    gst_structure_set (stats, GST_PAD_NAME (entry->pad), GST_TYPE_STRUCTURE, of_pad, nullptr);
    gst_structure_free (of_pad);
  }
  return stats;
}

std::vector<StatsRow>
rows_of (const MuxPads &pads, const MuxCounters &sent)
{
  std::vector<StatsRow> rows (1);
  guint64 late = 0;
  for (const auto &entry : pads) {
    late += entry->late + entry->out_of_step;
    rows.push_back ({.pad = GST_PAD_NAME (entry->pad),
        .counters = {.frames = entry->received,
            .lost = sent.frames - std::min (sent.frames, entry->matched),
            .late = entry->late + entry->out_of_step},
        .views = entry->views});
  }
  rows[0].counters = {.frames = sent.frames, .lost = sent.frames - sent.complete, .late = late};
  return rows;
}
