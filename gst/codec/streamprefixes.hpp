/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <gstrange/gstrangeinfo.hpp>
#include <rangecast/neighbourcode/bitstream/unit.hpp>
#include <vector>

/** What turns access units into a byte stream: a prefix for each, with the rig in the first one and
 *  then once a second. Streaming thread. */
class StreamPrefixes {
public:
  void set_rig (const gstrange::RangeInfo &info);
  /** The next prefix has the rig. */
  void repeat_rig () { last_rig_ = GST_CLOCK_TIME_NONE; }

  /** Maximum number of bytes of an access unit in a byte stream. */
  [[nodiscard]] gsize max_access_unit () const
  {
    return rangecast::kMaxAccessUnitSize - rig_.size ();
  }
  /** @param header       `capture_time_ns` and `key`; the others are filled in
   *  @param pts          in the byte stream: see byte_stream_time()
   *  @param access_unit  bytes, at most max_access_unit()
   *  @return (transfer full) */
  GstMemory *make (rangecast::AccessUnitHeader header, GstClockTime pts, gsize access_unit);

private:
  bool rig_is_due (GstClockTime pts);

  std::vector<guint8> rig_;
  GstClockTime last_rig_ = GST_CLOCK_TIME_NONE;
};

/** The time in a byte stream of a buffer's PTS: its running time, so that times go on in a new
 *  segment, as those of concat. 0 before the segment. */
GstClockTime byte_stream_time (const GstSegment &segment, GstClockTime pts);

/** Alignment of a source pad's coded frame sets: access-unit, slice or byte-stream, the first that
 *  the peer's caps name.
 *  @param otherwise  if they name none, as those of a filesink */
const char *preferred_alignment (GstPad *source, const char *otherwise);
