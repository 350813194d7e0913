/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "clockconsensus.hpp"

#include <algorithm>
#include <compare>
#include <cstdlib>

namespace {

bool
together (GstClockTimeDiff a, GstClockTimeDiff b)
{
  return std::llabs (a - b) <= ClockConsensus::kMaxDifference;
}

bool
is_pipeline_clock (GstClockTimeDiff offset)
{
  return offset >= -ClockConsensus::kMaxDifference && offset <= ClockConsensus::kMaxAhead;
}

} // namespace

GstClockTimeDiff
ClockConsensus::offset_of (GstClockTime capture, GstClockTime arrival)
{
  constexpr GstClockTimeDiff kMax = G_MAXINT64 / 4;
  const GstClockTimeDiff offset = GstClockTimeDiff (std::min<GstClockTime> (capture, G_MAXINT64)) -
                                  GstClockTimeDiff (std::min<GstClockTime> (arrival, G_MAXINT64));
  return std::clamp (offset, -kMax, kMax);
}

/* The candidate of the highest rank wins. */
struct ClockConsensus::Rank {
  std::ptrdiff_t streams = 0;
  bool is_pipeline_clock = false, won_before = false;
  auto operator<=> (const Rank &) const = default;
};

GstClockTimeDiff
ClockConsensus::most_frequent (std::span<const Stream> streams) const
{
  Rank best;
  GstClockTimeDiff winner = 0;
  for (const Stream &candidate : streams) {
    const Rank rank = {std::ranges::count_if (streams,
                           [&] (const Stream &s) { return together (s.offset, candidate.offset); }),
        is_pipeline_clock (candidate.offset), known_ && together (candidate.offset, reference_)};
    if (rank > best) {
      best = rank;
      winner = candidate.offset;
    }
  }
  return winner;
}

bool
ClockConsensus::update (std::span<Stream> streams)
{
  if (streams.empty ())
    return false;
  const auto [min, max] = std::ranges::minmax_element (streams, {}, &Stream::offset);
  const bool all = together (min->offset, max->offset);
  const GstClockTimeDiff centre = all ? min->offset : most_frequent (streams);
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
    s.in_sync = together (s.offset, reference_) &&
                !(is_pipeline_clock (reference_) && s.offset > kMaxAhead);
  return moved;
}
