/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <rangecast/neighbourcode/bitstream/unit.hpp>
#include <span>

/** Calls `take` for each unit of a buffer that holds whole units. Maps one memory at a time,
 * because mapping a buffer of several memories copies it; the whole buffer is mapped only if a unit
 * crosses two memories.
 *  @param take  bool (gsize offset, std::span<const guint8> unit, const UnitHeader &); returns
 * false to stop
 *  @param[out] status  kTruncated, kBadData or kUnsupported if a unit is damaged
 *  @return FALSE if the buffer cannot be mapped */
template <typename Take>
bool
for_each_unit (GstBuffer *buffer, Take take, rangecast::Status &status)
{
  using rangecast::StatusCode;
  rangecast::UnitHeader header;
  gsize offset = 0;
  bool more = true;
  const auto read = [&] (std::span<const guint8> bytes) {
    rangecast::UnitReader reader (bytes);
    while (more) {
      const auto unit = reader.next (header);
      if (!unit)
        break;
      more = take (offset, *unit, header);
      offset += unit->size ();
    }
    status = reader.status ();
  };
  const guint memories = gst_buffer_n_memory (buffer);
  for (guint i = 0; i < memories && more; i++) {
    GstMapInfo map;
    GstMemory *memory = gst_buffer_peek_memory (buffer, i);
    if (!gst_memory_map (memory, &map, GST_MAP_READ))
      return false;
    read ({map.data, map.size});
    gst_memory_unmap (memory, &map);
    if (status.ok ())
      continue;
    if (status.code () != StatusCode::kTruncated || i + 1 == memories)
      return true;
    if (!gst_buffer_map (buffer, &map, GST_MAP_READ))
      return false;
    read (std::span<const guint8> (map.data, map.size).subspan (offset));
    gst_buffer_unmap (buffer, &map);
    return true;
  }
  return true;
}
