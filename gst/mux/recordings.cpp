/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "recordings.hpp"

#include <algorithm>

#include "clockconsensus.hpp"
#include "waiting.hpp"

bool
MuxRecordings::judge (std::span<const Waiting> waiting, GstClockTime last_capture)
{
  if (waiting.empty ())
    return false;
  captures_.clear ();
  for (const Waiting &w : waiting)
    captures_.push_back (w.capture);
  const auto middle = captures_.begin () + std::ptrdiff_t (captures_.size () / 2);
  std::ranges::nth_element (captures_, middle);
  const bool can_vote = captures_.size () >= 3;
  const GstClockTime others = can_vote ? *middle : std::ranges::min (captures_);
  for (const Waiting &w : waiting) {
    w.entry->ahead = GST_CLOCK_DIFF (others, w.capture);
    w.entry->in_step = !can_vote || GstClockTime (ABS (w.entry->ahead)) <= kOtherRecording;
  }
  return GST_CLOCK_TIME_IS_VALID (last_capture) && *middle + MuxSteps::kOutOfStep < last_capture;
}

const Waiting *
MuxRecordings::find_apart (std::span<const Waiting> waiting)
{
  if (waiting.size () == 2)
    for (const Waiting &w : waiting)
      if (w.entry->ahead > GstClockTimeDiff (kOtherRecording))
        return &w;
  return nullptr;
}

MuxPad *
MuxRecordings::find_stranger (const MuxPads &pads)
{
  int streams = 0, told = 0, untold = 0;
  MuxPad *ended = nullptr;
  for (const auto &entry : pads) {
    streams += entry->received > 0;
    if (entry->received == 0 || entry->met)
      continue;
    if (entry->told_apart || entry->said != MuxState::kIn) {
      told++;
      continue;
    }
    untold++;
    if (gst_aggregator_pad_is_eos (entry->pad))
      ended = entry.get ();
  }
  const bool all_others_told = told > 0 && untold == 1;
  return streams > 1 && !all_others_told ? ended : nullptr;
}

GstClockTime
running_time_after (
    const FrameTimes &last, const FrameTimes &next, double speed, GstClockTime period)
{
  if (!GST_CLOCK_TIME_IS_VALID (last.running))
    return next.running;
  const bool follows = GST_CLOCK_TIME_IS_VALID (last.capture) && next.capture > last.capture &&
                       next.capture - last.capture <= MuxRecordings::kOtherRecording;
  const GstClockTime distance = follows ? next.capture - last.capture : period;
  const GstClockTime running = last.running + GstClockTime (double (distance) / speed);
  return follows || !GST_CLOCK_TIME_IS_VALID (next.running) ? running
                                                            : std::max (running, next.running);
}
