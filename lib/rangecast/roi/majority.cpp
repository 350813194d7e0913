/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "majority.hpp"

#include <algorithm>

#include "../base/simd.hpp"

namespace rangecast {
namespace {

template <int kRadius>
void
find_rows (const cv::Mat &mask, std::vector<std::uint8_t> &counts, cv::Mat &to)
{
  constexpr int kSide = 2 * kRadius + 1;
  const int n = mask.cols;
  counts.resize (std::size_t (n + 2 * kRadius));
  std::uint8_t *__restrict sums = counts.data () + kRadius;
  for (int y = 0; y < mask.rows; y++) {
    const std::uint8_t *rows[kSide];
    for (int k = 0; k < kSide; k++)
      rows[k] = mask.ptr (std::clamp (y + k - kRadius, 0, mask.rows - 1));
    for (int x = 0; x < n; x++) {
      std::uint8_t sum = 0; /* minus the number of pixels */
      for (int k = 0; k < kSide; k++)
        sum = std::uint8_t (sum + rows[k][x]);
      sums[x] = std::uint8_t (-sum);
    }
    for (int k = 1; k <= kRadius; k++) {
      sums[-k] = sums[0];
      sums[n - 1 + k] = sums[n - 1];
    }
    std::uint8_t *__restrict out = to.ptr (y);
    for (int x = 0; x < n; x++) {
      std::uint8_t sum = 0;
      for (int k = -kRadius; k <= kRadius; k++)
        sum = std::uint8_t (sum + sums[x + k]);
      out[x] = sum > kSide * kSide / 2 ? 255 : 0;
    }
  }
}

} // namespace

void
Majority::find (const cv::Mat &mask, int radius, cv::Mat &to)
{
  to.create (mask.size (), CV_8U);
  for_this_cpu ([&] {
    if (radius == 1)
      find_rows<1> (mask, counts_, to);
    else
      find_rows<2> (mask, counts_, to);
  });
}

} // namespace rangecast
