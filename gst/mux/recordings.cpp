/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "recordings.hpp"

#include <algorithm>
#include <cmath>
#include <gstrange/gstrangemeta.h>

bool
Recordings::compare (std::span<const WaitingBuffer> waiting, GstClockTime last_capture)
{
  if (waiting.empty ())
    return false;
  captures_.clear ();
  for (const WaitingBuffer &w : waiting)
    captures_.push_back (w.capture);
  const auto middle = captures_.begin () + std::ptrdiff_t (captures_.size () / 2);
  std::ranges::nth_element (captures_, middle);
  const bool can_vote = captures_.size () >= 3;
  const GstClockTime others = can_vote ? *middle : std::ranges::min (captures_);
  for (const WaitingBuffer &w : waiting) {
    w.stream->ahead = GST_CLOCK_DIFF (others, w.capture);
    w.stream->in_sync = !can_vote || GstClockTime (ABS (w.stream->ahead)) <= kMaxLater;
  }
  return GST_CLOCK_TIME_IS_VALID (last_capture) && *middle + kMaxBack < last_capture;
}

const WaitingBuffer *
Recordings::find_different_time (std::span<const WaitingBuffer> waiting)
{
  if (waiting.size () == 2)
    for (const WaitingBuffer &w : waiting)
      if (w.stream->ahead > GstClockTimeDiff (kMaxLater))
        return &w;
  return nullptr;
}

MuxStream *
Recordings::find_unmatched (const MuxStreams &streams)
{
  int received = 0, reported = 0, unreported = 0;
  MuxStream *ended = nullptr;
  for (const auto &stream : streams) {
    received += stream->received > 0;
    if (stream->received == 0 || stream->matched_others)
      continue;
    if (stream->different_time_reported || stream->reported != StreamState::kIn) {
      reported++;
      continue;
    }
    unreported++;
    if (gst_aggregator_pad_is_eos (stream->pad))
      ended = stream.get ();
  }
  const bool all_others_reported = reported > 0 && unreported == 1;
  return received > 1 && !all_others_reported ? ended : nullptr;
}

double
speed_of (const WaitingBuffer &w)
{
  GST_OBJECT_LOCK (w.stream->pad);
  const double rate = std::abs (w.stream->pad->segment.rate);
  GST_OBJECT_UNLOCK (w.stream->pad);
  /* A running time in place of the capture time is in playback time already. */
  const bool has_capture_time =
      rate == 1 || GST_CLOCK_TIME_IS_VALID (gst_range_buffer_get_capture_time (w.buffer));
  return has_capture_time ? rate : 1;
}

GstClockTime
running_time_after (
    const FrameTimes &last, const FrameTimes &next, double speed, GstClockTime period)
{
  if (!GST_CLOCK_TIME_IS_VALID (last.running))
    return next.running;
  const bool follows = GST_CLOCK_TIME_IS_VALID (last.capture) && next.capture > last.capture &&
                       next.capture - last.capture <= Recordings::kMaxLater;
  const GstClockTime distance = follows ? next.capture - last.capture : period;
  const GstClockTime running = last.running + GstClockTime (double (distance) / speed);
  return follows || !GST_CLOCK_TIME_IS_VALID (next.running) ? running
                                                            : std::max (running, next.running);
}
