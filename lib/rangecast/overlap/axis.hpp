/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <span>

#include "../geometry/camera.hpp"
#include "../geometry/world_points.hpp"

namespace rangecast {

/** How the cylinder gets its axis. */
enum class AxisMode {
  kPrincipal, ///< the direction in which the points spread most, through their centroid
  kVertical,  ///< world y, through the centroid
  kFixed,     ///< as the settings say
};

/** A line in the world. */
struct Axis {
  Vec3 position;           ///< any point of it, metres
  Vec3 direction{0, 1, 0}; ///< unit vector, never pointing down (y >= 0)
};

/** First and second moments of points, about any origin. */
struct Moments {
  double n = 0;
  double sum[3] = {};     ///< x y z
  double product[6] = {}; ///< xx xy xz yy yz zz

  void add (const WorldPoints &points, WorldPoints::Part part);
  Moments &operator+= (const Moments &other);
  [[nodiscard]] Vec3 centroid () const;
};

/** Eigenvalues, largest first, and unit eigenvectors of a symmetric matrix (xx xy xz yy yz zz), by
 *  cyclic Jacobi rotations. */
void eigen_symmetric (const double (&matrix)[6], double (&values)[3], Vec3 (&vectors)[3]);

/** The axis of this frame's points alone: the principal axis, or world y where the points have no
 *  direction of largest spread (its variance is under 1.3 times the next one's), or where some
 * camera looks along that direction more than any looks along y: a camera sees no slices end on. */
[[nodiscard]] Axis axis_of_points (
    AxisMode mode, const Moments &moments, std::span<const PixelRays> cameras);

/** Follows the axis from frame to frame, so that neither noise nor a raised arm makes cells jump.
 */
class AxisTracker {
public:
  /** Takes in one frame's axis; the first is taken as it is. */
  const Axis &follow (const Axis &measured);
  void reset () { started_ = false; }
  [[nodiscard]] bool started () const { return started_; }
  [[nodiscard]] const Axis &axis () const { return axis_; }

private:
  bool started_ = false;
  Axis axis_;
};

} // namespace rangecast
