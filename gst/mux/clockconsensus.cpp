/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "clockconsensus.hpp"

#include <algorithm>
#include <compare>
#include <cstdlib>

GstClockTimeDiff
MuxSteps::offset_of (GstClockTime capture, GstClockTime arrival)
{
  constexpr GstClockTimeDiff kMax = G_MAXINT64 / 4;
  const GstClockTimeDiff offset = GstClockTimeDiff (std::min<GstClockTime> (capture, G_MAXINT64)) -
                                  GstClockTimeDiff (std::min<GstClockTime> (arrival, G_MAXINT64));
  return std::clamp (offset, -kMax, kMax);
}

static bool
together (GstClockTimeDiff a, GstClockTimeDiff b)
{
  return std::llabs (a - b) <= MuxSteps::kOutOfStep;
}

static bool
is_pipelines_clock (GstClockTimeDiff offset)
{
  return offset >= -MuxSteps::kOutOfStep && offset <= MuxSteps::kFuture;
}

/* Of two candidates the greater one wins. */
struct MuxSteps::Rank {
  std::ptrdiff_t streams = 0;
  bool pipelines = false, before = false;
  auto operator<=> (const Rank &) const = default;
};

GstClockTimeDiff
MuxSteps::most_frequent (std::span<const Stream> streams) const
{
  Rank best;
  GstClockTimeDiff winner = 0;
  for (const Stream &candidate : streams) {
    const Rank rank = {std::ranges::count_if (streams,
                           [&] (const Stream &s) { return together (s.offset, candidate.offset); }),
        is_pipelines_clock (candidate.offset), known_ && together (candidate.offset, reference_)};
    if (rank > best) {
      best = rank;
      winner = candidate.offset;
    }
  }
  return winner;
}

bool
MuxSteps::judge (std::span<Stream> streams)
{
  if (streams.empty ())
    return false;
  const auto [least, most] = std::ranges::minmax_element (streams, {}, &Stream::offset);
  const bool all = together (least->offset, most->offset);
  const GstClockTimeDiff centre = all ? least->offset : most_frequent (streams);
  members_.clear ();
  for (const Stream &s : streams)
    if (all || together (s.offset, centre))
      members_.push_back (s.offset);
  const auto middle = members_.begin () + std::ptrdiff_t (members_.size () / 2);
  std::ranges::nth_element (members_, middle);
  const bool moved = known_ && !together (*middle, reference_);
  reference_ = *middle;
  known_ = true;
  for (Stream &s : streams)
    s.in_step =
        together (s.offset, reference_) && !(is_pipelines_clock (reference_) && s.offset > kFuture);
  return moved;
}
