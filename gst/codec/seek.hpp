/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/base.h>

#include <mutex>
#include <optional>
#include <rangecast/neighbourcode/bitstream/byte_stream.hpp>
#include <utility>

/** Seeking by time in a file, and the times of its stream. Any thread: the lock is never held while
 *  pulling, pushing, querying or posting. */
class NeighbourCodeSeek {
public:
  void reset ();
  /** The time of the next access unit, which has one in the stream. The first one of a file also
   *  sets the parser's duration.
   *  @param frame_duration  ns, or none */
  rangecast::StreamTimes::Time time_of (
      GstBaseParse *base, const rangecast::AccessUnitPlace &unit, GstClockTime frame_duration);
  /** Upstream pushes another stream: its times begin a frame after the last ones. */
  void begin_stream ();
  /** The next access unit does not follow the one before. */
  void interrupt ();
  /** @param event (transfer full): a seek.
   *  @return (transfer full): the seek for the base class, to a key access unit; null if refused */
  GstEvent *handle_seek (GstBaseParse *base, GstEvent *event);

private:
  std::optional<std::pair<rangecast::AccessUnitPlace, GstClockTime>> find_place (
      GstBaseParse *base, GstClockTime time, GstSeekFlags flags);

  std::mutex lock_; /* guards what follows */
  rangecast::StreamTimes times_;
};
