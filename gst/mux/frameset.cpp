/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "frameset.hpp"

#include <algorithm>
#include <gstrange/gstrangeframe.hpp>
#include <string>
#include <utility>

#include "common/codedunits.hpp"

using rangecast::Status;
using rangecast::StatusCode;

static constexpr gsize kViewIdByte = 4; /* of a slice */

void
FrameSetJoiner::begin (bool coded)
{
  gst_clear_buffer (&frame_set_);
  frame_set_ = gst_buffer_new ();
  coded_ = coded;
  is_key_ = true;
  size_ = 0;
  memories_ = 0;
  parts_.clear ();
}

bool
FrameSetJoiner::add (GstBuffer *buffer, int id_offset)
{
  if (coded_ ? size_ + gst_buffer_get_size (buffer) > writer_.max_size ()
             : !gstrange::append_metas (frame_set_, buffer, size_, guint (id_offset)))
    return false;
  is_key_ = is_key_ && !GST_BUFFER_FLAG_IS_SET (buffer, GST_BUFFER_FLAG_DELTA_UNIT);
  size_ += gst_buffer_get_size (buffer);
  memories_ += gst_buffer_n_memory (buffer);
  parts_.push_back ({buffer, id_offset});
  return true;
}

/* Not gst_buffer_extract(): GStreamer 1.22 leaks memory of buffers that cannot be mapped. */
static bool
copy_bytes (GstBuffer *buffer, guint8 *&end)
{
  for (guint i = 0; i < gst_buffer_n_memory (buffer); i++) {
    GstMemory *memory = gst_buffer_peek_memory (buffer, i);
    GstMapInfo map;
    if (!gst_memory_map (memory, &map, GST_MAP_READ))
      return false;
    end = std::copy_n (map.data, map.size, end);
    gst_memory_unmap (memory, &map);
  }
  return true;
}

Status
FrameSetJoiner::copy_parts ()
{
  GstMemory *copy = copies_.acquire (size_);
  GstMapInfo map;
  if (!copy)
    return {StatusCode::kNoSpace, "out of memory for " + std::to_string (size_) + " bytes of " +
                                      std::to_string (parts_.size ()) + " streams"};
  gst_buffer_append_memory (frame_set_, copy);
  bool all = gst_memory_map (copy, &map, GST_MAP_WRITE);
  if (all) {
    guint8 *end = map.data;
    for (const Part &part : parts_)
      all = all && copy_bytes (part.buffer, end);
    gst_memory_unmap (copy, &map);
  }
  return all ? Status{} : Status{StatusCode::kBadData, "cannot map an input buffer"};
}

/* The slices of all parts; each part's own access-unit unit and rig are left out. */
Status
FrameSetJoiner::write_access_unit (GstClockTime time)
{
  if (Status s = writer_.begin (is_key_, size_); !s.ok ())
    return s;
  bool all = true;
  for (const Part &part : parts_) {
    const auto add_slice = [&] (gsize, std::span<const guint8> unit,
                               const rangecast::UnitHeader &header) {
      if (header.type == guint8 (rangecast::UnitType::kSlice) && unit.size () > kViewIdByte &&
          unit[kViewIdByte] + part.id_offset < rangecast::kMaxViews)
        writer_.add (unit)[kViewIdByte] += guint8 (part.id_offset);
      return true;
    };
    Status damage; /* what follows it is skipped */
    all = for_each_unit (part.buffer, add_slice, damage) && all;
  }
  gst_buffer_unref (std::exchange (frame_set_, writer_.finish (time)));
  set_key (frame_set_, is_key_);
  return all ? Status{} : Status{StatusCode::kBadData, "cannot map an input buffer"};
}

Status
FrameSetJoiner::finish (GstClockTime time, GstBuffer *&frame_set)
{
  Status status;
  if (coded_)
    status = write_access_unit (time);
  else if (memories_ > gst_buffer_get_max_memory ())
    status = copy_parts ();
  else
    for (const auto &[buffer, id_offset] : parts_) {
      gst_buffer_copy_into (frame_set_, buffer, GST_BUFFER_COPY_MEMORY, 0, gsize (-1));
      gst_buffer_add_parent_buffer_meta (frame_set_, buffer); /* keeps the memory in its pool */
    }
  if (!status.ok ())
    gst_clear_buffer (&frame_set_);
  parts_.clear ();
  frame_set = std::exchange (frame_set_, nullptr);
  return status;
}
