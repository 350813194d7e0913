/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "keyunitrequests.hpp"

#include <gst/video/video.h>

bool
KeyUnitRequests::note (GstEvent *event)
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
  std::lock_guard guard (lock_);
  /* Of several the earliest counts; GST_CLOCK_TIME_NONE is the greatest number. */
  const bool at_once = !GST_CLOCK_TIME_IS_VALID (running_time);
  if (!waiting_)
    running_time_ = running_time;
  else if (at_once || (GST_CLOCK_TIME_IS_VALID (running_time_) && running_time < running_time_))
    running_time_ = running_time;
  all_headers_ = all_headers_ || all_headers;
  count_ = count;
  waiting_ = true;
  return true;
}

GstEvent *
KeyUnitRequests::answer (
    GstClockTime timestamp, GstClockTime stream_time, GstClockTime running_time)
{
  std::lock_guard guard (lock_);
  const bool early = GST_CLOCK_TIME_IS_VALID (running_time_) &&
                     GST_CLOCK_TIME_IS_VALID (running_time) && running_time < running_time_;
  if (!waiting_ || early)
    return nullptr;
  const bool all_headers = all_headers_;
  waiting_ = all_headers_ = false;
  return gst_video_event_new_downstream_force_key_unit (
      timestamp, stream_time, running_time, all_headers, count_);
}

void
KeyUnitRequests::forget ()
{
  std::lock_guard guard (lock_);
  waiting_ = all_headers_ = false;
}
