/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "keyunitrequests.hpp"

#include <gst/video/video.h>

#include <algorithm>

bool
KeyUnitRequests::handle_event (GstEvent *event)
{
  if (!gst_video_event_is_force_key_unit (event))
    return false;
  GstClockTime running_time = GST_CLOCK_TIME_NONE;
  gboolean all_headers = FALSE;
  guint count = 0;
  const bool parsed = GST_EVENT_TYPE (event) == GST_EVENT_CUSTOM_UPSTREAM
                          ? gst_video_event_parse_upstream_force_key_unit (
                                event, &running_time, &all_headers, &count)
                          : gst_video_event_parse_downstream_force_key_unit (
                                event, nullptr, nullptr, &running_time, &all_headers, &count);
  if (!parsed)
    return true;
  constexpr std::size_t kMax = 32;
  std::lock_guard guard (lock_);
  const Request request = {running_time, all_headers != FALSE, count};
  if (waiting_.size () < kMax)
    waiting_.push_back (request);
  else if (!GST_CLOCK_TIME_IS_VALID (running_time)) /* "at once" is never dropped */
    waiting_.back () = request;
  return true;
}

bool
KeyUnitRequests::is_due (GstClockTime running_time)
{
  std::lock_guard guard (lock_);
  return std::ranges::any_of (
      waiting_, [&] (const Request &request) { return request.is_due (running_time); });
}

GstEvent *
KeyUnitRequests::answer (
    GstClockTime timestamp, GstClockTime stream_time, GstClockTime running_time)
{
  bool any = false, all_headers = false;
  guint count = 0;
  const auto answered = [&] (const Request &r) {
    if (!r.is_due (running_time))
      return false;
    any = true;
    all_headers = all_headers || r.all_headers;
    count = r.count;
    return true;
  };
  std::lock_guard guard (lock_);
  std::erase_if (waiting_, answered);
  return any ? gst_video_event_new_downstream_force_key_unit (
                   timestamp, stream_time, running_time, all_headers, count)
             : nullptr;
}

void
KeyUnitRequests::reset ()
{
  std::lock_guard guard (lock_);
  waiting_.clear ();
}
