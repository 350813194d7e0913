/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "recordings.hpp"

#include <algorithm>
#include <cmath>
#include <gstrange/gstrangemeta.h>

/* Finds whether a buffer is of the next round. One that comes late within its round has the running
 * time of its place there, and seldom precedes the stream's first one. Where a clock was set back,
 * capture times go back less far than to the first one: all streams together have begun again, one
 * alone is late. If its running time goes on, as that of the next take of concat does, one capture
 * time may be damaged: it is if that of the buffer after it follows the newest one. */
static void
compare_with_round (const WaitingBuffer &w)
{
  RecordingRound &round = w.stream->round;
  round.over = round.unsure = round.damaged = false;
  if (!GST_CLOCK_TIME_IS_VALID (round.newest) || w.capture > round.newest) {
    round.went_back = false;
    return;
  }
  if (GST_CLOCK_TIME_IS_VALID (w.next_capture) && w.next_capture > round.newest) {
    round.damaged = true;
    round.went_back = false;
    return;
  }
  const GstClockTime back = round.newest - w.capture;
  const bool from_begin = w.capture <= round.begin;
  const bool running_goes_on = GST_CLOCK_TIME_IS_VALID (w.running) &&
                               GST_CLOCK_TIME_IS_VALID (round.newest_running) &&
                               w.running > round.newest_running;
  round.over = from_begin && back > Recordings::kMaxReordered;
  round.unsure = round.over && running_goes_on && !w.stream->held;
  round.went_back = round.went_back || from_begin || running_goes_on || back > Recordings::kMaxBack;
}

/* Those that wait for the next round, and damaged capture times, vote for the time that the others
 * have reached.
 * @return the median capture time */
GstClockTime
Recordings::vote (std::span<const WaitingBuffer> waiting, GstClockTime last_capture)
{
  const auto has_no_vote = [] (const WaitingBuffer &w) {
    return w.stream->round.over || w.stream->round.damaged;
  };
  const auto time_of = [&] (const WaitingBuffer &w) {
    return has_no_vote (w) ? last_capture : w.capture;
  };
  captures_.clear ();
  for (const WaitingBuffer &w : waiting)
    captures_.push_back (time_of (w));
  const auto middle = captures_.begin () + std::ptrdiff_t (captures_.size () / 2);
  std::ranges::nth_element (captures_, middle);
  const bool can_vote = captures_.size () >= 3;
  const GstClockTime others = can_vote ? *middle : std::ranges::min (captures_);
  for (const WaitingBuffer &w : waiting) {
    const GstClockTimeDiff distance = GST_CLOCK_DIFF (others, time_of (w));
    w.stream->ahead = has_no_vote (w) ? GST_CLOCK_DIFF (last_capture, w.capture) : distance;
    w.stream->in_sync = !can_vote || GstClockTime (ABS (distance)) <= kMaxLater;
  }
  return *middle;
}

bool
Recordings::compare (WaitingBuffers &waiting, GstClockTime last_capture)
{
  if (waiting.list.empty ())
    return false;
  for (const WaitingBuffer &w : waiting.list) {
    if (!GST_CLOCK_TIME_IS_VALID (last_capture))
      w.stream->round = {};
    compare_with_round (w);
  }
  const GstClockTime middle = vote (waiting.list, last_capture);
  const auto went_back = [] (const WaitingBuffer &w) {
    return w.stream->in_sync && w.stream->round.went_back;
  };
  const bool known = waiting.missing == 0 && GST_CLOCK_TIME_IS_VALID (last_capture);
  const bool most = known && middle + kMaxBack < last_capture;
  const bool all = known && std::ranges::all_of (waiting.list, [&] (const WaitingBuffer &w) {
    return !w.stream->in_sync || went_back (w);
  });
  if (most || (all && waiting.gaps.empty ())) {
    for (const WaitingBuffer &w : waiting.list)
      w.stream->round = {};
    vote (waiting.list, last_capture);
    return true;
  }
  if (!known || all)
    for (const WaitingBuffer &w : waiting.list)
      w.stream->round.unsure = false;
  /* Gaps of the old round are dropped first. */
  std::erase_if (waiting.list, [&] (const WaitingBuffer &w) {
    const bool next = w.stream->round.over || (all && went_back (w));
    if (next)
      waiting.next_round.push_back (w);
    return next;
  });
  return false;
}

const WaitingBuffer *
Recordings::find_different_time (const WaitingBuffers &waiting)
{
  const auto waits_long = [] (const WaitingBuffer &w, GstClockTimeDiff time) {
    return time > GstClockTimeDiff (kMaxLater) && !w.stream->different_time_reported;
  };
  if (waiting.list.size () == 2)
    for (const WaitingBuffer &w : waiting.list)
      if (waits_long (w, w.stream->ahead))
        return &w;
  for (const WaitingBuffer &w : waiting.next_round) {
    const GstClockTime reached = w.capture - w.stream->ahead; /* by the others */
    if (waits_long (w, GST_CLOCK_DIFF (w.stream->round.newest, reached)))
      return &w;
  }
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
    if (!stream->held && gst_aggregator_pad_is_eos (stream->pad))
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
running_time_after (const FrameTimes &last, const FrameTimes &next, double speed)
{
  if (!GST_CLOCK_TIME_IS_VALID (last.running))
    return next.running;
  const bool follows = GST_CLOCK_TIME_IS_VALID (last.capture) && next.capture > last.capture &&
                       next.capture - last.capture <= Recordings::kMaxLater;
  const GstClockTime distance = follows ? next.capture - last.capture : last.period;
  const GstClockTime running = last.running + GstClockTime (double (distance) / speed);
  return follows || !GST_CLOCK_TIME_IS_VALID (next.running) ? running
                                                            : std::max (running, next.running);
}
