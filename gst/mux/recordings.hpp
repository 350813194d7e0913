/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <span>
#include <vector>

#include "streams.hpp"
#include "waitingbuffers.hpp"

/** Times of a frame set, ns; capture and running time may be GST_CLOCK_TIME_NONE. */
struct FrameTimes {
  GstClockTime capture = GST_CLOCK_TIME_NONE;
  GstClockTime running = GST_CLOCK_TIME_NONE;
  GstClockTime period = 0; ///< from one frame set to the next
};

/** Compares the capture times of recordings, in pipelines that are not live: there each stream that
 *  has not ended has a buffer at its pad, and PTS may begin anywhere. Streaming thread. */
class Recordings {
public:
  /** A recording may begin, or continue after a pause, so much later than most; the others continue
   *  without it until then. Greater differences are another clock or another occasion, ns. */
  static constexpr GstClockTime kMaxLater = 60 * GST_SECOND;
  /** A buffer whose capture time and running time both went back by no more than this may have been
   *  reordered, ns. */
  static constexpr GstClockTime kMaxReordered = 250 * GST_MSECOND;
  /** If most capture times go back by more than this, all recordings have begun again, ns. */
  static constexpr GstClockTime kMaxBack = 2 * GST_SECOND;

  /** Sets `in_sync`, `ahead` and `round` of each stream. Between two streams there is no majority:
   *  the earlier one continues alone, and the other one waits. The buffers of recordings that have
   *  begun again become waiting.next_round, until all recordings have. Those of which this is
   *  `round.unsure` are to be held.
   *  @param last_capture  of the last frame set, or GST_CLOCK_TIME_NONE
   *  @return whether all of them have begun again: the buffers are the first ones of a round */
  bool compare (WaitingBuffers &waiting, GstClockTime last_capture);

  /** A stream that waits for more than kMaxLater and was not yet reported, or nullptr: of two
   *  streams the one that is ahead, or one that waits for the next round. After compare(). */
  static const WaitingBuffer *find_different_time (const WaitingBuffers &waiting);
  /** A stream that has ended without being matched with another one and was not yet reported, or
   *  nullptr. Once all others are reported, the last one need not be. */
  static MuxStream *find_unmatched (const MuxStreams &streams);

private:
  GstClockTime vote (std::span<const WaitingBuffer> waiting, GstClockTime last_capture);

  std::vector<GstClockTime> captures_; /* kept for its memory */
};

/** Playback speed: how much faster than its capture times proceed a buffer is played; > 0. */
double speed_of (const WaitingBuffer &w);

/** The running time of a frame set of recordings: as far from that of the last one as their capture
 *  times are. If these go back, or forward by more than Recordings::kMaxLater, it is the buffer's
 *  own running time, or one frame period after the last one if that is later.
 *  @param next    of its oldest buffer
 *  @param speed   playback speed, see speed_of(); > 0 */
GstClockTime running_time_after (const FrameTimes &last, const FrameTimes &next, double speed);
