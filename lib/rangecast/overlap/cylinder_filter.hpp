/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "../base/status.hpp"
#include "../geometry/range_image.hpp"
#include "../geometry/rig.hpp"
#include "../geometry/world_points.hpp"
#include "axis.hpp"
#include "cells.hpp"
#include "clusters.hpp"
#include "redundant_points.hpp"

namespace rangecast {

inline constexpr double kMaxOverlap = 16; ///< pixels

struct CylinderSettings {
  AxisMode axis = AxisMode::kPrincipal;
  Axis fixed_axis;    ///< for AxisMode::kFixed; any direction but 0
  CellSettings cells; ///< height_m >= 0.0002, columns 8 .. 3600, lengths >= 0
  /** Radius around a point within which the winner's surface must cover the surface of the point's
   *  own view before the point is cleared, 0 .. kMaxOverlap pixels of that view. 1: as far as its
   *  triangles reach, so that no hole opens. */
  double overlap = 1;
  int threads = 1; ///< views, and slices, at a time; 0 = number of cores
  /** Bonus of the view that won a cell in the previous frame, a cosine, 0 .. 2 (0 = none): it loses
   *  the cell only to a view whose |N . a| is larger by more than this. */
  double hysteresis = 0.2;
  /** Bonus of a view that won all four neighbours of a cell (a quarter for each), a cosine, 0 .. 2
   *  (0 = none). */
  double agreement = 0.1;
  /** Maximum number of clusters (people who stand apart) that get a cylinder each, 1 ..
   *  kMaxClusters; 1: one cylinder for all points, as with AxisMode::kFixed. */
  int max_clusters = 4;
};

/** Statistics of one frame. */
struct CylinderResult {
  std::uint64_t points_in = 0;    ///< valid pixels before
  std::uint64_t points_out = 0;   ///< valid pixels after
  std::uint64_t cells = 0;        ///< cells with points
  std::uint64_t cells_shared = 0; ///< cells with points of more than one view
  Axis axis;                      ///< of the cylinder of the largest cluster
  int clusters = 0;               ///< cylinders
  /** Surfaces in cells that also had a winner in the previous frame; those of them whose winner
   *  changed. */
  std::uint64_t cells_held = 0, cells_changed = 0;
};

/** Where several views see the same surface, keeps the points of the view that faces it most
 * directly and clears those of the others.
 *
 *  All points go onto a cylinder about the object's axis, which is cut into cells
 * of equal height and angle. In a cell with points of several views, let T be the mean of the
 * views' tangents in the slice, weighted by their numbers of points (Cells). The view whose optical
 * axis has the smallest inner product with T stays; the others' points there become invalid.
 *
 *  Beyond that plain rule:
 *  - Points of a cell with a gap in radius between them are different surfaces and do not compete.
 *  - T is summed over a neighbourhood, and a view competes in a cell that it has no point in, but
 *    points on both sides of. Without either, winners along a seam are a matter of chance.
 *  - Optical axes need not lie in the slice plane. So |N . a| is compared (N: normal of T in
 *    the plane, a: optical axis), the larger the better. For axes in the plane that is the same as
 *    the smallest |T . a|, as both squares add up to 1; a camera from above no longer wins by
 *    being shorter in the plane.
 *  - A point is cleared only if the winner's own surface covers the surface around it
 *    (RedundantPoints): a cell can be larger than what its winner sees of it, the winner may see
 *    something before the point, have a hole there, or see a thin thing from its other side.
 *  - Where no tangent is known, T is the circle's. Of equals, the first image wins.
 *  - The view that won the cell in the previous frame (hysteresis) and the views that won its
 *    neighbours (agreement) get a bonus.
 *  - Each cluster of points has a cylinder of its own (Clusters).
 *  - Of more than four surfaces in a cell, those beyond the fourth are kept (CellRows).
 *  Coordinates and colours are never changed. */
class CylinderFilter {
public:
  /** Sets the cameras and resets. All views must be range views. */
  Status set_rig (const Rig &rig);
  /** Sets other poses or cameras; axes and winners are kept. */
  Status change_rig (const Rig &rig);
  /** Resets the axes and winners of the frame before. */
  void reset ();

  /** Clears depths in place. A frame set of less than two images with points is left alone.
   *  Nothing is allocated once the largest frame set has been seen.
   *  @return kBadValue for settings out of range, kNotFound for a view that the rig has not,
   *  kBadSize for more than kMaxViews images, kNoSpace without memory; depth is then untouched. */
  Status process (
      std::span<const RangeImage> images, const CylinderSettings &settings, CylinderResult &result);

  /** The winners of the last frame set, to draw or measure them: slices of all clusters, each from
   * the lowest up. None if it had points of fewer than two views. */
  [[nodiscard]] int cell_slices () const { return decided_ ? cells_.rows.old_slices () : 0; }
  /** The view-id of the winner of a cell's outermost surface; -1 where the frame set has no points.
   */
  [[nodiscard]] int cell_winner (int slice, int column) const
  {
    return decided_ ? cells_.rows.old_winner (slice, column) : -1;
  }

private:
  Status work (
      std::span<const RangeImage> images, const CylinderSettings &settings, CylinderResult &result);
  Status find_cameras (std::span<const RangeImage> images);
  void reset_on_new_geometry (const CylinderSettings &settings);
  void find_clusters (const CylinderSettings &settings);
  void choose_axes (const CylinderSettings &settings, std::size_t images);
  void choose_slots (const std::array<Axis, kMaxClusters> &measured);
  void unroll (const CylinderSettings &settings, std::size_t images);
  void set_rules (const CylinderSettings &settings, std::size_t images);
  void decide_cells (const CylinderSettings &settings, CylinderResult &result);
  void clear_redundant (std::span<const RangeImage> images, const CylinderSettings &settings);

  std::array<PixelRays, kMaxViews> rig_rays_; /* by view-id */
  std::array<PixelLookup, kMaxViews> rig_lookups_;
  std::uint64_t rig_views_ = 0; /* bit i: view-id i is in the rig */
  /* By slot: a cluster keeps its slot as long as it exists. */
  std::array<AxisTracker, kMaxClusters> trackers_;
  Clusters clusters_;
  /* Of the last frame set. */
  AxisMode axis_mode_ = AxisMode::kPrincipal;
  Axis fixed_axis_;
  bool decided_ = false; /* has winners */

  /* Of the present frame; kept for their memory. By image: */
  std::array<PixelRays, kMaxViews> rays_;
  std::array<int, kMaxViews> ids_{};
  std::vector<Moments> moments_; /* of each run */
  Axis axis_;                    /* of the largest cluster */
  std::array<Axis, kMaxClusters> axes_;
  int cluster_count_ = 0;
  std::array<int, kMaxClusters> slots_{}; /* of the clusters, the largest first */
  WorldPoints cloud_;
  std::vector<PointRun> runs_;
  std::vector<HeightRange> run_ranges_;
  std::array<HeightRange, kMaxClusters> ranges_;
  std::vector<float> radius_;
  std::vector<std::int32_t> column_;
  Cells cells_;
  RowRules rules_;
  RedundantPoints redundant_;
};

} // namespace rangecast
