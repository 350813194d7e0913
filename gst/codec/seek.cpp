/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "seek.hpp"

#include <algorithm>

#include "bytestreamindex.hpp"

bool
NeighbourCodeSeek::reads_file (GstBaseParse *base)
{
  return GST_PAD_MODE (GST_BASE_PARSE_SINK_PAD (base)) == GST_PAD_MODE_PULL;
}

void
NeighbourCodeSeek::reset ()
{
  std::lock_guard guard (lock_);
  first_pts_ = GST_CLOCK_TIME_NONE;
  rig_offset_ = G_MAXUINT64;
  rig_units_ = {};
}

namespace {

/* From the first time of a file to the end of its last access unit. */
void
find_duration (GstBaseParse *base, GstClockTime first_pts, GstClockTime frame_duration)
{
  GstClockTime duration =
      NeighbourCodeFile (GST_BASE_PARSE_SINK_PAD (base), first_pts).last_time ();
  if (!GST_CLOCK_TIME_IS_VALID (duration))
    return; /* the base class estimates it */
  if (GST_CLOCK_TIME_IS_VALID (frame_duration))
    duration += frame_duration;
  if (duration <= G_MAXINT64)
    gst_base_parse_set_duration (base, GST_FORMAT_TIME, gint64 (duration), 0);
}

/* Where the segment of a seek will end: G_MAXINT64 if it is open. */
GstClockTime
end_of (GstBaseParse *base, GstSeekType stop_type, gint64 stop)
{
  const GstClockTime end =
      stop_type == GST_SEEK_TYPE_NONE ? base->segment.stop : GstClockTime (stop);
  return std::min<GstClockTime> (end, G_MAXINT64);
}

} // namespace

GstClockTime
NeighbourCodeSeek::time_of (GstBaseParse *base, guint64 pts_ns, GstClockTime frame_duration)
{
  if (!GST_CLOCK_TIME_IS_VALID (pts_ns))
    return GST_CLOCK_TIME_NONE;
  bool first = false;
  GstClockTime first_pts;
  {
    std::lock_guard guard (lock_);
    first = !GST_CLOCK_TIME_IS_VALID (first_pts_);
    if (first)
      first_pts_ = pts_ns;
    first_pts = first_pts_;
  }
  if (first && reads_file (base))
    find_duration (base, first_pts, frame_duration);
  return pts_ns >= first_pts ? pts_ns - first_pts : 0;
}

std::vector<guint8>
NeighbourCodeSeek::rig_at (guint64 offset)
{
  std::lock_guard guard (lock_);
  if (rig_offset_ != offset)
    return {};
  rig_offset_ = G_MAXUINT64;
  return std::move (rig_units_);
}

/* Finds the key access unit for a seek and adds it to the index of the base class, which has only
 * what was played. @return its time; none if there is none */
GstClockTime
NeighbourCodeSeek::find_place (
    GstBaseParse *base, GstClockTime time, GstClockTime stop, GstSeekFlags flags)
{
  GstClockTime first = GST_CLOCK_TIME_NONE;
  {
    std::lock_guard guard (lock_);
    first = first_pts_;
  }
  if (!GST_CLOCK_TIME_IS_VALID (first))
    return GST_CLOCK_TIME_NONE;
  NeighbourCodeFile file (GST_BASE_PARSE_SINK_PAD (base), first);
  auto place = file.find (time, stop, flags);
  if (!place)
    return GST_CLOCK_TIME_NONE;
  {
    /* Not each access unit has the rig: it is kept for the streaming thread. */
    std::lock_guard guard (lock_);
    rig_offset_ = place->offset;
    rig_units_ = std::move (place->rig_units);
  }
  gst_base_parse_add_index_entry (base, place->offset, place->time, TRUE, TRUE);
  return place->time;
}

GstEvent *
NeighbourCodeSeek::handle_seek (GstBaseParse *base, GstEvent *event)
{
  gdouble rate;
  GstFormat format;
  GstSeekFlags flags;
  GstSeekType start_type, stop_type;
  gint64 start, stop;
  gst_event_parse_seek (event, &rate, &format, &flags, &start_type, &start, &stop_type, &stop);
  if (rate < 0) { /* reverse playback is not supported */
    gst_event_unref (event);
    return nullptr;
  }
  if (format != GST_FORMAT_TIME || start_type != GST_SEEK_TYPE_SET || start < 0)
    return event;
  const GstClockTime end = end_of (base, stop_type, stop);
  const GstClockTime found = find_place (base, GstClockTime (start), end, flags);
  if (!GST_CLOCK_TIME_IS_VALID (found))
    return event;
  if (flags & GST_SEEK_FLAG_KEY_UNIT && found <= end)
    start = gint64 (found);
  /* The base class uses its index only for accurate seeks. */
  flags = GstSeekFlags (flags | GST_SEEK_FLAG_ACCURATE);
  GstEvent *result = gst_event_new_seek (rate, format, flags, start_type, start, stop_type, stop);
  gst_event_set_seqnum (result, gst_event_get_seqnum (event));
  gst_event_unref (event);
  return result;
}
