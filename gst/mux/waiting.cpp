/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "waiting.hpp"

#include <algorithm>
#include <cmath>
#include <gstrange/gstrangemeta.h>
#include <gstrange/gstrangepairing.hpp>

/* A stranger's may be any number; sums of this one and a few seconds do not overflow. */
static GstClockTime
capture_time (GstAggregatorPad *pad, GstBuffer *buffer, bool live)
{
  return std::min<GstClockTime> (gstrange::capture_time_of (pad, buffer, live), G_MAXINT64);
}

void
WaitingBuffers::take (const MuxPads &pads, bool live)
{
  release ();
  for (const auto &entry : pads) {
    GstBuffer *buffer = gst_aggregator_pad_peek_buffer (entry->pad);
    if (!buffer) {
      (gst_aggregator_pad_is_eos (entry->pad) ? ended : missing)++;
      continue;
    }
    const Waiting w = {entry.get (), buffer, capture_time (entry->pad, buffer, live),
        gstrange::running_time_of (entry->pad, buffer)};
    const bool gap = gstrange::is_gap (buffer);
    (gap ? gaps : list).push_back (w);
    if (!gap && GST_CLOCK_TIME_IS_VALID (w.running)) {
      entry->shift = GST_CLOCK_DIFF (w.running, w.capture);
      entry->shift_known = true;
    }
  }
}

void
WaitingBuffers::release ()
{
  for (auto *waiting : {&list, &gaps}) {
    for (const Waiting &w : *waiting)
      gst_buffer_unref (w.buffer);
    waiting->clear ();
  }
  missing = ended = 0;
}

/* Not live, running times of two streams cannot be compared; capture times of a gap are as far from
 * the pad's last buffer as running times are. */
bool
WaitingBuffers::drop_past_gaps (bool live, GstClockTime tolerance, bool timeout) const
{
  if (list.empty () && missing > 0 && !timeout)
    return false;
  GstClockTime running = GST_CLOCK_TIME_NONE, capture = GST_CLOCK_TIME_NONE;
  for (const Waiting &w : list) {
    running = std::min (running, w.running);
    capture = std::min (capture, w.capture);
  }
  bool any = false;
  for (const Waiting &gap : gaps) {
    const GstClockTime end = gstrange::gap_end (gap.running, gap.buffer, tolerance);
    const bool by_capture = !live && gap.entry->shift_known && GST_CLOCK_TIME_IS_VALID (end);
    const bool past = by_capture ? GST_CLOCK_DIFF (end, capture) > gap.entry->shift : running > end;
    if (!list.empty () && !past)
      continue;
    gst_aggregator_pad_drop_buffer (gap.entry->pad);
    any = true;
  }
  return any;
}

double
speed_of (const Waiting &w)
{
  GST_OBJECT_LOCK (w.entry->pad);
  const double rate = std::abs (w.entry->pad->segment.rate);
  GST_OBJECT_UNLOCK (w.entry->pad);
  /* A buffer that does not tell when it was captured has its running time instead. */
  const bool told =
      rate == 1 || GST_CLOCK_TIME_IS_VALID (gst_range_buffer_get_capture_time (w.buffer));
  return told ? rate : 1;
}
