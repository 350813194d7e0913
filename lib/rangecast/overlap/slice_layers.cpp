/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* One slice of Cells: its points become entries (of one view in one layer of one cell), entries
 * become layers (one surface in one cell), and layers get the tangents of their views. Most slices
 * are plain, with one layer in each cell, and have loops of their own for that. */
#include <algorithm>
#include <bit>
#include <cmath>

#include "../base/simd.hpp"
#include "cells.hpp"

namespace rangecast {

namespace {
constexpr std::uint32_t kNone = UINT32_MAX;
}

/* Cuts the cells of a slice into layers, and links the entries of each view in their order. */
struct Cells::Cutter {
  using F4 = Lanes<4>::F; /* of one point or entry: radius, x, z, weight */
  using I4 = Lanes<4>::I;

  Cells &cells;
  Slice &slice;
  Work &work;
  float gap;
  int column = 0;
  std::uint32_t entry_end = 0, layer_end;
  std::uint64_t views = 0; /* of the slice */
  std::uint32_t first[kMaxViews], last[kMaxViews];

  Cutter (Cells &owner, Slice &cut, Work &memory)
      : cells (owner), slice (cut), work (memory),
        gap (static_cast<float> (owner.settings_.layer_gap_m)), layer_end (cut.begin)
  {
  }

  void cut (const std::uint32_t *ends, int columns)
  {
    if (sum_entries (ends[columns - 1])) {
      finish_entries ();
    } else {
      entry_end = 0;
      cut_cells (ends, columns);
    }
    for (std::uint64_t rest = views; rest; rest &= rest - 1) { /* close the rings */
      const int view = std::countr_zero (rest);
      work.chain[last[view]] = first[view];
    }
    slice.layer_count = layer_end - slice.begin;
  }

  void link (std::uint32_t entry, std::uint32_t view)
  {
    const std::uint64_t bit = std::uint64_t{1} << view;
    (views & bit ? work.chain[last[view]] : first[view]) = entry;
    last[view] = entry;
    views |= bit;
  }

  /* Makes a layer of points, which come in the order of the cloud, so view after view.
   * @param any  whether they may lie further apart than a gap
   * @return whether they do; then nothing has been made */
  bool add_layer (std::uint32_t begin, std::uint32_t end, int plane, bool any)
  {
    CellLayer &layer = cells.layers[layer_end];
    layer = {0, entry_end, 0, column, plane, 0, {}, begin, end - begin};
    const Point *points = cells.points.data ();
    float radii = 0, low = kNoRadius, high = 0;
    std::uint32_t to = entry_end;
    for (std::uint32_t i = begin; i < end; to++) {
      float x = 0, z = 0, radius = 0;
      const std::uint32_t from = i, key = points[i].key;
      for (; i < end && points[i].key == key; i++) {
        x += points[i].x;
        z += points[i].z;
        radius += points[i].radius;
        low = std::min (low, points[i].radius);
        high = std::max (high, points[i].radius);
      }
      radii += radius;
      const auto weight = static_cast<float> (i - from);
      const float share = 1 / weight;
      work.entries[to] = {radius * share, x * share, z * share, weight, {}, key, layer_end};
      layer.views |= std::uint64_t{1} << work.entries[to].view ();
    }
    if (any && high - low > gap)
      return true;
    layer.radius = radii / static_cast<float> (end - begin);
    layer.entry_count = to - entry_end;
    for (; entry_end < to; entry_end++)
      link (entry_end, work.entries[entry_end].view ());
    layer_end++;
    return false;
  }

  /* @return the number of layers */
  int cut_apart (std::uint32_t begin, std::uint32_t end)
  {
    auto by_radius = [] (const Point &a, const Point &b) {
      return a.radius != b.radius ? a.radius < b.radius : a.index < b.index;
    };
    auto by_index = [] (const Point &a, const Point &b) { return a.index < b.index; };
    Point *points = cells.points.data ();
    std::sort (points + begin, points + end, by_radius);
    int plane = 0;
    for (std::uint32_t from = begin, to = begin + 1; to <= end; to++)
      if (to == end || points[to].radius - points[to - 1].radius > gap) {
        std::sort (points + from, points + to, by_index);
        add_layer (from, to, plane++, false);
        from = to;
      }
    return plane;
  }

  void cut_cells (const std::uint32_t *ends, int columns)
  {
    std::uint32_t begin = slice.begin;
    for (column = 0; column < columns; column++) {
      const std::uint32_t end = ends[column];
      if (begin == end)
        continue;
      const std::uint32_t first_layer = layer_end;
      const int planes = add_layer (begin, end, 0, true) ? cut_apart (begin, end) : 1;
      slice.planes = std::max (slice.planes, planes);
      std::uint64_t all = 0;
      for (std::uint32_t i = first_layer; i < layer_end; i++)
        all |= cells.layers[i].views;
      slice.occupied++;
      slice.shared += (all & (all - 1)) != 0;
      begin = end;
    }
  }

  /* ---- slices whose cells have one layer each ---- */

  /* Adds up the points of each entry of the slice as if its cells had one layer each. Without
   * branches: runs of one or two points, which all here are, are what processors guess worst.
   * @return whether they have: no cell's radii lie further apart than a gap */
  bool sum_entries (std::uint32_t end)
  {
    const F4 one = {0, 0, 0, 1};
    const I4 three = {-1, -1, -1, 0};
    F4 sum = {};
    float low = 0, high = 0, span = 0;
    std::uint32_t before = UINT32_MAX, to = UINT32_MAX;
    /* Not through the vectors: stores of vectors may alias them, for all that compilers know. */
    const Point *points = cells.points.data ();
    CellEntry *entries = work.entries.data ();
    for (std::uint32_t i = slice.begin; i < end; i++) {
      const Point &point = points[i];
      const std::uint32_t differs = point.key ^ before;
      before = point.key;
      const std::int32_t goes_on = -static_cast<std::int32_t> (differs == 0);
      to += differs != 0;
      const I4 keep = {goes_on, goes_on, goes_on, goes_on};
      const F4 values = (F4)((I4) * reinterpret_cast<const F4 *> (&point.radius) & three) + one;
      sum = (F4)((I4)sum & keep) + values;
      Lanes<4>::at (&entries[to].radius) = sum;
      entries[to].key = point.key;
      const bool new_cell = differs >= kMaxViews;
      low = new_cell || point.radius < low ? point.radius : low;
      high = new_cell || point.radius > high ? point.radius : high;
      span = high - low > span ? high - low : span;
    }
    entry_end = to + 1;
    return span <= gap;
  }

  /* Makes the layers of those entries. Layers are written again with each of their entries, for the
   * same reason. */
  void finish_entries ()
  {
    CellEntry *entries = work.entries.data ();
    CellLayer *layer = cells.layers.data () + slice.begin - 1;
    layer_end = slice.begin - 1;
    std::uint32_t *chain = work.chain.data ();
    std::uint32_t column_before = UINT32_MAX, first_entry = 0, shared = 0;
    std::uint64_t layer_views = 0;
    float weight = 0, radii = 0;
    for (std::uint32_t e = 0; e < entry_end; e++) {
      CellEntry &entry = entries[e];
      const std::uint32_t at = entry.key / kMaxViews, view = entry.key % kMaxViews;
      const bool fresh = at != column_before;
      const std::uint64_t bit = std::uint64_t{1} << view;
      column_before = at;
      layer += fresh;
      layer_end += fresh;
      weight = (fresh ? 0 : weight) + entry.weight;
      radii = (fresh ? 0 : radii) + entry.radius;
      layer_views = (fresh ? 0 : layer_views) | bit;
      first_entry = fresh ? e : first_entry;
      layer->views = layer_views;
      layer->first_entry = first_entry;
      layer->entry_count = e + 1 - first_entry;
      layer->column = static_cast<int> (at);
      layer->plane = 0;
      layer->radius = radii / weight;
      shared += layer->entry_count == 2;
      F4 &values = Lanes<4>::at (&entry.radius);
      const float share = 1 / entry.weight;
      values *= F4{share, share, share, 1};
      entry.tangent[0] = entry.tangent[1] = 0;
      entry.layer = layer_end;
      (views & bit ? chain[last[view]] : first[view]) = e;
      last[view] = e;
      views |= bit;
    }
    layer_end++;
    slice.occupied = layer_end - slice.begin;
    slice.shared = shared;
    slice.planes = layer_end > slice.begin;
  }
};

/* A view's next entries where slices have several layers. A cell may have as many as a view has
 * points, and going through all of them for each of them would take minutes. But both a view's
 * entries in a cell and those in the cells after it come from the axis outwards: where the search
 * for one entry ended the one for the next begins. */
struct Cells::Followers {
  int column = -1;               /* of the view's entries asked for */
  int count = 0;                 /* columns with entries of the view that follow it within reach */
  std::uint32_t entry[kReach]{}; /* of each, the next to be looked at; kNone after its last */

  void begin_column (const Work &work, std::uint32_t number, int reach, int columns)
  {
    int at = column = work.entries[number].column ();
    count = 0;
    for (std::uint32_t next = work.chain[number]; next != number; next = work.chain[next]) {
      const int found = work.entries[next].column ();
      const int distance = found - column + (found < column ? columns : 0);
      if (distance > reach)
        return;
      if (found != at)
        entry[count++] = next;
      at = found;
    }
  }

  std::uint32_t find (const Cells &cells, const Work &work, std::uint32_t number)
  {
    const float radius = work.entries[number].radius;
    const auto gap = static_cast<float> (cells.settings_.layer_gap_m);
    const auto radius_of = [&] (std::uint32_t other) {
      return cells.layers[work.entries[other].layer].radius;
    };
    for (int k = 0; k < count; k++) {
      while (entry[k] != kNone && radius_of (entry[k]) - radius < -gap) {
        const std::uint32_t next = work.chain[entry[k]];
        const bool same = work.entries[next].column () == work.entries[entry[k]].column ();
        entry[k] = same ? next : kNone;
      }
      if (entry[k] != kNone && std::abs (radius_of (entry[k]) - radius) <= gap)
        return entry[k];
    }
    return kNone;
  }
};

/* Gives entries of a slice their tangents, and nodes their sums. */
struct Cells::Tangents {
  Cells &cells;
  const Slice &slice;
  Work &work;
  std::uint32_t entry_count;
  int reach;

  /* The view's next entry within reach, across 2 pi too, whose layer is not across a layer gap. For
   * slices of one layer a cell, where each step goes a column further. */
  [[nodiscard]] std::uint32_t next_entry (std::uint32_t from) const
  {
    const CellEntry &entry = work.entries[from];
    const auto gap = static_cast<float> (cells.settings_.layer_gap_m);
    int column = entry.column ();
    for (std::uint32_t next = work.chain[from], before = from; next != from;
         before = next, next = work.chain[next]) {
      const CellEntry &other = work.entries[next];
      if (next < before)
        column -= cells.settings_.columns;
      const int distance = other.column () - column;
      if (distance > reach)
        return kNone;
      if (std::abs (cells.layers[other.layer].radius - entry.radius) <= gap)
        return next;
    }
    return kNone;
  }

  void point_at (std::uint32_t from, std::uint32_t found)
  {
    if (found == kNone)
      return;
    CellEntry &entry = work.entries[from], &next = work.entries[found];
    const float dx = next.x - entry.x, dz = next.z - entry.z;
    const float squared = dx * dx + dz * dz;
    if (!(squared > 1e-18f))
      return;
    const float per_length = 1 / std::sqrt (squared);
    entry.tangent[0] = dx * per_length;
    entry.tangent[1] = dz * per_length;
    if (next.tangent[0] == 0 && next.tangent[1] == 0)
      std::copy_n (entry.tangent, 2, next.tangent);
  }

  void find ()
  {
    if (slice.planes > 1) {
      find_layered ();
      return;
    }
    for (std::uint32_t e = 0; e < entry_count; e++)
      point_at (e, next_entry (e));
  }

  void find_layered ()
  {
    std::array<Followers, kMaxViews> followers;
    for (std::uint32_t e = 0; e < entry_count; e++) {
      Followers &of_view = followers[work.entries[e].view ()];
      if (of_view.column != work.entries[e].column ())
        of_view.begin_column (work, e, reach, cells.settings_.columns);
      point_at (e, of_view.find (cells, work, e));
    }
  }

  void sum ()
  {
    for (std::uint32_t l = slice.begin; l < slice.begin + slice.layer_count; l++) {
      CellLayer &layer = cells.layers[l];
      const CellEntry *entry = work.entries.data () + layer.first_entry;
      float x = 0, z = 0;
      for (std::uint32_t e = 0; e < layer.entry_count; e++, entry++) {
        x += entry->weight * entry->tangent[0];
        z += entry->weight * entry->tangent[1];
      }
      layer.tangent[0] = x;
      layer.tangent[1] = z;
    }
  }
};

void
Cells::cut (Slice &slice, Work &work)
{
  const int columns = settings_.columns;
  const auto number = static_cast<std::size_t> (&slice - slices.data ());
  const std::uint32_t *ends = begin_.data () + number * static_cast<std::size_t> (columns);
  for_this_cpu ([&] {
    Cutter cutter (*this, slice, work);
    cutter.cut (ends, columns);
    Tangents tangents{*this, slice, work, cutter.entry_end, std::min (kReach, columns / 4)};
    tangents.find ();
    tangents.sum ();
  });
}

} // namespace rangecast
