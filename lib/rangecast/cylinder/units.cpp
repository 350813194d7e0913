/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "units.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core/utility.hpp>

namespace rangecast {

void
Units::sort (const WorldPoints &cloud, std::span<const float> radius,
    std::span<const std::int32_t> column, WallRange range, const UnitSettings &settings)
{
  settings_ = settings;
  const double most = kMaxUnits / settings.columns - 2;
  const double height = std::max (0.0, double{range.y_max} - range.y_min);
  const double step = std::max (settings.unit_height_m, height / most);
  /* Slices begin at multiples of their height from the axis' origin, not at the lowest point. */
  const double first = std::floor (range.y_min / step);
  first_y_ = static_cast<float> (first * step);
  slices_per_metre_ = static_cast<float> (1 / step);
  slices_ = std::max (1, static_cast<int> (std::floor (range.y_max / step) - first) + 1);
  count_units (cloud, column);
  scatter (cloud, radius);
  cut_into_layers (cloud);
}

void
Units::count_units (const WorldPoints &cloud, std::span<const std::int32_t> column)
{
  if (unit_of_.size () < cloud.x.size ())
    unit_of_.resize (cloud.x.size ());
  begin_.assign (static_cast<std::size_t> (slices_) * settings_.columns + 1, 0);
  for (const WorldPoints::Part &part : cloud.parts ())
    for (std::size_t i = part.begin; i < part.end; i++) {
      const int slice = static_cast<int> ((cloud.y[i] - first_y_) * slices_per_metre_);
      const int unit = std::clamp (slice, 0, slices_ - 1) * settings_.columns + column[i];
      unit_of_[i] = static_cast<std::uint32_t> (unit);
      begin_[unit]++;
    }
}

void
Units::scatter (const WorldPoints &cloud, std::span<const float> radius)
{
  std::uint32_t total = 0;
  for (std::uint32_t &begin : begin_) {
    const std::uint32_t count = begin;
    begin = total;
    total += count;
  }
  if (points.size () < total)
    points.resize (total);
  for (const WorldPoints::Part &part : cloud.parts ())
    for (std::size_t i = part.begin; i < part.end; i++)
      points[begin_[unit_of_[i]]++] = {
          radius[i], cloud.x[i], cloud.z[i], static_cast<std::uint32_t> (i)};
  /* Now each element is its unit's end, which is the next one's begin. */
}

/* Whether all radii lie within a gap: then there is one layer, and nothing to sort. */
static bool
is_one_layer (std::span<const Units::Point> points, float gap)
{
  float low = points[0].radius, high = low;
  for (const Units::Point &point : points) {
    low = std::min (low, point.radius);
    high = std::max (high, point.radius);
  }
  return high - low <= gap;
}

void
Units::cut_into_layers (const WorldPoints &cloud)
{
  const auto gap = static_cast<float> (settings_.layer_gap_m);
  auto by_radius = [] (const Point &a, const Point &b) {
    return a.radius != b.radius ? a.radius < b.radius : a.index < b.index;
  };
  auto by_index = [] (const Point &a, const Point &b) { return a.index < b.index; };
  layers.clear ();
  entries.clear ();
  occupied = shared = 0;
  std::uint32_t begin = 0;
  for (std::uint32_t unit = 0; unit + 1 < begin_.size (); unit++) {
    const std::uint32_t end = begin_[unit];
    begin_[unit] = static_cast<std::uint32_t> (layers.size ());
    if (begin == end)
      continue;
    Point *first = &points[begin];
    if (is_one_layer ({first, end - begin}, gap)) {
      add_layer (cloud, unit, begin, end);
    } else {
      std::sort (first, first + (end - begin), by_radius);
      for (std::uint32_t from = begin, to = begin + 1; to <= end; to++)
        if (to == end || points[to].radius - points[to - 1].radius > gap) {
          std::sort (&points[from], &points[from] + (to - from), by_index);
          add_layer (cloud, unit, from, to);
          from = to;
        }
    }
    std::uint64_t views = 0;
    for (std::size_t i = begin_[unit]; i < layers.size (); i++)
      views |= layers[i].views;
    occupied++;
    shared += (views & (views - 1)) != 0;
    begin = end;
  }
  begin_.back () = static_cast<std::uint32_t> (layers.size ());
}

/* The points come in the order of the cloud, so view after view. */
void
Units::add_layer (
    const WorldPoints &cloud, std::uint32_t unit, std::uint32_t begin, std::uint32_t end)
{
  const auto parts = cloud.parts ();
  UnitLayer &layer = layers.emplace_back ();
  layer.slice = static_cast<int> (unit) / settings_.columns;
  layer.column = static_cast<int> (unit) % settings_.columns;
  layer.first_entry = static_cast<std::uint32_t> (entries.size ());
  std::uint32_t view = 0;
  float radii = 0;
  for (std::uint32_t i = begin; i < end;) {
    float x = 0, z = 0, radius = 0;
    const std::uint32_t first = i;
    while (points[i].index >= parts[view].end)
      view++;
    for (; i < end && points[i].index < parts[view].end; i++) {
      x += points[i].x;
      z += points[i].z;
      radius += points[i].radius;
    }
    radii += radius;
    const float share = 1 / static_cast<float> (i - first);
    layer.views |= std::uint64_t{1} << view;
    entries.push_back ({x * share, z * share, radius * share, {}, first, i - first, view});
  }
  layer.covering = layer.views;
  layer.entry_count = static_cast<std::uint32_t> (entries.size ()) - layer.first_entry;
  layer.radius = radii / static_cast<float> (end - begin);
}

/* The layer of that unit whose radius is nearest, unless a gap lies between. */
const UnitLayer *
Units::find_layer (int slice, int column, float radius) const
{
  const std::size_t unit = static_cast<std::size_t> (slice) * settings_.columns + column;
  const UnitLayer *best = nullptr;
  auto least = static_cast<float> (settings_.layer_gap_m);
  for (std::uint32_t i = begin_[unit]; i < begin_[unit + 1]; i++)
    if (const float d = std::abs (layers[i].radius - radius); d <= least) {
      least = d;
      best = &layers[i];
    }
  return best;
}

/* Calls work for the layers of the other columns of the slice, up to `reach` columns to one side
 * (1: the way phi grows, -1) and across 2 pi, nearest first, until it returns true. Layers lie in
 * the order of their columns, so empty units cost nothing. */
template <typename Work>
void
Units::along_slice (const UnitLayer &from, int reach, int side, const Work &work) const
{
  const int columns = settings_.columns;
  const std::size_t unit = static_cast<std::size_t> (from.slice) * columns;
  const UnitLayer *first = layers.data () + begin_[unit];
  const UnitLayer *last = layers.data () + begin_[unit + columns] - 1;
  const UnitLayer *other = &from;
  for (;;) {
    other = side > 0 ? (other == last ? first : other + 1) : (other == first ? last : other - 1);
    if (other == &from)
      return;
    int distance = side * (other->column - from.column);
    distance += distance < 0 ? columns : 0;
    if (distance > reach || (distance > 0 && work (*other)))
      return;
  }
}

const UnitEntry *
Units::next_entry (const UnitLayer &layer, const UnitEntry &entry) const
{
  const std::uint64_t bit = std::uint64_t{1} << entry.view;
  const auto gap = static_cast<float> (settings_.layer_gap_m);
  const UnitEntry *next = nullptr;
  along_slice (layer, std::min (kReach, settings_.columns / 4), 1, [&] (const UnitLayer &other) {
    if (!(other.views & bit) || std::abs (other.radius - entry.radius) > gap)
      return false;
    next = &entries[other.first_entry];
    while (next->view != entry.view)
      next++;
    return true;
  });
  return next;
}

void
Units::find_tangents_of (const UnitLayer &layer)
{
  for (UnitEntry &entry : entries_of (layer)) {
    const UnitEntry *found = next_entry (layer, entry);
    if (!found)
      continue;
    UnitEntry &next = entries[static_cast<std::size_t> (found - entries.data ())];
    const float dx = next.x - entry.x, dz = next.z - entry.z;
    const float length = std::sqrt (dx * dx + dz * dz);
    if (!(length > 1e-9f))
      continue;
    entry.tangent[0] = dx / length;
    entry.tangent[1] = dz / length;
    if (next.tangent[0] == 0 && next.tangent[1] == 0)
      std::copy_n (entry.tangent, 2, next.tangent);
  }
}

/* Runs work (layers) for the layers of each slice, several slices at a time if that is wanted. */
template <typename Work>
void
Units::for_each_slice (int threads, const Work &work)
{
  auto some = [&] (const cv::Range &range) {
    for (int slice = range.start; slice < range.end; slice++) {
      const std::size_t unit = static_cast<std::size_t> (slice) * settings_.columns;
      const std::uint32_t begin = begin_[unit], end = begin_[unit + settings_.columns];
      work (std::span<UnitLayer> (layers.data () + begin, end - begin));
    }
  };
  if (threads == 1)
    return some ({0, slices_});
  /* More stripes than threads: slices hold very different numbers of points. */
  const int stripes = threads > 0 ? threads : 4 * cv::getNumThreads ();
  cv::parallel_for_ ({0, slices_}, some, stripes);
}

void
Units::find_tangents (int threads)
{
  for_each_slice (threads, [&] (std::span<UnitLayer> slice) {
    for (const UnitLayer &layer : slice)
      find_tangents_of (layer);
    for (UnitLayer &layer : slice)
      for (const UnitEntry &entry : entries_of (layer))
        for (int k = 0; k < 2; k++)
          layer.tangent[k] += static_cast<float> (entry.point_count) * entry.tangent[k];
  });
}

void
Units::sum_along_slice (UnitLayer &layer, int reach)
{
  const auto gap = static_cast<float> (settings_.layer_gap_m);
  float x = layer.tangent[0], z = layer.tangent[1];
  std::uint64_t around[2] = {};
  for (int side : {0, 1})
    along_slice (layer, reach, side ? 1 : -1, [&] (const UnitLayer &other) {
      if (std::abs (other.radius - layer.radius) <= gap) {
        x += other.tangent[0];
        z += other.tangent[1];
        around[side] |= other.views;
      }
      return false;
    });
  layer.covering |= around[0] & around[1];
  sums_[static_cast<std::size_t> (&layer - layers.data ())] = {x, z};
}

void
Units::sum_across_slices (UnitLayer &layer, int reach)
{
  std::array<float, 2> sum = sums_[static_cast<std::size_t> (&layer - layers.data ())];
  std::uint64_t below = 0, above = 0;
  const int bottom = std::max (0, layer.slice - reach);
  const int top = std::min (slices_ - 1, layer.slice + reach);
  for (int slice = bottom; slice <= top; slice++) {
    if (slice == layer.slice)
      continue;
    const UnitLayer *other = find_layer (slice, layer.column, layer.radius);
    if (!other)
      continue;
    const auto &part = sums_[static_cast<std::size_t> (other - layers.data ())];
    sum[0] += part[0];
    sum[1] += part[1];
    (slice < layer.slice ? below : above) |= other->views;
  }
  layer.covering |= below & above;
  std::copy_n (sum.begin (), 2, layer.tangent);
}

void
Units::smooth (int threads)
{
  if (settings_.smoothing_m <= 0)
    return;
  sums_.resize (std::max (sums_.size (), layers.size ()));
  /* Units are narrow near the axis; beyond this many columns they would cost more than they tell.
   */
  constexpr double kMostColumns = 8, kMostSlices = 8;
  const double most = std::min (kMostColumns, settings_.columns / 4.0);
  const double columns_per_radian = settings_.columns / (2 * M_PI);
  for_each_slice (threads, [&] (std::span<UnitLayer> slice) {
    for (UnitLayer &layer : slice) {
      const double radians = settings_.smoothing_m / std::max (1e-6, double{layer.radius});
      sum_along_slice (layer, static_cast<int> (std::min (radians * columns_per_radian, most)));
    }
  });
  const double slices = std::min (settings_.smoothing_m * slices_per_metre_, kMostSlices);
  for_each_slice (threads, [&] (std::span<UnitLayer> slice) {
    for (UnitLayer &layer : slice)
      sum_across_slices (layer, static_cast<int> (slices + 0.5));
  });
}

} // namespace rangecast
