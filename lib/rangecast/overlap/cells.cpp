/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "cells.hpp"

#include <algorithm>
#include <cmath>

#include "../base/parallel.hpp"

namespace rangecast {

/* Cells of rows, at most; slices beyond have fewer planes. */
constexpr std::uint32_t kMaxNodes = 2 * kMaxCells;

void
Cells::lay_out (std::span<const HeightRange> ranges)
{
  double height = 0;
  for (const HeightRange &range : ranges)
    height += std::max (0.0, double{range.y_max} - range.y_min);
  const double max_slices =
      kMaxCells / settings_.columns - 2.0 * static_cast<double> (ranges.size ());
  const double step = slice_height_m = std::max (settings_.height_m, height / max_slices);
  slices.clear ();
  for (std::size_t cluster = 0; cluster < ranges.size (); cluster++) {
    const HeightRange &range = ranges[cluster];
    Stack &stack = stacks_[cluster];
    stack = {static_cast<int> (slices.size ()), 0, 0};
    if (!(range.y_min <= range.y_max))
      continue;
    /* Slices begin at multiples of their height from the axis' origin, not at the lowest point. */
    const double first = std::floor (range.y_min / step);
    stack.count = static_cast<int> (std::floor (range.y_max / step) - first) + 1;
    stack.first_y = static_cast<float> (first * step);
    for (int i = 0; i < stack.count; i++) {
      Slice &slice = slices.emplace_back ();
      slice.cluster = static_cast<int> (cluster);
      slice.number = static_cast<int> (std::clamp (first, -1e9, 1e9)) + i;
    }
  }
}

void
Cells::count_cells (
    const WorldPoints &cloud, std::span<const std::int32_t> column, std::span<const PointRun> runs)
{
  if (slice_of.size () < cloud.x.size ())
    slice_of.resize (cloud.x.size ());
  begin_.assign (slices.size () * settings_.columns + 1, 0);
  const auto per_metre = static_cast<float> (1 / slice_height_m);
  const auto columns = static_cast<std::uint32_t> (settings_.columns);
  for (const PointRun &run : runs) {
    const Stack &stack = stacks_[run.cluster];
    const float first_y = stack.first_y;
    const int last = stack.count - 1, first = stack.first_slice;
    for (std::size_t i = run.begin; i < run.end; i++) {
      const int slice = static_cast<int> ((cloud.y[i] - first_y) * per_metre);
      slice_of[i] = static_cast<std::uint32_t> (first + std::clamp (slice, 0, last));
    }
    for (std::size_t i = run.begin; i < run.end; i++)
      begin_[slice_of[i] * columns + static_cast<std::uint32_t> (column[i])]++;
  }
}

void
Cells::scatter (const WorldPoints &cloud, std::span<const float> radius,
    std::span<const std::int32_t> column, std::span<const PointRun> runs)
{
  std::uint32_t total = 0;
  for (std::size_t s = 0; s < slices.size (); s++) {
    slices[s].begin = total;
    for (int c = 0; c < settings_.columns; c++) {
      std::uint32_t &begin = begin_[s * settings_.columns + c];
      const std::uint32_t count = begin;
      begin = total;
      total += count;
    }
  }
  if (layers.size () < total) { /* the last to grow: all have grown */
    points.resize (total);
    layers.resize (total);
  }
  const auto columns = static_cast<std::uint32_t> (settings_.columns);
  std::uint32_t *ends = begin_.data ();
  Point *to = points.data ();
  for (const PointRun &run : runs)
    for (std::size_t i = run.begin; i < run.end; i++) {
      const auto at = static_cast<std::uint32_t> (column[i]);
      to[ends[slice_of[i] * columns + at]++] = {radius[i], cloud.x[i], cloud.z[i],
          static_cast<std::uint32_t> (i), at * kMaxViews + run.view};
    }
  /* Now each element is its cell's end, which is the next one's begin. */
}

/* Makes room for as many entries as the largest slice has points. */
void
Cells::make_works (int threads)
{
  const std::size_t workers = workers_for (slices.size (), threads);
  std::size_t largest = 0;
  for (std::size_t s = 0; s < slices.size (); s++)
    largest = std::max<std::size_t> (largest,
        begin_[(s + 1) * static_cast<std::size_t> (settings_.columns) - 1] - slices[s].begin);
  if (works_.size () < workers)
    works_.resize (workers);
  for (Work &work : works_)
    if (work.chain.size () < largest) {
      work.entries.resize (largest + largest / 4);
      work.chain.resize (largest + largest / 4);
    }
}

void
Cells::sort (const WorldPoints &cloud, std::span<const float> radius,
    std::span<const std::int32_t> column, std::span<const PointRun> runs,
    std::span<const HeightRange> ranges, const CellSettings &settings, int threads)
{
  settings_ = settings;
  lay_out (ranges);
  count_cells (cloud, column, runs);
  scatter (cloud, radius, column, runs);
  make_works (threads);
  in_parallel (slices.size (), threads,
      [&] (std::size_t s, std::size_t worker) { cut (slices[s], works_[worker]); });
  const auto images = static_cast<int> (cloud.parts ().size ());
  rows.begin (settings.columns, slice_height_m, images, slices.size ());
  int rows_left = static_cast<int> (kMaxNodes / (settings.columns + 24));
  for (const Slice &slice : slices) {
    const int planes = std::min ({slice.planes, CellRows::kPlanes, rows_left});
    rows.add_slice (slice.cluster, slice.number, planes);
    rows_left -= planes;
  }
  rows.make_room ();
}

void
Cells::fill_rows (int number)
{
  const int planes = rows.slices ()[number].planes;
  for (const CellLayer &layer : layers_of (slices[number]))
    if (layer.plane < planes)
      rows.put (rows.node (number, layer.plane, layer.column),
          {layer.radius, {layer.tangent[0], layer.tangent[1]}, layer.views});
}

} // namespace rangecast
