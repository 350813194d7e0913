/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* clear_flying() uses OpenCV's vectors for saturating 16-bit arithmetic, because Lanes
 * (base/simd.hpp) have 32-bit elements, half as many. */
#include "disparity_filter.hpp"

#include <algorithm>
#include <cstdlib>
#include <opencv2/core/hal/intrin.hpp>

namespace rangecast {
namespace {

/* Radius and area of patches, pixels. */
constexpr int kPatchRadius = 3, kPatchArea = 49;
/* Difference between two images of a patch due to noise and interpolation, grey levels. */
constexpr int kNoise = 4;

/* Grey level at 1/16 pixel positions, interpolated linearly. */
int
grey_at (const std::uint8_t *row, int x16, int width)
{
  const int x = std::clamp (x16 >> 4, 0, width - 1), f = x16 & 15;
  return (row[x] * (16 - f) + row[std::min (x + 1, width - 1)] * f + 8) >> 4;
}

/* Copies a tile with a border of one pixel, and `more` columns for vectors that end beyond it. */
void
copy_with_border (
    const cv::Mat &disparity, const cv::Rect &tile, int more, std::int16_t none, Plane &to)
{
  const cv::Rect all (0, 0, disparity.cols, disparity.rows);
  const cv::Rect there (tile.x - 1, tile.y - 1, tile.width + 2, tile.height + 2);
  const cv::Rect inside = there & all;
  to.set_size (there.width + more, there.height);
  for (int y = 0; y < to.height (); y++) {
    std::int16_t *row = to.row (y);
    std::fill_n (row, to.width (), none);
    if (const int v = there.y + y; v >= 0 && v < all.height)
      std::copy_n (
          disparity.ptr<std::int16_t> (v) + inside.x, inside.width, row + (inside.x - there.x));
  }
}

} // namespace

/* Sums over patches: number of pixels with disparity, signed and absolute difference between both
 * images, and contrast of the left one. */
void
DisparityFilter::compare_patches (const cv::Mat &left, const cv::Mat &right, int right_x, int min,
    const cv::Rect &tile, const cv::Mat &disparity, Memory &m) const
{
  cut_grey (left, tile, 2 * kPatchRadius, m.grey);
  differ_from_mean<kPatchRadius> (m.grey, m.contrast, m.sums, m.columns);
  const int width = m.contrast.width (), height = m.contrast.height ();
  for (Plane *plane : {&m.valid, &m.difference, &m.size})
    plane->set_size (width, height);
  const int x0 = tile.x - kPatchRadius, begin = std::max (0, -x0),
            end = std::min (width, disparity.cols - x0);
  for (int y = 0; y < height; y++) {
    std::int16_t *valid = m.valid.row (y), *difference = m.difference.row (y),
                 *size = m.size.row (y);
    const int row = tile.y - kPatchRadius + y;
    std::fill_n (valid, width, std::int16_t{0});
    std::fill_n (difference, width, std::int16_t{0});
    if (row >= 0 && row < disparity.rows) {
      const auto d = disparity.ptr<std::int16_t> (row) + x0;
      const std::int16_t *l = m.grey.row (y + kPatchRadius) + kPatchRadius;
      look_up (d + begin, end - begin, right.ptr<std::uint8_t> (row), right.cols,
          x0 + begin + right_x, size);
      for (int x = begin; x < end; x++) {
        valid[x] = d[x] >= min;
        difference[x] = std::int16_t (valid[x] ? l[x] - size[x - begin] : 0);
      }
    }
    for (int x = 0; x < width; x++)
      size[x] = std::int16_t (std::abs (difference[x]));
  }
  sum_windows<kPatchRadius> (m.contrast, m.contrasts, m.columns);
  sum_windows<kPatchRadius> (m.valid, m.counts, m.columns);
  sum_windows<kPatchRadius> (m.difference, m.differences, m.columns);
  sum_windows<kPatchRadius> (m.size, m.sizes, m.columns);
}

void
DisparityFilter::clear_unlike (const cv::Mat &left, const cv::Mat &right, int right_x,
    double tolerance, int min, const Tiles &tiles, const cv::Mat &disparity, cv::Mat &to)
{
  const int share = int (256 * tolerance);
  memory_.reserve (tiles.workers ());
  tiles.each ([&] (const cv::Rect &tile, std::size_t worker) {
    Memory &m = memory_.of (worker);
    compare_patches (left, right, right_x, min, tile, disparity, m);
    for (int y = 0; y < tile.height; y++) {
      const std::int16_t *counts = m.counts.row (y), *differences = m.differences.row (y),
                         *sizes = m.sizes.row (y), *contrasts = m.contrasts.row (y);
      const auto from = disparity.ptr<std::int16_t> (tile.y + y) + tile.x;
      auto out = to.ptr<std::int16_t> (tile.y + y) + tile.x;
      for (int x = 0; x < tile.width; x++) {
        const int unlike = kPatchArea * (sizes[x] - std::abs (int (differences[x])) / 2),
                  max = (share * contrasts[x] / 256 + kNoise * kPatchArea) * counts[x];
        out[x] = unlike > max ? std::int16_t (min - 16) : from[x];
      }
    }
  });
}

void
DisparityFilter::clear_hidden (int min, const Tiles &tiles, cv::Mat &disparity)
{
  constexpr int kTolerance = 24; /* 1/16 pixel */
  const auto none = static_cast<std::int16_t> (min - 16);
  memory_.reserve (tiles.workers ());
  tiles.each ([&] (const cv::Rect &tile, std::size_t worker) {
    std::vector<std::int16_t> &nearest = memory_.of (worker).nearest;
    for (int y = tile.y; y < tile.br ().y; y++) {
      auto d = disparity.ptr<std::int16_t> (y) + tile.x;
      int low = 32767, high = min;
      for (int x = 0; x < tile.width; x++) {
        low = std::min<int> (low, d[x] >= min ? d[x] : 32767);
        high = std::max<int> (high, d[x]);
      }
      if (low > high)
        continue;
      const int first = (high + 8) >> 4; /* offset of the first column of the right image */
      nearest.assign (std::size_t (tile.width + first - ((low + 8) >> 4)), none);
      const auto there = [&] (int x) { return std::size_t (x + first - ((d[x] + 8) >> 4)); };
      for (int x = 0; x < tile.width; x++)
        if (d[x] >= min)
          nearest[there (x)] = std::max (nearest[there (x)], d[x]);
      for (int x = 0; x < tile.width; x++)
        if (d[x] >= min && d[x] + kTolerance < nearest[there (x)])
          d[x] = none;
    }
  });
}

void
DisparityFilter::clear_flying (double step, int support, int offset, int min, const Tiles &tiles,
    const cv::Mat &disparity, cv::Mat &to)
{
  const auto share = static_cast<std::uint16_t> (std::min (65535.0, 65536 * step));
  const auto none = static_cast<std::int16_t> (min - 16);
  memory_.reserve (tiles.workers ());
  tiles.each ([&] (const cv::Rect &tile, std::size_t worker) {
    Plane &copy = memory_.of (worker).grey;
    constexpr int kLanes = cv::v_int16x8::nlanes;
    copy_with_border (disparity, tile, kLanes, none, copy);
    const cv::v_int16x8 valid = cv::v_setall_s16 (static_cast<short> (min)),
                        zero = cv::v_setzero_s16 (), nothing = cv::v_setall_s16 (none),
                        shift = cv::v_setall_s16 (static_cast<short> (offset)),
                        /* counts are negative and include the pixel itself */
        enough = cv::v_setall_s16 (static_cast<short> (-support));
    for (int y = 0; y < tile.height; y++) {
      auto out = to.ptr<std::int16_t> (tile.y + y) + tile.x;
      for (int x = 0; x < tile.width; x += kLanes) {
        const cv::v_int16x8 d = cv::v_load (copy.row (y + 1) + x + 1);
        const cv::v_uint16x8 max = cv::v_max (cv::v_setall_u16 (8),
            cv::v_mul_hi (
                cv::v_reinterpret_as_u16 (cv::v_max (d + shift, zero)), cv::v_setall_u16 (share)));
        cv::v_int16x8 n = zero;
        for (int v = y; v < y + 3; v++)
          for (int u = x; u < x + 3; u++) {
            const cv::v_int16x8 other = cv::v_load (copy.row (v) + u);
            n = n + ((other >= valid) & cv::v_reinterpret_as_s16 (cv::v_absdiff (other, d) <= max));
          }
        const cv::v_int16x8 result = cv::v_select (n < enough, d, nothing);
        if (x + kLanes <= tile.width)
          cv::v_store (out + x, result);
        else {
          std::int16_t last[kLanes];
          cv::v_store (last, result);
          std::copy_n (last, tile.width - x, out + x);
        }
      }
    }
  });
}

/* ---- doubles ---- */

void
DisparityFilter::clear_doubled_of_row (const std::uint8_t *left, const std::uint8_t *right,
    int right_width, int right_x, int min, int width, Memory &m, std::int16_t *d)
{
  constexpr int kNarrow = 16, kWide = 48; /* pixels */
  m.surfaces.clear ();
  for (int x = 0; x < width;) {
    const int begin = x++;
    while (x < width && d[begin] >= min && d[x] >= min && std::abs (d[x] - d[x - 1]) <= 16)
      x++;
    if (d[begin] >= min && (x - begin <= kNarrow || x - begin >= kWide))
      m.surfaces.push_back ({begin, x});
  }
  const auto there = [&] (int x) {
    return std::size_t (std::clamp (x + right_x - ((d[x] + 8) >> 4), 0, right_width - 1));
  };
  std::vector<std::int16_t> &seen = m.nearest; /* at least this disparity, in a wide surface */
  seen.assign (std::size_t (right_width), 32767);
  for (const auto &[begin, end] : m.surfaces)
    for (int x = begin; x < end && end - begin >= kWide; x++)
      if (std::abs (left[x] - grey_at (right, 16 * (x + right_x) - d[x], right_width)) <= kNoise)
        seen[there (x)] = std::min (seen[there (x)], d[x]);
  for (const auto &[begin, end] : m.surfaces) {
    if (end - begin > kNarrow)
      continue;
    int doubled = 0;
    for (int x = begin; x < end; x++)
      doubled += seen[there (x)] < d[x] - 32;
    if (2 * doubled >= end - begin)
      std::fill (d + begin, d + end, std::int16_t (min - 16));
  }
}

void
DisparityFilter::clear_doubled (const cv::Mat &left, const cv::Mat &right, int right_x, int min,
    const Tiles &tiles, cv::Mat &disparity)
{
  memory_.reserve (tiles.workers ());
  tiles.each ([&] (const cv::Rect &tile, std::size_t worker) {
    for (int y = tile.y; y < tile.br ().y; y++)
      clear_doubled_of_row (left.ptr<std::uint8_t> (y) + tile.x, right.ptr<std::uint8_t> (y),
          right.cols, right_x + tile.x, min, tile.width, memory_.of (worker),
          disparity.ptr<std::int16_t> (y) + tile.x);
  });
}

/* ---- specks ---- */

int
DisparityFilter::find_root (int run)
{
  while (runs_[std::size_t (run)].root != run) {
    const int up = runs_[std::size_t (run)].root;
    run = runs_[std::size_t (run)].root = runs_[std::size_t (up)].root;
  }
  return run;
}

/* Merges runs a to a_end of a row with runs a_end to b_end of the row below. */
void
DisparityFilter::join_rows (const std::int16_t *upper, const std::int16_t *lower, std::size_t a,
    std::size_t a_end, std::size_t b_end, int range)
{
  for (std::size_t b = a_end; a < a_end && b < b_end;) {
    const int x0 = std::max (runs_[a].x0, runs_[b].x0), x1 = std::min (runs_[a].x1, runs_[b].x1);
    bool touch = false;
    for (int x = x0; x < x1 && !touch; x++)
      touch = std::abs (upper[x] - lower[x]) <= range;
    if (touch) {
      const int one = find_root (int (a)), other = find_root (int (b));
      if (one != other) {
        runs_[std::size_t (other)].root = one;
        runs_[std::size_t (one)].size += runs_[std::size_t (other)].size;
      }
    }
    runs_[a].x1 <= runs_[b].x1 ? a++ : b++;
  }
}

/* Finds the runs of one row, from x0 to x1. */
void
DisparityFilter::find_runs (const std::int16_t *d, int x0, int x1, int range, int min)
{
  for (int x = x0; x < x1;) {
    if (d[x] < min) {
      x++;
      continue;
    }
    const int begin = x++;
    while (x < x1 && d[x] >= min && std::abs (d[x] - d[x - 1]) <= range)
      x++;
    runs_.push_back ({begin, x, int (runs_.size ()), x - begin});
  }
}

void
DisparityFilter::clear_specks (
    int window, int range, int min, int nearest, const Tiles &tiles, cv::Mat &disparity)
{
  runs_.clear ();
  first_runs_.assign (std::size_t (disparity.rows) + 1, 0);
  std::size_t next = 0; /* first row without first_runs_ */
  for (const cv::Rect &part : tiles.parts ()) {
    const std::size_t top = std::size_t (part.y);
    for (; next <= top; next++)
      first_runs_[next] = runs_.size ();
    for (std::size_t y = top; y < top + std::size_t (part.height); y++) {
      const auto row = disparity.ptr<std::int16_t> (int (y));
      find_runs (row, part.x, part.br ().x, range, nearest);
      first_runs_[y + 1] = runs_.size ();
      if (y > 0 && first_runs_[y - 1] < first_runs_[y])
        join_rows (disparity.ptr<std::int16_t> (int (y) - 1), row, first_runs_[y - 1],
            first_runs_[y], runs_.size (), range);
    }
    next = top + std::size_t (part.height) + 1;
  }
  for (const cv::Rect &part : tiles.parts ())
    for (int y = part.y; y < part.br ().y; y++) {
      auto row = disparity.ptr<std::int16_t> (y);
      for (std::size_t i = first_runs_[std::size_t (y)]; i < first_runs_[std::size_t (y) + 1]; i++)
        if (runs_[std::size_t (find_root (int (i)))].size <= window)
          std::fill (row + runs_[i].x0, row + runs_[i].x1, std::int16_t (min - 16));
    }
}

/* ---- gaps ---- */

namespace {

/* Whether a colour is approximately between two others. */
bool
is_between (const cv::Vec4b &p, const cv::Vec4b &a, const cv::Vec4b &b)
{
  constexpr int kLike = 16; /* levels */
  for (int c = 0; c < 3; c++)
    if (p[c] < std::min (a[c], b[c]) - kLike || p[c] > std::max (a[c], b[c]) + kLike)
      return false;
  return true;
}

/* Fills elements `last` + 1 to i - 1 of a row or column if they are a gap in one surface. Steps are
 * in elements. */
void
fill_gap (const cv::Vec4b *colour, std::ptrdiff_t colour_step, std::int16_t *disparity,
    std::ptrdiff_t step, int last, int i)
{
  const int a = disparity[last * step], d = disparity[i * step];
  if (std::abs (a - d) > 16)
    return;
  for (int k = last + 1; k < i; k++)
    if (!is_between (colour[k * colour_step], colour[last * colour_step], colour[i * colour_step]))
      return;
  for (int k = last + 1; k < i; k++)
    disparity[k * step] = static_cast<std::int16_t> (a + (d - a) * (k - last) / (i - last));
}

} // namespace

void
DisparityFilter::fill_gaps (
    const cv::Mat &colour, int width, int min, const Tiles &tiles, cv::Mat &disparity)
{
  tiles.each ([&] (const cv::Rect &tile, std::size_t) {
    for (int y = tile.y; y < tile.br ().y; y++) {
      auto d = disparity.ptr<std::int16_t> (y);
      int last = -1; /* with a disparity */
      for (int x = tile.x; x < tile.br ().x; x++) {
        if (d[x] < min)
          continue;
        if (last >= 0 && x - last > 1 && x - last - 1 <= width)
          fill_gap (colour.ptr<cv::Vec4b> (y), 1, d, 1, last, x);
        last = x;
      }
    }
  });
  /* Columns are processed in groups, in memory order; threads share the groups. */
  constexpr int kColumns = 64;
  const cv::Rect hull = tiles.hull ();
  last_rows_.assign (std::size_t (disparity.cols), -1);
  in_parallel (std::size_t ((hull.width + kColumns - 1) / kColumns), tiles.n_threads (),
      [&] (std::size_t stripe) {
        const int begin = hull.x + int (stripe) * kColumns,
                  end = std::min (begin + kColumns, hull.br ().x);
        for (const cv::Rect &part : tiles.parts ())
          for (int y = part.y; y < part.br ().y; y++) {
            const auto d = disparity.ptr<std::int16_t> (y);
            for (int x = std::max (begin, part.x); x < std::min (end, part.br ().x); x++) {
              if (d[x] < min)
                continue;
              int &last = last_rows_[std::size_t (x)];
              if (last >= 0 && y - last > 1 && y - last - 1 <= width)
                fill_gap (colour.ptr<cv::Vec4b> (0) + x,
                    std::ptrdiff_t (colour.step / sizeof (cv::Vec4b)),
                    disparity.ptr<std::int16_t> (0) + x, std::ptrdiff_t (disparity.step1 ()), last,
                    y);
              last = y;
            }
          }
      });
}

} // namespace rangecast
