/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "orbit.hpp"

namespace rangecast {

/** An orbiting camera that pointers and keys move, within the ranges of striprender's properties.
 */
class OrbitMotion {
public:
  Orbit orbit;                ///< azimuth -360 to 360 degrees
  unsigned home_requests = 0; ///< how often the first view was requested

  /** Sets what is on the screen, for drags, and the camera's position while members of `orbit` are
   *  0. @param width, height  of the picture, pixels */
  void set_shown (const OrbitMatrices &matrices, const SceneFrame &scene, int width, int height);

  void turn (double azimuth_deg, double elevation_deg);
  /** Multiplies the distance. */
  void zoom (double factor);
  /** A drag by pixels: half a circle over the width of the picture, a quarter over its height. */
  void orbit_by (double dx, double dy);
  /** A drag by pixels: the scene follows the pointer. */
  void pan_by (double dx, double dy);
  /** Two fingers move: to distance `after` between them, pixels, and their middle by (dx, dy). */
  void pinch (double dx, double dy, double before, double after);
  /** What a key or a notch of the wheel does: turns by steps, moves nearer or farther by one. */
  void step (int right, int up);
  void step_nearer (bool nearer);
  /** Back to the first view; the field of view stays. */
  void go_home ();

private:
  double home_distance_m_ = 1, home_elevation_deg_ = 0;
  Vec3 pan_right_, pan_down_;
  int width_ = 640, height_ = 480;
};

} // namespace rangecast
