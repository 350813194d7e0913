/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "semi_global_matcher.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <utility>

#include "../base/simd.hpp"

namespace rangecast {
namespace {

/* The neighbours of the descriptor: every second one of 7 x 5 in a chessboard pattern. */
constexpr int kRadiusX = 3, kRadiusY = 2, kNeighbours = 16;
/* Clipping of differences to neighbours, grey levels. */
constexpr int kMaxDifference = 7;
/* Clipping of the difference of both pixels, grey levels, and its weight. */
constexpr int kMaxGrey = 15, kGreyWeight = 2;
constexpr int kCostShift = 2;
constexpr int kMaxCost = (kNeighbours * 2 * kMaxDifference + kGreyWeight * kMaxGrey) >> kCostShift;
static_assert (kMaxCost << kCostShift < 256);

/* Penalties for a change of disparity along a path by one pixel, and by more; the latter decreases
 * with the grey level step, because surfaces end at edges. */
constexpr int kStep = 10, kJump = 60, kMinJump = 15, kEdge = 8;
/* Greater than any cost along a path. */
constexpr std::uint8_t kNever = 200;
static_assert (kMaxCost + kJump < kNever && kNever + kStep < 256);

constexpr int kPad = 16;                    /* padding around the costs of a pixel, bytes */
constexpr int kRows = 16, kColumns = 32;    /* per job */
constexpr int kOverlap = 16;                /* rows in which paths converge */
constexpr std::size_t kMaxCells = 24 << 20; /* maximum number in memory, of three bytes each */
constexpr int kMaxKnown = 128;              /* disparities */
constexpr std::int16_t kAmbiguous = INT16_MIN;

constexpr auto kJumps = [] {
  std::array<std::uint8_t, 256> jumps{};
  for (int step = 0; step < 256; step++)
    jumps[std::size_t (step)] = std::uint8_t (std::max (kMinJump, kJump * kEdge / (kEdge + step)));
  return jumps;
}();

template <typename T>
constexpr T
lesser (T a, T b)
{
  return a < b ? a : b;
}

template <typename T>
constexpr T
greater (T a, T b)
{
  return a > b ? a : b;
}

/* Computes the differences of a row's pixels to one neighbour, offset to start at 0, and adds them
 * up. */
void
compare_with (const std::uint8_t *__restrict other, const std::uint8_t *__restrict own, int n,
    std::uint8_t *__restrict differences, std::uint8_t *__restrict sums)
{
  for (int x = 0; x < n; x++) {
    const int by = lesser (greater (other[x] - own[x], -kMaxDifference), kMaxDifference);
    differences[x] = std::uint8_t (by + kMaxDifference);
    sums[x] = std::uint8_t (sums[x] + by + kMaxDifference);
  }
}

/* @param way  -1: the image is reversed
 * @param[out] planes  by neighbour and column, and a plane of their sums */
void
transform_row (const cv::Mat &padded, int y, int way, std::vector<std::uint8_t> &planes)
{
  const int width = padded.cols - 2 * kRadiusX;
  planes.assign (std::size_t (kNeighbours + 1) * std::size_t (width), 0);
  const std::uint8_t *own = padded.ptr<std::uint8_t> (y + kRadiusY) + kRadiusX;
  std::uint8_t *plane = planes.data (), *sums = plane + std::ptrdiff_t (kNeighbours) * width;
  for (int v = -kRadiusY; v <= kRadiusY; v++)
    for (int u = -kRadiusX; u <= kRadiusX; u++) {
      if ((u + v) % 2 != 0 || (u == 0 && v == 0))
        continue;
      compare_with (padded.ptr<std::uint8_t> (y + kRadiusY + v) + kRadiusX + way * u, own, width,
          plane, sums);
      plane += width;
    }
}

/* Minimum and maximum grey level from half a pixel to the left to half a pixel to the right. */
void
range_of_row (const std::uint8_t *__restrict grey, int n, std::uint8_t *__restrict low,
    std::uint8_t *__restrict high)
{
  for (int x = 0; x < n; x++) {
    const int left = (grey[x - 1] + grey[x]) / 2, right = (grey[x + 1] + grey[x]) / 2,
              own = grey[x];
    low[x] = std::uint8_t (lesser (lesser (left, right), own));
    high[x] = std::uint8_t (greater (greater (left, right), own));
  }
}

/* The cost of each disparity of a pixel.
 * @param left       differences to the neighbours and their sum; `own`: the grey level
 * @param right      the same for right pixels in order of disparity, by neighbour
 * @param low, high  range_of_row() of the right pixels */
template <int kCount>
inline void
compare (const std::uint8_t *__restrict left, std::uint8_t own,
    const std::uint8_t *__restrict right, int stride, const std::uint8_t *__restrict low,
    const std::uint8_t *__restrict high, int disparities, std::uint8_t *__restrict cost)
{
  const int n = kCount > 0 ? kCount : disparities;
  for (int d = 0; d < n; d++) {
    const auto above = std::uint8_t (greater (own, high[d]) - high[d]),
               below = std::uint8_t (greater (own, low[d]) - own);
    auto sum =
        std::uint8_t (kGreyWeight * lesser (greater (above, below), std::uint8_t (kMaxGrey)));
    /* The sum of |a - b| is that of 2 max (a, b) - a - b; overflow cancels. */
    std::uint8_t greatest = 0;
#pragma GCC unroll 16
    for (int k = 0; k < kNeighbours; k++)
      greatest = std::uint8_t (greatest + greater (left[k], right[k * stride + d]));
    sum = std::uint8_t (sum + 2 * greatest - left[kNeighbours] - right[kNeighbours * stride + d]);
    cost[d] = std::uint8_t (sum >> kCostShift);
  }
}

/* One step of a path: costs of the disparities of a pixel, given those of the previous pixel.
 * @param before, now  padded by kPad bytes on both sides
 * @param lowest  minimum of `before`. @return the minimum of `now` */
template <int kCount>
inline std::uint8_t
step (const std::uint8_t *__restrict cost, const std::uint8_t *__restrict before,
    std::uint8_t lowest, std::uint8_t jump, int disparities, std::uint8_t *__restrict now)
{
  const int n = kCount > 0 ? kCount : disparities;
  const auto far = std::uint8_t (lowest + jump);
  std::uint8_t min = 255;
  for (int d = 0; d < n; d++) {
    const auto beside = std::uint8_t (lesser (before[d - 1], before[d + 1]) + kStep);
    const auto value = std::uint8_t (cost[d] + lesser (lesser (before[d], far), beside) - lowest);
    now[d] = value;
    min = lesser (min, value);
  }
  return min;
}

} // namespace

std::size_t
SemiGlobalMatcher::at (const Stripe &stripe, int x, int y) const
{
  return (std::size_t (y - stripe.y0) * std::size_t (stripe.columns) + std::size_t (x)) *
         std::size_t (disparities_);
}

/* Costs of all disparities of a row. */
template <int kCount>
void
SemiGlobalMatcher::compare_row (const Stripe &stripe, int y, Memory &m)
{
  const int n = kCount > 0 ? kCount : disparities_, width = stripe.left.cols;
  transform_row (padded_[0], y, 1, m.transformed[0]);
  transform_row (padded_[1], y, -1, m.transformed[1]);
  m.low.resize (std::size_t (width));
  m.high.resize (std::size_t (width));
  range_of_row (
      padded_[1].ptr<std::uint8_t> (y + kRadiusY) + kRadiusX, width, m.low.data (), m.high.data ());
  const std::uint8_t *left = m.transformed[0].data () + stripe.x0,
                     *grey = stripe.left.ptr<std::uint8_t> (y) + stripe.x0;
  std::uint8_t *costs = &costs_[at (stripe, 0, y)];
  for (int x = 0; x < stripe.columns; x++) {
    /* In the reversed row. */
    const int first = width - 1 - (stripe.x0 + x - stripe.min_disparity);
    const std::uint8_t *right = m.transformed[1].data () + first, *low = m.low.data () + first,
                       *high = m.high.data () + first;
    const std::uint8_t own = grey[x];
    std::uint8_t of_left[kNeighbours + 1];
    for (int k = 0; k <= kNeighbours; k++)
      of_left[k] = left[k * width + x];
    compare<kCount> (of_left, own, right, width, low, high, n, costs + std::ptrdiff_t (x) * n);
  }
}

/* Both paths along a row. */
template <int kCount>
void
SemiGlobalMatcher::walk_row (const Stripe &stripe, int y, Memory &m)
{
  const int n = kCount > 0 ? kCount : disparities_;
  const std::uint8_t *grey = stripe.left.ptr<std::uint8_t> (y) + stripe.x0;
  compare_row<kCount> (stripe, y, m);
  const std::uint8_t *costs = &costs_[at (stripe, 0, y)];
  std::uint8_t *sums = &across_[at (stripe, 0, y)];
  for (const int way : {1, -1}) {
    m.paths.assign (2 * std::size_t (n + 2 * kPad), kNever);
    std::uint8_t *before = m.paths.data () + kPad, *now = before + n + 2 * kPad, lowest = 0;
    const int first = way > 0 ? 0 : stripe.columns - 1;
    std::fill_n (before, n, std::uint8_t{0});
    for (int i = 0, x = first; i < stripe.columns; i++, x += way) {
      const int edge = std::abs (grey[x] - grey[i > 0 ? x - way : x]);
      lowest = step<kCount> (
          costs + std::ptrdiff_t (x) * n, before, lowest, kJumps[std::size_t (edge)], n, now);
      std::uint8_t *__restrict sum = sums + std::ptrdiff_t (x) * n;
      const std::uint8_t *__restrict path = now;
      if (way > 0)
        std::copy_n (path, n, sum);
      else
        for (int d = 0; d < n; d++)
          sum[d] = std::uint8_t (sum[d] + lesser (path[d], std::uint8_t (255 - sum[d])));
      std::swap (before, now);
    }
  }
}

/* Whether no cost but those next to the best one is nearly as good. */
template <int kCount>
bool
SemiGlobalMatcher::is_unique (const std::uint16_t *sums, int best, int disparities) const
{
  const int n = kCount > 0 ? kCount : disparities, share = 100 - settings_.uniqueness_ratio;
  const auto like = std::uint16_t (share > 0 ? (100 * sums[best] + share - 1) / share : UINT16_MAX);
  std::uint16_t rivals = 0;
  for (int d = 0; d < n; d++)
    rivals = std::uint16_t (rivals + (sums[d] < like ? 1 : 0));
  for (int d = std::max (best - 1, 0); d <= std::min (best + 1, n - 1); d++)
    rivals -= sums[d] < like;
  return rivals == 0;
}

/* The disparity of a pixel with the lowest cost, with subpixel precision by a parabola through it
 * and its neighbours; none if another one is nearly as good.
 * @param up  costs along the path from below */
template <int kCount>
SemiGlobalMatcher::Match
SemiGlobalMatcher::choose (
    const Stripe &stripe, std::size_t cell, const std::uint8_t *__restrict up, Memory &m) const
{
  const int n = kCount > 0 ? kCount : disparities_;
  std::uint16_t *__restrict sums = m.sums.data ();
  const std::uint8_t *__restrict across = &across_[cell], *__restrict down = &down_[cell];
  std::uint16_t min_cost = UINT16_MAX;
  for (int d = 0; d < n; d++) {
    sums[d] = std::uint16_t (across[d] + down[d] + up[d]);
    min_cost = lesser (min_cost, sums[d]);
  }
  auto place = std::uint16_t (n);
  for (int d = 0; d < n; d++)
    place = lesser (place, sums[d] == min_cost ? std::uint16_t (d) : std::uint16_t (n));
  const int best = place;
  Match match = {kAmbiguous, std::int16_t (best + stripe.min_disparity), min_cost};
  if (settings_.uniqueness_ratio > 0 && !is_unique<kCount> (sums, best, disparities_))
    return match;
  match.disparity = std::int16_t (16 * match.whole);
  if (best > 0 && best < n - 1) {
    const int nearer = sums[best + 1], farther = sums[best - 1];
    const int bend = greater (nearer + farther - 2 * min_cost, 1);
    match.disparity =
        std::int16_t (match.disparity + ((farther - nearer) * 16 + bend) / (2 * bend));
  }
  return match;
}

/* Both paths along columns x to end: down, then up with the choice of disparities. */
template <int kCount>
void
SemiGlobalMatcher::walk_columns (const Stripe &stripe, int x, int end, Memory &m)
{
  const int n = kCount > 0 ? kCount : disparities_, width = end - x;
  const std::ptrdiff_t each = n + 2 * kPad;
  m.sums.resize (std::size_t (n));
  for (const int way : {1, -1}) {
    m.paths.assign (2 * std::size_t (width) * std::size_t (each), kNever);
    m.lowest.assign (std::size_t (width), 0);
    std::uint8_t *before = m.paths.data () + kPad, *now = before + width * each;
    for (int k = 0; k < width; k++)
      std::fill_n (before + k * each, n, std::uint8_t{0});
    const int first = way > 0 ? stripe.y0 : stripe.y0 + stripe.rows - 1;
    for (int i = 0, y = first; i < stripe.rows; i++, y += way) {
      const std::uint8_t *grey = stripe.left.ptr<std::uint8_t> (y) + stripe.x0 + x,
                         *last =
                             stripe.left.ptr<std::uint8_t> (i > 0 ? y - way : y) + stripe.x0 + x;
      for (int k = 0; k < width; k++) {
        const std::size_t cell = at (stripe, x + k, y);
        std::uint8_t &lowest = m.lowest[std::size_t (k)];
        lowest = step<kCount> (&costs_[cell], before + k * each, lowest,
            kJumps[std::size_t (std::abs (grey[k] - last[k]))], n,
            way > 0 ? &down_[cell] : now + k * each);
        if (way > 0)
          std::copy_n (&down_[cell], n, now + k * each);
        else
          matches_[cell / std::size_t (n)] = choose<kCount> (stripe, cell, now + k * each, m);
      }
      std::swap (before, now);
    }
  }
}

/* Writes the disparities of a row, without those whose right pixel has a better match. */
void
SemiGlobalMatcher::check_row (const Stripe &stripe, int y, Memory &m, cv::Mat &disparity) const
{
  const int width = stripe.left.cols;
  const auto none = static_cast<std::int16_t> (16 * stripe.min_disparity - 16);
  const Match *matches = &matches_[at (stripe, 0, y) / std::size_t (disparities_)];
  auto out = disparity.ptr<std::int16_t> (y);
  std::fill_n (out, width, none);
  m.right.resize (std::size_t (width));
  m.right_sums.assign (std::size_t (width), UINT16_MAX);
  const auto partner_of = [&] (int x) { return std::size_t (stripe.x0 + x - matches[x].whole); };
  for (int x = 0; x < stripe.columns; x++) {
    const std::size_t there = partner_of (x);
    if (matches[x].sum >= m.right_sums[there])
      continue;
    m.right_sums[there] = matches[x].sum;
    m.right[there] = matches[x].whole;
  }
  const int max_difference = settings_.left_right_max_difference;
  for (int x = 0; x < stripe.columns; x++)
    if (matches[x].disparity != kAmbiguous &&
        (max_difference < 0 ||
            std::abs (m.right[partner_of (x)] - matches[x].whole) <= max_difference))
      out[stripe.x0 + x] = matches[x].disparity;
}

/* @param y, end  rows of the stripe to write */
template <int kCount>
void
SemiGlobalMatcher::match_stripe (
    const Stripe &stripe, int y, int end, int n_threads, cv::Mat &disparity)
{
  /* Calls work (first, last, memory) for parts of n rows or columns in parallel. */
  const auto in_parts = [&] (int n, int each, const auto &work) {
    in_parallel (
        std::size_t ((n + each - 1) / each), n_threads, [&] (std::size_t i, std::size_t worker) {
          const int first = int (i) * each;
          for_this_cpu ([&] { work (first, std::min (first + each, n), memory_.of (worker)); });
        });
  };
  in_parts (stripe.rows, kRows, [&] (int first, int last, Memory &memory) {
    for (int row = first; row < last; row++)
      walk_row<kCount> (stripe, stripe.y0 + row, memory);
  });
  in_parts (stripe.columns, kColumns, [&] (int first, int last, Memory &memory) {
    walk_columns<kCount> (stripe, first, last, memory);
  });
  in_parts (end - y, kRows, [&] (int first, int last, Memory &memory) {
    for (int row = first; row < last; row++)
      check_row (stripe, y + row, memory, disparity);
  });
}

void
SemiGlobalMatcher::match (const cv::Mat &left, const cv::Mat &right, int min_disparity,
    int disparities, int n_threads, cv::Mat &disparity)
{
  disparities_ = disparities;
  disparity.create (left.size (), CV_16S);
  const int x0 = std::max (min_disparity + disparities, 0),
            columns = left.cols + std::min (min_disparity, 0) - x0;
  if (columns <= 0) {
    disparity.setTo (16 * min_disparity - 16);
    return;
  }
  for (int i = 0; i < 2; i++)
    cv::copyMakeBorder (
        i ? right : left, padded_[i], kRadiusY, kRadiusY, kRadiusX, kRadiusX, cv::BORDER_REPLICATE);
  cv::flip (padded_[1], padded_[1], 1);
  const std::size_t cells = std::size_t (columns) * std::size_t (disparities);
  const int rows = std::clamp (int (kMaxCells / cells), 4 * kOverlap, left.rows + 4 * kOverlap);
  memory_.reserve (workers_for (std::size_t (std::max (left.rows, columns)), n_threads));
  for (int y = 0; y < left.rows; y += rows) {
    const int end = std::min (y + rows, left.rows), top = std::max (0, y - kOverlap),
              bottom = std::min (end + kOverlap, left.rows);
    const Stripe stripe = {left, min_disparity, x0, columns, top, bottom - top};
    const std::size_t needed = cells * std::size_t (stripe.rows);
    for (auto *memory : {&costs_, &across_, &down_})
      memory->resize (std::max (memory->size (), needed));
    matches_.resize (std::max (matches_.size (), needed / std::size_t (disparities)));
    /* With a compile-time number of disparities, unless it is too large. */
    const bool known = [&]<int... kTimes> (std::integer_sequence<int, kTimes...>)
    {
      return ((disparities == 16 * (kTimes + 1) &&
                  (match_stripe<16 * (kTimes + 1)> (stripe, y, end, n_threads, disparity), true)) ||
              ...);
    }
    (std::make_integer_sequence<int, kMaxKnown / 16>{});
    if (!known)
      match_stripe<0> (stripe, y, end, n_threads, disparity);
  }
}

} // namespace rangecast
