/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* How unlike two pixels are, for SemiGlobalMatcher: its file alone includes this one. */
#pragma once

#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "../base/simd.hpp"

namespace rangecast {
namespace {

constexpr int kSide = 32; /* of a tile, pixels */

/* The neighbours of the descriptor: every second one of 7 x 5 in a chessboard pattern. */
constexpr int kRadiusX = 3, kRadiusY = 2, kNeighbours = 16;
/* Clipping of differences to neighbours, grey levels. */
constexpr int kMaxDifference = 7;
/* Clipping of the difference of both pixels, grey levels, and its weight. */
constexpr int kMaxGrey = 15, kGreyWeight = 2;
constexpr int kCostShift = 2;
constexpr int kMaxCost = (kNeighbours * 2 * kMaxDifference + kGreyWeight * kMaxGrey) >> kCostShift;
static_assert (kMaxCost << kCostShift < 256);

template <typename T>
constexpr T
lesser (const T &a, const T &b)
{
  return a < b ? a : b;
}

template <typename T>
constexpr T
greater (const T &a, const T &b)
{
  return a > b ? a : b;
}

/* The same for vectors. Types of template arguments lose their alignment, hence not of B. */
template <typename Lanes>
inline typename Lanes::B
min_of (const typename Lanes::B &a, const typename Lanes::B &b)
{
  return a < b ? a : b;
}

template <typename Lanes>
inline typename Lanes::B
max_of (const typename Lanes::B &a, const typename Lanes::B &b)
{
  return a > b ? a : b;
}

/* a - b, at least 0. */
template <typename Lanes>
inline typename Lanes::B
subtract_down_to_0 (const typename Lanes::B &a, const typename Lanes::B &b)
{
  return a - min_of<Lanes> (a, b);
}

/* Computes the differences of a row's pixels to one neighbour, offset to start at 0, and adds them
 * up. @param n  a multiple of kSide, as below */
void
compare_with (const std::uint8_t *__restrict other, const std::uint8_t *__restrict own, int n,
    std::uint8_t *__restrict differences, std::uint8_t *__restrict sums)
{
  constexpr std::uint8_t kMaxShift = kMaxDifference;
  for (int begin = 0; begin < n; begin += kSide)
    for (int x = begin; x < begin + kSide; x++) {
      const std::uint8_t high = greater (other[x], own[x]);
      const auto above = std::uint8_t (high - own[x]), below = std::uint8_t (high - other[x]);
      differences[x] =
          std::uint8_t (kMaxShift + lesser (above, kMaxShift) - lesser (below, kMaxShift));
      sums[x] = std::uint8_t (sums[x] + differences[x]);
    }
}

/* Describes columns x0 to x1 of a row, which are multiples of kSide.
 * @param[out] planes  by neighbour and column, and a plane of their sums */
void
transform_row (const cv::Mat &padded, int y, int x0, int x1, std::vector<std::uint8_t> &planes)
{
  const int width = padded.cols - 2 * kRadiusX, n = x1 - x0;
  planes.resize (std::size_t (kNeighbours + 1) * std::size_t (width));
  const std::uint8_t *own = padded.ptr<std::uint8_t> (y + kRadiusY) + kRadiusX + x0;
  std::uint8_t *plane = planes.data () + x0, *sums = plane + std::ptrdiff_t (kNeighbours) * width;
  std::fill_n (sums, n, std::uint8_t{0});
  for (int v = -kRadiusY; v <= kRadiusY; v++)
    for (int u = -kRadiusX; u <= kRadiusX; u++) {
      if ((u + v) % 2 != 0 || (u == 0 && v == 0))
        continue;
      compare_with (
          padded.ptr<std::uint8_t> (y + kRadiusY + v) + kRadiusX + x0 + u, own, n, plane, sums);
      plane += width;
    }
}

/* Minimum and maximum grey level from half a pixel to the left to half a pixel to the right. */
void
range_of_row (const std::uint8_t *__restrict grey, int n, std::uint8_t *__restrict low,
    std::uint8_t *__restrict high)
{
  const auto mean = [] (std::uint8_t a, std::uint8_t b) {
    return std::uint8_t ((a & b) + std::uint8_t ((a ^ b) >> 1));
  };
  for (int begin = 0; begin < n; begin += kSide)
    for (int x = begin; x < begin + kSide; x++) {
      const std::uint8_t own = grey[x], left = mean (grey[x - 1], own),
                         right = mean (grey[x + 1], own);
      low[x] = lesser (lesser (left, right), own);
      high[x] = greater (greater (left, right), own);
    }
}

/* One row of a picture, described for matching. */
struct RowView {
  const std::uint8_t *planes; /* see transform_row() */
  int stride;
  const std::uint8_t *low, *high; /* of the right picture: see range_of_row() */
};

/* Adds up the greater of both descriptors' elements, for half of the neighbours and all
 * disparities. Adding up |a - b| is adding up 2 max (a, b) - a - b. */
template <typename Lanes, bool kFirst>
inline void
add_greater (const std::uint8_t *left, int left_stride, const std::uint8_t *right, int right_stride,
    int count, std::uint8_t *sums)
{
  using B = typename Lanes::B;
  constexpr int kHalf = kNeighbours / 2;
  B own[kHalf];
#pragma GCC unroll 8
  for (int k = 0; k < kHalf; k++)
    own[k] = Lanes::at (left + k * left_stride);
  for (int d = 0; d < count; d++, sums += kSide) {
    B sum = kFirst ? B{} : Lanes::at (sums);
#pragma GCC unroll 8
    for (int k = 0; k < kHalf; k++)
      sum += max_of<Lanes> (own[k], Lanes::at (right + k * right_stride - d));
    Lanes::at (sums) = sum;
  }
}

/* The costs of a row of a tile.
 * @param x      its first column; @param grey  of the left row from there on
 * @param right  the right row
 * @param[out] costs  by disparity and column */
template <typename Lanes>
inline void
compare (const RowView &left, const std::uint8_t *grey, int x, const RowView &right, int low,
    int count, std::uint8_t *costs)
{
  using B = typename Lanes::B;
  constexpr int kHalf = kNeighbours / 2;
  for (int part = 0; part < kSide; part += int (sizeof (B))) {
    const int from = x + part, to = from - low;
    const std::uint8_t *l = left.planes + from, *r = right.planes + to;
    add_greater<Lanes, true> (l, left.stride, r, right.stride, count, costs + part);
    add_greater<Lanes, false> (l + kHalf * left.stride, left.stride, r + kHalf * right.stride,
        right.stride, count, costs + part);
    const B own = Lanes::at (grey + part), sum = Lanes::at (l + kNeighbours * left.stride),
            most = B{} + std::uint8_t (kMaxGrey);
    const std::uint8_t *sums = r + kNeighbours * right.stride;
    for (int d = 0; d < count; d++) {
      const B high = Lanes::at (right.high + to - d), above = max_of<Lanes> (own, high) - high,
              below = max_of<Lanes> (own, Lanes::at (right.low + to - d)) - own,
              differs = min_of<Lanes> (max_of<Lanes> (above, below), most);
      static_assert (kGreyWeight == 2);
      B &cost = Lanes::at (costs + part + d * kSide);
      const B all = (cost + differs) * 2 - sum - Lanes::at (sums - d);
      cost = all >> kCostShift;
    }
  }
}

} // namespace
} // namespace rangecast
