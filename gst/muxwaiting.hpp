/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <algorithm>
#include <gstrange/gstrangepairing.hpp>
#include <vector>

#include "muxstreams.hpp"

/* A pad with the buffer that waits on it. */
struct Waiting {
  MuxPad *entry;
  GstBuffer *buffer; /* a reference of ours */
  GstClockTime capture, running;
};

/* All buffers that wait, from take() to release(). Keeps its memory from one frame set to the next.
 */
class WaitingBuffers {
public:
  WaitingBuffers () = default;
  ~WaitingBuffers () { release (); }
  WaitingBuffers (const WaitingBuffers &) = delete;

  void take (const MuxPads &pads, bool live)
  {
    release ();
    for (const auto &entry : pads) {
      GstBuffer *buffer = gst_aggregator_pad_peek_buffer (entry->pad);
      if (buffer)
        (gstrange::is_gap (buffer) ? gaps : list)
            .push_back ({entry.get (), buffer, capture_time (entry->pad, buffer, live),
                gstrange::running_time_of (entry->pad, buffer)});
      else if (!gst_aggregator_pad_is_eos (entry->pad))
        missing++;
      else
        ended++;
    }
  }
  void release ()
  {
    for (auto *waiting : {&list, &gaps}) {
      for (const Waiting &w : *waiting)
        gst_buffer_unref (w.buffer);
      waiting->clear ();
    }
    missing = ended = 0;
  }

  std::vector<Waiting> list, gaps;
  int missing = 0, ended = 0;

private:
  /* A stranger's may be any number; sums of this one and a few seconds do not overflow. */
  static GstClockTime capture_time (GstAggregatorPad *pad, GstBuffer *buffer, bool live)
  {
    return std::min<GstClockTime> (gstrange::capture_time_of (pad, buffer, live), G_MAXINT64);
  }
};
