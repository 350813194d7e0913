/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "seek.hpp"

#include <algorithm>

#include "bytestreamindex.hpp"

using rangecast::AccessUnitPlace;
using rangecast::TakeList;

bool
NeighbourCodeSeek::reads_file (GstBaseParse *base)
{
  return GST_PAD_MODE (GST_BASE_PARSE_SINK_PAD (base)) == GST_PAD_MODE_PULL;
}

void
NeighbourCodeSeek::reset ()
{
  std::lock_guard guard (lock_);
  takes_ = {};
  last_unit_.reset ();
  rig_offset_ = G_MAXUINT64;
  rig_units_ = {};
}

namespace {

/* To the end of the last access unit; none if its time is damaged. */
GstClockTime
duration_of (const TakeList &list, const AccessUnitPlace &last, GstClockTime frame_duration)
{
  if (last.header.pts_ns < list.takes ()[list.index_at (last.offset)].pts_ns)
    return GST_CLOCK_TIME_NONE;
  return list.time_of (last.offset, last.header.pts_ns) + frame_duration;
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

/* The takes and the end of a file whose first access unit is here. */
void
NeighbourCodeSeek::index_file (GstBaseParse *base, guint64 offset, GstClockTime frame_duration)
{
  NeighbourCodeFile file (GST_BASE_PARSE_SINK_PAD (base));
  TakeList takes = file.takes (offset, frame_duration);
  auto last_unit = file.last ();
  std::lock_guard guard (lock_);
  takes_ = std::move (takes);
  takes_.interrupt ();
  last_unit_ = std::move (last_unit);
}

TakeList::Time
NeighbourCodeSeek::time_of (
    GstBaseParse *base, const AccessUnitPlace &unit, GstClockTime frame_duration)
{
  if (!GST_CLOCK_TIME_IS_VALID (frame_duration))
    frame_duration = 0;
  const bool is_first = takes_.empty (); /* which changes in this thread only */
  if (is_first && reads_file (base))
    index_file (base, unit.offset, frame_duration);
  TakeList::Time time;
  GstClockTime duration = GST_CLOCK_TIME_NONE; /* the base class estimates it */
  {
    std::lock_guard guard (lock_);
    const gsize known = takes_.takes ().size ();
    time = takes_.add (unit, frame_duration);
    if (last_unit_ && (is_first || takes_.takes ().size () != known))
      duration = duration_of (takes_, *last_unit_, frame_duration);
  }
  if (duration <= G_MAXINT64)
    gst_base_parse_set_duration (base, GST_FORMAT_TIME, gint64 (duration), 0);
  return time;
}

void
NeighbourCodeSeek::begin_stream (bool flushed)
{
  std::lock_guard guard (lock_);
  last_unit_.reset ();
  if (flushed)
    takes_ = {};
  else
    takes_.begin_stream ();
}

void
NeighbourCodeSeek::interrupt ()
{
  std::lock_guard guard (lock_);
  takes_.interrupt ();
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
  TakeList takes;
  {
    std::lock_guard guard (lock_);
    takes = takes_;
  }
  auto place = NeighbourCodeFile (GST_BASE_PARSE_SINK_PAD (base)).find (takes, time, stop, flags);
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
