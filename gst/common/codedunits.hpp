/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <rangecast/neighbourcode/bitstream/unit.hpp>
#include <span>

/** A buffer of whole units, mapped for reading. */
class CodedUnitsMap {
public:
  explicit CodedUnitsMap (GstBuffer *buffer)
      : buffer_ (buffer), is_mapped_ (gst_buffer_map (buffer, &map_, GST_MAP_READ))
  {
  }
  ~CodedUnitsMap ()
  {
    if (is_mapped_)
      gst_buffer_unmap (buffer_, &map_);
  }
  CodedUnitsMap (const CodedUnitsMap &) = delete;
  CodedUnitsMap &operator= (const CodedUnitsMap &) = delete;

  /** Whether the buffer could be mapped. */
  explicit operator bool () const { return is_mapped_; }
  [[nodiscard]] std::span<const guint8> bytes () const { return {map_.data, map_.size}; }

private:
  GstBuffer *buffer_;
  GstMapInfo map_{};
  bool is_mapped_;
};

/** Calls `handle` for each unit of a buffer of whole units.
 *  @param handle  bool (gsize offset, std::span<const guint8> unit, const UnitHeader &); false ends
 *  it
 *  @param[out] status  how it ended: kTruncated, kBadData or kUnsupported at damage, after which
 *  nothing is read
 *  @return false if the buffer cannot be mapped */
template <typename Handle>
bool
for_each_unit (GstBuffer *buffer, Handle handle, rangecast::Status &status)
{
  const CodedUnitsMap map (buffer);
  rangecast::UnitReader reader (map.bytes ());
  rangecast::UnitHeader header;
  status = {};
  gsize offset = 0;
  while (const auto unit = reader.next (header)) {
    if (!handle (offset, *unit, header))
      return true;
    offset += unit->size ();
  }
  status = reader.status ();
  return bool (map);
}
