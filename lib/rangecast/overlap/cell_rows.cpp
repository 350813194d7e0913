/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "cell_rows.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "../base/parallel.hpp"
#include "cell_row_loops.hpp"

namespace rangecast {
namespace {

/* Grows in large steps: how many planes slices need changes a little from frame to frame. */
template <typename Vector>
void
grow (Vector &vector, std::size_t size)
{
  if (vector.size () < size)
    vector.resize (size + size / 4);
}

} // namespace

void
CellRows::begin (int columns, double slice_height_m, int images, std::size_t slices)
{
  slice_height_m_ = slice_height_m;
  /* They are swapped after each frame. */
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
  std::fill_n (radius_.begin (), nodes, kNoRadius);
  for (auto &plane : tangent_)
    std::fill_n (plane.begin (), nodes, 0.f);
}

/* ---- the neighbourhood ---- */

/* Copies columns of the other end beside both ends of a row. */
template <typename Number>
void
CellRows::wrap (Plane<Number> &plane, std::uint32_t row) const
{
  Number *first = plane.data () + std::size_t{row} * width_ + kPad;
  std::copy_n (first + columns_ - kPad, kPad, first - kPad);
  std::copy_n (first, kPad, first + columns_);
}

void
CellRows::sum_along (const RowRules &rules, int number)
{
  const Slice &slice = slices_[number];
  const std::uint32_t end = slice.first_row + static_cast<std::uint32_t> (slice.planes);
  for (std::uint32_t row = slice.first_row; row < end; row++) {
    wrap (radius_, row);
    wrap (tangent_[0], row);
    wrap (tangent_[1], row);
    for (int w = 0; w < words_; w++)
      wrap (views_[w], row);
  }
  for_this_cpu ([&]<typename L> (L) {
    const RowLoops<L> loops{*this, rules};
    for (std::uint32_t row = slice.first_row; row < end; row++)
      words_ == 1 ? loops.template along_row<1> (row, slice)
                  : loops.template along_row<2> (row, slice);
  });
}

void
CellRows::sum_across (const RowRules &rules, int number)
{
  const Slice &slice = slices_[number];
  const std::uint32_t end = slice.first_row + static_cast<std::uint32_t> (slice.planes);
  for_this_cpu ([&]<typename L> (L) {
    const RowLoops<L> loops{*this, rules};
    for (std::uint32_t row = slice.first_row; row < end; row++)
      words_ == 1 ? loops.template across_row<1> (row, number)
                  : loops.template across_row<2> (row, number);
  });
}

/* ---- decisions ---- */

void
CellRows::decide_slice (const RowRules &rules, std::size_t number, Pass pass)
{
  const Slice &slice = slices_[number];
  for (int p = 0; p < slice.planes; p++) {
    const std::uint32_t row = slice.first_row + static_cast<std::uint32_t> (p);
    for_this_cpu ([&]<typename L> (L) {
      const RowLoops<L> loops{*this, rules};
      if (pass == Pass::kAlone)
        loops.find_held (row, slice);
      loops.decide_row (row, static_cast<int> (number), pass);
    });
    const std::size_t begin = std::size_t{row} * width_ + kPad;
    std::copy_n (next_.begin () + begin, columns_, first_.begin () + begin);
    wrap (first_, row);
  }
}

/* A sweep decides every other slice, then the rest: so the neighbours that a slice reads do not
 * change meanwhile, with any number of threads, and two neighbours cannot swap forever. */
RowCounts
CellRows::decide (const RowRules &rules, int threads)
{
  const std::size_t count = slices_.size ();
  in_parallel (count, threads, [&] (std::size_t s) { decide_slice (rules, s, Pass::kAlone); });
  for (int sweep = 0; sweep < kSweeps && rules.agreement > 0; sweep++)
    for (std::size_t odd : {0, 1})
      in_parallel ((count + 1 - odd) / 2, threads,
          [&] (std::size_t s) { decide_slice (rules, 2 * s + odd, Pass::kWithNeighbours); });
  RowCounts counts;
  for (const Slice &slice : slices_)
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
  return counts;
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

/* ---- from frame to frame ---- */

void
CellRows::keep_winners (const RowRules &rules, const std::array<int, kMaxViews> &ids)
{
  /* A cell without points in one frame keeps its winner. */
  for (const Slice &slice : slices_) {
    const Slice *old = old_slice (slice);
    const int planes = old ? std::min (slice.planes, old->planes) : 0;
    for_this_cpu ([&]<typename L> (L) {
      for (int p = 0; p < planes; p++)
        RowLoops<L>{*this, rules}.carry_over (slice.first_row + static_cast<std::uint32_t> (p),
            old->first_row + static_cast<std::uint32_t> (p));
    });
  }
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
CellRows::renumber_winners (const std::array<int, kMaxViews> &ids, int images)
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
CellRows::reset ()
{
  old_slices_.clear ();
  old_begin_.fill (0);
}

} // namespace rangecast
