/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <mutex>

/** Requests for key frame sets (GstForceKeyUnit) that wait for their time. Any thread. */
class KeyUnitRequests {
public:
  /** Takes note of an event from upstream or downstream. @return false if it is another event */
  bool note (GstEvent *event);

  /** Whether the frame set of this running time is to be a key one; forgets the requests that it
   *  answers.
   *  @return the event that announces it downstream, for the caller to push; nullptr: none was
   *  asked for */
  GstEvent *answer (GstClockTime timestamp, GstClockTime stream_time, GstClockTime running_time);
  void forget ();

private:
  std::mutex lock_;
  bool waiting_ = false, all_headers_ = false;
  GstClockTime running_time_ = GST_CLOCK_TIME_NONE; /* none: at once */
  guint count_ = 0;
};
