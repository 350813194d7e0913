/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/base.h>

#include <mutex>
#include <optional>
#include <rangecast/neighbourcode/bitstream/byte_stream.hpp>
#include <vector>

/** Seeking by time in a file, and the times of its stream, of one or several takes. Any thread: the
 *  lock is never held while pulling, pushing, querying or posting. */
class NeighbourCodeSeek {
public:
  /** Whether the parser is in pull mode. */
  static bool reads_file (GstBaseParse *base);

  void reset ();
  /** The time of the next access unit, which has one in the stream. The first one of a file also
   *  sets the parser's duration.
   *  @param frame_duration  ns, or none */
  rangecast::TakeList::Time time_of (
      GstBaseParse *base, const rangecast::AccessUnitPlace &unit, GstClockTime frame_duration);
  /** Upstream pushes another stream: its times begin a frame after the last ones, or at 0 after a
   *  flush. */
  void begin_stream (bool flushed);
  /** The next access unit does not follow the one before. */
  void interrupt ();
  /** The rig units that apply at `offset`, bytes, if a seek has chosen it; else empty. Only the
   *  first call returns them. */
  std::vector<guint8> rig_at (guint64 offset);
  /** @param event (transfer full): a seek.
   *  @return (transfer full): the seek for the base class, to a key access unit; null if refused */
  GstEvent *handle_seek (GstBaseParse *base, GstEvent *event);

private:
  void index_file (GstBaseParse *base, guint64 offset, GstClockTime frame_duration);
  GstClockTime find_place (
      GstBaseParse *base, GstClockTime time, GstClockTime stop, GstSeekFlags flags);

  std::mutex lock_; /* guards all below */
  rangecast::TakeList takes_;
  std::optional<rangecast::AccessUnitPlace> last_unit_; /* of a file */
  /* The rig at the target of the last seek, whose access unit may not contain one. */
  guint64 rig_offset_ = G_MAXUINT64;
  std::vector<guint8> rig_units_;
};
