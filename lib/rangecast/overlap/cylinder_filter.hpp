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
#include "cell_grid.hpp"
#include "redundant_points.hpp"

namespace rangecast {

inline constexpr double kMaxOverlap = 16; ///< pixels

struct CylinderSettings {
  AxisMode axis = AxisMode::kPrincipal;
  double slice_height_m = 0.004; ///< 0.0002 .. 10 metres
  int columns = 360;             ///< cells round a slice, 8 .. 3600
  /** Radius around a point within which the winner's surface must cover the surface of the point's
   *  own view before the point is cleared, 0 .. kMaxOverlap pixels of that view. 1: as far as its
   *  triangles reach, so that no hole opens. */
  double overlap = 1;
  int threads = 1; ///< views, and slices, at a time; 0 = number of cores
};

/** Statistics of one frame. */
struct CylinderResult {
  std::uint64_t points_in = 0;  ///< valid pixels before
  std::uint64_t points_out = 0; ///< valid pixels after
  CellGrid::Counts cells;
  Axis axis; ///< of the cylinder
};

/** Where several views see the same surface, keeps the points of the view that faces it most
 *  directly and clears those of the others.
 *
 *  All points go onto a cylinder about the object's axis, which is cut into cells of equal height
 * and angle. In a cell with points of several views let T be the mean of the views' tangents in the
 * slice, weighted by their numbers of points. The view whose optical axis has the smallest inner
 * product with T wins; the others' points there become invalid.
 *
 *  Beyond that published rule:
 *  - CellGrid keeps surfaces at different radii apart and winners compact and still.
 *  - Optical axes need not lie in the slice plane. So |N . a| is compared (N: normal of T in
 *    the plane, a: optical axis), the larger the better. For axes in the plane that is the same as
 *    the smallest |T . a|, as both squares add up to 1; a camera from above no longer wins by
 *    being shorter in the plane.
 *  - A point is cleared only if the winner's own surface covers the surface around it
 *    (RedundantPoints): a cell can be larger than what its winner sees of it, the winner may see
 *    something before the point, have a hole there, or see a thin thing from its other side.
 *  Coordinates and colours are never changed. */
class CylinderFilter {
public:
  /** Sets the cameras and resets. All views must be range views. */
  Status set_rig (const Rig &rig);
  /** Resets the axes and winners of the frame before. */
  void reset ();

  /** Clears depths in place. A frame set of less than two images with points is left alone.
   *  Nothing is allocated once the largest frame set has been seen.
   *  @return kNotFound for a view that the rig has not,
   *  kBadSize for more than kMaxViews images, kNoSpace without memory; depth is then untouched. */
  Status process (
      std::span<const RangeImage> images, const CylinderSettings &settings, CylinderResult &result);

  /** The winners of the last frame set, to measure them: slices from the lowest up. None if it had
   * points of fewer than two views. */
  [[nodiscard]] int cell_slices () const { return decided_ ? grid_.slices () : 0; }
  /** The view-id of the winner of a cell's outermost surface; -1 where the frame set has no points.
   */
  [[nodiscard]] int cell_winner (int slice, int column) const
  {
    return grid_.cell_winner (slice, column);
  }

private:
  Status work (
      std::span<const RangeImage> images, const CylinderSettings &settings, CylinderResult &result);
  Status find_cameras (std::span<const RangeImage> images);
  void choose_axis (const CylinderSettings &settings, Axis &axis);
  void fill_grid (const CylinderSettings &settings, const Axis &axis);

  std::array<PixelRays, kMaxViews> rig_rays_; /* by view-id */
  std::array<PixelLookup, kMaxViews> rig_lookups_;
  std::uint64_t rig_views_ = 0; /* bit i: view-id i is in the rig */
  AxisTracker tracker_;
  AxisMode axis_mode_ = AxisMode::kPrincipal; /* of the last frame set */
  bool decided_ = false;                      /* the last frame set has winners */

  /* Of the present frame; kept for their memory. By image: */
  std::array<PixelRays, kMaxViews> rays_;
  std::array<PixelLookup, kMaxViews> lookups_;
  std::array<int, kMaxViews> ids_{};
  std::array<Moments, kMaxViews> moments_;
  std::array<CellGrid::HeightRange, kMaxViews> ranges_;
  CellGrid::OpticalAxes optical_;
  WorldPoints cloud_;
  std::vector<float> radius_;
  std::vector<std::uint32_t> cell_; /* of each point; at first its column */
  CellGrid grid_;
  RedundantPoints redundant_;
};

} // namespace rangecast
