/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "waitingbuffers.hpp"

#include <algorithm>
#include <gstrange/gstrangepairing.hpp>

/* Capture times from the network may be any number; sums of this one and a few seconds do not
 * overflow. */
static GstClockTime
capture_time_of (GstAggregatorPad *pad, GstBuffer *buffer, bool live)
{
  return std::min<GstClockTime> (gstrange::capture_time_of (pad, buffer, live), G_MAXINT64);
}

/* @param next  at the pad, or nullptr; taken */
void
WaitingBuffers::add_held (MuxStream &stream, GstBuffer *next, bool live)
{
  WaitingBuffer w = {
      &stream, gst_buffer_ref (stream.held), stream.held_capture, stream.held_running};
  if (next && !gstrange::is_gap (next))
    w.next_capture = capture_time_of (stream.pad, next, live);
  else if (!next && !live && !gst_aggregator_pad_is_eos (stream.pad))
    missing++;
  gst_clear_buffer (&next);
  list.push_back (w);
}

void
WaitingBuffers::collect (const MuxStreams &streams, bool live)
{
  release ();
  for (const auto &stream : streams) {
    GstAggregatorPad *pad = stream->pad;
    GstBuffer *buffer = gst_aggregator_pad_peek_buffer (pad);
    if (stream->held) {
      add_held (*stream, buffer, live);
      continue;
    }
    if (!buffer) {
      (gst_aggregator_pad_is_eos (pad) ? ended : missing)++;
      continue;
    }
    const GstClockTime capture = capture_time_of (pad, buffer, live);
    const GstClockTime running = gstrange::running_time_of (pad, buffer);
    const bool gap = gstrange::is_gap (buffer);
    (gap ? gaps : list).push_back ({stream.get (), buffer, capture, running});
    if (!gap && GST_CLOCK_TIME_IS_VALID (running)) {
      stream->shift = GST_CLOCK_DIFF (running, capture);
      stream->shift_known = true;
    }
  }
}

void
WaitingBuffers::release ()
{
  for (auto *buffers : {&list, &gaps, &next_round}) {
    for (const WaitingBuffer &w : *buffers)
      gst_buffer_unref (w.buffer);
    buffers->clear ();
  }
  missing = ended = 0;
}
