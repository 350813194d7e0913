/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "streamprefixes.hpp"

#include <gstrange/gstrangecaps.h>

#include <algorithm>
#include <rangecast/neighbourcode/bitstream/byte_stream.hpp>

/* The rig is repeated in the byte stream at this interval. */
constexpr GstClockTime kRigInterval = GST_SECOND;

void
StreamPrefixes::set_rig (const gstrange::RangeInfo &info)
{
  rig_.clear ();
  rangecast::write_rig_units ({info.rig, info.fps_n, info.fps_d}, rig_);
  repeat_rig ();
}

bool
StreamPrefixes::rig_is_due (GstClockTime pts)
{
  const bool due = !GST_CLOCK_TIME_IS_VALID (last_rig_) || !GST_CLOCK_TIME_IS_VALID (pts) ||
                   pts < last_rig_ || pts - last_rig_ >= kRigInterval;
  if (due)
    last_rig_ = pts;
  return due;
}

/* Start code, header, and the rig if it is due. */
GstMemory *
StreamPrefixes::make (rangecast::AccessUnitHeader header, GstClockTime pts, gsize access_unit)
{
  const gsize rig_size = rig_is_due (pts) ? rig_.size () : 0;
  const gsize size = rangecast::kStreamPrefixSize + rig_size;
  auto bytes = static_cast<guint8 *> (g_malloc (size));
  header.size = guint32 (rig_size + access_unit);
  header.pts_ns = pts;
  std::ranges::copy (rangecast::kStartCode, bytes);
  rangecast::write_access_unit_header (header, bytes + rangecast::kStartCode.size ());
  std::copy_n (rig_.begin (), rig_size, bytes + rangecast::kStreamPrefixSize);
  return gst_memory_new_wrapped (GstMemoryFlags (0), bytes, size, 0, size, bytes, g_free);
}

GstClockTime
byte_stream_time (const GstSegment &segment, GstClockTime pts)
{
  if (segment.format != GST_FORMAT_TIME || !GST_CLOCK_TIME_IS_VALID (pts))
    return pts;
  guint64 time = 0;
  return gst_segment_to_running_time_full (&segment, GST_FORMAT_TIME, pts, &time) > 0 ? time : 0;
}

const char *
preferred_alignment (GstPad *source, const char *otherwise)
{
  if (!gst_pad_is_linked (source))
    return "access-unit";
  GstCaps *caps = gst_pad_peer_query_caps (source, nullptr);
  /* Nothing fits where an application's decodebin says so before it plugs a decoder. */
  const char *preferred = gst_caps_is_empty (caps) ? "access-unit" : otherwise;
  for (const char *alignment :
      {"byte-stream", "slice", "access-unit"}) { /* the last match counts */
    GstStructure *wanted = gst_structure_new (
        GST_NEIGHBOUR_CODE_MEDIA_TYPE, "alignment", G_TYPE_STRING, alignment, nullptr);
    for (guint i = 0; i < gst_caps_get_size (caps); i++) {
      const GstStructure *structure = gst_caps_get_structure (caps, i);
      if (gst_structure_has_field (structure, "alignment") &&
          gst_structure_can_intersect (structure, wanted))
        preferred = alignment;
    }
    gst_structure_free (wanted);
  }
  gst_caps_unref (caps);
  return preferred;
}
