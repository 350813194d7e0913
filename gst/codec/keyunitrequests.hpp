/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <mutex>
#include <vector>

/** Requests for key frame sets (GstForceKeyUnit) that wait for their time. Any thread. */
class KeyUnitRequests {
public:
  /** Takes note of an event from upstream or downstream. Of too many that wait for
   *  their time the latest are forgotten. @return false if it is another event */
  bool note (GstEvent *event);

  /** Whether somebody asked for the frame set of this running time to be a key one. */
  bool is_due (GstClockTime running_time);

  /** The frame set of this running time is a key one; forgets the requests that it answers.
   *  @return the event that announces it downstream, for the caller to push; nullptr: none was
   *  asked for */
  GstEvent *answer (GstClockTime timestamp, GstClockTime stream_time, GstClockTime running_time);
  void forget ();

private:
  struct Request {
    GstClockTime running_time; /* none: at once */
    bool all_headers;
    guint count;

    [[nodiscard]] bool is_due (GstClockTime now) const
    {
      return !GST_CLOCK_TIME_IS_VALID (running_time) || !GST_CLOCK_TIME_IS_VALID (now) ||
             now >= running_time;
    }
  };
  std::mutex lock_;
  std::vector<Request> waiting_;
};
