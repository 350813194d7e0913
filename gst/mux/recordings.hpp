/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <span>
#include <vector>

#include "streams.hpp"

struct Waiting;

/** Of a frame set, ns; either may be GST_CLOCK_TIME_NONE. */
struct FrameTimes {
  GstClockTime capture = GST_CLOCK_TIME_NONE;
  GstClockTime running = GST_CLOCK_TIME_NONE;
};

/** Compares the capture times of recordings: of pipelines that are not live, where every stream
 *  that has not ended has a buffer that waits, and PTS may begin anywhere. Streaming thread. */
class MuxRecordings {
public:
  /** A recording may begin or pause so much later than most: it waits, and the others go without
   *  it. What is further away has another clock, or was taken on another occasion; ns. */
  static constexpr GstClockTime kOtherRecording = 60 * GST_SECOND;

  /** Sets `in_step` and `ahead` of each. Of two that are apart nobody knows which one is wrong: the
   *  earlier one goes alone, the other one waits.
   *  @return whether all of them have begun again */
  bool judge (std::span<const Waiting> waiting, GstClockTime last_capture);

  /** Of two that wait, the one that waits for more than kOtherRecording; nullptr: none. After
   *  judge(). */
  static const Waiting *find_apart (std::span<const Waiting> waiting);
  /** A stream that has ended and never met another, and was not told yet. Of those that did not
   *  meet each other the last one need not be. */
  static MuxPad *find_stranger (const MuxPads &pads);

private:
  std::vector<GstClockTime> captures_; /* kept for its memory */
};

/** The running time of a frame set of recordings: as far from that of the last one as their capture
 *  times are. Where those go back, or on by more than kOtherRecording, it is that of the stream
 *  itself, if later, or else one frame period on.
 *  @param next    what its oldest buffer says
 *  @param speed   how much faster than it was captured it is played, > 0
 *  @param period  ns */
GstClockTime running_time_after (
    const FrameTimes &last, const FrameTimes &next, double speed, GstClockTime period);
