/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace rangecast {

/** First and last bin of interest. */
struct HistogramRange {
  int low = 0, high = 0;
};

/** The range of bins without the lowest and highest 0.5 % of all counts.
 *  @param histogram  counts >= 0, at least one bin
 *  @return all bins if the histogram is empty */
inline HistogramRange
without_half_a_per_cent (std::span<const int> histogram)
{
  std::int64_t total = 0;
  for (int n : histogram)
    total += n;
  const auto last = static_cast<int> (histogram.size ()) - 1;
  HistogramRange range = {0, last};
  if (total == 0)
    return range;
  const auto at = [&] (int bin) -> std::int64_t {
    return histogram[static_cast<std::size_t> (bin)];
  };
  for (std::int64_t n = at (0); n * 200 < total && range.low < last; n += at (range.low))
    range.low++;
  for (std::int64_t n = at (last); n * 200 < total && range.high > 0; n += at (range.high))
    range.high--;
  return range;
}

} // namespace rangecast
