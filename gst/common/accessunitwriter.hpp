/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <gstrange/gstrangeinfo.hpp>
#include <rangecast/neighbourcode/bitstream/unit.hpp>
#include <span>
#include <vector>

#include "recycledmemories.hpp"

/** Makes access units that describe themselves: an access-unit unit, the rig in key ones and where
 *  it is new, then the slices, in one memory that is recycled. Streaming thread. */
class AccessUnitWriter {
public:
  void set_rig (const gstrange::RangeInfo &info);
  /** The next access unit holds the rig. */
  void repeat_rig () { repeats_rig_ = true; }
  /** Maximum bytes of an access unit's slices. */
  [[nodiscard]] gsize max_size () const { return rangecast::kMaxAccessUnitSize - rig_.size (); }

  /** Begins an access unit.
   *  @param size  maximum bytes of its slices
   *  @return kBadSize if that is more than max_size(), kNoSpace if memory is short */
  rangecast::Status begin (bool key, gsize size);
  guint8 *add (std::span<const guint8> slices); ///< @return where they are, until finish()
  /** @param time  in the byte stream: see byte_stream_time()
   *  @return (transfer full): without times and flags */
  GstBuffer *finish (GstClockTime time);

  /** Frees the recycled memories. */
  void drop () { memories_.drop (); }

private:
  std::vector<guint8> rig_;  /* units */
  bool repeats_rig_ = false; /* in the next access unit, whether it is a key one or not */
  RecycledMemories memories_;
  GstMapInfo map_{};                   /* of the memory that is written */
  gsize end_ = 0;                      /* bytes that are written or reserved in it */
  rangecast::AccessUnitHeader header_; /* the access-unit unit */
};

/** The time in a byte stream of a buffer's PTS: its running time, so that times go on in a new
 *  segment, as those of concat. 0 before the segment. */
GstClockTime byte_stream_time (const GstSegment &segment, GstClockTime pts);

/** Flags a buffer as one where decoders can begin, or not. */
inline void
set_key (GstBuffer *buffer, bool key)
{
  if (key)
    GST_BUFFER_FLAG_UNSET (buffer, GST_BUFFER_FLAG_DELTA_UNIT);
  else
    GST_BUFFER_FLAG_SET (buffer, GST_BUFFER_FLAG_DELTA_UNIT);
}
