/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/base.h>

#include <mutex>
#include <vector>

/** Seeking by time in a file, and the times of its stream, which begin at 0. Any thread: the lock
 *  is never held while pulling, pushing, querying or posting. */
class NeighbourCodeSeek {
public:
  /** Whether the parser is in pull mode. */
  static bool reads_file (GstBaseParse *base);

  void reset ();
  /** The stream time, ns, of a time in the file; none for none. At the first time of a file it also
   *  sets the parser's duration.
   *  @param frame_duration  ns, or none */
  GstClockTime time_of (GstBaseParse *base, guint64 pts_ns, GstClockTime frame_duration);
  /** The rig units that apply at `offset`, bytes, if a seek has chosen it; else empty. Only the
   *  first call returns them. */
  std::vector<guint8> rig_at (guint64 offset);
  /** @param event (transfer full): a seek.
   *  @return (transfer full): the seek for the base class, to a key access unit; null if refused */
  GstEvent *handle_seek (GstBaseParse *base, GstEvent *event);

private:
  GstClockTime find_place (
      GstBaseParse *base, GstClockTime time, GstClockTime stop, GstSeekFlags flags);

  std::mutex lock_; /* guards all below */
  GstClockTime first_pts_ = GST_CLOCK_TIME_NONE;
  /* The rig at the target of the last seek, whose access unit may not contain one. */
  guint64 rig_offset_ = G_MAXUINT64;
  std::vector<guint8> rig_units_;
};
