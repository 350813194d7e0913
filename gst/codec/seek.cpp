/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "seek.hpp"

#include <algorithm>
#include <vector>

using rangecast::AccessUnitPlace;
using rangecast::StreamFile;
using rangecast::StreamTimes;

namespace {

bool
is_pulling (GstBaseParse *base)
{
  return GST_PAD_MODE (GST_BASE_PARSE_SINK_PAD (base)) == GST_PAD_MODE_PULL;
}

void
read_file (GstPad *pad, guint64 offset, gsize size, std::vector<guint8> &to)
{
  to.clear ();
  GstBuffer *buffer = nullptr;
  if (gst_pad_pull_range (pad, offset, guint (size), &buffer) != GST_FLOW_OK)
    return;
  to.resize (std::min (gst_buffer_get_size (buffer), size));
  gst_buffer_extract (buffer, 0, to.data (), to.size ());
  gst_buffer_unref (buffer);
}

StreamFile
file_of (GstBaseParse *base)
{
  GstPad *pad = GST_BASE_PARSE_SINK_PAD (base);
  gint64 size = 0;
  if (!gst_pad_peer_query_duration (pad, GST_FORMAT_BYTES, &size))
    size = 0;
  const auto read = [pad] (guint64 offset, gsize bytes, std::vector<guint8> &to) {
    read_file (pad, offset, bytes, to);
  };
  return {read, guint64 (std::max<gint64> (size, 0))};
}

/* The access unit that the seek's flags select. */
std::optional<AccessUnitPlace>
choose (const StreamFile::Target &target, guint64 pts, GstSeekFlags flags)
{
  const bool snaps_after = flags & GST_SEEK_FLAG_KEY_UNIT && flags & GST_SEEK_FLAG_SNAP_AFTER;
  if (!target.before || !target.after || !snaps_after)
    return target.before ? target.before : target.after;
  const bool is_nearer = pts - target.before->header.pts_ns <= target.after->header.pts_ns - pts;
  return flags & GST_SEEK_FLAG_SNAP_BEFORE && is_nearer ? target.before : target.after;
}

} // namespace

void
NeighbourCodeSeek::reset ()
{
  std::lock_guard guard (lock_);
  times_ = {};
}

StreamTimes::Time
NeighbourCodeSeek::time_of (
    GstBaseParse *base, const AccessUnitPlace &unit, GstClockTime frame_duration)
{
  if (!GST_CLOCK_TIME_IS_VALID (frame_duration))
    frame_duration = 0;
  if (!times_.first_ns () && is_pulling (base)) { /* which changes in this thread only */
    const auto last = file_of (base).last ();
    const guint64 first = unit.header.pts_ns;
    if (last && last->header.pts_ns != rangecast::kNoTime && last->header.pts_ns >= first)
      if (const guint64 duration = last->header.pts_ns - first + frame_duration;
          duration <= G_MAXINT64) /* else the base class estimates it */
        gst_base_parse_set_duration (base, GST_FORMAT_TIME, gint64 (duration), 0);
  }
  std::lock_guard guard (lock_);
  return times_.next (unit, frame_duration);
}

void
NeighbourCodeSeek::begin_stream ()
{
  std::lock_guard guard (lock_);
  times_.begin_stream ();
}

void
NeighbourCodeSeek::interrupt ()
{
  std::lock_guard guard (lock_);
  times_.seek ();
}

/* Finds the key access unit for a seek, and its time; none if the file has no times. */
std::optional<std::pair<AccessUnitPlace, GstClockTime>>
NeighbourCodeSeek::find_place (GstBaseParse *base, GstClockTime time, GstSeekFlags flags)
{
  std::optional<guint64> first;
  {
    std::lock_guard guard (lock_);
    first = times_.first_ns ();
  }
  if (!first)
    return std::nullopt;
  const guint64 pts = *first + std::min (time, rangecast::kNoTime - 1 - *first);
  const auto chosen = choose (file_of (base).locate (pts), pts, flags);
  if (!chosen)
    return std::nullopt;
  return {{*chosen, chosen->header.pts_ns - std::min (chosen->header.pts_ns, *first)}};
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
  if (rate < 0) {
    GST_ELEMENT_WARNING (base, STREAM, NOT_IMPLEMENTED,
        ("Reverse playback is not supported: seek with a positive rate"), (nullptr));
    gst_event_unref (event);
    return nullptr;
  }
  if (!is_pulling (base) || format != GST_FORMAT_TIME || start_type != GST_SEEK_TYPE_SET ||
      start < 0)
    return event;
  const auto end = stop_type == GST_SEEK_TYPE_NONE ? base->segment.stop : GstClockTime (stop);
  auto found = find_place (base, GstClockTime (start), flags);
  const bool snaps = flags & GST_SEEK_FLAG_KEY_UNIT && found && found->second <= end;
  if (found && found->second > end)
    found = find_place (base, GstClockTime (start), GST_SEEK_FLAG_NONE);
  if (!found)
    return event;
  if (snaps)
    start = gint64 (found->second);
  /* The base class uses its index only for accurate seeks; by a time between two entries it may
   * find one that is no key, or of another time (GStreamer 1.22). */
  gst_base_parse_add_index_entry (base, found->first.offset, GstClockTime (start), TRUE, TRUE);
  flags = GstSeekFlags (flags | GST_SEEK_FLAG_ACCURATE);
  GstEvent *result = gst_event_new_seek (rate, format, flags, start_type, start, stop_type, stop);
  gst_event_set_seqnum (result, gst_event_get_seqnum (event));
  gst_event_unref (event);
  return result;
}
