/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The loops of cell_rows.cpp over the nodes of one row, some columns at a time: sums over the
 * neighbourhood, and the choice of a winner. A node's winner is, of the views that cover it, the
 * one with the largest sum of |N . a| (N: normal of the summed tangent, a: the view's optical
 * axis), a bonus if it won the node in the frame before (hysteresis), and one for each neighbour
 * that it has won (agreement). */
#pragma once

#include <bit>

#include "../base/simd.hpp"
#include "cell_rows.hpp"

namespace rangecast {

template <typename L> struct CellRows::RowLoops {
  using F = typename L::F;
  using I = typename L::I;
  using U = typename L::U;
  static constexpr int kLanes = L::kLanes;

  CellRows &rows;
  const RowRules &rules;

  /* Tangents, and views left and right of a block of a row. */
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
      if (L::any (radius < kNoRadius)) {
        const F tiny = 1e-6f + F{};
        const F reach = rules.smoothing_columns / (radius > tiny ? radius : tiny);
        for (int d = 1; static_cast<float> (d) <= rules.max_columns; d++) {
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

  /* Adds, of each column of another slice, the layer whose radius is nearest, within the gap. */
  template <int kWords>
  void add_nearest (
      const Slice &other, std::size_t column, const F &radius, F &x, F &z, U (&seen)[2]) const
  {
    F nearest = rules.layer_gap + F{}, best_x = {}, best_z = {};
    U best[2] = {};
    for (int q = 0; q < other.planes; q++) {
      const std::size_t at = std::size_t{other.first_row + q} * rows.width_ + kPad + column;
      F d = L::at (&rows.radius_[at]) - radius;
      L::make_positive (d);
      const I nearer = d <= nearest;
      nearest = nearer ? d : nearest;
      best_x = nearer ? L::at (&rows.sum_[0][at]) : best_x;
      best_z = nearer ? L::at (&rows.sum_[1][at]) : best_z;
      for (int w = 0; w < kWords; w++)
        best[w] = nearer ? L::at (&rows.views_[w][at]) : best[w];
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
      if (!L::any (radius < kNoRadius)) /* empty nodes are not read */
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
      const I full = radius < kNoRadius;
      for (int w = 0; w < kWords; w++) {
        U &covering = L::at (&rows.covering_[w][here]);
        covering = (covering | (below[w] & above[w])) & (U)full;
      }
    }
  }

  /* Scales a tangent to unit length; the circle's where it is not known. */
  void normalise (F &x, F &z, int column) const
  {
    F length = x * x + z * z;
    L::make_root (length);
    const I known = length > 1e-6f;
    const F by = known ? length : 1.f + F{};
    x = known ? x / by : L::at (&rows.circle_tangent_[0][column]);
    z = known ? z / by : L::at (&rows.circle_tangent_[1][column]);
  }

  /* ---- decisions ---- */

  /* The previous winner of each node of a row: that of the layer whose radius was nearest. */
  void find_held (std::uint32_t row, const Slice &slice) const
  {
    const Slice *old = rows.old_slice (slice);
    const std::size_t to = std::size_t{row} * rows.width_ + kPad;
    for (int c = 0; c < rows.columns_; c += kLanes) {
      const F radius = L::at (&rows.radius_[to + c]);
      F nearest = rules.layer_gap + F{};
      I held = I{} - 1;
      for (int q = 0; old && q < old->planes; q++) {
        const std::size_t at = std::size_t{old->first_row + q} * rows.old_width_ + kPad + c;
        F d = L::at (&rows.old_radius_[at]) - radius;
        L::make_positive (d);
        const I nearer = d <= nearest;
        nearest = nearer ? d : nearest;
        held = nearer ? L::at (&rows.old_first_[at]) : held;
      }
      L::at (&rows.held_[to + c]) = held;
    }
  }

  /* Fills the empty nodes of a row from a row of the frame before. */
  void carry_over (std::uint32_t row, std::uint32_t old_row) const
  {
    const std::size_t to = std::size_t{row} * rows.width_,
                      from = std::size_t{old_row} * rows.old_width_;
    for (std::uint32_t c = 0; c < rows.width_; c += kLanes) {
      F &radius = L::at (&rows.radius_[to + c]);
      I &first = L::at (&rows.first_[to + c]);
      const I empty = radius >= kNoRadius;
      radius = empty ? L::at (&rows.old_radius_[from + c]) : radius;
      first = empty ? L::at (&rows.old_first_[from + c]) : first;
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
    const I better = in & (score > best.score);
    best.score = better ? score : best.score;
    best.view = better ? view + I{} : best.view;
  }

  void decide_block (std::size_t here, const Slice &slice, const Neighbours &around) const
  {
    std::uint64_t views = 0;
    for (int w = 0; w < rows.words_; w++)
      views |= std::uint64_t{L::any_of (L::at (&rows.covering_[w][here]))} << (32 * w);
    if (std::has_single_bit (views)) { /* one view covers the block */
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
    L::at (&rows.next_[here]) = best.view; /* not first_, which the next columns read */
  }

  /* Whether some of a block's neighbours have another winner. */
  bool differ (std::size_t here, const Neighbours &around) const
  {
    const I &own = L::at (&rows.first_[here]);
    I other = {};
    for (int k = 0; k < around.count; k++)
      other |= (around.winners[k] != own) & (around.winners[k] >= 0);
    return L::any (other);
  }

  void decide_row (std::uint32_t row, int number, Pass pass) const
  {
    Neighbours around;
    for (int c = 0; c < rows.columns_; c += kLanes) {
      const std::size_t here = std::size_t{row} * rows.width_ + kPad + c;
      const F radius = L::at (&rows.radius_[here]);
      if (!L::any (radius < kNoRadius)) {
        L::at (&rows.next_[here]) = I{} - 1;
        continue;
      }
      if (pass == Pass::kWithNeighbours) {
        around.count = 0;
        find_neighbours (around, number, c, radius);
        if (!differ (here, around)) { /* then they do not change the winners */
          L::at (&rows.next_[here]) = L::at (&rows.first_[here]);
          continue;
        }
      }
      decide_block (here, rows.slices_[number], around);
    }
  }
};

} // namespace rangecast
