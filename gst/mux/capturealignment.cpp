/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "capturealignment.hpp"

#include <algorithm>
#include <cstdlib>
#include <utility>

namespace {

/* A lag that differs by more than this from before is that of another sender or clock. */
constexpr gint64 kOtherClock = 500 * GST_MSECOND;
/* Less than this is followed without a step. Viewers notice sound that is 45 ms early or 125 ms
 * late (ITU-R BT.1359, detectability). */
constexpr gint64 kStep = 10 * GST_MSECOND;
constexpr GstClockTime kSilence = 5 * GST_SECOND;
/* Shares of a difference by which a lag, and the common lag, follow it with each buffer. */
constexpr gint64 kLagShare = 16, kCommonShare = 64;

} // namespace

void
CaptureAlignment::remove (const Stream *stream)
{
  std::erase (streams_, stream);
}

/* A stream that has been silent for long may come back from another host, and holds nobody up. */
bool
CaptureAlignment::counts (const Stream &stream, GstClockTime running_time) const
{
  return stream.lag && stream.last + kSilence >= running_time;
}

gint64
CaptureAlignment::spread (GstClockTime running_time) const
{
  gint64 quickest = G_MAXINT64, slowest = G_MININT64;
  for (const Stream *stream : streams_)
    if (counts (*stream, running_time)) {
      quickest = std::min (quickest, *stream->lag);
      slowest = std::max (slowest, *stream->lag);
    }
  return slowest > quickest ? slowest - quickest : 0;
}

CaptureAlignment::Relation
CaptureAlignment::place (Stream &stream, GstClockTime running_time, GstClockTime capture_time,
    GstClockTime max_delay, bool &stepped)
{
  const gint64 lag = GST_CLOCK_DIFF (capture_time, running_time);
  if (stream.lag && std::abs (lag - *stream.lag) <= kOtherClock)
    *stream.lag += (lag - *stream.lag) / kLagShare;
  else
    stream.lag = lag;

  stream.last = running_time;
  if (guint64 (spread (running_time)) > max_delay) {
    common_.reset ();
    stepped = stream.delay != 0;
    steps_ += stepped;
    stream.delay = 0;
    return Relation::kApart;
  }
  gint64 slowest = *stream.lag;
  for (const Stream *other : streams_)
    if (counts (*other, running_time))
      slowest = std::max (slowest, *other->lag);
  if (!common_ || std::abs (slowest - *common_) > kStep) {
    common_ = slowest;
    steps_++;
  } else {
    *common_ += (slowest - *common_) / kCommonShare;
  }
  stepped = std::exchange (stream.steps, steps_) != steps_;
  stream.delay = *common_ - lag;
  return Relation::kTogether;
}
