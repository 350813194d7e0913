/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "scene_fit.hpp"

#include <algorithm>
#include <cmath>

namespace rangecast {
namespace {

constexpr double kFill = 0.85;   /* of the picture's width or height */
constexpr double kNoise = 0.002; /* share of the points beyond each edge */

/* The value that all but the share kNoise of the values do not exceed. */
template <typename Value>
double
edge (std::span<const Vec3> points, std::vector<double> &values, const Value &value)
{
  values.clear ();
  for (const Vec3 &p : points)
    values.push_back (value (p));
  const auto at = values.begin () + std::ptrdiff_t ((1 - kNoise) * double (values.size () - 1));
  std::ranges::nth_element (values, at);
  return *at;
}

/* What two opposite sides of the frustum require of the camera's place along one image axis.
 */
struct Sides {
  double middle;   /* along that axis */
  double distance; /* along the axis towards the viewer, at least */
};

} // namespace

void
append_points (
    const ConstRangeImage &image, const View &view, std::size_t step, std::vector<Vec3> &points)
{
  std::size_t number = 0;
  for (int y = 0; y < image.depth.height; y++)
    for (int x = 0; x < image.depth.width; x++)
      if (const int depth = image.depth.at (x, y); depth != kInvalidDepth && number++ % step == 0)
        points.push_back (view.world_from_view * view.intrinsics.unproject (image.roi.x + x,
                                                     image.roi.y + y, depth * view.depth_unit_m));
}

SceneFrame
fitted_frame (
    const SceneFrame &scene, const Orbit &orbit, double aspect, std::span<const Vec3> points)
{
  if (points.empty ())
    return scene;
  const OrbitAxes axes = orbit_axes (scene, orbit);
  const double fov = orbit.fov_deg > 0 ? orbit.fov_deg : scene.fov_deg;
  const double up = kFill * std::tan (fov * M_PI / 360), right = up * aspect;
  std::vector<double> values;
  const auto reach = [&] (Vec3 axis, double slope) {
    return edge (
        points, values, [&] (const Vec3 &p) { return dot (axis, p) + slope * dot (axes.back, p); });
  };
  /* With a camera at (x, z) and a side of slope s, a point p is left of the right side if
   * p.x - x <= s (z - p.z). So the greatest p.x + s p.z of all points is at most x + s z, and on
   * the left the greatest s p.z - p.x at most s z - x. */
  const auto sides = [&] (Vec3 axis, double slope) {
    const double after = reach (axis, slope), before = reach (-1.0 * axis, slope);
    return Sides{(after - before) / 2, (after + before) / (2 * slope)};
  };
  /* From farther away than the sides require, the same with less slope is in the middle. */
  const auto centred = [&] (Vec3 axis, double slope, double distance) {
    double low = 0;
    for (int i = 0; i < 12; i++) {
      const double between = (low + slope) / 2;
      (sides (axis, between).distance > distance ? low : slope) = between;
    }
    return sides (axis, slope).middle;
  };
  const double nearest = reach (axes.back, 0), farthest = -reach (-1.0 * axes.back, 0);
  const double middle = (nearest + farthest) / 2;
  const double distance =
      std::max (sides (axes.right, right).distance, sides (axes.up, up).distance);
  SceneFrame fitted = scene;
  fitted.target = centred (axes.right, right, distance) * axes.right +
                  centred (axes.up, up, distance) * axes.up + middle * axes.back;
  fitted.distance_m = std::max (distance - middle, 0.01); /* a single point has no size */
  fitted.off_centre_x = fitted.off_centre_y = 0;
  return fitted;
}

bool
is_similar (const SceneFrame &a, const SceneFrame &b, double fov_deg)
{
  constexpr double kSame = 0.1;
  const double height = 2 * std::tan (fov_deg * M_PI / 360) * a.distance_m;
  return std::abs (a.distance_m - b.distance_m) <= kSame * a.distance_m &&
         norm (a.target - b.target) <= kSame * height;
}

} // namespace rangecast
