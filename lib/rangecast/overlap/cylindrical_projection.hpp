/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "../geometry/world_points.hpp"
#include "axis.hpp"

namespace rangecast {

/** The frame of a cylinder: y along its axis, z as near to world z as that leaves (world x where
 * the axis is along z), right-handed. */
struct CylinderFrame {
  CylinderFrame () = default;
  explicit CylinderFrame (const Axis &axis);

  Vec3 origin;               ///< world, metres
  Mat3 rotation{kIdentity3}; ///< cylinder_from_world; rows are the frame's axes in the world
};

/** Heights and angles of points on a cylinder's inner wall. */
struct HeightRange {
  float y_min = 0, y_max = 0; ///< metres along the axis; y_min > y_max if there is no point
};

/** atan2 in 0 .. 2 pi, radians; 0 for (0, 0). At most 1.5e-5 rad wrong (checked by test): with 360
 *  columns a point within a thousandth of a column's edge may fall on the other side of it.
 *  An odd minimax polynomial of degree 11 for atan on 0 .. 1, and reflections. */
[[nodiscard]] float fast_atan2 (float y, float x);

/** Moves the points of a part from world to cylinder coordinates, in place, and gives for each its
 *  radius sqrt (x^2 + z^2) (metres) and its column floor (phi / 2 pi * columns), phi = atan2 (z,
 * x). radius and column have the cloud's size. Reentrant for different parts. */
[[nodiscard]] HeightRange project_to_cylinder (WorldPoints &cloud, WorldPoints::Part part,
    const CylinderFrame &frame, int columns, float *radius, std::int32_t *column);

} // namespace rangecast
