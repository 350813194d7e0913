/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "codedviews.hpp"

#include "common/codedunits.hpp"

using rangecast::Status;
using rangecast::StatusCode;

bool
CodedViews::add_unit (gsize offset, std::span<const guint8> unit)
{
  rangecast::SliceHeader slice;
  if (!rangecast::read_slice_header (unit, slice).ok ())
    return false;
  OneView &view = views_[slice.view_id];
  if (view.ranges.empty ())
    view.capture_time = slice.capture_time_ns;
  view.check.add (slice);
  if (!view.ranges.empty () && view.ranges.back ().offset + view.ranges.back ().size == offset)
    view.ranges.back ().size += unit.size ();
  else
    view.ranges.push_back ({offset, unit.size ()});
  return true;
}

Status
CodedViews::read (GstBuffer *frame_set)
{
  for (OneView &view : views_) {
    view.ranges.clear ();
    view.check.reset ();
  }
  dropped_ = 0;
  Status end;
  const auto handle = [this] (gsize offset, std::span<const guint8> unit,
                          const rangecast::UnitHeader &) {
    dropped_ += !add_unit (offset, unit);
    return true;
  };
  if (!for_each_unit (frame_set, handle, end))
    return {StatusCode::kBadData, "cannot map a coded frame set"};
  dropped_ += !end.ok ();
  return {};
}

GstBuffer *
CodedViews::copy_view (GstBuffer *frame_set, int id) const
{
  const std::vector<Range> &ranges = views_[std::size_t (id)].ranges;
  guint pieces = 0;
  gsize size = 0;
  for (const Range &range : ranges) {
    guint index = 0, length = 0;
    gsize skip = 0;
    gst_buffer_find_memory (frame_set, range.offset, range.size, &index, &length, &skip);
    pieces += length;
    size += range.size;
  }
  GstBuffer *view = gst_buffer_new ();
  if (pieces <= gst_buffer_get_max_memory ()) {
    for (const Range &range : ranges)
      gst_buffer_copy_into (view, frame_set, GST_BUFFER_COPY_MEMORY, range.offset, range.size);
    gst_buffer_add_parent_buffer_meta (view, frame_set); /* keeps the memory in its pool */
    return view;
  }
  /* GStreamer would copy all memories with each one that is too many. */
  GstMemory *memory = gst_allocator_alloc (nullptr, size, nullptr);
  GstMapInfo map;
  if (gst_memory_map (memory, &map, GST_MAP_WRITE)) {
    gsize end = 0;
    for (const Range &range : ranges)
      end += gst_buffer_extract (frame_set, range.offset, map.data + end, range.size);
    gst_memory_unmap (memory, &map);
  }
  gst_buffer_append_memory (view, memory);
  return view;
}
