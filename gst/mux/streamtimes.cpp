/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "streamtimes.hpp"

#include <algorithm>
#include <cstdlib>
#include <gstrange/gstrangemeta.h>
#include <gstrange/gstrangepairing.hpp>

using Head = MatchStream::Head;

/* Live: capture times that differ by more from the pipeline clock, less the transmission delay, are
 * of another clock. They may be ahead of it by kMaxAhead. */
static constexpr GstClockTimeDiff kMaxClockDifference = 2 * GST_SECOND,
                                  kMaxAhead = 100 * GST_MSECOND;
/* Not live: a longer pause is not one of the output. */
static constexpr GstClockTime kMaxPause = 60 * GST_SECOND;
/* Capture times from the network may be any number: sums of this one do not overflow. */
static constexpr GstClockTime kMaxCapture = G_MAXINT64 / 4;

/* Gaps have running times only; with the last buffer's difference they become capture times. */
void
StreamTimes::peek (const MuxStreams &streams, bool live, GstClockTime base, GstClockTime tolerance)
{
  live_ = live;
  const MuxStream *timed = nullptr;
  for (const auto &stream : streams) {
    stream->peek (tolerance);
    if (stream->head != Head::kFrame)
      continue;
    stream->time =
        std::min (gstrange::capture_time_of (stream->pad, stream->buffer, live), kMaxCapture);
    if (!GST_CLOCK_TIME_IS_VALID (stream->running))
      continue;
    stream->shift = GST_CLOCK_DIFF (stream->running, stream->time);
    stream->shift_known = true;
    timed = stream.get ();
  }
  const GstClockTimeDiff usual = timed ? timed->shift : live ? GstClockTimeDiff (base) : 0;
  for (const auto &stream : streams) {
    if (stream->head != Head::kGap || !GST_CLOCK_TIME_IS_VALID (stream->running))
      continue;
    const GstClockTimeDiff shift = stream->shift_known ? stream->shift : usual;
    for (GstClockTime *time : {&stream->time, &stream->end})
      *time = GstClockTime (
          std::max<GstClockTimeDiff> (0, GstClockTimeDiff (std::min (*time, kMaxCapture)) + shift));
  }
}

/* A stream is silent if it has no buffer and its last one is much older than the oldest buffer that
 * waits, so that a stream whose times jump silences no other. */
bool
StreamTimes::find_silent (const MuxStreams &streams)
{
  oldest_ = GST_CLOCK_TIME_NONE; /* the greatest number there is */
  for (const auto &stream : streams)
    if (GST_CLOCK_TIME_IS_VALID (stream->running)) {
      stream->seen = stream->running;
      oldest_ = std::min (oldest_, stream->running);
    }
  if (!GST_CLOCK_TIME_IS_VALID (oldest_))
    return false;
  bool changed = false;
  for (const auto &stream : streams) {
    if (!GST_CLOCK_TIME_IS_VALID (stream->seen))
      stream->seen = oldest_; /* it has not begun yet */
    const bool alive =
        stream->buffer || oldest_ <= stream->seen || oldest_ - stream->seen <= kSilentAfter;
    changed |= alive != stream->alive;
    stream->alive = alive;
  }
  return changed;
}

void
StreamTimes::compare_clocks (const MuxStreams &streams, GstClockTime base)
{
  const auto is_near = [] (GstClockTimeDiff a, GstClockTimeDiff b) {
    return std::llabs (a - b) <= kMaxClockDifference;
  };
  const auto follows_pipeline = [] (GstClockTimeDiff offset) {
    return offset >= -kMaxClockDifference && offset <= kMaxAhead;
  };
  const MuxStream *first = nullptr;
  bool pipeline = false, same = false;
  for (const auto &stream : streams) {
    if (!stream->chosen || !stream->alive || !stream->shift_known)
      continue;
    stream->offset = stream->shift - GstClockTimeDiff (base);
    first = first ? first : stream.get ();
    pipeline |= follows_pipeline (stream->offset);
    same |= is_near (stream->offset, clock_offset_);
  }
  if (!first)
    return;
  const GstClockTimeDiff reference = pipeline ? 0 : same ? clock_offset_ : first->offset.load ();
  if (!is_near (reference, clock_offset_))
    last_.capture = GST_CLOCK_TIME_NONE; /* a time of the other clock */
  clock_offset_ = reference;
  for (const auto &stream : streams)
    stream->in_sync =
        pipeline ? follows_pipeline (stream->offset) : is_near (stream->offset, reference);
}

void
StreamTimes::find_late (const MuxStreams &streams, GstClockTime tolerance)
{
  const auto goes_back = [this] (const auto &stream) {
    return stream->head == Head::kEnded ||
           (stream->head == Head::kFrame && stream->time <= last_.capture);
  };
  if (!live_ && std::ranges::all_of (streams, goes_back))
    last_.capture = GST_CLOCK_TIME_NONE;
  for (const auto &stream : streams)
    stream->late = stream->head == Head::kFrame && GST_CLOCK_TIME_IS_VALID (last_.capture) &&
                   stream->time <= last_.capture + tolerance;
}

GstClockTimeDiff
StreamTimes::ahead (const MuxStream &stream) const
{
  if (live_)
    return stream.offset - clock_offset_;
  const bool known =
      GST_CLOCK_TIME_IS_VALID (stream.time) && GST_CLOCK_TIME_IS_VALID (last_.capture);
  return known ? GST_CLOCK_DIFF (last_.capture, stream.time) : 0;
}

/* A frame set of recordings is as far from the last one as their capture times are; if these go
 * back, or leap, it has the buffer's own running time, or follows after one period if that is
 * later. */
GstClockTime
StreamTimes::add_frame_set (const FrameTimes &times, GstClockTime period)
{
  const FrameTimes before = last_;
  last_ = times;
  GstClockTime &running = last_.running;
  if (!GST_CLOCK_TIME_IS_VALID (before.running))
    return running;
  if (live_)
    return running = std::max (running, before.running); /* never backwards; NONE is the maximum */
  const bool follows = GST_CLOCK_TIME_IS_VALID (before.capture) && times.capture > before.capture &&
                       times.capture - before.capture <= kMaxPause;
  const GstClockTime distance = follows ? times.capture - before.capture : period;
  const GstClockTime next = before.running + distance;
  running = follows || !GST_CLOCK_TIME_IS_VALID (running) ? next : std::max (next, running);
  return running;
}
