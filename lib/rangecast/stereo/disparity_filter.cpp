/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "disparity_filter.hpp"

#include <algorithm>
#include <cstdlib>
#include <cstring>

namespace rangecast {
namespace {

/* Radius and area of patches, pixels. */
constexpr int kPatchRadius = 3, kPatchArea = 49;
/* Difference between two images of a patch due to noise and interpolation, grey levels. */
constexpr int kNoise = 4;
constexpr int kSupport = 4;    /* of eight neighbours; at a straight edge there are five */
constexpr int kSpeck = 100;    /* pixels; smaller surfaces are mostly wrong matches */
constexpr int kSpeckStep = 32; /* 1/16 pixel */
constexpr int kGap = 12;       /* pixels */

/* Grey level at 1/16 pixel positions, interpolated linearly. */
int
grey_at (const std::uint8_t *row, int x16, int width)
{
  const int x = std::clamp (x16 >> 4, 0, width - 1), f = x16 & 15;
  return (row[x] * (16 - f) + row[std::min (x + 1, width - 1)] * f + 8) >> 4;
}

/* Copies a tile with a border of one pixel. */
void
copy_with_border (const cv::Mat &disparity, const cv::Rect &tile, std::int16_t none, Plane &to)
{
  const cv::Rect there (tile.x - 1, tile.y - 1, tile.width + 2, tile.height + 2),
      inside = there & cv::Rect ({}, disparity.size ());
  to.set_size (there.width, there.height);
  for (int y = 0; y < to.height (); y++) {
    std::int16_t *row = to.row (y);
    std::fill_n (row, to.width (), none);
    if (const int v = there.y + y; v >= 0 && v < disparity.rows)
      std::copy_n (
          disparity.ptr<std::int16_t> (v) + inside.x, inside.width, row + (inside.x - there.x));
  }
}

/* Adds one to the counts of a row's pixels whose neighbours' disparities are within `max`. */
void
count_support (const std::int16_t *__restrict d, const std::int16_t *__restrict other,
    const std::uint16_t *__restrict max, int min, int n, std::uint16_t *__restrict counts)
{
  const auto lowest = std::int16_t (min);
  for (int x = 0; x < n; x++) {
    const auto difference = std::uint16_t (
        std::uint16_t (std::max (d[x], other[x])) - std::uint16_t (std::min (d[x], other[x])));
    counts[x] = std::uint16_t (counts[x] + ((other[x] >= lowest) & (difference <= max[x])));
  }
}

/* Differences of grey levels where there is a disparity, else 0; and where that is. */
void
subtract_row (const std::int16_t *__restrict d, const std::int16_t *__restrict left,
    const std::int16_t *__restrict right, int min, int n, std::int16_t *__restrict valid,
    std::int16_t *__restrict difference)
{
  for (int x = 0; x < n; x++) {
    const auto is_valid = std::int16_t (d[x] >= min), all = std::int16_t (left[x] - right[x]);
    valid[x] = is_valid;
    difference[x] = std::int16_t (all & -is_valid);
  }
}

/* Sums over the patches of a row: see compare_patches(). */
struct PatchSums {
  const std::int16_t *counts, *differences, *sizes, *contrasts;
};

void
clear_unlike_of_row (const std::int16_t *__restrict from, const PatchSums &sums, std::int16_t none,
    int n, std::int16_t *__restrict to)
{
  const std::int16_t *__restrict counts = sums.counts, *__restrict differences = sums.differences,
                                 *__restrict sizes = sums.sizes,
                                 *__restrict contrasts = sums.contrasts;
  for (int x = 0; x < n; x++) {
    const std::int16_t d = from[x]; /* not loaded by condition, so that vectors are */
    const int unlike = kPatchArea * (sizes[x] - std::abs (int (differences[x])) / 2),
              max = (contrasts[x] + kNoise * kPatchArea) * counts[x];
    to[x] = unlike > max ? none : d;
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
      subtract_row (
          d + begin, l + begin, size, min, end - begin, valid + begin, difference + begin);
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
DisparityFilter::clear_unlike (const cv::Mat &left, const cv::Mat &right, int right_x, int min,
    const Tiles &tiles, const cv::Mat &disparity, cv::Mat &to)
{
  memory_.reserve (tiles.workers ());
  tiles.each ([&] (const cv::Rect &tile, std::size_t worker) {
    Memory &m = memory_.of (worker);
    compare_patches (left, right, right_x, min, tile, disparity, m);
    for (int y = 0; y < tile.height; y++) {
      clear_unlike_of_row (disparity.ptr<std::int16_t> (tile.y + y) + tile.x,
          {m.counts.row (y), m.differences.row (y), m.sizes.row (y), m.contrasts.row (y)},
          std::int16_t (min - 16), tile.width, to.ptr<std::int16_t> (tile.y + y) + tile.x);
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
DisparityFilter::clear_flying (
    int offset, int min, const Tiles &tiles, const cv::Mat &disparity, cv::Mat &to)
{
  constexpr int kShare = int (65536 * kSurfaceStep);
  const auto none = static_cast<std::int16_t> (min - 16);
  memory_.reserve (tiles.workers ());
  tiles.each ([&] (const cv::Rect &tile, std::size_t worker) {
    Memory &m = memory_.of (worker);
    const auto n = std::size_t (tile.width);
    copy_with_border (disparity, tile, none, m.grey);
    m.max.resize (n);
    for (int y = 0; y < tile.height; y++) {
      const std::int16_t *d = m.grey.row (y + 1) + 1;
      for (std::size_t x = 0; x < n; x++)
        m.max[x] = std::uint16_t (std::max (8, std::max (d[x] + offset, 0) * kShare >> 16));
      m.support.assign (n, 0);
      for (int v = 0; v < 3; v++)
        for (int u = 0; u < 3; u++)
          count_support (
              d, m.grey.row (y + v) + u, m.max.data (), min, tile.width, m.support.data ());
      auto out = to.ptr<std::int16_t> (tile.y + y) + tile.x;
      for (std::size_t x = 0; x < n; x++)
        out[x] = m.support[x] > kSupport ? d[x] : none; /* the pixel itself counts, too */
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

void
DisparityFilter::clear_specks (int min, int nearest, const Tiles &tiles, cv::Mat &disparity)
{
  components_.clear ();
  int next = 0;
  for (const cv::Rect &part : tiles.parts ()) {
    for (; next < part.y; next++)
      components_.add_empty_row ();
    for (; next < part.br ().y; next++)
      components_.add_level_row (disparity.ptr<std::int16_t> (next),
          disparity.ptr<std::int16_t> (std::max (0, next - 1)), part.x, part.br ().x, nearest,
          kSpeckStep);
  }
  for (const cv::Rect &part : tiles.parts ())
    for (int y = part.y; y < part.br ().y; y++) {
      auto row = disparity.ptr<std::int16_t> (y);
      for (const ConnectedComponents::Run &run : components_.row (y))
        if (components_.size_of (run) <= kSpeck)
          std::fill (row + run.x0, row + run.x1, std::int16_t (min - 16));
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

/* Whether row y ends a gap, by column.
 *  @param last  rows with a disparity before, or INT16_MIN */
void
find_ends (const std::int16_t *__restrict d, int n, int min, int y,
    const std::int16_t *__restrict last, std::uint8_t *__restrict ends)
{
  const auto first = std::int16_t (std::max (0, y - 1 - kGap)), end = std::int16_t (y - 1),
             lowest = std::int16_t (min);
  for (int i = 0; i < n; i++)
    ends[i] = (d[i] >= lowest) & (last[i] >= first) & (last[i] < end);
}

void
move_last (const std::int16_t *__restrict d, int n, int min, int y, std::int16_t *__restrict last)
{
  const auto lowest = std::int16_t (min), now = std::int16_t (y);
  for (int i = 0; i < n; i++)
    last[i] = d[i] >= lowest ? now : last[i];
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
DisparityFilter::fill_gaps (const cv::Mat &colour, int min, const Tiles &tiles, cv::Mat &disparity)
{
  memory_.reserve (tiles.workers ());
  tiles.each ([&] (const cv::Rect &tile, std::size_t worker) {
    std::vector<std::uint8_t> &known = memory_.of (worker).known;
    known.resize (std::size_t (tile.width));
    for (int y = tile.y; y < tile.br ().y; y++) {
      const auto d = disparity.ptr<std::int16_t> (y);
      for (int i = 0; i < tile.width; i++)
        known[std::size_t (i)] = d[tile.x + i] >= min;
      const auto find = [&] (int from, int value) {
        const void *found =
            std::memchr (known.data () + from, value, std::size_t (tile.width - from));
        return found ? int (static_cast<const std::uint8_t *> (found) - known.data ()) : tile.width;
      };
      for (int end, begin = find (find (0, 1), 0); begin < tile.width; begin = find (end, 0)) {
        end = find (begin, 1);
        if (end < tile.width && end - begin <= kGap)
          fill_gap (colour.ptr<cv::Vec4b> (y), 1, d, 1, tile.x + begin - 1, tile.x + end);
      }
    }
  });
  fill_gaps_of_columns (colour, min, tiles, disparity);
}

/* Columns are processed in groups, in memory order; threads share the groups. */
void
DisparityFilter::fill_gaps_of_columns (
    const cv::Mat &colour, int min, const Tiles &tiles, cv::Mat &disparity)
{
  constexpr int kColumns = 64;
  const cv::Rect hull = tiles.hull ();
  in_parallel (std::size_t ((hull.width + kColumns - 1) / kColumns), tiles.n_threads (),
      [&] (std::size_t stripe) {
        for_this_cpu ([&] {
          const int x0 = hull.x + int (stripe) * kColumns;
          std::int16_t last[kColumns]; /* rows with a disparity */
          std::uint8_t ends[kColumns] = {};
          int bottom = -1; /* of the part before */
          for (const cv::Rect &part : tiles.parts ()) {
            const int begin = std::clamp (part.x - x0, 0, kColumns),
                      end = std::clamp (part.br ().x - x0, begin, kColumns);
            /* A gap lies within what was matched: between parts, nothing is known. */
            if (part.y != bottom)
              std::fill_n (last, kColumns, std::int16_t{INT16_MIN});
            std::fill (last, last + begin, std::int16_t{INT16_MIN});
            std::fill (last + end, last + kColumns, std::int16_t{INT16_MIN});
            bottom = part.br ().y;
            for (int y = part.y; begin < end && y < bottom; y++) {
              const auto d = disparity.ptr<std::int16_t> (y) + x0;
              find_ends (d + begin, end - begin, min, y, last + begin, ends + begin);
              const std::uint8_t *at = ends + begin;
              while (const void *found = std::memchr (at, 1, std::size_t (ends + end - at))) {
                at = static_cast<const std::uint8_t *> (found);
                const int i = int (at++ - ends);
                fill_gap (colour.ptr<cv::Vec4b> (0) + x0 + i,
                    std::ptrdiff_t (colour.step / sizeof (cv::Vec4b)),
                    disparity.ptr<std::int16_t> (0) + x0 + i, std::ptrdiff_t (disparity.step1 ()),
                    last[i], y);
              }
              move_last (d + begin, end - begin, min, y, last + begin);
            }
          }
        });
      });
}

} // namespace rangecast
