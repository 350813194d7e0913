/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <array>
#include <rangecast/neighbourcode/bitstream/unit.hpp>
#include <span>

/** A buffer of whole units, mapped for reading. Memories are mapped one by one, because mapping a
 *  buffer of several memories copies them into one. Only where a unit crosses memories is the
 *  buffer mapped as a whole. */
class CodedUnitsMap {
public:
  using Bytes = std::span<const guint8>;

  explicit CodedUnitsMap (GstBuffer *buffer) : buffer_ (buffer)
  {
    const guint memories = gst_buffer_n_memory (buffer);
    const bool by_memory = memories > 1 && memories <= maps_.size () && map_memories (memories);
    if (by_memory)
      return;
    unmap ();
    whole_ = gst_buffer_map (buffer, &maps_[0], GST_MAP_READ);
    if (whole_)
      bytes_[count_++] = {maps_[0].data, maps_[0].size};
  }
  ~CodedUnitsMap () { unmap (); }
  CodedUnitsMap (const CodedUnitsMap &) = delete;
  CodedUnitsMap &operator= (const CodedUnitsMap &) = delete;

  /** The bytes in order, cut between units; none if the buffer could not be mapped. */
  [[nodiscard]] std::span<const Bytes> pieces () const { return {bytes_.data (), count_}; }

private:
  /* @return false if a memory cannot be mapped, or a unit may continue in the next one */
  bool map_memories (guint memories)
  {
    while (count_ < memories) {
      GstMapInfo &map = maps_[count_];
      if (!gst_memory_map (gst_buffer_peek_memory (buffer_, guint (count_)), &map, GST_MAP_READ))
        return false;
      bytes_[count_] = {map.data, map.size};
      rangecast::UnitReader reader (bytes_[count_++]);
      rangecast::UnitHeader header;
      while (reader.next (header)) {
      }
      if (count_ < memories && reader.status ().code () == rangecast::StatusCode::kTruncated)
        return false;
    }
    return true;
  }
  void unmap ()
  {
    if (whole_)
      gst_buffer_unmap (buffer_, &maps_[0]);
    else
      for (std::size_t i = 0; i < count_; i++)
        gst_memory_unmap (maps_[i].memory, &maps_[i]);
    whole_ = false;
    count_ = 0;
  }

  static constexpr std::size_t kMaxMemories = 16; /* gst_buffer_get_max_memory() of GStreamer 1.x */

  GstBuffer *buffer_;
  bool whole_ = false;
  std::size_t count_ = 0; /* of maps, or 1 for the whole buffer */
  std::array<GstMapInfo, kMaxMemories> maps_;
  std::array<Bytes, kMaxMemories> bytes_;
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
  gsize offset = 0;
  status = {};
  for (const CodedUnitsMap::Bytes piece : map.pieces ()) {
    rangecast::UnitReader reader (piece);
    rangecast::UnitHeader header;
    while (const auto unit = reader.next (header)) {
      if (!handle (offset, *unit, header))
        return true;
      offset += unit->size ();
    }
    status = reader.status ();
    if (!status.ok ())
      return true;
  }
  return !map.pieces ().empty ();
}
