/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <span>

#include "../geometry/world_points.hpp"

namespace rangecast {

/** How the cylinder gets its axis. */
enum class AxisMode {
  kPrincipal, ///< the direction in which the points spread most, through their centroid
  kVertical,  ///< world y, through the centroid
  kWorld,     ///< world y, through the origin
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

  void add (double x, double y, double z);
  Moments &operator+= (const Moments &other);
  [[nodiscard]] Vec3 centroid () const;
};

/** The axis of one frame's points: the principal axis; world y where the points have no direction
 * of largest spread (its variance is less than 1.3 times the next one's), or where a camera looks
 *  along it more nearly than any camera looks along y: a camera cannot see slices along the axis.
 */
[[nodiscard]] Axis axis_of_points (
    AxisMode mode, const Moments &moments, std::span<const PixelRays> cameras);

/** Smooths the axis over time, so that neither noise nor a raised arm makes cells jump. */
class AxisTracker {
public:
  /** Updates the axis with that of a new frame; the first one is used unchanged. */
  const Axis &follow (const Axis &measured);
  void reset () { started_ = false; }

private:
  bool started_ = false;
  Axis axis_;
};

} // namespace rangecast
