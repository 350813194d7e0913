/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "cell_rows.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "../base/parallel.hpp"
#include "../base/simd.hpp"

namespace rangecast {

void
CellRows::begin (int columns, double slice_height_m, int images, std::size_t slices)
{
  slice_height_m_ = slice_height_m;
  /* This frame's memory is the next one's for what was: both have to be large enough. */
  slices_.reserve (slices);
  old_slices_.reserve (slices);
  const int rounded = (columns + kMaxLanes - 1) / kMaxLanes * kMaxLanes;
  if (columns != columns_) {
    for (int k = 0; k < 2; k++)
      circle_tangent_[k].resize (static_cast<std::size_t> (rounded));
    for (int c = 0; c < rounded; c++) {
      const double phi = 2 * M_PI * (c + 0.5) / columns;
      circle_tangent_[0][c] = static_cast<float> (-std::sin (phi));
      circle_tangent_[1][c] = static_cast<float> (std::cos (phi));
    }
    columns_ = columns;
  }
  width_ = static_cast<std::uint32_t> (rounded + 2 * kPad);
  words_ = images > 32 ? 2 : 1;
  slices_.clear ();
  rows_ = 0;
}

void
CellRows::add_slice (int cluster, int number, int planes)
{
  slices_.push_back ({rows_, planes, cluster, number});
  rows_ += static_cast<std::uint32_t> (planes);
}

/* Grows in large steps: how many planes slices need changes a little from frame to frame. */
template <typename Vector>
static void
grow (Vector &vector, std::size_t size)
{
  if (vector.size () < size)
    vector.resize (size + size / 4);
}

void
CellRows::make_room ()
{
  const std::size_t nodes = std::size_t{rows_} * width_;
  grow (radius_, nodes);
  grow (old_radius_, nodes);
  grow (old_first_, nodes);
  for (auto *plane : {&tangent_[0], &tangent_[1], &sum_[0], &sum_[1]})
    grow (*plane, nodes);
  for (auto *plane : {&first_, &next_, &held_})
    grow (*plane, nodes);
  for (int w = 0; w < words_; w++) {
    grow (views_[w], nodes);
    grow (covering_[w], nodes);
    std::fill_n (views_[w].begin (), nodes, 0);
  }
  std::fill_n (radius_.begin (), nodes, kNowhere);
  for (auto &plane : tangent_)
    std::fill_n (plane.begin (), nodes, 0.f);
}

/* ---- loops over eight columns ---- */

template <typename L> struct CellRows::Loops {
  using F = typename L::F;
  using I = typename L::I;
  using U = typename L::U;
  static constexpr int kLanes = L::kLanes;

  CellRows &rows;
  const RowRules &rules;

  /* Columns of the other end beside both ends of a row. */
  template <typename Number> void wrap (Plane<Number> &plane, std::uint32_t row) const
  {
    Number *first = plane.data () + std::size_t{row} * rows.width_ + kPad;
    std::copy_n (first + rows.columns_ - kPad, kPad, first - kPad);
    std::copy_n (first, kPad, first + rows.columns_);
  }

  /* What a row's block adds up of another row of its slice. */
  struct Sum {
    F x, z;
    U left[2], right[2];
  };

  template <int kWords> void add_side (Sum &sum, U (&seen)[2], const I &in, std::size_t at) const
  {
    F x = L::at (&rows.tangent_[0][at]), z = L::at (&rows.tangent_[1][at]);
    L::keep_where (x, in);
    L::keep_where (z, in);
    sum.x += x;
    sum.z += z;
    for (int w = 0; w < kWords; w++)
      seen[w] |= L::at (&rows.views_[w][at]) & (U)in;
  }

  template <int kWords> void along_row (std::uint32_t row, const Slice &slice) const
  {
    const std::size_t to = std::size_t{row} * rows.width_ + kPad;
    for (int c = 0; c < rows.columns_; c += kLanes) {
      const std::size_t here = to + static_cast<std::size_t> (c);
      const F radius = L::at (&rows.radius_[here]);
      Sum sum = {L::at (&rows.tangent_[0][here]), L::at (&rows.tangent_[1][here]), {}, {}};
      if (L::any (radius < kNowhere)) {
        const F least = 1e-6f + F{};
        const F reach = rules.smoothing_columns / (radius > least ? radius : least);
        for (int d = 1; static_cast<float> (d) <= rules.most_columns; d++) {
          const I near = reach >= static_cast<float> (d);
          if (!L::any (near))
            break;
          for (int q = 0; q < slice.planes; q++) {
            const std::size_t other = std::size_t{slice.first_row + q} * rows.width_ + kPad + c;
            F left = L::at (&rows.radius_[other - d]) - radius;
            F right = L::at (&rows.radius_[other + d]) - radius;
            L::make_positive (left);
            L::make_positive (right);
            add_side<kWords> (sum, sum.right, near & (right <= rules.layer_gap), other + d);
            add_side<kWords> (sum, sum.left, near & (left <= rules.layer_gap), other - d);
          }
        }
      }
      L::at (&rows.sum_[0][here]) = sum.x;
      L::at (&rows.sum_[1][here]) = sum.z;
      for (int w = 0; w < kWords; w++)
        L::at (&rows.covering_[w][here]) =
            L::at (&rows.views_[w][here]) | (sum.left[w] & sum.right[w]);
    }
  }

  void along (int number) const
  {
    const Slice &slice = rows.slices_[number];
    for (int p = 0; p < slice.planes; p++) {
      const std::uint32_t row = slice.first_row + static_cast<std::uint32_t> (p);
      wrap (rows.radius_, row);
      wrap (rows.tangent_[0], row);
      wrap (rows.tangent_[1], row);
      for (int w = 0; w < rows.words_; w++)
        wrap (rows.views_[w], row);
    }
    for (int p = 0; p < slice.planes; p++)
      if (rows.words_ == 1)
        along_row<1> (slice.first_row + static_cast<std::uint32_t> (p), slice);
      else
        along_row<2> (slice.first_row + static_cast<std::uint32_t> (p), slice);
  }

  /* Adds, of each column of another slice, the layer whose radius is nearest, within the gap. */
  template <int kWords>
  void add_nearest (
      const Slice &other, std::size_t column, const F &radius, F &x, F &z, U (&seen)[2]) const
  {
    F least = rules.layer_gap + F{}, best_x = {}, best_z = {};
    U best[2] = {};
    for (int q = 0; q < other.planes; q++) {
      const std::size_t at = std::size_t{other.first_row + q} * rows.width_ + kPad + column;
      F d = L::at (&rows.radius_[at]) - radius;
      L::make_positive (d);
      const I take = d <= least;
      least = take ? d : least;
      best_x = take ? L::at (&rows.sum_[0][at]) : best_x;
      best_z = take ? L::at (&rows.sum_[1][at]) : best_z;
      for (int w = 0; w < kWords; w++)
        best[w] = take ? L::at (&rows.views_[w][at]) : best[w];
    }
    x += best_x;
    z += best_z;
    for (int w = 0; w < kWords; w++)
      seen[w] |= best[w];
  }

  template <int kWords> void across_row (std::uint32_t row, int number) const
  {
    const Slice &slice = rows.slices_[number];
    const int last = static_cast<int> (rows.slices_.size ()) - 1;
    const int bottom = std::max (0, number - rules.smoothing_slices),
              top = std::min (last, number + rules.smoothing_slices);
    for (int c = 0; c < rows.columns_; c += kLanes) {
      const std::size_t here = std::size_t{row} * rows.width_ + kPad + c;
      const F radius = L::at (&rows.radius_[here]);
      if (!L::any (radius < kNowhere)) /* nobody looks at what is in an empty node */
        continue;
      F x = L::at (&rows.sum_[0][here]), z = L::at (&rows.sum_[1][here]);
      U below[2] = {}, above[2] = {};
      for (int s = bottom; s <= top; s++)
        if (s != number && rows.slices_[s].cluster == slice.cluster)
          add_nearest<kWords> (rows.slices_[s], static_cast<std::size_t> (c), radius, x, z,
              s < number ? below : above);
      normalise (x, z, c);
      L::at (&rows.tangent_[0][here]) = x;
      L::at (&rows.tangent_[1][here]) = z;
      const I full = radius < kNowhere;
      for (int w = 0; w < kWords; w++) {
        U &covering = L::at (&rows.covering_[w][here]);
        covering = (covering | (below[w] & above[w])) & (U)full;
      }
    }
  }

  /* Where no tangent is known the wall's own stands in. */
  void normalise (F &x, F &z, int column) const
  {
    F length = x * x + z * z;
    L::make_root (length);
    const I known = length > 1e-6f;
    const F by = known ? length : 1.f + F{};
    x = known ? x / by : L::at (&rows.circle_tangent_[0][column]);
    z = known ? z / by : L::at (&rows.circle_tangent_[1][column]);
  }

  void across (int number) const
  {
    const Slice &slice = rows.slices_[number];
    for (int p = 0; p < slice.planes; p++)
      if (rows.words_ == 1)
        across_row<1> (slice.first_row + static_cast<std::uint32_t> (p), number);
      else
        across_row<2> (slice.first_row + static_cast<std::uint32_t> (p), number);
  }

  /* ---- decisions ---- */

  /* Who held each node of a row: the winner of the layer whose radius was nearest. */
  void find_held (std::uint32_t row, const Slice &slice) const
  {
    const Slice *old = rows.old_slice (slice);
    const std::size_t to = std::size_t{row} * rows.width_ + kPad;
    for (int c = 0; c < rows.columns_; c += kLanes) {
      const F radius = L::at (&rows.radius_[to + c]);
      F least = rules.layer_gap + F{};
      I held = I{} - 1;
      for (int q = 0; old && q < old->planes; q++) {
        const std::size_t at = std::size_t{old->first_row + q} * rows.old_width_ + kPad + c;
        F d = L::at (&rows.old_radius_[at]) - radius;
        L::make_positive (d);
        const I take = d <= least;
        least = take ? d : least;
        held = take ? L::at (&rows.old_first_[at]) : held;
      }
      L::at (&rows.held_[to + c]) = held;
    }
  }

  /* A cell that has no point for a frame does not forget who held it. */
  void carry_over (const Slice &slice) const
  {
    const Slice *old = rows.old_slice (slice);
    const int planes = old ? std::min (slice.planes, old->planes) : 0;
    for (int p = 0; p < planes; p++) {
      const std::size_t to = std::size_t{slice.first_row + p} * rows.width_,
                        from = std::size_t{old->first_row + p} * rows.old_width_;
      for (std::uint32_t c = 0; c < rows.width_; c += kLanes) {
        F &radius = L::at (&rows.radius_[to + c]);
        I &first = L::at (&rows.first_[to + c]);
        const I empty = radius >= kNowhere;
        radius = empty ? L::at (&rows.old_radius_[from + c]) : radius;
        first = empty ? L::at (&rows.old_first_[from + c]) : first;
      }
    }
  }

  /* Winners of up to 4 neighbours of some nodes, of all planes; -1 where there is none. */
  struct Neighbours {
    I winners[4 * kPlanes];
    int count = 0;
  };

  void add_neighbours (
      Neighbours &all, const Slice &slice, std::ptrdiff_t column, const F &radius) const
  {
    for (int q = 0; q < slice.planes; q++) {
      const std::size_t at =
          std::size_t{slice.first_row + q} * rows.width_ + static_cast<std::size_t> (kPad + column);
      F d = L::at (&rows.radius_[at]) - radius;
      L::make_positive (d);
      const I near = d <= rules.layer_gap;
      all.winners[all.count++] = L::at (&rows.first_[at]) | ~near;
    }
  }

  void find_neighbours (Neighbours &all, int number, int column, const F &radius) const
  {
    const Slice &slice = rows.slices_[number];
    add_neighbours (all, slice, column - 1, radius);
    add_neighbours (all, slice, column + 1, radius);
    for (int other : {number - 1, number + 1})
      if (other >= 0 && other < static_cast<int> (rows.slices_.size ()) &&
          rows.slices_[other].cluster == slice.cluster)
        add_neighbours (all, rows.slices_[other], column, radius);
  }

  /* -1 where that view covers the node. */
  void covers (I &in, std::size_t here, int view) const
  {
    const U bits = L::at (&rows.covering_[view >> 5][here]);
    in = (I)bits << (31 - (view & 31)) >> 31;
  }

  struct Best {
    F score;
    I view;
  };

  void compare_view (Best &best, std::size_t here, int view, const std::array<float, 2> &optical,
      const Neighbours &around) const
  {
    I in;
    covers (in, here, view);
    const F facing =
        L::at (&rows.tangent_[1][here]) * optical[0] - L::at (&rows.tangent_[0][here]) * optical[1];
    const I is_held = L::at (&rows.held_[here]) == view;
    F score = facing, bonus = rules.hysteresis + F{};
    L::make_positive (score);
    L::keep_where (bonus, is_held);
    I agreeing = {};
    for (int k = 0; k < around.count; k++)
      agreeing -= around.winners[k] == view;
    score += bonus + __builtin_convertvector(agreeing, F) * (rules.agreement / 4);
    const I take = in & (score > best.score);
    best.score = take ? score : best.score;
    best.view = take ? view + I{} : best.view;
  }

  void decide_block (std::size_t here, const Slice &slice, const Neighbours &around) const
  {
    std::uint64_t views = 0;
    for (int w = 0; w < rows.words_; w++)
      views |= std::uint64_t{L::any_of (L::at (&rows.covering_[w][here]))} << (32 * w);
    if (std::has_single_bit (views)) { /* nobody else sees this */
      const int view = std::countr_zero (views);
      I in;
      covers (in, here, view);
      L::at (&rows.next_[here]) = in ? view + I{} : I{} - 1;
      return;
    }
    Best best = {F{} - 1, I{} - 1};
    for (std::uint64_t rest = views; rest; rest &= rest - 1) {
      const int view = std::countr_zero (rest);
      compare_view (best, here, view, rules.optical[slice.cluster][view], around);
    }
    L::at (&rows.next_[here]) = best.view; /* not yet: the next columns ask for this one's */
  }

  /* Whether some of a block's neighbours have another winner. If not, asking them changes nothing.
   */
  bool differ (std::size_t here, const Neighbours &around) const
  {
    const I &own = L::at (&rows.first_[here]);
    I other = {};
    for (int k = 0; k < around.count; k++)
      other |= (around.winners[k] != own) & (around.winners[k] >= 0);
    return L::any (other);
  }

  void decide_row (int number, int plane, Pass pass) const
  {
    const Slice &slice = rows.slices_[number];
    const std::uint32_t row = slice.first_row + static_cast<std::uint32_t> (plane);
    Neighbours around;
    for (int c = 0; c < rows.columns_; c += kLanes) {
      const std::size_t here = std::size_t{row} * rows.width_ + kPad + c;
      const F radius = L::at (&rows.radius_[here]);
      if (!L::any (radius < kNowhere)) {
        L::at (&rows.next_[here]) = I{} - 1;
        continue;
      }
      if (pass == Pass::kAskNeighbours) {
        around.count = 0;
        find_neighbours (around, number, c, radius);
        if (!differ (here, around)) {
          L::at (&rows.next_[here]) = L::at (&rows.first_[here]);
          continue;
        }
      }
      decide_block (here, slice, around);
    }
    const std::size_t begin = std::size_t{row} * rows.width_ + kPad;
    std::copy_n (rows.next_.begin () + begin, rows.columns_, rows.first_.begin () + begin);
    wrap (rows.first_, row);
  }

  void decide (int number, Pass pass) const
  {
    const Slice &slice = rows.slices_[number];
    for (int p = 0; p < slice.planes; p++) {
      if (pass == Pass::kAlone)
        find_held (slice.first_row + static_cast<std::uint32_t> (p), slice);
      decide_row (number, p, pass);
    }
  }
};

void
CellRows::sum_along (const RowRules &rules, int slice)
{
  for_this_cpu ([&]<typename L> (L) { Loops<L>{*this, rules}.along (slice); });
}

void
CellRows::sum_across (const RowRules &rules, int slice)
{
  for_this_cpu ([&]<typename L> (L) { Loops<L>{*this, rules}.across (slice); });
}

/* In a sweep every other slice is decided anew, then the rest: what a slice asks is then at rest
 * while it asks, with any number of threads, and two neighbours cannot swap for ever. */
RowCounts
CellRows::decide (const RowRules &rules, int threads)
{
  const auto decide_slice = [&] (std::size_t s, Pass pass) {
    for_this_cpu ([&]<typename L> (L) {
      Loops<L>{*this, rules}.decide (static_cast<int> (s), pass);
    });
  };
  const std::size_t count = slices_.size ();
  in_parallel (count, threads, [&] (std::size_t s) { decide_slice (s, Pass::kAlone); });
  for (int sweep = 0; sweep < kSweeps && rules.agreement > 0; sweep++)
    for (std::size_t odd : {0, 1})
      in_parallel ((count + 1 - odd) / 2, threads,
          [&] (std::size_t s) { decide_slice (2 * s + odd, Pass::kAskNeighbours); });
  RowCounts all;
  for (const Slice &slice : slices_)
    count_slice (slice, all);
  return all;
}

/* The slice of the frame before that has the same place; null if there is none. */
const CellRows::Slice *
CellRows::old_slice (const Slice &slice) const
{
  const std::uint32_t begin = old_begin_[slice.cluster], end = old_begin_[slice.cluster + 1];
  if (begin == end || old_columns_ != columns_ || old_slice_height_m_ != slice_height_m_)
    return nullptr;
  const std::int64_t at = std::int64_t{slice.number} - old_slices_[begin].number;
  return at < 0 || at >= std::int64_t{end} - begin ? nullptr : &old_slices_[begin + at];
}

void
CellRows::count_slice (const Slice &slice, RowCounts &counts) const
{
  for (int p = 0; p < slice.planes; p++) {
    const std::size_t row = std::size_t{slice.first_row + p} * width_ + kPad;
    const std::int32_t *first = &first_[row], *held = &held_[row];
    std::uint32_t both = 0, changed = 0;
    for (int c = 0; c < columns_; c++) {
      const bool known = (first[c] >= 0) & (held[c] >= 0);
      both += known;
      changed += known & (first[c] != held[c]);
    }
    counts.held += both;
    counts.changed += changed;
  }
}

/* ---- from frame to frame ---- */

void
CellRows::remember (const RowRules &rules, const std::array<int, kMaxViews> &ids)
{
  for (const Slice &slice : slices_)
    for_this_cpu ([&]<typename L> (L) { Loops<L>{*this, rules}.carry_over (slice); });
  std::swap (radius_, old_radius_);
  std::swap (first_, old_first_);
  std::swap (slices_, old_slices_);
  old_begin_.fill (0);
  for (const Slice &slice : old_slices_)
    old_begin_[slice.cluster + 1]++;
  for (int cluster = 0; cluster < kMaxClusters; cluster++)
    old_begin_[cluster + 1] += old_begin_[cluster];
  old_width_ = width_;
  old_columns_ = columns_;
  old_slice_height_m_ = slice_height_m_;
  old_ids_ = ids;
  old_images_ = rules.images;
}

void
CellRows::recall (const std::array<int, kMaxViews> &ids, int images)
{
  std::array<std::int32_t, kMaxViews> now;
  bool same = true;
  for (int old = 0; old < old_images_; old++) {
    const auto found = std::find (ids.begin (), ids.begin () + images, old_ids_[old]);
    now[old] = found == ids.begin () + images ? -1 : static_cast<int> (found - ids.begin ());
    same &= now[old] == old;
  }
  if (same)
    return;
  for (std::int32_t &view : old_first_)
    view = view < 0 || view >= old_images_ ? -1 : now[view];
  old_ids_ = ids;
  old_images_ = images;
}

int
CellRows::old_winner (int slice, int column) const
{
  if (slice < 0 || slice >= old_slices () || column < 0 || column >= old_columns_)
    return -1;
  const Slice &old = old_slices_[slice];
  for (int p = old.planes - 1; p >= 0; p--) {
    const std::size_t row = old.first_row + static_cast<std::uint32_t> (p);
    const int image = next_[row * old_width_ + kPad + static_cast<std::size_t> (column)];
    if (image >= 0 && image < old_images_)
      return old_ids_[image];
  }
  return -1;
}

void
CellRows::forget ()
{
  old_slices_.clear ();
  old_begin_.fill (0);
}

} // namespace rangecast
