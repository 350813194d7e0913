/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "seek.hpp"

#include <algorithm>
#include <vector>

using rangecast::AccessUnitPlace;
using rangecast::kNoTime;
using rangecast::StreamFile;
using rangecast::Take;
using rangecast::TakeList;

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

/* A part of the file, whose offsets begin at 0; by default up to its end. */
StreamFile
file_part (GstBaseParse *base, guint64 begin, guint64 end = G_MAXUINT64)
{
  GstPad *pad = GST_BASE_PARSE_SINK_PAD (base);
  gint64 size = 0;
  if (!gst_pad_peer_query_duration (pad, GST_FORMAT_BYTES, &size))
    size = 0;
  end = std::min (end, guint64 (std::max<gint64> (size, 0)));
  const guint64 length = end - std::min (begin, end);
  const auto read = [=] (guint64 offset, gsize bytes, std::vector<guint8> &to) {
    const guint64 rest = length - std::min (offset, length);
    read_file (pad, begin + offset, gsize (std::min<guint64> (bytes, rest)), to);
  };
  return {read, length};
}

/* To the end of the last access unit; none if its time is damaged. */
GstClockTime
duration_of (const TakeList &list, const AccessUnitPlace &last, GstClockTime frame_duration)
{
  if (last.header.pts_ns < list.takes ()[list.index_at (last.offset)].pts_ns)
    return GST_CLOCK_TIME_NONE;
  return list.time_of (last.offset, last.header.pts_ns) + frame_duration;
}

/* The time in the file of a time in a take. */
guint64
pts_at (const Take &take, GstClockTime time)
{
  const guint64 latest = kNoTime - 1, after = time - std::min (time, take.time_ns);
  return after < latest - std::min (take.pts_ns, latest) ? take.pts_ns + after : latest;
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
  takes_ = {};
  last_unit_.reset ();
}

TakeList::Time
NeighbourCodeSeek::time_of (
    GstBaseParse *base, const AccessUnitPlace &unit, GstClockTime frame_duration)
{
  if (!GST_CLOCK_TIME_IS_VALID (frame_duration))
    frame_duration = 0;
  const bool is_first = takes_.empty (); /* which changes in this thread only */
  if (is_first && is_pulling (base)) {
    StreamFile file = file_part (base, 0);
    TakeList takes = file.takes (unit.offset, frame_duration);
    takes.interrupt ();
    const auto last = file.last ();
    std::lock_guard guard (lock_);
    takes_ = std::move (takes);
    if (last && last->header.pts_ns != kNoTime)
      last_unit_ = last;
  }
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
NeighbourCodeSeek::begin_stream ()
{
  std::lock_guard guard (lock_);
  takes_.begin_stream ();
}

void
NeighbourCodeSeek::interrupt ()
{
  std::lock_guard guard (lock_);
  takes_.interrupt ();
}

/* Finds the key access unit for a seek, in the take of that time, and adds it to the index of the
 * base class, which has only what was played. @return its time; none if the file has no times */
GstClockTime
NeighbourCodeSeek::find_place (GstBaseParse *base, GstClockTime time, GstSeekFlags flags)
{
  TakeList list;
  {
    std::lock_guard guard (lock_);
    list = takes_;
  }
  if (list.empty ())
    return GST_CLOCK_TIME_NONE;
  const std::vector<Take> &takes = list.takes ();
  const auto next = std::ranges::upper_bound (takes, time, {}, &Take::time_ns);
  const auto take = next == takes.begin () ? next : next - 1;
  const guint64 end = take + 1 == takes.end () ? G_MAXUINT64 : take[1].offset;
  const guint64 pts = pts_at (*take, time);
  const StreamFile::Target target = file_part (base, take->offset, end).locate (pts);
  const auto chosen = choose (target, pts, flags);
  if (!chosen)
    return GST_CLOCK_TIME_NONE;
  const guint64 offset = take->offset + chosen->offset;
  const GstClockTime found = list.time_of (offset, chosen->header.pts_ns);
  gst_base_parse_add_index_entry (base, offset, found, TRUE, TRUE);
  return found;
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
  const GstClockTime found = find_place (base, GstClockTime (start), flags);
  if (!GST_CLOCK_TIME_IS_VALID (found))
    return event;
  const auto end = stop_type == GST_SEEK_TYPE_NONE ? base->segment.stop : GstClockTime (stop);
  if (flags & GST_SEEK_FLAG_KEY_UNIT && found <= end)
    start = gint64 (found);
  /* The base class uses its index only for accurate seeks. */
  flags = GstSeekFlags (flags | GST_SEEK_FLAG_ACCURATE);
  GstEvent *result = gst_event_new_seek (rate, format, flags, start_type, start, stop_type, stop);
  gst_event_set_seqnum (result, gst_event_get_seqnum (event));
  gst_event_unref (event);
  return result;
}
