/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "orbit_motion.hpp"

#include <algorithm>
#include <cmath>

namespace rangecast {
namespace {

constexpr double kZoomStep = 1.1;
constexpr double kTurnStep_deg = 5;
constexpr double kMaxElevation_deg = 89;
constexpr double kMaxDistance_m = 1000;

} // namespace

void
OrbitMotion::set_shown (
    const OrbitMatrices &matrices, const SceneFrame &scene, int width, int height)
{
  home_distance_m_ = scene.distance_m;
  home_elevation_deg_ = scene.elevation_deg;
  pan_right_ = matrices.pan_right;
  pan_down_ = matrices.pan_down;
  width_ = width;
  height_ = height;
}

/* Stays below the vertical, which is nearer where the first view itself looks down or up. */
void
OrbitMotion::turn (double azimuth_deg, double elevation_deg)
{
  orbit.azimuth_deg = std::fmod (orbit.azimuth_deg + azimuth_deg, 360.0);
  orbit.elevation_deg = std::clamp (orbit.elevation_deg + elevation_deg,
      std::max (-kMaxElevation_deg, -kMaxElevation_deg - home_elevation_deg_),
      std::min (kMaxElevation_deg, kMaxElevation_deg - home_elevation_deg_));
}

void
OrbitMotion::zoom (double factor)
{
  const double distance_m = orbit.distance_m > 0 ? orbit.distance_m : home_distance_m_;
  orbit.distance_m = std::clamp (distance_m * factor, 0.01, kMaxDistance_m);
}

void
OrbitMotion::orbit_by (double dx, double dy)
{
  turn (-180 * dx / width_, 90 * dy / height_);
}

void
OrbitMotion::pan_by (double dx, double dy)
{
  const Vec3 pan = orbit.pan - dx / width_ * pan_right_ - dy / height_ * pan_down_;
  const auto limited = [] (double metres) {
    return std::clamp (metres, -kMaxDistance_m, kMaxDistance_m);
  };
  orbit.pan = {limited (pan.x), limited (pan.y), limited (pan.z)};
}

void
OrbitMotion::pinch (double dx, double dy, double before, double after)
{
  pan_by (dx, dy);
  if (before > 1 && after > 1)
    zoom (before / after);
}

void
OrbitMotion::step (int right, int up)
{
  turn (kTurnStep_deg * right, kTurnStep_deg * up);
}

void
OrbitMotion::step_nearer (bool nearer)
{
  zoom (nearer ? 1 / kZoomStep : kZoomStep);
}

void
OrbitMotion::go_home ()
{
  orbit = {.fov_deg = orbit.fov_deg, .pan = {}};
  home_requests++;
}

} // namespace rangecast
