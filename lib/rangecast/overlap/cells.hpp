/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "../geometry/world_points.hpp"
#include "cell_rows.hpp"
#include "cylindrical_projection.hpp"

namespace rangecast {

/** How the wall is cut, and how its units are compared. */
struct UnitSettings {
  double unit_height_m = 0.004; ///< height of a slice, metres
  int columns = 360;            ///< units round a slice
  double layer_gap_m = 0.03;    ///< radii further apart than this are different surfaces, metres
  double smoothing_m = 0.01;    ///< neighbours this far count in a decision, metres; 0 = none
};

/** The walls hold no more units than this together; slices become higher where the points would
 * need more. */
inline constexpr int kMaxUnits = 1 << 21;

/** A run of points of one image that go onto one cylinder. */
struct PointRun {
  std::size_t begin = 0, end = 0; ///< in the cloud
  std::uint32_t view = 0;         ///< number of the image in the frame set, not its view-id
  std::uint32_t body = 0;         ///< number of the cylinder
};

/** The points of one view in one layer of one unit. */
struct UnitEntry {
  float radius = 0, x = 0, z = 0; ///< mean of the points, cylinder coordinates, metres
  float weight = 0;               ///< number of points
  float tangent[2] = {};          ///< x, z; unit vector, as phi grows; 0, 0 if not known
  std::uint32_t key = 0;          ///< as in Units::Point
  std::uint32_t layer = 0;        ///< in Units::layers

  /** Number of the image in the frame set, not its view-id. */
  [[nodiscard]] std::uint32_t view () const { return key % kMaxViews; }
  [[nodiscard]] int column () const { return static_cast<int> (key / kMaxViews); }
};

/** One surface in one unit: points whose radii have no gap between them. */
struct UnitLayer {
  std::uint64_t views = 0;       ///< bit i: image i has points here; one entry each, in their order
  std::uint32_t first_entry = 0; ///< while the slice is worked on
  std::uint32_t entry_count = 0;
  int column = 0;
  int plane = 0;         ///< number of the layer in its unit, from the axis outwards
  float radius = 0;      ///< mean of the points, metres
  float tangent[2] = {}; ///< x, z; sum of the entries' tangents, weighted by their points
  /** In Units::points; not known where the slice is plain. */
  std::uint32_t first_point = 0, point_count = 0;
};

/** The points of a frame set, sorted into the units of the inner walls of some cylinders. Keeps its
 * memory from frame to frame: 72 bytes a point, 4 a unit, 36 a point of the largest slice for each
 * worker, and what UnitRows has. */
class Units {
public:
  struct Point {
    float radius, x, z;
    std::uint32_t index; ///< in the cloud
    std::uint32_t key;   ///< column * kMaxViews + number of the image
  };

  /** Sorts points (in cylinder coordinates, with radius and column as to_wall() gives them) into
   *  units and layers, gives each layer the sum of its views' tangents weighted by their points,
   * and makes room for them in the rows.
   *
   *  A view's tangent in a layer is the normalised difference to its next point in the slice. Rows
   *  of a range image need not lie along slices, and a unit often holds one point of a view or
   * none. So "next" means: of the view's mean points in successive occupied units of the slice, at
   * most kReach columns apart and not across a layer gap, in the order of phi, across 2 pi too. The
   * last one of such a run has the tangent of the one before it.
   *  @param runs    ordered by view
   *  @param ranges  heights of each body's points */
  void sort (const WorldPoints &cloud, std::span<const float> radius,
      std::span<const std::int32_t> column, std::span<const PointRun> runs,
      std::span<const WallRange> ranges, const UnitSettings &settings, int threads);

  /** Puts a slice's layers into the rows. Different slices may be put there at the same time. */
  void fill_rows (int slice);

  /** Columns over which a view's points are still successive. */
  static constexpr int kReach = 6;

  /** A slice's part of the lists below. Elements between the parts mean nothing. */
  struct Slice {
    std::uint32_t begin = 0; ///< its first point; its layers begin there, too
    std::uint32_t layer_count = 0;
    std::uint32_t occupied = 0, shared = 0; ///< units with points; of more than one view
    int planes = 0, body = 0, number = 0;   ///< as in UnitRows
  };

  [[nodiscard]] std::span<const UnitLayer> layers_of (const Slice &slice) const
  {
    return {layers.data () + slice.begin, slice.layer_count};
  }
  /** Whether a layer is in the rows: the fifth and further ones of a unit are not. */
  [[nodiscard]] bool has_cell (int slice, const UnitLayer &layer) const
  {
    return layer.plane < rows.slices ()[slice].planes;
  }

  /** Whether a slice has one layer in each unit, all of them in the rows. */
  [[nodiscard]] bool is_plain (std::uint32_t slice) const
  {
    return slices[slice].planes == 1 && rows.slices ()[slice].planes == 1;
  }

  std::vector<Point> points;
  std::vector<std::uint32_t> slice_of; ///< of each point of the cloud
  std::vector<UnitLayer> layers;
  std::vector<Slice> slices;
  double slice_height_m = 0;
  UnitRows rows;

private:
  struct Work { /* of a worker, for one slice after the other: small enough to stay in caches */
    std::vector<UnitEntry> entries;
    std::vector<std::uint32_t> chain; /* of each entry: the view's next one, in a ring */
  };
  struct Stack { /* the slices of a body */
    int first_slice = 0, count = 0;
    float first_y = 0;
  };

  void lay_out (std::span<const WallRange> ranges);
  void count_units (const WorldPoints &cloud, std::span<const std::int32_t> column,
      std::span<const PointRun> runs);
  void scatter (const WorldPoints &cloud, std::span<const float> radius,
      std::span<const std::int32_t> column, std::span<const PointRun> runs);
  void make_works (int threads);
  void cut (Slice &slice, Work &work);
  struct Cutter;
  struct Followers;
  struct Tangents;

  UnitSettings settings_;
  std::array<Stack, kMaxBodies> stacks_;
  std::vector<std::uint32_t> begin_; /* of each unit in points; after scatter () its end */
  std::vector<Work> works_;
};

} // namespace rangecast
