/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "waitingbuffers.hpp"

#include <algorithm>
#include <gstrange/gstrangepairing.hpp>

void
WaitingBuffers::collect (const MuxStreams &streams, bool live)
{
  release ();
  for (const auto &stream : streams) {
    GstAggregatorPad *pad = stream->pad;
    GstBuffer *buffer = gst_aggregator_pad_peek_buffer (pad);
    if (!buffer) {
      (gst_aggregator_pad_is_eos (pad) ? ended : missing)++;
      continue;
    }
    /* Capture times from the network may be any number; sums of this one and a few seconds do not
     * overflow. */
    const GstClockTime capture =
        std::min<GstClockTime> (gstrange::capture_time_of (pad, buffer, live), G_MAXINT64);
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
