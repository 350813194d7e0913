/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "bytestreamindex.hpp"

#include <algorithm>

using rangecast::AccessUnitPlace;
using rangecast::kNoTime;
using rangecast::StreamFile;

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

} // namespace

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

StreamFile
NeighbourCodeFile::stream ()
{
  gint64 size = 0;
  if (!gst_pad_peer_query_duration (pad_, GST_FORMAT_BYTES, &size))
    size = 0;
  return {
      [this] (guint64 offset, gsize bytes, std::vector<guint8> &to) { read (offset, bytes, to); },
      guint64 (std::max<gint64> (size, 0))};
}

GstClockTime
NeighbourCodeFile::last_time ()
{
  const auto last = stream ().last ();
  if (!last || last->header.pts_ns == kNoTime || last->header.pts_ns < first_pts_)
    return GST_CLOCK_TIME_NONE;
  return last->header.pts_ns - first_pts_;
}

/* The time in the file of a stream time. */
guint64
NeighbourCodeFile::pts_at (GstClockTime time) const
{
  const guint64 latest = kNoTime - 1;
  return time < latest - std::min (first_pts_, latest) ? first_pts_ + time : latest;
}

std::optional<NeighbourCodeFile::Place>
NeighbourCodeFile::find (GstClockTime start, GstClockTime stop, GstSeekFlags flags)
{
  const guint64 pts = pts_at (start);
  const StreamFile::Target target = stream ().locate (pts);
  const auto chosen = choose (target, pts, pts_at (stop), flags);
  if (!chosen)
    return {};
  const guint64 found = chosen->header.pts_ns;
  Place place = {chosen->offset, found - std::min (first_pts_, found), {}};
  if (target.rig)
    read (target.rig->offset + rangecast::kStreamPrefixSize,
        std::min<gsize> (target.rig->header.size, kMaxRigBytes), place.rig_units);
  return place;
}
