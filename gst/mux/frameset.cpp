/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "frameset.hpp"

#include <algorithm>
#include <gstrange/gstrangeframe.hpp>
#include <string>
#include <utility>

using rangecast::Status;
using rangecast::StatusCode;

void
FrameSetJoiner::begin (guint memories, bool coded)
{
  gst_clear_buffer (&frame_set_);
  frame_set_ = gst_buffer_new ();
  coded_ = coded;
  const guint max = gst_buffer_get_max_memory ();
  max_shared_ = memories <= max ? max : max - 1; /* the last one is for the copy */
  size_ = rest_size_ = 0;
  rest_.clear ();
}

bool
FrameSetJoiner::add (GstBuffer *buffer)
{
  if (!coded_ && !gstrange::append_metas (frame_set_, buffer, size_))
    return false;
  if (coded_ && GST_BUFFER_FLAG_IS_SET (buffer, GST_BUFFER_FLAG_DELTA_UNIT))
    GST_BUFFER_FLAG_SET (frame_set_, GST_BUFFER_FLAG_DELTA_UNIT);
  const gsize size = gst_buffer_get_size (buffer);
  size_ += size;
  /* After the first one that is copied all are, to keep their order. */
  if (rest_.empty () &&
      gst_buffer_n_memory (frame_set_) + gst_buffer_n_memory (buffer) <= max_shared_) {
    gst_buffer_copy_into (frame_set_, buffer, GST_BUFFER_COPY_MEMORY, 0, gsize (-1));
    gst_buffer_add_parent_buffer_meta (frame_set_, buffer); /* keeps the memory in its pool */
  } else {
    rest_.push_back (buffer);
    rest_size_ += size;
  }
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
FrameSetJoiner::copy_rest ()
{
  GstMemory *copy = copies_.acquire (rest_size_);
  GstMapInfo map;
  if (!copy)
    return {StatusCode::kNoSpace, "out of memory for " + std::to_string (rest_size_) +
                                      " bytes of " + std::to_string (rest_.size ()) + " streams"};
  gst_buffer_append_memory (frame_set_, copy);
  bool all = gst_memory_map (copy, &map, GST_MAP_WRITE);
  if (all) {
    guint8 *end = map.data;
    for (GstBuffer *buffer : rest_)
      all = all && copy_bytes (buffer, end);
    gst_memory_unmap (copy, &map);
  }
  return all ? Status{} : Status{StatusCode::kBadData, "cannot map an input buffer"};
}

Status
FrameSetJoiner::finish (GstBuffer *&frame_set)
{
  Status status;
  if (rest_size_ > 0)
    status = copy_rest ();
  if (!status.ok ())
    gst_clear_buffer (&frame_set_);
  rest_.clear ();
  frame_set = std::exchange (frame_set_, nullptr);
  return status;
}
