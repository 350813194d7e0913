/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "accessunitwriter.hpp"

#include <algorithm>
#include <string>

using rangecast::kAccessUnitHeaderSize;
using rangecast::Status;
using rangecast::StatusCode;

void
AccessUnitWriter::set_rig (const gstrange::RangeInfo &info)
{
  rig_.clear ();
  rangecast::write_rig_units ({info.rig, info.fps_n, info.fps_d}, rig_);
  repeats_rig_ = true;
}

Status
AccessUnitWriter::begin (bool key, gsize size)
{
  if (size > max_size ())
    return {StatusCode::kBadSize, "A coded frame set of " + std::to_string (size) +
                                      " bytes is longer than 32 MiB with its rig; set larger "
                                      "thresholds or a smaller frame size"};
  const gsize rig_size = key || repeats_rig_ ? rig_.size () : 0;
  GstMemory *memory = memories_.acquire (kAccessUnitHeaderSize + rig_size + size);
  if (!memory || !gst_memory_map (memory, &map_, GST_MAP_WRITE)) {
    g_clear_pointer (&memory, gst_memory_unref);
    return {StatusCode::kNoSpace, "out of memory for a coded frame set"};
  }
  repeats_rig_ = false;
  header_ = {.size = guint32 (rig_size), .key = key};
  std::copy_n (rig_.begin (), rig_size, map_.data + kAccessUnitHeaderSize);
  end_ = kAccessUnitHeaderSize + rig_size;
  return {};
}

guint8 *
AccessUnitWriter::add (std::span<const guint8> slices)
{
  rangecast::SliceHeader first;
  if (header_.capture_time_ns == 0 && rangecast::read_slice_header (slices, first).ok ())
    header_.capture_time_ns = first.capture_time_ns;
  guint8 *to = map_.data + end_;
  std::ranges::copy (slices, to);
  header_.size += guint32 (slices.size ());
  end_ += slices.size ();
  return to;
}

GstBuffer *
AccessUnitWriter::finish (GstClockTime time)
{
  header_.pts_ns = time;
  rangecast::write_access_unit_header (header_, map_.data);
  GstMemory *memory = map_.memory;
  gst_memory_unmap (memory, &map_);
  gst_memory_resize (memory, 0, end_);
  GstBuffer *buffer = gst_buffer_new ();
  gst_buffer_append_memory (buffer, memory);
  return buffer;
}

GstClockTime
byte_stream_time (const GstSegment &segment, GstClockTime pts)
{
  if (segment.format != GST_FORMAT_TIME || !GST_CLOCK_TIME_IS_VALID (pts))
    return pts;
  guint64 time = 0;
  return gst_segment_to_running_time_full (&segment, GST_FORMAT_TIME, pts, &time) > 0 ? time : 0;
}
