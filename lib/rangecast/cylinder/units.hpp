/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "wall.hpp"
#include "world_points.hpp"

namespace rangecast {

/** How the wall is cut, and how its units are compared. */
struct UnitSettings {
  double unit_height_m = 0.004; ///< height of a slice, metres
  int columns = 360;            ///< units round a slice
  double layer_gap_m = 0.03;    ///< radii further apart than this are different surfaces, metres
  double smoothing_m = 0.01;    ///< neighbours this far count in a decision, metres; 0 = none
};

/** The wall holds no more units than this; slices become higher where the points would need more.
 */
inline constexpr int kMaxUnits = 1 << 22;

/** The points of one view in one layer of one unit. */
struct UnitEntry {
  float x = 0, z = 0;            ///< mean of the points, cylinder coordinates, metres
  float radius = 0;              ///< mean of the points, metres
  float tangent[2] = {};         ///< x, z; unit vector, the way phi grows; 0, 0 if not known
  std::uint32_t first_point = 0; ///< in Units::points
  std::uint32_t point_count = 0;
  std::uint32_t view = 0; ///< number of the image in the frame set, not its view-id
};

/** One surface in one unit: points whose radii have no gap between them. */
struct UnitLayer {
  float radius = 0;              ///< mean of the points, metres
  std::uint32_t first_entry = 0; ///< in Units::entries, one for each bit of views, in their order
  std::uint32_t entry_count = 0;
  int slice = 0, column = 0;
  std::uint64_t views = 0;    ///< bit i: image i has points here
  std::uint64_t covering = 0; ///< bit i: image i has points here or around here
  float tangent[2] = {};      ///< x, z; sum over points; after smooth() over the neighbourhood
};

/** The points of a frame set, sorted into the units of a cylinder's inner wall. Keeps its memory
 * from frame to frame: 20 bytes a point, 4 a unit, 56 a layer and 32 an entry. */
class Units {
public:
  struct Point {
    float radius, x, z;
    std::uint32_t index; ///< in the cloud
  };

  /** Sorts the cloud (in cylinder coordinates, with radius and column as to_wall() gives them) into
   *  units and layers. Points of images in the order of the cloud's parts. */
  void sort (const WorldPoints &cloud, std::span<const float> radius,
      std::span<const std::int32_t> column, WallRange range, const UnitSettings &settings);

  /** Gives each entry the normalised difference to the view's next entry in the slice, and each
   *  layer the sum of its entries' tangents weighted by their points.
   *
   *  Rows of a range image need not lie along slices, and a unit often holds one point of a view or
   *  none. So "successive" means: the view's mean points in successive occupied units of the slice,
   *  at most kReach columns apart and not across a layer gap, in the order of phi, across 2 pi too.
   *  The last one of such a run has the tangent of the one before it.
   *  @param threads  slices worked on at the same time; 0 = number of cores */
  void find_tangents (int threads);

  /** Adds up tangents over the neighbourhood of each layer (smoothing_m each way along the slice,
   *  then across slices, not across layer gaps), so that winners do not change from unit to unit by
   *  chance; and finds the views that cover a layer without a point in it: those with points on
   *  both sides of it (in angle or in height) in that neighbourhood. */
  void smooth (int threads);

  /** Columns over which a view's points are still successive. */
  static constexpr int kReach = 6;

  std::vector<Point> points;
  std::vector<UnitEntry> entries;
  std::vector<UnitLayer> layers;
  std::uint64_t occupied = 0; ///< units with points
  std::uint64_t shared = 0;   ///< units with points of more than one view

private:
  void count_units (const WorldPoints &cloud, std::span<const std::int32_t> column);
  void scatter (const WorldPoints &cloud, std::span<const float> radius);
  void cut_into_layers (const WorldPoints &cloud);
  void add_layer (
      const WorldPoints &cloud, std::uint32_t unit, std::uint32_t begin, std::uint32_t end);
  template <typename Work> void for_each_slice (int threads, const Work &work);
  void find_tangents_of (const UnitLayer &layer);
  [[nodiscard]] const UnitLayer *find_layer (int slice, int column, float radius) const;
  template <typename Work>
  void along_slice (const UnitLayer &from, int reach, int side, const Work &work) const;
  [[nodiscard]] const UnitEntry *next_entry (const UnitLayer &layer, const UnitEntry &entry) const;
  void sum_along_slice (UnitLayer &layer, int reach);
  void sum_across_slices (UnitLayer &layer, int reach);
  [[nodiscard]] std::span<UnitEntry> entries_of (const UnitLayer &layer)
  {
    return {entries.data () + layer.first_entry, layer.entry_count};
  }

  UnitSettings settings_;
  int slices_ = 0;
  float first_y_ = 0, slices_per_metre_ = 0;
  std::vector<std::uint32_t> unit_of_;     /* of each point of the cloud */
  std::vector<std::uint32_t> begin_;       /* of each unit in points; then in layers */
  std::vector<std::array<float, 2>> sums_; /* of each layer, between the passes of smooth () */
};

} // namespace rangecast
