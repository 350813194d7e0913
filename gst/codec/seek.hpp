/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/base.h>

#include <mutex>
#include <vector>

/** Seeks by time in the file in front of a parser, and the times of its stream, which begin at 0.
 *  Any thread: what a seek, in the application's thread, shares with the streaming thread is behind
 *  a lock that is never held while pulling, pushing, querying or posting. */
class NeighbourCodeSeek {
public:
  /** Whether the parser pulls from a file, rather than being pushed to. */
  static bool reads_file (GstBaseParse *base);

  /** Forgets the file. */
  void reset ();
  /** The time of the stream for a time that the file tells, none for none. At the first one of a
   *  file the parser learns the duration. `frame_duration` in ns, or none. */
  GstClockTime time_of (GstBaseParse *base, guint64 pts_ns, GstClockTime frame_duration);
  /** The rig units that the file had last at the place that a seek chose; empty if `offset` (bytes)
   *  is no such place. Gives them once. */
  std::vector<guint8> take_rig (guint64 offset);
  /** @param event (transfer full): a seek.
   *  @return (transfer full): the seek that the base class shall do; null if it is refused. */
  GstEvent *aim (GstBaseParse *base, GstEvent *event);

private:
  GstClockTime find_place (
      GstBaseParse *base, GstClockTime time, GstClockTime stop, GstSeekFlags flags);
  GstClockTime first_pts ();

  std::mutex lock_; /* guards all below */
  GstClockTime first_pts_ = GST_CLOCK_TIME_NONE;
  /* The rig of the access unit at that offset, which may not have one of its own. */
  guint64 rig_offset_ = G_MAXUINT64;
  std::vector<guint8> rig_units_;
};
