/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "bytestreamindex.hpp"

#include <algorithm>

using rangecast::AccessUnitPlace;
using rangecast::kNoTime;
using rangecast::StreamFile;
using rangecast::Take;
using rangecast::TakeList;

namespace {

/* The rig views are the first units of an access unit: 64 of at most 500 bytes. */
constexpr gsize kMaxRigBytes = 32000;

/* The access unit that the seek's flags select; not after `last_pts`, where the segment ends. */
std::optional<AccessUnitPlace>
choose (StreamFile::Target target, guint64 pts, guint64 last_pts, GstSeekFlags flags)
{
  if (target.after && target.after->header.pts_ns > last_pts && target.before)
    target.after.reset ();
  const bool snap = flags & GST_SEEK_FLAG_KEY_UNIT;
  const bool nearest = (flags & GST_SEEK_FLAG_SNAP_NEAREST) == GST_SEEK_FLAG_SNAP_NEAREST;
  const bool after = flags & GST_SEEK_FLAG_SNAP_AFTER;
  if (!target.before || !target.after || !snap || !after)
    return target.before ? target.before : target.after;
  if (nearest && pts - target.before->header.pts_ns <= target.after->header.pts_ns - pts)
    return target.before;
  return target.after;
}

/* Whether a seek to `start` is to land on the first place of the next take instead of the last one
 * of its own. */
bool
is_better (GstClockTime next, GstClockTime own, GstClockTime start, GstClockTime stop, bool nearest)
{
  return next <= stop && (!nearest || next - start < start - std::min (start, own));
}

/* The time in the file of a time in a take. */
guint64
pts_at (const Take &take, GstClockTime time)
{
  const guint64 latest = kNoTime - 1, after = time - std::min (time, take.time_ns);
  return after < latest - std::min (take.pts_ns, latest) ? take.pts_ns + after : latest;
}

} // namespace

NeighbourCodeFile::NeighbourCodeFile (GstPad *pad) : pad_ (pad)
{
  gint64 size = 0;
  if (gst_pad_peer_query_duration (pad, GST_FORMAT_BYTES, &size))
    size_ = guint64 (std::max<gint64> (size, 0));
}

void
NeighbourCodeFile::read (guint64 offset, gsize size, std::vector<guint8> &to)
{
  to.clear ();
  GstBuffer *buffer = nullptr;
  if (gst_pad_pull_range (pad_, offset, guint (size), &buffer) != GST_FLOW_OK)
    return;
  to.resize (std::min (gst_buffer_get_size (buffer), size));
  gst_buffer_extract (buffer, 0, to.data (), to.size ());
  gst_buffer_unref (buffer);
}

/* A part of the file, whose offsets begin at 0. */
StreamFile
NeighbourCodeFile::part (guint64 begin, guint64 end)
{
  const guint64 length = end - std::min (begin, end);
  const auto read_part = [this, begin, length] (
                             guint64 offset, gsize bytes, std::vector<guint8> &to) {
    read (
        begin + offset, gsize (std::min<guint64> (bytes, length - std::min (offset, length))), to);
  };
  return {read_part, length};
}

std::optional<AccessUnitPlace>
NeighbourCodeFile::last ()
{
  auto last = part (0, size_).last ();
  if (last && last->header.pts_ns == kNoTime)
    last.reset ();
  return last;
}

TakeList
NeighbourCodeFile::takes (guint64 offset, GstClockTime frame_duration)
{
  return part (0, size_).takes (offset, frame_duration);
}

std::optional<NeighbourCodeFile::Place>
NeighbourCodeFile::find (
    const TakeList &list, GstClockTime start, GstClockTime stop, GstSeekFlags flags)
{
  if (list.empty ())
    return {};
  const std::vector<Take> &takes = list.takes ();
  const auto after = std::ranges::upper_bound (takes, start, {}, &Take::time_ns);
  const auto take = after == takes.begin () ? after : after - 1;
  const auto next = take + 1;
  const guint64 end = next == takes.end () ? size_ : next->offset;
  const guint64 pts = pts_at (*take, start);
  const StreamFile::Target target = part (take->offset, end).locate (pts);
  const auto chosen = choose (target, pts, pts_at (*take, stop), flags);
  if (!chosen)
    return {};
  const guint64 offset = take->offset + chosen->offset;
  Place place = {offset, list.time_of (offset, chosen->header.pts_ns), {}};
  const bool snaps_after = flags & GST_SEEK_FLAG_KEY_UNIT && flags & GST_SEEK_FLAG_SNAP_AFTER;
  const bool nearest = flags & GST_SEEK_FLAG_SNAP_BEFORE; /* and after */
  if (snaps_after && !target.after && next != takes.end () && next->time_ns > start &&
      is_better (next->time_ns, place.time, start, stop, nearest))
    return find (list, next->time_ns, stop, GST_SEEK_FLAG_KEY_UNIT);
  if (target.rig)
    read (take->offset + target.rig->offset + rangecast::kStreamPrefixSize,
        std::min<gsize> (target.rig->header.size, kMaxRigBytes), place.rig_units);
  return place;
}
