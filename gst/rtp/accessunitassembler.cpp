/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "accessunitassembler.hpp"

#include <algorithm>
#include <cstring>
#include <rangecast/neighbourcode/bitstream/unit.hpp>

bool
AccessUnitAssembler::grow (gsize needed)
{
  GstMemory *larger = memories_.acquire (std::min<gsize> (
      std::max ({needed, 2 * map_.size, expected_}), rangecast::kMaxAccessUnitSize));
  if (!larger)
    return false;
  GstMapInfo map;
  gst_memory_resize (larger, 0, larger->maxsize);
  if (!gst_memory_map (larger, &map, GST_MAP_WRITE)) {
    gst_memory_unref (larger);
    return false;
  }
  if (memory_) {
    std::memcpy (map.data, map_.data, size_);
    gst_memory_unmap (memory_, &map_);
    gst_memory_unref (memory_);
  }
  memory_ = larger;
  map_ = map;
  return true;
}

bool
AccessUnitAssembler::add (std::span<const guint8> unit)
{
  const gsize end = size_ + unit.size ();
  if (end > rangecast::kMaxAccessUnitSize || units_ == rangecast::kMaxSlices)
    return false;
  if (end > map_.size && !grow (end))
    return false;
  std::memcpy (map_.data + size_, unit.data (), unit.size ());
  size_ = end;
  units_++;
  return true;
}

GstBuffer *
AccessUnitAssembler::finish ()
{
  /* A single huge access unit does not claim memory for all that follow it. */
  constexpr gsize kMaxExpected = gsize{1} << 20;
  expected_ = std::min (size_ + size_ / 8, kMaxExpected);
  gst_memory_unmap (memory_, &map_);
  gst_memory_resize (memory_, 0, size_);
  GstBuffer *buffer = gst_buffer_new ();
  gst_buffer_append_memory (buffer, memory_);
  memory_ = nullptr;
  map_ = {};
  clear ();
  return buffer;
}

void
AccessUnitAssembler::reset ()
{
  clear ();
  if (memory_) {
    gst_memory_unmap (memory_, &map_);
    gst_memory_unref (memory_);
  }
  memory_ = nullptr;
  map_ = {};
  memories_.drop ();
}
