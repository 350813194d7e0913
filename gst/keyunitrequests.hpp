/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <mutex>
#include <vector>

/** Requests for key frame sets (GstForceKeyUnit) that wait for their time. Any thread. */
class KeyUnitRequests {
public:
  /** Takes note of an event from upstream or downstream. Of too many that wait the latest are
   *  forgotten. @return false if it is another event */
  bool note (GstEvent *event);

  /** Whether the frame set of this running time is to be a key one; forgets the requests that it
   *  answers.
   *  @return the event that announces it downstream, for the caller to push; nullptr: none was
   *  asked for */
  GstEvent *answer (GstClockTime timestamp, GstClockTime stream_time, GstClockTime running_time);
  void forget ();

private:
  struct Request {
    GstClockTime running_time; /* none: at once */
    bool all_headers;
    guint count;
  };
  std::mutex lock_;
  std::vector<Request> waiting_;
};
