/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "frame_associator.hpp"

#include <cstdlib>

namespace rangecast {

void
FrameAssociator::start (std::int64_t period_ns)
{
  *this = {};
  period_ns_ = period_ns;
}

void
FrameAssociator::leader (std::uint64_t number, std::int64_t taken_ns)
{
  leaders_[count_++ % kLeaders] = {number, taken_ns};
}

const FrameAssociator::Leader *
FrameAssociator::nearest (std::int64_t taken_ns) const
{
  const Leader *best = nullptr;
  for (std::int64_t i = count_ - 1; i >= 0 && i >= count_ - kLeaders; i--) {
    const Leader &one = leaders_[i % kLeaders];
    if (!best || std::llabs (one.taken_ns - taken_ns) < std::llabs (best->taken_ns - taken_ns))
      best = &one;
  }
  return best;
}

const FrameAssociator::Leader *
FrameAssociator::numbered (std::uint64_t number) const
{
  for (std::int64_t i = count_ - 1; i >= 0 && i >= count_ - kLeaders; i--)
    if (leaders_[i % kLeaders].number == number - static_cast<std::uint64_t> (difference_))
      return &leaders_[i % kLeaders];
  return nullptr;
}

std::optional<std::int64_t>
FrameAssociator::place (std::uint64_t number, std::optional<std::int64_t> taken_ns, bool stamped)
{
  const Leader *by_time = taken_ns ? nearest (*taken_ns) : nullptr;
  const bool near = by_time && std::llabs (by_time->taken_ns - *taken_ns) < period_ns_ / 4;
  const auto difference = near ? static_cast<std::int64_t> (number - by_time->number) : 0;
  if (!learnt ()) {
    if (near) { /* a different one begins again */
      agreed_ = agreed_ > 0 && difference == difference_ ? agreed_ + 1 : 1;
      difference_ = difference;
    }
    return taken_ns;
  }
  const Leader *by_number = numbered (number);
  if (near && difference == difference_) {
    contradictions_ = 0;
    return taken_ns;
  }
  if (near) {
    contradictions_ = difference == contradiction_ ? contradictions_ + 1 : 1;
    contradiction_ = difference;
    if (contradictions_ >= kContradictions) { /* it missed signals, or its counter restarted */
      difference_ = difference;
      contradictions_ = 0;
      return taken_ns;
    }
    if (stamped)
      return taken_ns;
  }
  /* the leading camera's frame may not have arrived yet */
  return by_number ? std::optional (by_number->taken_ns) : taken_ns;
}

} // namespace rangecast
