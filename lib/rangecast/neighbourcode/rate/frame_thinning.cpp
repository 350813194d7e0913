/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "frame_thinning.hpp"

#include <algorithm>
#include <cmath>

namespace rangecast {
namespace {

/* Seconds for which a rate must be too low, or sufficient for more, before n changes. */
constexpr double kShort = 0.25, kEnough = 2;
/* Cost over rate from which the rate is too low, and rate over cost from which n may fall. */
constexpr double kTooMuch = 1.03, kReserve = 1.2;
constexpr int kMax = 1000;
/* Number of intervals to measure, and seconds from which one is a pause. */
constexpr int kMeasured = 32;
constexpr double kPause = 2;

} // namespace

void
FrameThinning::measure (const ThinningInput &in, double elapsed_s)
{
  if (nominal_ns_ != in.interval_ns) {
    nominal_ns_ = interval_ns_ = in.interval_ns;
    measured_ = 0, measured_s_ = 0;
  }
  if (elapsed_s <= 0 || elapsed_s > kPause)
    return;
  measured_s_ += elapsed_s;
  if (++measured_ < kMeasured)
    return;
  const double mean_s = measured_s_ / measured_;
  measured_ = 0, measured_s_ = 0;
  const double slower = mean_s / (1e-9 * static_cast<double> (nominal_ns_)), faster = 1 / slower;
  interval_ns_ = slower >= 1 ? nominal_ns_ * static_cast<std::uint64_t> (std::round (slower))
                             : nominal_ns_ / static_cast<std::uint64_t> (std::round (faster));
}

void
FrameThinning::adjust (const ThinningInput &in, double elapsed_s)
{
  const double fps = 1e9 / static_cast<double> (interval_ns_);
  const int max =
      in.min_fps > 0 ? static_cast<int> (std::clamp (fps / in.min_fps, 1.0, double (kMax))) : kMax;
  const double share = in.bits_per_s > 0 ? in.min_bits * fps / in.bits_per_s : 0;
  const auto one_of = [&] (double x) {
    return static_cast<int> (std::ceil (std::clamp (x, 1.0, double (max))));
  };
  short_s_ = share > kTooMuch * one_of_ ? short_s_ + elapsed_s : 0;
  enough_s_ = one_of (kReserve * share) < one_of_ ? enough_s_ + elapsed_s : 0;
  if (short_s_ > kShort || one_of_ > max)
    one_of_ = one_of (share);
  else if (enough_s_ > kEnough)
    one_of_ = one_of (kReserve * share);
  else
    return;
  short_s_ = enough_s_ = 0;
}

bool
FrameThinning::keep (const ThinningInput &in)
{
  if (in.interval_ns == 0)
    return true;
  const double elapsed =
      has_time_ ? 1e-9 * static_cast<double> (static_cast<std::int64_t> (in.time_ns - time_ns_))
                : 0;
  has_time_ = true;
  time_ns_ = in.time_ns;
  measure (in, elapsed);
  const int before = one_of_;
  adjust (in, std::clamp (elapsed, 0.0, 1.0));
  const std::uint64_t number = (in.time_ns + interval_ns_ / 2) / interval_ns_;
  const std::uint64_t slot = number / static_cast<std::uint64_t> (one_of_);
  const bool keeps = one_of_ == 1 || one_of_ != before || slot != kept_;
  kept_ = slot;
  return keeps;
}

} // namespace rangecast
