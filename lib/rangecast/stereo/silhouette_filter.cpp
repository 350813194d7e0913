/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Uses OpenCV's vectors for saturating 8 and 16-bit arithmetic, because Lanes (base/simd.hpp) have
 * 32-bit elements. */
#include "silhouette_filter.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>
#include <numeric>
#include <opencv2/core/hal/intrin.hpp>

#include "../base/simd.hpp"

namespace rangecast {
namespace {

/* Maximum colour difference (sum over R, G, B) of similar pixels. */
constexpr int kLike = 60;
/* Required sum of weights, each at most kLike: four pixels of nearly the same colour. */
constexpr int kEnough = 160;
/* A window has kLanes x kLanes samples of every second pixel, so its radius is kRadius pixels. */
constexpr int kLanes = 8, kRadius = kLanes;
/* Samples beside the image, so that windows stay inside. */
constexpr int kPad = kRadius / 2 + 1;
/* kSurfaceStep in 1/65536. */
constexpr int kShare = int (65536 * kSurfaceStep);

/* Minimum or maximum of each window of `side` x `side` pixels.
 * @param[out] to  smaller by side - 1; @param memory  scratch */
template <typename Choose>
void
choose_in_windows (const Plane &from, int side, Plane &memory, Plane &to, const Choose &choose)
{
  const int width = from.width (), height = from.height (), cols = width - side + 1,
            rows = height - side + 1;
  memory.set_size (width, height);
  std::copy_n (from.row (0), std::ptrdiff_t (width) * height, memory.row (0));
  to.set_size (cols, rows);
  int reach = 1; /* rows, then columns, that each value covers */
  for (; 2 * reach <= side; reach *= 2)
    for (int y = 0; y + reach < height; y++) {
      std::int16_t *row = memory.row (y);
      const std::int16_t *below = memory.row (y + reach);
      for (int x = 0; x < width; x++)
        row[x] = choose (row[x], below[x]);
    }
  for (int y = 0; y < rows; y++) {
    std::int16_t *row = memory.row (y), *out = to.row (y);
    const std::int16_t *below = memory.row (y + side - reach);
    for (int x = 0; x < width; x++)
      row[x] = choose (row[x], below[x]);
    for (int right = 1; 2 * right <= side; right *= 2)
      for (int x = 0; x + right < width; x++)
        row[x] = choose (row[x], row[x + right]);
    for (int x = 0; x < cols; x++)
      out[x] = choose (row[x], row[x + side - reach]);
  }
}

/* Copies a part of an image with `around` pixels on each side; the border is repeated. */
void
cut (const cv::Mat &picture, const cv::Rect &tile, int around, Plane &to)
{
  to.set_size (tile.width + 2 * around, tile.height + 2 * around);
  const int first = tile.x - around, begin = std::max (0, -first),
            end = std::min (to.width (), picture.cols - first);
  for (int y = 0; y < to.height (); y++) {
    const auto from =
        picture.ptr<std::int16_t> (std::clamp (tile.y - around + y, 0, picture.rows - 1));
    std::int16_t *row = to.row (y);
    std::fill (row, row + begin, from[0]);
    std::copy (from + first + begin, from + first + end, row + begin);
    std::fill (row + end, row + to.width (), from[picture.cols - 1]);
  }
}

/* By how much the disparity changes over `distance` pixels across and down, together, where it does
 * so evenly to both sides: a slanted surface has no steps. */
int
slant_at (const cv::Mat &disparity, int x, int y, int distance, int min)
{
  const auto slope = [own = disparity.at<std::int16_t> (y, x), min] (int before, int after) {
    const bool is_even =
        std::min (before, after) >= min && std::abs (before + after - 2 * own) <= 16;
    return is_even ? std::abs (after - before) / 2 : 0;
  };
  const auto at = [&, whole = cv::Rect ({}, disparity.size ())] (const cv::Point &p) {
    return whole.contains (p) ? int (disparity.at<std::int16_t> (p)) : min - 16;
  };
  return slope (at ({x - distance, y}), at ({x + distance, y})) +
         slope (at ({x, y - distance}), at ({x, y + distance}));
}

/* Splits every second pixel of a row into planes, from column x0 of theirs on. */
void
take_every_second (
    const std::uint32_t *__restrict pixels, int n, std::uint8_t *const (&planes)[4], int x0)
{
  constexpr int kAtOnce = 64;
  for (int begin = 0; begin < n; begin += kAtOnce) {
    const int end = std::min (kAtOnce, n - begin);
    std::uint32_t chosen[kAtOnce];
    for (int i = 0; i < end; i++)
      chosen[i] = pixels[2 * (begin + i)];
    for (int c = 0; c < 3; c++) {
      std::uint8_t *__restrict to = planes[c] + x0 + begin;
      for (int i = 0; i < end; i++)
        to[i] = std::uint8_t (chosen[i] >> 8 * c);
    }
  }
}

} // namespace

void
SilhouetteFilter::sample (
    const Settings &settings, const cv::Mat &colour, const cv::Mat &disparity, int n_threads)
{
  const bool sample_colour = !settings.only_beyond;
  const int cols = (disparity.cols + 1) / 2, rows = (disparity.rows + 1) / 2;
  samples_.set_size (cols + 2 * kPad + kLanes, rows + 2 * kPad);
  const auto width = std::size_t (samples_.width ());
  for (std::vector<std::uint8_t> &plane : colours_)
    if (const std::size_t n = width * std::size_t (samples_.height ()); plane.size () < n)
      plane.resize (n);
  constexpr int kRows = 32;
  in_parallel (
      std::size_t ((samples_.height () + kRows - 1) / kRows), n_threads, [&] (std::size_t i) {
        const int begin = int (i) * kRows, end = std::min (begin + kRows, samples_.height ());
        for (int v = begin; v < end; v++) {
          std::uint8_t *to[4];
          for (int c = 0; c < 4; c++)
            to[c] = colours_[c].data () + std::size_t (v) * width;
          if (sample_colour)
            std::fill_n (to[3], width, std::uint8_t{255});
          std::int16_t *depth = samples_.row (v);
          std::fill_n (depth, width, std::int16_t{0});
          const int y = 2 * (v - kPad);
          if (y < 0 || y >= disparity.rows)
            continue;
          const auto from = colour.ptr<std::uint32_t> (y);
          const auto d = disparity.ptr<std::int16_t> (y);
          if (sample_colour)
            std::fill_n (to[3] + kPad, cols, std::uint8_t{0});
          for_this_cpu ([&] {
            if (sample_colour)
              take_every_second (from, cols, to, kPad);
            for (int x = 0; x < cols; x++)
              depth[kPad + x] = d[2 * x];
          });
        }
      });
}

/* Calls `count (weight, disparity)` for eight samples of a window at a time, of two rows together.
 */
template <typename Count>
void
SilhouetteFilter::for_window (const cv::Vec4b &own, int x, int y, const Count &count) const
{
  const cv::v_uint8x16 r = cv::v_setall_u8 (own[0]), g = cv::v_setall_u8 (own[1]),
                       b = cv::v_setall_u8 (own[2]), max = cv::v_setall_u8 (kLike);
  const int x0 = x / 2 - kRadius / 2 + kPad, y0 = y / 2 - kRadius / 2 + kPad;
  const std::ptrdiff_t width = samples_.width ();
  for (int v = 0; v < kRadius; v += 2) {
    const std::ptrdiff_t at = (y0 + v) * width + x0;
    const auto load = [&] (int c) {
      const std::uint8_t *from = colours_[c].data () + at;
      return cv::v_load_halves (from, from + width);
    };
    /* Saturates at 255, which exceeds kLike. */
    const cv::v_uint8x16 unlike = cv::v_absdiff (load (0), r) + cv::v_absdiff (load (1), g) +
                                  cv::v_absdiff (load (2), b) + load (3);
    cv::v_uint16x8 upper, lower;
    cv::v_expand (max - unlike, upper, lower);
    const std::int16_t *depth = samples_.row (y0 + v) + x0;
    count (cv::v_reinterpret_as_s16 (upper), cv::v_load (depth));
    count (cv::v_reinterpret_as_s16 (lower), cv::v_load (depth + width));
  }
}

template <bool kCountNone>
SilhouetteFilter::Votes
SilhouetteFilter::vote (
    const Settings &settings, const cv::Vec4b &own, int x, int y, int d, int max) const
{
  const cv::v_int16x8 valid = cv::v_setall_s16 (static_cast<short> (settings.min)),
                      low = cv::v_max (
                          valid, cv::v_setall_s16 (static_cast<short> (
                                     settings.only_beyond ? settings.nearest : d - max))),
                      high = cv::v_setall_s16 (static_cast<short> (std::min (d + max, 32767)));
  cv::v_int16x8 all = cv::v_setzero_s16 (), none = all, below = all, above = all;
  for_window (own, x, y, [&] (const cv::v_int16x8 &w, const cv::v_int16x8 &depth) {
    all = all + w;
    if constexpr (kCountNone)
      none = none + (w & (depth < valid));
    below = below + (w & (depth < low));
    above = above + (w & (depth > high));
  });
  Votes votes;
  votes.near = cv::v_reduce_sum (above);
  votes.none = cv::v_reduce_sum (none);
  const int farther = cv::v_reduce_sum (below);
  votes.far = farther - votes.none;
  votes.same = cv::v_reduce_sum (all) - farther - votes.near;
  return votes;
}

/* Mean disparity of the similar samples around a pixel, or `min` - 1. */
int
SilhouetteFilter::likely (const Settings &settings, const cv::Vec4b &own, int x, int y) const
{
  const cv::v_int16x8 valid = cv::v_setall_s16 (static_cast<short> (settings.min)),
                      one = cv::v_setall_s16 (1);
  cv::v_int32x4 sum = cv::v_setzero_s32 (), weights = sum;
  for_window (own, x, y, [&] (const cv::v_int16x8 &w, const cv::v_int16x8 &depth) {
    const cv::v_int16x8 counting = w & (depth >= valid);
    sum = sum + cv::v_dotprod (counting, depth);
    weights = weights + cv::v_dotprod (counting, one);
  });
  const int total = cv::v_reduce_sum (weights);
  if (total < kEnough)
    return settings.min - 1;
  std::array<int, 4> sums; /* all four together may exceed an int */
  cv::v_store (sums.data (), sum);
  return int (std::accumulate (sums.begin (), sums.end (), std::int64_t{0}) / total);
}

/* Marks pixels of a row that may change: at a step to farther pixels, or without disparity near
 * pixels of interest.
 * @param lowest, highest  within reach */
void
SilhouetteFilter::mark_row (const Settings &settings, const std::int16_t *__restrict disparity,
    const std::int16_t *__restrict lowest, const std::int16_t *__restrict highest, int n,
    std::uint8_t *__restrict marks)
{
  const int offset = settings.offset, min = settings.min, nearest = settings.nearest,
            limit = std::max (min, nearest), look_near = settings.only_beyond ? min : INT16_MAX;
  for (int x = 0; x < n; x++) {
    const int d = disparity[x], tolerance = std::max (16, (d + offset) * kShare >> 16);
    const bool inside = (d < nearest) | (lowest[x] >= d - tolerance) | (lowest[x] > look_near);
    marks[x] = (highest[x] >= limit) & ((d < min) | !inside);
  }
}

void
SilhouetteFilter::apply_to (const Settings &settings, const cv::Mat &colour, const cv::Rect &tile,
    const cv::Mat &disparity, Memory &m, cv::Mat &to) const
{
  const int reach = kRadius * 2 / 3, min = settings.min;
  const auto none = static_cast<std::int16_t> (min - 16);
  const auto smaller = [] (std::int16_t a, std::int16_t b) { return std::min (a, b); };
  const auto greater = [] (std::int16_t a, std::int16_t b) { return std::max (a, b); };
  cut (disparity, tile, reach, m.around);
  choose_in_windows (m.around, 2 * reach + 1, m.line, m.lowest, smaller);
  choose_in_windows (m.around, 2 * reach + 1, m.line, m.highest, greater);
  m.marks.resize (std::size_t (tile.width));
  for (int y = 0; y < tile.height; y++) {
    const int at_y = tile.y + y;
    const auto pixels = colour.ptr<cv::Vec4b> (at_y) + tile.x;
    const auto from = disparity.ptr<std::int16_t> (at_y) + tile.x;
    auto out = to.ptr<std::int16_t> (at_y) + tile.x;
    std::copy_n (from, tile.width, out);
    mark_row (settings, from, m.lowest.row (y), m.highest.row (y), tile.width, m.marks.data ());
    const std::uint8_t *mark = m.marks.data (), *end = mark + tile.width;
    while (const void *found = std::memchr (mark, 1, std::size_t (end - mark))) {
      mark = static_cast<const std::uint8_t *> (found);
      const int x = int (mark++ - m.marks.data ()), at_x = tile.x + x;
      const bool valid = from[x] >= min;
      const cv::Vec4b &own = pixels[x];
      const int d = valid ? from[x] : likely (settings, own, at_x, at_y);
      if (d < std::max (min, settings.nearest))
        continue;
      const int slant = valid ? slant_at (disparity, at_x, at_y, kRadius / 2, min) : 0,
                max = std::max (16, (d + settings.offset) * kShare >> 16) + slant,
                lowest = m.lowest.row (y)[x];
      if (valid && !settings.only_beyond && lowest >= std::max (min, d - max))
        continue;
      const Votes votes = valid && !settings.only_beyond
                              ? vote<false> (settings, own, at_x, at_y, d, max)
                              : vote<true> (settings, own, at_x, at_y, d, max);

      if (valid && votes.far > votes.same)
        out[x] = none;
      else if (!valid && votes.same > 4 * (votes.near + votes.far) && votes.same > votes.none)
        out[x] = static_cast<std::int16_t> (d);
    }
  }
}

void
SilhouetteFilter::apply (const Settings &settings, const cv::Mat &colour, const Tiles &tiles,
    const cv::Mat &disparity, cv::Mat &to)
{
  sample (settings, colour, disparity, tiles.n_threads ());
  memory_.reserve (tiles.workers ());
  tiles.each ([&] (const cv::Rect &tile, std::size_t worker) {
    apply_to (settings, colour, tile, disparity, memory_.of (worker), to);
  });
}

} // namespace rangecast
