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

/** How a cylinder is cut into cells, and how these are compared. */
struct CellSettings {
  double height_m = 0.004;   ///< height of a slice, metres
  int columns = 360;         ///< cells round a slice
  double layer_gap_m = 0.03; ///< radii further apart than this are different surfaces, metres
  double smoothing_m = 0.01; ///< neighbours this far count in a decision, metres; 0 = none
};

/** All cylinders together have no more cells; slices become higher where points would need more. */
inline constexpr int kMaxCells = 1 << 21;

/** A run of points of one image that go onto one cylinder. */
struct PointRun {
  std::size_t begin = 0, end = 0; ///< in the cloud
  std::uint32_t view = 0;         ///< number of the image in the frame set, not its view-id
  std::uint32_t cluster = 0;      ///< number of the cylinder
};

/** The points of one view in one layer of one cell. */
struct CellEntry {
  float radius = 0, x = 0, z = 0; ///< mean of the points, cylinder coordinates, metres
  float weight = 0;               ///< number of points
  float tangent[2] = {};          ///< x, z; unit vector, as phi grows; 0, 0 if not known
  std::uint32_t key = 0;          ///< as in Cells::Point
  std::uint32_t layer = 0;        ///< in Cells::layers

  /** Number of the image in the frame set, not its view-id. */
  [[nodiscard]] std::uint32_t view () const { return key % kMaxViews; }
  [[nodiscard]] int column () const { return static_cast<int> (key / kMaxViews); }
};

/** One surface in one cell: points whose radii have no gap between them. */
struct CellLayer {
  std::uint64_t views = 0;       ///< bit i: image i has points here; one entry each, in their order
  std::uint32_t first_entry = 0; ///< while the slice is worked on
  std::uint32_t entry_count = 0;
  int column = 0;
  int plane = 0;         ///< number of the layer in its cell, from the axis outwards
  float radius = 0;      ///< mean of the points, metres
  float tangent[2] = {}; ///< x, z; sum of the entries' tangents, weighted by their points
  /** In Cells::points; not set in slices with one layer in each cell. */
  std::uint32_t first_point = 0, point_count = 0;
};

/** The points of a frame set, sorted into the cells of some cylinders. Keeps its
 * memory from frame to frame: 72 bytes a point, 4 a cell, 36 a point of the largest slice for each
 * worker, and what CellRows has. */
class Cells {
public:
  struct Point {
    float radius, x, z;
    std::uint32_t index; ///< in the cloud
    std::uint32_t key;   ///< column * kMaxViews + number of the image
  };

  /** Sorts points (in cylinder coordinates, with radius and column as project_to_cylinder() gives
   * them) into cells and layers, gives each layer the sum of its views' tangents weighted by their
   * points, and makes room for them in the rows.
   *
   *  A view's tangent in a layer is the normalised difference to its next point in the slice. Rows
   *  of a range image need not lie along slices, and a cell often holds one point of a view or
   * none. So "next" means: of the view's mean points in successive occupied cells of the slice, at
   * most kReach columns apart and not across a layer gap, in the order of phi, across 2 pi too. The
   * last one of such a run has the tangent of the one before it.
   *  @param runs    ordered by view
   *  @param ranges  heights of each cluster's points */
  void sort (const WorldPoints &cloud, std::span<const float> radius,
      std::span<const std::int32_t> column, std::span<const PointRun> runs,
      std::span<const HeightRange> ranges, const CellSettings &settings, int threads);

  /** Puts a slice's layers into the rows. Different slices may be put there at the same time. */
  void fill_rows (int slice);

  /** Columns over which a view's points are still successive. */
  static constexpr int kReach = 6;

  /** A slice's part of the lists below. Elements between the parts are unused. */
  struct Slice {
    std::uint32_t begin = 0; ///< its first point; its layers begin there, too
    std::uint32_t layer_count = 0;
    std::uint32_t occupied = 0, shared = 0;  ///< cells with points; of more than one view
    int planes = 0, cluster = 0, number = 0; ///< as in CellRows
  };

  [[nodiscard]] std::span<const CellLayer> layers_of (const Slice &slice) const
  {
    return {layers.data () + slice.begin, slice.layer_count};
  }
  std::vector<Point> points;
  std::vector<std::uint32_t> slice_of; ///< of each point of the cloud
  std::vector<CellLayer> layers;
  std::vector<Slice> slices;
  double slice_height_m = 0;
  CellRows rows;

private:
  struct Work { /* of a worker, for one slice after the other: small enough to stay in caches */
    std::vector<CellEntry> entries;
    std::vector<std::uint32_t> chain; /* of each entry: the view's next one, in a ring */
  };
  struct Stack { /* the slices of a cluster */
    int first_slice = 0, count = 0;
    float first_y = 0;
  };

  void lay_out (std::span<const HeightRange> ranges);
  void count_cells (const WorldPoints &cloud, std::span<const std::int32_t> column,
      std::span<const PointRun> runs);
  void scatter (const WorldPoints &cloud, std::span<const float> radius,
      std::span<const std::int32_t> column, std::span<const PointRun> runs);
  void make_works (int threads);
  /* Cuts a slice into layers, and finds their tangents (slice_layers.cpp). */
  void cut (Slice &slice, Work &work);
  struct Cutter;
  struct Followers;
  struct Tangents;

  CellSettings settings_;
  std::array<Stack, kMaxClusters> stacks_;
  std::vector<std::uint32_t> begin_; /* of each cell in points; after scatter () its end */
  std::vector<Work> works_;
};

} // namespace rangecast
