/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/video/video.h>

#include <algorithm>
#include <mutex>
#include <vector>

/** Requests for key frame sets (GstForceKeyUnit) that wait for their time. Any thread. */
class KeyUnitRequests {
public:
  /** Handles an event from upstream or downstream. If too many requests wait, the latest are
   *  replaced. @return false if the event is another one */
  bool handle_event (GstEvent *event)
  {
    constexpr std::size_t kMax = 32;
    if (!gst_video_event_is_force_key_unit (event))
      return false;
    Request request{};
    const bool parsed =
        GST_EVENT_TYPE (event) == GST_EVENT_CUSTOM_UPSTREAM
            ? gst_video_event_parse_upstream_force_key_unit (
                  event, &request.running_time, &request.all_headers, &request.count)
            : gst_video_event_parse_downstream_force_key_unit (event, nullptr, nullptr,
                  &request.running_time, &request.all_headers, &request.count);
    std::lock_guard guard (lock_);
    if (parsed && waiting_.size () == kMax)
      waiting_.pop_back ();
    if (parsed)
      waiting_.push_back (request);
    return true;
  }

  /** Whether a request is due at this running time. */
  bool is_due (GstClockTime running_time)
  {
    std::lock_guard guard (lock_);
    return std::ranges::any_of (
        waiting_, [&] (const Request &request) { return request.is_due (running_time); });
  }

  /** Removes the requests that a key frame set of this running time answers.
   *  @return the GstForceKeyUnit event for downstream, for the caller to push; nullptr if there was
   *  no request */
  GstEvent *answer (GstClockTime timestamp, GstClockTime stream_time, GstClockTime running_time)
  {
    bool any = false;
    gboolean all_headers = FALSE;
    guint count = 0;
    std::lock_guard guard (lock_);
    std::erase_if (waiting_, [&] (const Request &request) {
      if (!request.is_due (running_time))
        return false;
      any = true;
      all_headers |= request.all_headers;
      count = request.count;
      return true;
    });
    return any ? gst_video_event_new_downstream_force_key_unit (
                     timestamp, stream_time, running_time, all_headers, count)
               : nullptr;
  }
  void reset ()
  {
    std::lock_guard guard (lock_);
    waiting_.clear ();
  }

private:
  struct Request {
    GstClockTime running_time; /* GST_CLOCK_TIME_NONE: immediately */
    gboolean all_headers;
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
