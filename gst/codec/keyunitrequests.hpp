/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <mutex>
#include <vector>

/** Requests for key frame sets (GstForceKeyUnit) that wait for their time. Any thread. */
class KeyUnitRequests {
public:
  /** Handles an event from upstream or downstream. If too many requests wait, the latest are
   *  dropped. @return false if the event is another one */
  bool handle_event (GstEvent *event);

  /** Whether a request is due at this running time. */
  bool is_due (GstClockTime running_time);

  /** Removes the requests that a key frame set of this running time answers.
   *  @return the GstForceKeyUnit event for downstream, for the caller to push; nullptr if there was
   *  no request */
  GstEvent *answer (GstClockTime timestamp, GstClockTime stream_time, GstClockTime running_time);
  void reset ();

private:
  struct Request {
    GstClockTime running_time; /* GST_CLOCK_TIME_NONE: at once */
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
