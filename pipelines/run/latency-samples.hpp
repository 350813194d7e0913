/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

/** Latencies of a run of any length, in bounded memory: all of them up to kMax, then as many,
 *  chosen so that each one of the run is among them with the same probability (J. S. Vitter,
 *  "Random sampling with a reservoir", 1985, algorithm R). Half an hour at 30/s is exact. No
 *  locks. */
class LatencySamples {
public:
  static constexpr std::size_t kMax = 65536;

  LatencySamples () { samples_.reserve (kMax); }

  void add (double value)
  {
    count_++;
    if (samples_.size () < kMax)
      samples_.push_back (value);
    else if (const auto at = std::uniform_int_distribution<std::uint64_t> (0, count_ - 1) (random_);
             at < kMax)
      samples_[at] = value;
  }
  /** Of the whole run. */
  [[nodiscard]] std::uint64_t count () const { return count_; }
  /** @param p  0 to 1. @return 0 if there are none */
  [[nodiscard]] double percentile (double p) const
  {
    if (samples_.empty ())
      return 0;
    std::vector<double> values = samples_;
    const auto k = static_cast<std::ptrdiff_t> (p * double (values.size () - 1));
    std::nth_element (values.begin (), values.begin () + k, values.end ());
    return values[std::size_t (k)];
  }

private:
  std::vector<double> samples_;
  std::uint64_t count_ = 0;
  std::minstd_rand random_;
};
