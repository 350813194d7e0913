/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "semi_global_matcher.hpp"

#include <algorithm>
#include <array>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "matching_cost.hpp"

namespace rangecast {
namespace {

/* Penalties for a change of disparity along a path by one pixel, and by more; the latter decreases
 * with the grey level step, because surfaces end at edges. */
constexpr int kStep = 10, kJump = 50, kMinJump = 15, kEdge = 8;
/* Greater than any cost along a path. */
constexpr std::uint8_t kNever = 200;
static_assert (kMaxCost + kJump < kNever && kNever + kStep < 256);

constexpr int kOverlap = 16; /* rows in which paths converge */
/* Costs of a stripe, two bytes each; up to kMaxCellsOfBands where two bands of tiles have more. */
constexpr std::size_t kMaxCells = 36 << 20, kMaxCellsOfBands = 4 * kMaxCells;
constexpr int kMinBands = 2;         /* one has no rows without overlap */
constexpr int kMaxDisparities = 512; /* of a tile; if there are more, the nearest are searched */
static_assert (kMinBands * kSide > 2 * kOverlap);
/* Maximum difference of the disparities of a pixel and of its right pixel's best match, pixels. */
constexpr int kMaxInconsistency = 1;

/* Number of disparities from which half the size is matched first, and from which only what it
 * found is searched: small near things vanish at a fraction of the size. */
constexpr int kSome = 16, kMany = 64;
/* Margin around what it found, disparities; its pixels around a tile that count. */
constexpr int kMargin = 2, kAround = 4;
/* Disparities that half the size found in its plain parts, and those next to them, cost one less.
 * Plain is where grey levels within kPlainRadius differ by at most kPlain: there noise may exceed
 * texture, and half the size has half the noise. */
constexpr int kPlainRadius = 4, kPlain = 16;

/* The penalties of jumps between kSide pixels and as many others. */
inline void
find_jumps (const std::uint8_t *__restrict pixels, const std::uint8_t *__restrict others,
    std::uint8_t *__restrict jumps)
{
  for (int i = 0; i < kSide; i++) {
    const int step = std::abs (pixels[i] - others[i]);
    /* Rounded down: exact in floats, and vectors have no division of integers. */
    jumps[i] =
        std::uint8_t (greater (kMinJump, int (float (kJump * kEdge) / float (kEdge + step))));
  }
}

/* One step of kSide paths: costs of the disparities of a pixel, given those of the previous one.
 * @param path    of the previous pixel, then of this one, by disparity; one more at both ends
 * @param lowest  minimum of `path`
 * @param use     called with each disparity and its new costs */
template <typename Lanes, typename Use>
inline void
step (const std::uint8_t *cost, std::uint8_t *path, std::uint8_t *lowest, const std::uint8_t *jump,
    int count, const Use &use)
{
  using B = typename Lanes::B;
  const B low = Lanes::at (lowest), far = low + Lanes::at (jump);
  B least = B{} + std::uint8_t{255}, before = Lanes::at (path - kSide), own = Lanes::at (path);
  for (int d = 0; d < count; d++, path += kSide, cost += kSide) {
    const B after = Lanes::at (path + kSide),
            beside = min_of<Lanes> (before, after) + std::uint8_t (kStep),
            now = Lanes::at (cost) + min_of<Lanes> (min_of<Lanes> (own, far), beside) - low;
    Lanes::at (path) = now;
    least = min_of<Lanes> (least, now);
    use (d, now);
    before = own;
    own = after;
  }
  Lanes::at (lowest) = least;
}

/* Interleaves the bytes of two rows within each 16 of them. */
template <typename B>
inline void
interleave (const B &a, const B &b, B &low, B &high)
{
  if constexpr (sizeof (B) == 16) {
    low = __builtin_shufflevector (a, b, 0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23);
    high = __builtin_shufflevector (
        a, b, 8, 24, 9, 25, 10, 26, 11, 27, 12, 28, 13, 29, 14, 30, 15, 31);
  } else {
    low = __builtin_shufflevector (a, b, 0, 32, 1, 33, 2, 34, 3, 35, 4, 36, 5, 37, 6, 38, 7, 39, 16,
        48, 17, 49, 18, 50, 19, 51, 20, 52, 21, 53, 22, 54, 23, 55);
    high = __builtin_shufflevector (a, b, 8, 40, 9, 41, 10, 42, 11, 43, 12, 44, 13, 45, 14, 46, 15,
        47, 24, 56, 25, 57, 26, 58, 27, 59, 28, 60, 29, 61, 30, 62, 31, 63);
  }
}

/* Transposes kSide x kSide bytes in squares of 16 x 16; a vector of 32 bytes holds rows of two, one
 * below the other. Interleaving rows i and i + 8 four times transposes a square. */
template <typename Lanes>
inline void
transpose (
    const std::uint8_t *from, std::ptrdiff_t from_step, std::uint8_t *to, std::ptrdiff_t to_step)
{
  using B = typename Lanes::B;
  using Half = rangecast::Lanes<4>;
  constexpr int kBytes = sizeof (B), kSquare = 16;
  for (int y = 0; y < kSide; y += kBytes)
    for (int x = 0; x < kSide; x += kSquare) {
      B rows[kSquare], next[kSquare];
      for (int i = 0; i < kSquare; i++) {
        const std::uint8_t *row = from + (y + i) * from_step + x;
        if constexpr (kBytes == kSquare)
          rows[i] = Lanes::at (row);
        else /* not by way of memory: see Lanes::make_root() */
          rows[i] = __builtin_shufflevector (Half::at (row), Half::at (row + kSquare * from_step),
              0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23,
              24, 25, 26, 27, 28, 29, 30, 31);
      }
#pragma GCC unroll 2
      for (int round = 0; round < 2; round++) {
#pragma GCC unroll 8
        for (int i = 0; i < kSquare / 2; i++)
          interleave<B> (rows[i], rows[i + 8], next[2 * i], next[2 * i + 1]);
#pragma GCC unroll 8
        for (int i = 0; i < kSquare / 2; i++)
          interleave<B> (next[i], next[i + 8], rows[2 * i], rows[2 * i + 1]);
      }
      for (int i = 0; i < kSquare; i++)
        Lanes::at (to + (x + i) * to_step + y) = rows[i];
    }
}

/* Begins paths: no cost at any disparity. Paths have a row of kNever at both ends. */
void
begin_paths (std::vector<std::uint8_t> &path, int count)
{
  const std::size_t n = std::size_t (count) * kSide;
  path.resize (std::max (path.size (), n + 2 * kSide));
  std::fill_n (path.begin (), n + 2 * kSide, std::uint8_t{0});
  std::fill_n (path.begin (), kSide, kNever);
  std::fill_n (path.begin () + std::ptrdiff_t (n) + kSide, kSide, kNever);
}

/* The best of `count` disparities from `low` on for a row of a tile, and what their costs, and
 * those of the disparities before and after, leave of 255. */
struct Best {
  int low, count;
  const std::int16_t *place;
  const std::uint8_t *most, *farther, *nearer;
};

/* @param[out] whole, disparity  pixels, 1/16 pixel */
inline void
interpolate (const Best &best, std::int16_t *__restrict whole, std::int16_t *__restrict disparity)
{
  float bends[kSide], slopes[kSide];
  for (int i = 0; i < kSide; i++) {
    const auto most = float (best.most[i]), before = float (best.farther[i]),
               after = float (best.nearer[i]);
    bends[i] = std::max (2 * most - after - before, 1.f);
    slopes[i] = after - before;
  }
  std::int32_t parts[kSide];
  /* Rounded half up; floats are exact and so is their quotient's integer part. */
  for (int i = 0; i < kSide; i++)
    parts[i] = std::int32_t ((16 * slopes[i] + bends[i]) / (2 * bends[i]));
  for (int i = 0; i < kSide; i++) {
    const bool inside = (best.place[i] > 0) & (best.place[i] < best.count - 1);
    whole[i] = std::int16_t (best.place[i] + best.low);
    disparity[i] = std::int16_t (16 * whole[i] + (inside ? parts[i] : 0));
  }
}

/* Lowers the costs of the disparities that half the size found.
 * @param likely  1/8 pixel of a row of half the size, of `columns`; less than `least` = none
 * @param x       of the tile's first column; @param costs  of its row, by disparity and column */
void
favour (const std::int16_t *likely, int columns, int least, int x, int low, int count,
    std::uint8_t *costs)
{
  std::int16_t place[kSide];
  int first = INT16_MAX, last = INT16_MIN;
  for (int i = 0; i < kSide; i++) {
    const int found = likely[std::min ((x + i) / 2, columns - 1)];
    place[i] = std::int16_t (found < least ? INT16_MIN / 2 : ((found + 4) >> 3) - low);
    first = found < least ? first : std::min<int> (first, place[i]);
    last = std::max<int> (last, place[i]);
  }
  for (int d = std::max (0, first - 1); d <= std::min (count - 1, last + 1); d++) {
    std::uint8_t *__restrict row = costs + d * kSide;
    for (int i = 0; i < kSide; i++)
      row[i] = std::uint8_t (row[i] - ((std::abs (d - place[i]) <= 1) & (row[i] > 0)));
  }
}

} // namespace

/* The costs of all tiles of a band, row by row. */
template <typename Lanes>
void
SemiGlobalMatcher::compare_band (const Stripe &stripe, int band, Memory &m)
{
  const Tile *tiles = &tiles_[std::size_t (band * stripe.across)];
  const int width = padded_[0].cols - 2 * kRadiusX, begin = band * kSide,
            end = std::min (begin + kSide, stripe.rows);
  const auto round_down = [] (int x) { return x / kSide * kSide; };
  /* Columns that are compared, in both pictures. */
  const int from[] = {round_down (stripe.x0),
      round_down (stripe.x0 - (min_disparity_ + disparities_ - 1))},
            to[] = {
                width, round_down (stripe.x0 + stripe.across * kSide - min_disparity_ + kSide - 1)};
  m.low.resize (std::size_t (width));
  m.high.resize (std::size_t (width));
  for (int row = begin; row < end; row++) {
    const int y = stripe.y0 + row;
    for (int i = 0; i < 2; i++)
      transform_row (padded_[i], y, from[i], to[i], m.transformed[i]);
    const std::uint8_t *grey = padded_[0].ptr<std::uint8_t> (y + kRadiusY) + kRadiusX;
    range_of_row (padded_[1].ptr<std::uint8_t> (y + kRadiusY) + kRadiusX, width, m.low.data (),
        m.high.data ());
    const RowView left = {m.transformed[0].data (), width, nullptr, nullptr},
                  right = {m.transformed[1].data (), width, m.low.data (), m.high.data ()};
    for (int i = 0, x = stripe.x0; i < stripe.across; i++, x += kSide) {
      const Tile &tile = tiles[i];
      std::uint8_t *costs =
          &costs_[tile.at + std::size_t (row - begin) * std::size_t (tile.count) * kSide];
      compare<Lanes> (left, grey + x, x, right, tile.low, tile.count, costs);
      if (has_coarse_)
        favour (likely_.ptr<std::int16_t> (std::min (y / 2, likely_.rows - 1)), likely_.cols,
            16 * coarse_min_, x, tile.low, tile.count, costs);
    }
  }
}

/* Jumps between each column and the one before. */
template <typename Lanes>
void
SemiGlobalMatcher::find_jumps_of_band (const Stripe &stripe, int band, Memory &m)
{
  const int begin = band * kSide, rows = std::min (kSide, stripe.rows - begin);
  const std::size_t n = std::size_t (stripe.across) * kTileArea;
  m.jumps.resize (n + kSide);
  std::fill_n (&m.jumps[n], kSide, std::uint8_t{0}); /* before the first column from the right */
  std::uint8_t jumps[kTileArea] = {};
  for (int i = 0; i < stripe.across; i++) {
    for (int row = 0; row < rows; row++) {
      const std::uint8_t *grey = padded_[0].ptr<std::uint8_t> (stripe.y0 + begin + row + kRadiusY) +
                                 kRadiusX + stripe.x0 + i * kSide;
      find_jumps (grey, grey - 1, jumps + row * kSide);
    }
    transpose<Lanes> (jumps, kSide, &m.jumps[std::size_t (i) * kTileArea], kSide);
  }
}

/* Both paths along the rows of a band, together. */
template <typename Lanes>
void
SemiGlobalMatcher::walk_band (const Stripe &stripe, int band, Memory &m)
{
  using B = typename Lanes::B;
  const Tile *tiles = &tiles_[std::size_t (band * stripe.across)];
  compare_band<Lanes> (stripe, band, m);
  find_jumps_of_band<Lanes> (stripe, band, m);
  const std::size_t first = tiles[0].at, n = end_of (tiles[stripe.across - 1]) - first;
  m.costs.resize (std::max (m.costs.size (), n));
  m.rests.resize (std::max (m.rests.size (), n));
  for (const int way : {1, -1}) {
    std::array<std::uint8_t, kSide> lowest{};
    const int begin = way > 0 ? 0 : stripe.across - 1;
    for (int i = begin; i >= 0 && i < stripe.across; i += way) {
      const Tile &tile = tiles[i];
      const std::ptrdiff_t each = std::ptrdiff_t (tile.count) * kSide;
      std::uint8_t *costs = m.costs.data () + (tile.at - first),
                   *rests = m.rests.data () + (tile.at - first);
      if (i == begin)
        begin_paths (m.path, tile.count);
      else
        realign (tiles[i - way], tile, m);
      if (way > 0)
        for (int d = 0; d < tile.count; d++)
          transpose<Lanes> (&costs_[tile.at] + d * kSide, each, costs + d * kSide, each);
      const int last = std::min (kSide, stripe.columns - i * kSide);
      for (int k = 0; k < last; k++) {
        const int x = way > 0 ? k : last - 1 - k;
        const std::uint8_t *jumps =
            m.jumps.data () + std::ptrdiff_t (i * kSide + x + (way > 0 ? 0 : 1)) * kSide;
        std::uint8_t *rest = rests + x * each;
        for (int part = 0; part < kSide; part += int (sizeof (B))) {
          const auto walk = [&] (const auto &use) {
            step<Lanes> (costs + x * each + part, m.path.data () + kSide + part,
                lowest.data () + part, jumps + part, tile.count, use);
          };
          if (way > 0)
            walk ([&] (int d, const B &now) { Lanes::at (rest + d * kSide + part) = ~now; });
          else
            walk ([&] (int d, const B &now) {
              B &to = Lanes::at (rest + d * kSide + part);
              to = subtract_down_to_0<Lanes> (to, now);
            });
        }
      }
      if (way < 0)
        for (int d = 0; d < tile.count; d++)
          transpose<Lanes> (rests + d * kSide, each, &rests_[tile.at] + d * kSide, each);
    }
  }
}

/* Makes costs along paths continue with the disparities of another tile. */
void
SemiGlobalMatcher::realign (const Tile &from, const Tile &to, Memory &m)
{
  if (from.low == to.low && from.count == to.count)
    return;
  const std::size_t n = std::size_t (to.count + 2) * kSide;
  m.realigned.resize (std::max (m.realigned.size (), n));
  std::fill_n (m.realigned.begin (), n, kNever);
  const int low = std::max (from.low, to.low),
            count = std::min (from.low + from.count, to.low + to.count) - low;
  if (count > 0)
    std::copy_n (m.path.begin () + std::ptrdiff_t (low - from.low + 1) * kSide, count * kSide,
        m.realigned.begin () + std::ptrdiff_t (low - to.low + 1) * kSide);
  std::swap (m.path, m.realigned);
}

/* The disparities of a row of a tile with the lowest cost, with subpixel precision by a parabola
 * through it and its neighbours.
 * @param x, y   position in the stripe; @param most  what the lowest costs leave of 255 */
template <typename Lanes>
void
SemiGlobalMatcher::choose (
    const Stripe &stripe, const Tile &tile, int x, int y, const std::uint8_t *most, Memory &m)
{
  using B = typename Lanes::B;
  constexpr int kAtOnce = 256; /* disparities that a byte tells apart */
  const std::uint8_t *rests = m.last.data () + kSide;
  const int n = tile.count;
  std::int16_t best[kSide];
  std::uint8_t place[kSide], found[kSide], farther[kSide] = {}, nearer[kSide] = {};
  std::fill_n (best, kSide, std::int16_t{0});
  for (int begin = (n - 1) / kAtOnce * kAtOnce; begin >= 0; begin -= kAtOnce) {
    for (int part = 0; part < kSide; part += int (sizeof (B))) {
      const B highest = Lanes::at (most + part);
      B at{}, any{}, before = Lanes::at (farther + part), after = Lanes::at (nearer + part);
      for (int d = std::min (n, begin + kAtOnce) - 1; d >= begin; d--) {
        const std::uint8_t *rest = rests + d * kSide + part;
        const B is_best = (B)(Lanes::at (rest) == highest);
        at = is_best ? B{} + std::uint8_t (d - begin) : at;
        before = is_best ? Lanes::at (rest - kSide) : before;
        after = is_best ? Lanes::at (rest + kSide) : after;
        any |= is_best;
      }
      Lanes::at (place + part) = at;
      Lanes::at (found + part) = any;
      Lanes::at (farther + part) = before;
      Lanes::at (nearer + part) = after;
    }
    for (int i = 0; i < kSide; i++)
      best[i] = std::int16_t (found[i] ? begin + place[i] : best[i]);
  }
  const std::size_t at = std::size_t (y) * std::size_t (stripe.across * kSide) + std::size_t (x);
  interpolate (
      {tile.low, n, best, most, farther, nearer}, &matches_.whole[at], &matches_.disparity[at]);
  for (int i = 0; i < kSide; i++)
    matches_.sum[at + std::size_t (i)] = std::uint8_t (255 - most[i]);
}

/* Both paths along the columns of a column of tiles: down, then up with the choice of disparities.
 */
template <typename Lanes>
void
SemiGlobalMatcher::walk_columns (const Stripe &stripe, int column, Memory &m)
{
  using B = typename Lanes::B;
  const int x0 = stripe.x0 + column * kSide;
  const auto tile_of = [&] (int band) -> const Tile & {
    return tiles_[std::size_t (band * stripe.across + column)];
  };
  const auto grey_of = [&] (int row) {
    return padded_[0].ptr<std::uint8_t> (stripe.y0 + row + kRadiusY) + kRadiusX + x0;
  };
  for (const int way : {1, -1}) {
    std::array<std::uint8_t, kSide> lowest{}, jumps{};
    const int begin = way > 0 ? 0 : stripe.rows - 1;
    for (int row = begin; row >= 0 && row < stripe.rows; row += way) {
      const int band = row / kSide;
      const Tile &tile = tile_of (band);
      if (row == begin)
        begin_paths (m.path, tile.count);
      else {
        if (const int last = (row - way) / kSide; last != band)
          realign (tile_of (last), tile, m);
        const std::uint8_t *grey = grey_of (row), *before = grey_of (row - way);
        find_jumps (grey, before, jumps.data ());
      }
      const std::size_t at =
          tile.at + std::size_t (row - band * kSide) * std::size_t (tile.count) * kSide;
      std::uint8_t *rests = &rests_[at];
      m.last.resize (std::max (m.last.size (), std::size_t (tile.count + 2) * kSide));
      std::uint8_t *last = m.last.data () + kSide;
      std::array<std::uint8_t, kSide> most;
      for (int part = 0; part < kSide; part += int (sizeof (B))) {
        const auto walk = [&] (const auto &use) {
          step<Lanes> (&costs_[at] + part, m.path.data () + kSide + part, lowest.data () + part,
              jumps.data () + part, tile.count, use);
        };
        if (way > 0)
          walk ([&] (int d, const B &now) {
            B &to = Lanes::at (rests + d * kSide + part);
            to = subtract_down_to_0<Lanes> (to, now);
          });
        else {
          B most_of_all{};
          walk ([&] (int d, const B &now) {
            const B rest = subtract_down_to_0<Lanes> (Lanes::at (rests + d * kSide + part), now);
            Lanes::at (last + d * kSide + part) = rest;
            most_of_all = max_of<Lanes> (most_of_all, rest);
          });
          Lanes::at (most.data () + part) = most_of_all;
        }
      }
      if (way < 0)
        choose<Lanes> (stripe, tile, column * kSide, row, most.data (), m);
    }
  }
}

/* Writes the disparities of a row, without those whose right pixel has a better match. */
void
SemiGlobalMatcher::check_row (const Stripe &stripe, int y, Memory &m, cv::Mat &disparity) const
{
  const int width = stripe.left.cols;
  const auto none = static_cast<std::int16_t> (16 * min_disparity_ - 16);
  const std::size_t at = std::size_t (y - stripe.y0) * std::size_t (stripe.across * kSide);
  const std::int16_t *whole = &matches_.whole[at], *exact = &matches_.disparity[at];
  const std::uint8_t *sums = &matches_.sum[at];
  auto out = disparity.ptr<std::int16_t> (y);
  std::fill_n (out, width, none);
  out += stripe.x0;
  if (!checks_right_) {
    std::copy_n (exact, stripe.columns, out);
    return;
  }
  /* The best match of each right pixel: its cost, then its disparity in 16 bits. */
  m.right.assign (std::size_t (width), UINT32_MAX);
  std::uint32_t *right = m.right.data () + stripe.x0;
  for (int x = 0; x < stripe.columns; x++) {
    std::uint32_t &best = right[x - whole[x]];
    best = lesser (best, std::uint32_t (sums[x]) << 16 | std::uint32_t (whole[x] - INT16_MIN));
  }
  for (int x = 0; x < stripe.columns; x++) {
    const int there = int (right[x - whole[x]] & 0xffff) + INT16_MIN;
    out[x] = std::abs (there - whole[x]) <= kMaxInconsistency ? exact[x] : none;
  }
}

/* @param y, end  rows of the stripe to write */
void
SemiGlobalMatcher::match_stripe (
    const Stripe &stripe, int y, int end, int n_threads, cv::Mat &disparity)
{
  const auto n = std::size_t (stripe.bands * kSide) * std::size_t (stripe.across * kSide);
  for (Costs *costs : {&costs_, &rests_})
    costs->resize (std::max (costs->size (), end_of (tiles_.back ())));
  matches_.disparity.resize (std::max (matches_.disparity.size (), n));
  matches_.whole.resize (matches_.disparity.size ());
  matches_.sum.resize (matches_.disparity.size ());
  memory_.reserve (workers_for (std::size_t (std::max (stripe.bands, stripe.across)), n_threads));
  in_parallel (std::size_t (stripe.bands), n_threads, [&] (std::size_t i, std::size_t worker) {
    for_this_cpu ([&]<typename Lanes> (
                      const Lanes &) { walk_band<Lanes> (stripe, int (i), memory_.of (worker)); });
  });
  in_parallel (std::size_t (stripe.across), n_threads, [&] (std::size_t i, std::size_t worker) {
    for_this_cpu ([&]<typename Lanes> (const Lanes &) {
      walk_columns<Lanes> (stripe, int (i), memory_.of (worker));
    });
  });
  in_parallel (std::size_t ((end - y + kSide - 1) / kSide), n_threads,
      [&] (std::size_t i, std::size_t worker) {
        const int first = y + int (i) * kSide;
        for (int row = first; row < std::min (first + kSide, end); row++)
          check_row (stripe, row, memory_.of (worker), disparity);
      });
}

/* Disparities at half the size. Those without a counterpart in the right image count, too: searched
 * only at disparities of its surroundings, an occluded pixel would more often seem to match. */
void
SemiGlobalMatcher::find_coarse (const cv::Mat &left, const cv::Mat &right, int n_threads)
{
  if (!coarse_)
    coarse_ = std::make_unique<SemiGlobalMatcher> ();
  const cv::Size half (left.cols / 2, left.rows / 2);
  for (int i = 0; i < 2; i++)
    cv::resize ((i ? right : left) (cv::Rect ({}, half * 2)), half_[i], half, 0, 0, cv::INTER_AREA);
  const int low = (min_disparity_ - 1) / 2, high = (min_disparity_ + disparities_) / 2;
  coarse_->checks_right_ = false;
  coarse_->match (half_[0], half_[1], low, high - low + 1, n_threads, coarse_disparity_);
  coarse_min_ = low;
  static const cv::Mat kWindow = cv::Mat::ones (2 * kPlainRadius + 1, 2 * kPlainRadius + 1, CV_8U);
  cv::morphologyEx (half_[0], contrast_, cv::MORPH_GRADIENT, kWindow);
  cv::compare (contrast_, kPlain, contrast_, cv::CMP_GT);
  coarse_disparity_.copyTo (likely_);
  likely_.setTo (16 * low - 16, contrast_);
}

/* @param x, y    position of the tile in the image
 * @param across  tiles in a row */
void
SemiGlobalMatcher::choose_disparities (int x, int y, int across, Tile &tile) const
{
  const auto fits = kMaxCellsOfBands / (kMinBands * kTileArea * std::size_t (across));
  const int max = int (std::min<std::size_t> (kMaxDisparities, fits));
  const auto search = [&] (int low, int end) {
    tile.low = std::max (low, end - max);
    tile.count = end - tile.low;
  };
  search (min_disparity_, min_disparity_ + disparities_);
  if (!has_coarse_ || disparities_ < kMany)
    return;
  const cv::Rect around (
      x / 2 - kAround, y / 2 - kAround, kSide / 2 + 2 * kAround, kSide / 2 + 2 * kAround);
  const cv::Rect part = around & cv::Rect ({}, coarse_disparity_.size ());
  std::int16_t low = INT16_MAX, high = INT16_MIN;
  const auto least = std::int16_t (16 * coarse_min_);
  for (int row = part.y; row < part.br ().y; row++) {
    const auto d = coarse_disparity_.ptr<std::int16_t> (row) + part.x;
    for (int i = 0; i < part.width; i++) {
      low = lesser (low, d[i] < least ? std::int16_t (INT16_MAX) : d[i]);
      high = greater (high, d[i]);
    }
  }
  if (high < least)
    return;
  const int first = std::max (min_disparity_, (low >> 3) - kMargin),
            end = std::min (min_disparity_ + disparities_, (high >> 3) + 2 + kMargin);
  if (first < end)
    search (first, end);
}

/* Adds bands of tiles to a stripe until it reaches the end of the image or memory is full. */
void
SemiGlobalMatcher::add_bands (Stripe &stripe)
{
  static_assert (kTileArea == kSide * kSide);
  std::size_t at = 0;
  tiles_.clear ();
  stripe.bands = stripe.rows = 0;
  while (stripe.y0 + stripe.rows < stripe.left.rows) {
    for (int i = 0; i < stripe.across; i++) {
      Tile &tile = tiles_.emplace_back ();
      choose_disparities (stripe.x0 + i * kSide, stripe.y0 + stripe.rows, stripe.across, tile);
      tile.at = at;
      at = end_of (tile);
    }
    if (stripe.bands >= kMinBands && at > kMaxCells) {
      tiles_.resize (tiles_.size () - std::size_t (stripe.across));
      return;
    }
    stripe.bands++;
    stripe.rows = std::min (stripe.rows + kSide, stripe.left.rows - stripe.y0);
  }
}

void
SemiGlobalMatcher::match (const cv::Mat &left, const cv::Mat &right, int min_disparity,
    int disparities, int n_threads, cv::Mat &disparity)
{
  min_disparity_ = min_disparity;
  disparities_ = disparities;
  disparity.create (left.size (), CV_16S);
  const int x0 = std::max (min_disparity + disparities, 0),
            columns = left.cols + std::min (min_disparity, 0) - x0;
  if (columns <= 0) {
    disparity.setTo (16 * min_disparity - 16);
    return;
  }
  has_coarse_ = disparities >= kSome && left.rows > 1;
  if (has_coarse_)
    find_coarse (left, right, n_threads);
  /* Room for columns of tiles beyond the image. */
  const int more = kSide + (kSide - left.cols % kSide) % kSide;
  for (int i = 0; i < 2; i++)
    cv::copyMakeBorder (i ? right : left, padded_[i], kRadiusY, kRadiusY, kRadiusX, kRadiusX + more,
        cv::BORDER_REPLICATE);
  Stripe stripe = {left, x0, columns, 0, 0, (columns + kSide - 1) / kSide, 0};
  for (int y = 0; y < left.rows;) {
    stripe.y0 = std::max (0, y - kOverlap);
    add_bands (stripe);
    const int bottom = stripe.y0 + stripe.rows,
              end = bottom < left.rows ? bottom - kOverlap : bottom;
    match_stripe (stripe, y, end, n_threads, disparity);
    y = end;
  }
}

} // namespace rangecast
