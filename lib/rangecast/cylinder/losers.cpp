/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "losers.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

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
      for (std::uint32_t i = 0; i < layer.point_count; i++)
        cell_of_[units.points[layer.first_point + i].index] = cell;
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

/* Some losers at a time. What a view has where it sees a point is, in full: in the pixel on which
 * that falls the same surface, and in the pixels beside it (of the four round the place) none of
 * the same surface that goes: where two regions meet they overlap by a pixel. */
template <typename L> struct Losers::CoverLoop {
  using F = typename L::F;
  using I = typename L::I;
  using U = typename L::U;
  static constexpr int kLanes = L::kLanes;

  Losers &losers;
  const DecidedFrame &frame;

  /* Consecutive losers that one view won, and what it has there. Of each the four pixels round the
   * place are four bits: upper left, upper right, lower left, lower right. */
  struct Batch {
    int size = 0;
    float x[kLanes], y[kLanes], z[kLanes];      /* the points */
    std::uint32_t upper[kLanes], lower[kLanes]; /* depths of two pixels each */
    std::int32_t left[kLanes], top[kLanes];     /* the first pixel, on the plane */
    std::int32_t inside[kLanes];                /* all four are on the plane */
    std::int32_t border[kLanes];                /* some are */
    std::int32_t same[kLanes]; /* 1: the same surface; all 0 if the pixel it falls on is not */
  };

  /* Bit 0: whether that place is a loser's; bit 1: the next one. */
  [[nodiscard]] std::uint32_t lost_at (std::size_t place) const
  {
    std::uint16_t bits;
    std::memcpy (&bits, losers.lost_.data () + place / 8, sizeof bits);
    return static_cast<std::uint32_t> (bits) >> place % 8;
  }

  void begin (Batch &batch, const Loser *first, std::size_t most) const
  {
    const auto alike = [first] (const Loser &other) {
      return other.winner == first->winner && other.body == first->body;
    };
    const WorldPoints &cloud = frame.cloud;
    const std::size_t end = std::min<std::size_t> (most, kLanes);
    std::size_t size = 1;
    while (size < end && alike (first[size]))
      size++;
    batch.size = static_cast<int> (size);
    const std::uint32_t point = first->point;
    if (first[size - 1].point - point == size - 1 && point + kLanes <= cloud.x.size ()) {
      L::at (batch.x) = L::at (cloud.x.data () + point);
      L::at (batch.y) = L::at (cloud.y.data () + point);
      L::at (batch.z) = L::at (cloud.z.data () + point);
      return;
    }
    for (std::size_t i = 0; i < kLanes; i++) {
      const std::uint32_t other = first[i < size ? i : 0].point;
      batch.x[i] = cloud.x[other];
      batch.y[i] = cloud.y[other];
      batch.z[i] = cloud.z[other];
    }
  }

  void find_places (Batch &batch, const Loser &first) const
  {
    const float (&rows)[3][4] = frame.lookups[first.body][first.winner].rows;
    const RangeImage &image = frame.images[first.winner];
    const F px = L::at (batch.x), py = L::at (batch.y), pz = L::at (batch.z);
    F depth = rows[2][0] * px + rows[2][1] * py + rows[2][2] * pz + rows[2][3];
    F x = (rows[0][0] * px + rows[0][1] * py + rows[0][2] * pz + rows[0][3]) / depth;
    F y = (rows[1][0] * px + rows[1][1] * py + rows[1][2] * pz + rows[1][3]) / depth;
    x -= static_cast<float> (image.roi.x);
    y -= static_cast<float> (image.roi.y);
    const I seen = (depth > 0) & (x > -1) & (y > -1) &
                   (x < static_cast<float> (image.depth.width)) &
                   (y < static_cast<float> (image.depth.height));
    L::keep_where (x, seen);
    L::keep_where (y, seen);
    const I left = __builtin_convertvector(x + 1, I) - 1,
            top = __builtin_convertvector(y + 1, I) - 1;
    const I inside = seen & (left >= 0) & (top >= 0) & (left + 1 < image.depth.width) &
                     (top + 1 < image.depth.height);
    L::at (batch.left) = left;
    L::at (batch.top) = top;
    L::at (batch.inside) = inside;
    L::at (batch.border) = seen & ~inside;
    load_depths (batch, image);
    compare_depths (batch, x, y, depth, first.winner);
  }

  void load_depths (Batch &batch, const RangeImage &image) const
  {
    for (int i = 0; i < kLanes; i++) {
      batch.upper[i] = batch.lower[i] = kInvalidDepth;
      if (!batch.inside[i])
        continue;
      std::memcpy (&batch.upper[i], image.depth.row (batch.top[i]) + batch.left[i], 4);
      std::memcpy (&batch.lower[i], image.depth.row (batch.top[i] + 1) + batch.left[i], 4);
    }
  }

  void compare_depths (Batch &batch, const F &x, const F &y, const F &z, std::size_t rival) const
  {
    const U upper = L::at (batch.upper), lower = L::at (batch.lower);
    const U depths[] = {upper & 0xffff, upper >> 16, lower & 0xffff, lower >> 16};
    I same[4];
    for (int k = 0; k < 4; k++) {
      const F behind = z - __builtin_convertvector((I)depths[k], F);
      same[k] = ((I)depths[k] != kInvalidDepth) & (behind <= frame.behind[rival]) &
                (-behind <= frame.before[rival]);
    }
    const I right = x - __builtin_convertvector(L::at (batch.left), F) >= 0.5f,
            below = y - __builtin_convertvector(L::at (batch.top), F) >= 0.5f;
    const I above_it = right ? same[1] : same[0], below_it = right ? same[3] : same[2];
    const I bits = (same[0] & 1) | (same[1] & 2) | (same[2] & 4) | (same[3] & 8);
    L::at (batch.same) = bits & (below ? below_it : above_it);
  }

  /* Whether the winner covers the batch's loser i. */
  [[nodiscard]] bool covers (const Batch &batch, int i, const Loser &loser) const
  {
    if (batch.border[i]) {
      const std::uint32_t of_winner = std::uint32_t{1} << loser.winner % kLanes;
      return covers_any (loser, loser.winner / kLanes * kLanes, of_winner, false);
    }
    if (batch.same[i] == 0)
      return false;
    const auto width = static_cast<std::size_t> (frame.images[loser.winner].depth.width);
    const std::size_t upper = frame.cloud.parts ()[loser.winner].begin +
                              static_cast<std::size_t> (batch.top[i]) * width +
                              static_cast<std::size_t> (batch.left[i]);
    const std::uint32_t lost = (lost_at (upper) & 3) | (lost_at (upper + width) & 3) << 2;
    return !(lost & static_cast<std::uint32_t> (batch.same[i]));
  }

  /* Whether an image covers a loser that it sees at pixel (x, y) of its plane and depth z; any part
   * of what is round it may lie beyond the plane.
   * @param scrap  the pixels beside the one it falls on do not matter */
  [[nodiscard]] bool covers_at (std::size_t rival, float x, float y, float z, bool scrap) const
  {
    const RangeImage &image = frame.images[rival];
    const int width = image.depth.width, height = image.depth.height;
    const int left = static_cast<int> (x + 1) - 1, top = static_cast<int> (y + 1) - 1;
    const int nearest = (y - static_cast<float> (top) >= 0.5f ? 2 : 0) +
                        (x - static_cast<float> (left) >= 0.5f ? 1 : 0);
    const std::size_t begin = frame.cloud.parts ()[rival].begin;
    const auto is_lost = [&] (int k) {
      return lost_at (begin + static_cast<std::size_t> (top + k / 2) * width +
                      static_cast<std::size_t> (left + k % 2)) &
             1;
    };
    const auto is_on = [&] (int k) {
      return left + k % 2 >= 0 && top + k / 2 >= 0 && left + k % 2 < width && top + k / 2 < height;
    };
    /* Most that do not cover have lost the place themselves. */
    if (!is_on (nearest) || is_lost (nearest))
      return false;
    for (int k : {nearest, nearest ^ 1, nearest ^ 2, nearest ^ 3}) {
      if (!is_on (k))
        continue;
      const std::uint16_t depth = image.depth.at (left + k % 2, top + k / 2);
      const float behind = z - static_cast<float> (depth);
      const bool same =
          depth != kInvalidDepth && behind <= frame.behind[rival] && -behind <= frame.before[rival];
      if (k == nearest ? !same : same && is_lost (k))
        return false;
      if (scrap)
        return true;
    }
    return true;
  }

  /* Whether some of kLanes images from `first` on cover a loser.
   * @param which  bit i: image first + i is asked
   * @param scrap  as for covers_at() */
  [[nodiscard]] bool covers_any (
      const Loser &loser, std::size_t first, std::uint32_t which, bool scrap) const
  {
    const WorldPoints &cloud = frame.cloud;
    const float px = cloud.x[loser.point], py = cloud.y[loser.point], pz = cloud.z[loser.point];
    const Lookups &all = losers.lookups_[loser.body];
    const auto row = [&] (int k, F &to) {
      to = L::at (&all.rows[k][0][first]) * px + L::at (&all.rows[k][1][first]) * py +
           L::at (&all.rows[k][2][first]) * pz + L::at (&all.rows[k][3][first]);
    };
    F x, y, z;
    row (0, x);
    row (1, y);
    row (2, z);
    x = x / z - L::at (&losers.boxes_[0][first]);
    y = y / z - L::at (&losers.boxes_[1][first]);
    std::int32_t seen[kLanes];
    L::at (seen) = (z > 0) & (x > -1) & (y > -1) & (x < L::at (&losers.boxes_[2][first])) &
                   (y < L::at (&losers.boxes_[3][first]));
    float u[kLanes], v[kLanes], depth[kLanes];
    L::at (u) = x;
    L::at (v) = y;
    L::at (depth) = z;
    for (; which; which &= which - 1) {
      const int i = std::countr_zero (which);
      if (seen[i] && covers_at (first + static_cast<std::size_t> (i), u[i], v[i], depth[i], scrap))
        return true;
    }
    return false;
  }

  /* Whether some view covers a loser.
   * @param but  a view that is not asked */
  [[nodiscard]] bool covers_one_of (const Loser &loser, std::uint64_t but, bool scrap) const
  {
    const std::uint64_t rivals =
        frame.units.rows.covering (loser.cell) & ~(std::uint64_t{1} << loser.image) & ~but;
    constexpr std::uint64_t kAll = (1u << kLanes) - 1;
    for (std::size_t first = 0; first < kMaxViews && rivals >> first; first += kLanes) {
      const auto which = static_cast<std::uint32_t> (rivals >> first & kAll);
      if (which && covers_any (loser, first, which, scrap))
        return true;
    }
    return false;
  }

  /* Whether a loser that stays is one of kScrap pixels at most that a row of its view has there. */
  [[nodiscard]] bool is_scrap (const Loser &loser) const
  {
    constexpr int kScrap = 2;
    const RangeImage &image = frame.images[loser.image];
    const int x = static_cast<int> (frame.cloud.pixel[loser.point] & 0xffff),
              y = static_cast<int> (frame.cloud.pixel[loser.point] >> 16);
    const std::uint16_t *depth = image.depth.row (y);
    int pixels = 1;
    for (const int step : {-1, 1})
      for (int u = x + step; u >= 0 && u < image.depth.width && pixels <= kScrap; u += step) {
        if (depth[u] == kInvalidDepth ||
            (lost_at (loser.place + static_cast<std::size_t> (u) - static_cast<std::size_t> (x)) &
                1))
          break;
        pixels++;
      }
    return pixels <= kScrap;
  }

  void set_lost (std::uint32_t place, bool lost) const
  {
    const auto bit = static_cast<std::uint8_t> (1 << place % 8);
    std::uint8_t &bits = losers.lost_[place / 8];
    bits = static_cast<std::uint8_t> (lost ? bits | bit : bits & ~bit);
  }

  void find_uncovered () const
  {
    const Loser *all = losers.losers_.data ();
    Batch batch;
    for (std::size_t done = 0; done < losers.count_;
         done += static_cast<std::size_t> (batch.size)) {
      begin (batch, all + done, losers.count_ - done);
      find_places (batch, all[done]);
      for (int i = 0; i < batch.size; i++) {
        const Loser &loser = all[done + static_cast<std::size_t> (i)];
        if (!covers (batch, i, loser) && /* most often it does */
            !covers_one_of (loser, std::uint64_t{1} << loser.winner, false))
          set_lost (loser.place, false);
      }
    }
  }

  /* Of what stays, scraps are no surface that could overlap with another one: points that strips
   * would draw alone. They go where another view has the place itself. (To ask again about all that
   * stay, of which some were kept for a pixel beside that stays now, too, makes half a percent
   * fewer double units of eight views, and takes half as long again as asking once.) */
  void take_off_list () const
  {
    Loser *all = losers.losers_.data ();
    std::size_t left = 0;
    for (std::size_t i = 0; i < losers.count_; i++) {
      const Loser loser = all[i];
      if (!(lost_at (loser.place) & 1)) {
        if (!is_scrap (loser) || !covers_one_of (loser, 0, true))
          continue;
        set_lost (loser.place, true);
      }
      all[left++] = loser;
    }
    losers.count_ = left;
  }

  void run () const
  {
    find_uncovered ();
    take_off_list ();
  }
};

/* What each processor runs. */
struct Losers::Twins {
  [[RANGECAST_CYLINDER_ANY]] static void run (const CoverLoop<Narrow> &loop) { loop.run (); }
  [[RANGECAST_CYLINDER_AVX2]] static void run (const CoverLoop<Wide> &loop) { loop.run (); }
};

/* What images need to look points up, one array a number. */
void
Losers::take_lookups (const DecidedFrame &frame)
{
  for (std::size_t i = 0; i < frame.images.size (); i++) {
    const RangeImage &image = frame.images[i];
    const int box[] = {image.roi.x, image.roi.y, image.depth.width, image.depth.height};
    for (int k = 0; k < 4; k++)
      boxes_[k][i] = static_cast<float> (box[k]);
    for (int body = 0; body < kMaxBodies; body++)
      for (int k = 0; k < 12; k++)
        lookups_[body].rows[k / 4][k % 4][i] = frame.lookups[body][i].rows[k / 4][k % 4];
  }
}

void
Losers::keep_uncovered (const DecidedFrame &frame)
{
  take_lookups (frame);
  lost_.assign (frame.cloud.x.size () / 8 + 3, 0); /* read two bytes at a time */
  for (std::size_t i = 0; i < count_; i++)
    lost_[losers_[i].place / 8] |= static_cast<std::uint8_t> (1 << losers_[i].place % 8);
  cpu_level () >= CpuLevel::kAvx2 ? Twins::run (CoverLoop<Wide>{*this, frame})
                                  : Twins::run (CoverLoop<Narrow>{*this, frame});
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
