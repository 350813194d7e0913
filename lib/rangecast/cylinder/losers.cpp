/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "losers.hpp"

#include <algorithm>
#include <bit>

#include "isa.hpp"

namespace rangecast {

/* Where units of a slice have several layers, a point's column does not tell its cell. */
void
Losers::find_cells (const DecidedFrame &frame)
{
  const Units &units = frame.units;
  const UnitRows &rows = units.rows;
  cell_of_.resize (std::max (cell_of_.size (), frame.cloud.x.size ()));
  first_cell_.resize (units.slices.size ());
  for (std::size_t s = 0; s < units.slices.size (); s++) {
    const auto number = static_cast<int> (s);
    const bool plain = units.is_plain (static_cast<std::uint32_t> (s));
    first_cell_[s] = plain ? rows.cell (number, 0, 0) : kNoCell;
    if (plain)
      continue;
    for (const UnitLayer &layer : units.layers_of (units.slices[s])) {
      const std::uint32_t cell =
          units.has_cell (number, layer) ? rows.cell (number, layer.plane, layer.column) : kNoCell;
      for (std::uint32_t e = 0; e < layer.entry_count; e++) {
        const UnitEntry &entry = units.entries[layer.first_entry + e];
        for (std::uint32_t i = 0; i < entry.point_count; i++)
          cell_of_[units.points[entry.first_point + i].index] = cell;
      }
    }
  }
}

/* In the order of the cloud, in which neighbours follow each other and meet the same pixels. */
void
Losers::list (const DecidedFrame &frame)
{
  find_cells (frame);
  if (losers_.size () < frame.cloud.x.size ())
    losers_.resize (frame.cloud.x.size ());
  const UnitRows &rows = frame.units.rows;
  const std::uint32_t *slice_of = frame.units.slice_of.data ();
  Loser *to = losers_.data ();
  for (const PointRun &run : frame.runs) {
    const auto view = static_cast<int> (run.view);
    const auto width = static_cast<std::uint32_t> (frame.images[run.view].depth.width);
    const auto begin = static_cast<std::uint32_t> (frame.cloud.parts ()[run.view].begin);
    for (std::size_t i = run.begin; i < run.end; i++) {
      const std::uint32_t first = first_cell_[slice_of[i]];
      const std::uint32_t cell =
          first != kNoCell ? first + static_cast<std::uint32_t> (frame.column[i]) : cell_of_[i];
      if (cell == kNoCell)
        continue;
      const int winner = rows.winner (cell);
      if (winner == view || winner < 0 || rows.second (cell) == view)
        continue;
      const std::uint32_t pixel = frame.cloud.pixel[i];
      *to++ = {static_cast<std::uint32_t> (i), begin + (pixel >> 16) * width + (pixel & 0xffff),
          cell, static_cast<std::uint8_t> (run.view), static_cast<std::uint8_t> (run.body),
          static_cast<std::uint8_t> (winner)};
    }
  }
  count_ = static_cast<std::size_t> (to - losers_.data ());
}

struct Losers::CoverLoop {
  using I = Narrow::I;

  /* Where an image sees a point: the pixel to the upper left, and depth in the image's units. */
  struct Place {
    int left, top; /* on the plane; nowhere near it if the image does not see the point */
    int nearest;   /* of the four pixels round it: bit 0 the right one, bit 1 the lower one */
    float z;
  };

  Losers &losers;
  const DecidedFrame &frame;

  [[nodiscard]] Place find (const Loser &loser, std::size_t rival) const
  {
    const WorldPoints &cloud = frame.cloud;
    const float point[] = {cloud.x[loser.point], cloud.y[loser.point], cloud.z[loser.point]};
    float u, v, z;
    frame.lookups[loser.body][rival].find (point, u, v, z);
    const RangeImage &image = frame.images[rival];
    const float x = u - static_cast<float> (image.roi.x), y = v - static_cast<float> (image.roi.y);
    const bool inside = (z > 0) & (x > -1) & (y > -1) &
                        (x < static_cast<float> (image.depth.width)) &
                        (y < static_cast<float> (image.depth.height));
    if (!inside)
      return {-2, -2, 0, 0};
    const int left = static_cast<int> (x + 1) - 1, top = static_cast<int> (y + 1) - 1;
    const int nearest =
        (y - static_cast<float> (top) >= 0.5f) * 2 + (x - static_cast<float> (left) >= 0.5f);
    return {left, top, nearest, z};
  }

  /* What will be asked for at a place is mostly in no cache: losers come in the order of their own
   * view, and the winner's pixels are far from those of the last view's losers. */
  void fetch (const Place &place, std::size_t rival) const
  {
    const RangeImage &image = frame.images[rival];
    const int x = std::max (place.left, 0), y = std::max (place.top, 0);
    const int below = std::min (y + 1, image.depth.height - 1);
    if (place.left < -1 || y >= image.depth.height)
      return;
    const std::uint8_t *lost = lost_of (rival);
    const auto width = static_cast<std::size_t> (image.depth.width);
    __builtin_prefetch (image.depth.row (y) + x);
    __builtin_prefetch (image.depth.row (below) + x);
    __builtin_prefetch (lost + static_cast<std::size_t> (y) * width + x);
    __builtin_prefetch (lost + static_cast<std::size_t> (below) * width + x);
  }

  [[nodiscard]] const std::uint8_t *lost_of (std::size_t image) const
  {
    return losers.lost_.data () + frame.cloud.parts ()[image].begin;
  }

  /* What a view has in the pixel and its neighbours where it sees a point at depth z: in that pixel
   * the same surface, and in the pixels beside it none of the same surface that goes. Without
   * branches but two: what neighbours have is a coin toss along every seam. */
  [[nodiscard]] bool covers (std::size_t rival, const Place &place) const
  {
    const RangeImage &image = frame.images[rival];
    const int width = image.depth.width, height = image.depth.height;
    const std::uint8_t *lost = lost_of (rival);
    /* Most that do not cover have lost the place themselves. */
    const int column = place.left + (place.nearest & 1), row = place.top + (place.nearest >> 1);
    if (column < 0 || row < 0 || column >= width || row >= height ||
        lost[static_cast<std::size_t> (row) * width + column])
      return false;
    const int left = place.left, top = place.top;
    I depth = {}, gone = {};
    if (left >= 0 && top >= 0 && left + 1 < width && top + 1 < height) {
      const std::uint16_t *upper = image.depth.row (top) + left,
                          *lower = image.depth.row (top + 1) + left;
      const std::uint8_t *flags = lost + static_cast<std::size_t> (top) * width + left;
      depth = I{upper[0], upper[1], lower[0], lower[1]};
      gone = I{flags[0], flags[1], flags[width], flags[width + 1]};
    } else {
      for (int k = 0; k < 4; k++) {
        const int px = left + k % 2, py = top + k / 2;
        if (px < 0 || py < 0 || px >= width || py >= height)
          continue;
        depth[k] = image.depth.at (px, py);
        gone[k] = lost[static_cast<std::size_t> (py) * width + px];
      }
    }
    const Narrow::F behind = place.z - __builtin_convertvector(depth, Narrow::F);
    const I same = (depth != kInvalidDepth) & (behind <= frame.behind[rival]) &
                   (-behind <= frame.before[rival]);
    /* Where the winner's region ends the two overlap by a pixel. */
    return same[place.nearest] != 0 && !Narrow::any (same & (gone != 0));
  }

  /* @param place  where the winner sees the point: most often it is the winner who covers */
  [[nodiscard]] bool is_covered (const Loser &loser, const Place &place) const
  {
    if (covers (loser.winner, place))
      return true;
    std::uint64_t rivals = frame.units.rows.covering (loser.cell) &
                           ~(std::uint64_t{1} << loser.image) & ~(std::uint64_t{1} << loser.winner);
    for (; rivals; rivals &= rivals - 1) {
      const auto rival = static_cast<std::size_t> (std::countr_zero (rivals));
      if (covers (rival, find (loser, rival)))
        return true;
    }
    return false;
  }

  void run () const
  {
    constexpr std::size_t kAhead = 16;
    std::array<Place, kAhead> places;
    Loser *all = losers.losers_.data ();
    const std::size_t count = losers.count_;
    const auto look = [&] (std::size_t i) {
      if (i >= count)
        return;
      places[i % kAhead] = find (all[i], all[i].winner);
      fetch (places[i % kAhead], all[i].winner);
    };
    for (std::size_t i = 0; i < kAhead; i++)
      look (i);
    std::size_t left = 0;
    for (std::size_t i = 0; i < count; i++) {
      const Loser loser = all[i];
      const Place place = places[i % kAhead];
      look (i + kAhead);
      const bool goes = is_covered (loser, place);
      losers.lost_[loser.place] = goes;
      all[left] = loser;
      left += goes;
    }
    losers.count_ = left;
  }

  [[RANGECAST_CYLINDER_ANY]] void run_any () const { run (); }
  [[RANGECAST_CYLINDER_AVX2]] void run_avx2 () const { run (); }
};

void
Losers::keep_uncovered (const DecidedFrame &frame)
{
  lost_.assign (frame.cloud.x.size (), 0);
  for (std::size_t i = 0; i < count_; i++)
    lost_[losers_[i].place] = 1;
  const CoverLoop loop{*this, frame};
  cpu_level () >= CpuLevel::kAvx2 ? loop.run_avx2 () : loop.run_any ();
}

void
Losers::clear (const DecidedFrame &frame) const
{
  for (std::size_t i = 0; i < count_; i++) {
    const std::uint32_t pixel = frame.cloud.pixel[losers_[i].point];
    frame.images[losers_[i].image].depth.at (
        static_cast<int> (pixel & 0xffff), static_cast<int> (pixel >> 16)) = kInvalidDepth;
  }
}

} // namespace rangecast
