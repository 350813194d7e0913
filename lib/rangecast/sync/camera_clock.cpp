/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "camera_clock.hpp"

#include <algorithm>
#include <cmath>

namespace rangecast {

std::int64_t
CameraClock::host_time (std::int64_t camera_ns, std::int64_t arrival_ns)
{
  if (camera_ns <= 0)
    return arrival_ns;
  constexpr std::int64_t kJump_ns = 1'000'000'000; /* more is not jitter: the clock was set */
  const std::int64_t delay = arrival_ns - camera_ns;
  const auto min = [this] { return *std::min_element (min_.begin (), min_.begin () + windows_); };
  if (windows_ == 0 || camera_ns < last_camera_ns_ || std::abs (delay - min ()) > kJump_ns) {
    min_.fill (delay);
    windows_ = 1;
    current_ = in_window_ = 0;
  }
  last_camera_ns_ = camera_ns;
  if (++in_window_ > kWindowFrames) {
    in_window_ = 1;
    current_ = (current_ + 1) % kWindows;
    windows_ = std::max (windows_, current_ + 1);
    min_[current_] = delay;
  }
  min_[current_] = std::min (min_[current_], delay);
  return camera_ns + min ();
}

std::int64_t
RecentValues::quantile (double share) const
{
  if (count_ == 0)
    return 0;
  std::array<std::int64_t, kMax> sorted = values_;
  const auto n = static_cast<std::ptrdiff_t> (std::min<std::uint64_t> (count_, kMax));
  const auto rank = static_cast<std::ptrdiff_t> (std::ceil (share * static_cast<double> (n))) - 1;
  const auto at = sorted.begin () + std::clamp<std::ptrdiff_t> (rank, 0, n - 1);
  std::nth_element (sorted.begin (), at, sorted.begin () + n);
  return *at;
}

} // namespace rangecast
