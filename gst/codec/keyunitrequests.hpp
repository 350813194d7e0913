/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/video/video.h>

#include <algorithm>
#include <mutex>
#include <utility>

/** Requests for key frame sets (GstForceKeyUnit) that wait for their time. Any thread. */
class KeyUnitRequests {
public:
  /** Handles an event from upstream or downstream. A request that comes while another one waits is
   *  answered with it, at the earlier time. @return false if the event is another one */
  bool handle_event (GstEvent *event)
  {
    if (!gst_video_event_is_force_key_unit (event))
      return false;
    Request request;
    const bool parsed =
        GST_EVENT_TYPE (event) == GST_EVENT_CUSTOM_UPSTREAM
            ? gst_video_event_parse_upstream_force_key_unit (
                  event, &request.running_time, &request.all_headers, &request.count)
            : gst_video_event_parse_downstream_force_key_unit (event, nullptr, nullptr,
                  &request.running_time, &request.all_headers, &request.count);
    if (!parsed)
      return true;
    if (!GST_CLOCK_TIME_IS_VALID (request.running_time))
      request.running_time = 0; /* immediately */
    std::lock_guard guard (lock_);
    waiting_.running_time = std::min (waiting_.running_time, request.running_time);
    waiting_.all_headers |= request.all_headers;
    waiting_.count = request.count;
    return true;
  }

  /** Whether a request is due at this running time. */
  bool is_due (GstClockTime running_time)
  {
    std::lock_guard guard (lock_);
    return GST_CLOCK_TIME_IS_VALID (waiting_.running_time) &&
           running_time >= waiting_.running_time; /* NONE is the greatest */
  }

  /** Removes the request if a key frame set of this running time answers it.
   *  @return the GstForceKeyUnit event for downstream, for the caller to push; nullptr if there was
   *  no request */
  GstEvent *answer (GstClockTime timestamp, GstClockTime stream_time, GstClockTime running_time)
  {
    if (!is_due (running_time))
      return nullptr;
    std::lock_guard guard (lock_);
    const Request request = std::exchange (waiting_, {});
    return gst_video_event_new_downstream_force_key_unit (
        timestamp, stream_time, running_time, request.all_headers, request.count);
  }
  void reset ()
  {
    std::lock_guard guard (lock_);
    waiting_ = {};
  }

private:
  struct Request {
    GstClockTime running_time = GST_CLOCK_TIME_NONE; /* NONE: there is none */
    gboolean all_headers = FALSE;
    guint count = 0;
  };
  std::mutex lock_;
  Request waiting_;
};
