/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "disparity_filter.hpp"

#include <algorithm>
#include <cstdlib>
#include <cstring>

namespace rangecast {
namespace {

constexpr int kSupport = 4;    /* of eight neighbours; at a straight edge there are five */
constexpr int kSpeck = 100;    /* pixels; smaller surfaces are mostly wrong matches */
constexpr int kSpeckStep = 32; /* 1/16 pixel */
constexpr int kGap = 12;       /* pixels */

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

} // namespace

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
    copy_with_border (disparity, tile, none, m.disparities);
    m.max.resize (n);
    for (int y = 0; y < tile.height; y++) {
      const std::int16_t *d = m.disparities.row (y + 1) + 1;
      for (std::size_t x = 0; x < n; x++)
        m.max[x] = std::uint16_t (std::max (8, std::max (d[x] + offset, 0) * kShare >> 16));
      m.support.assign (n, 0);
      for (int v = 0; v < 3; v++)
        for (int u = 0; u < 3; u++)
          count_support (
              d, m.disparities.row (y + v) + u, m.max.data (), min, tile.width, m.support.data ());
      auto out = to.ptr<std::int16_t> (tile.y + y) + tile.x;
      for (std::size_t x = 0; x < n; x++)
        out[x] = m.support[x] > kSupport ? d[x] : none; /* the pixel itself counts, too */
    }
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
