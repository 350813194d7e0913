/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "view_fit.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "../geometry/point_cloud.hpp"

namespace rangecast {
namespace {

constexpr std::uint64_t kInterval_ns = 500'000'000;
constexpr std::uint64_t kMaxWait_ns = 5'000'000'000; /* for views that have no points */
constexpr std::size_t kMaxPoints = 16384;            /* of all views: enough for a fit */
constexpr std::size_t kMinPoints = 16;

/* Appends world points, metres, of every `step`-th valid pixel, row by row. */
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

/* @return in how many views the points are; 0 if they are too few */
std::size_t
sample_points (const SurfaceScene &scene, std::vector<Vec3> &points)
{
  std::size_t count = 0, views = 0;
  for (const SurfaceLayer &layer : scene.layers ()) {
    const std::size_t of_view = count_points (layer.image);
    count += of_view;
    views += of_view > 0;
  }
  if (count < kMinPoints)
    return 0;
  points.clear ();
  points.reserve (kMaxPoints + kMaxViews);
  for (const SurfaceLayer &layer : scene.layers ())
    append_points (layer.image, *layer.view, count / kMaxPoints + 1, points);
  return views;
}

/* Whether two frames show the scene at about the same size and place: within a tenth of the
 * distance and of the picture's height. */
bool
is_similar (const SceneFrame &a, const SceneFrame &b, double fov_deg)
{
  constexpr double kSame = 0.1;
  const double height = 2 * std::tan (fov_deg * M_PI / 360) * a.distance_m;
  return std::abs (a.distance_m - b.distance_m) <= kSame * a.distance_m &&
         norm (a.target - b.target) <= kSame * height;
}

} // namespace

bool
ViewFit::user_moved_camera (const Orbit &orbit) const
{
  const Orbit &before = picture_.orbit;
  return fitted_ &&
         (orbit.distance_m != before.distance_m || orbit.elevation_deg != before.elevation_deg ||
             norm (orbit.pan - before.pan) > 0);
}

void
ViewFit::refit (const SurfaceScene &scene, const Picture &picture)
{
  const std::size_t views = sample_points (scene, candidates_);
  tried_ = picture.pts;
  if (views >= views_ || picture.pts < complete_)
    complete_ = picture.pts;
  if (views == 0 || (views < views_ && picture.pts - complete_ < kMaxWait_ns))
    return;
  const SceneFrame frame =
      fitted_frame (scene.frame (), picture.orbit, picture.aspect, candidates_);
  const double fov = picture.orbit.fov_deg > 0 ? picture.orbit.fov_deg : frame.fov_deg;
  settled_ =
      picture.pts == kNoPts || (fitted_ && views == views_ && is_similar (frame, frame_, fov));
  if (settled_ && fitted_)
    return; /* no jump for a small difference */
  fitted_ = true;
  views_ = views;
  std::swap (points_, candidates_);
  picture_ = picture;
  frame_ = frame;
}

const SceneFrame &
ViewFit::update (const SurfaceScene &scene, const Picture &picture)
{
  if (std::exchange (picture_.home_requests, picture.home_requests) != picture.home_requests) {
    fitted_ = settled_ = false;
    views_ = 0;
  }
  if (user_moved_camera (picture.orbit))
    settled_ = true;
  if (!fitted_ || (!settled_ && (picture.pts < tried_ || picture.pts - tried_ >= kInterval_ns)))
    refit (scene, picture);
  if (points_.empty ())
    return scene.frame ();
  if (picture.aspect != picture_.aspect || picture.orbit.fov_deg != picture_.orbit.fov_deg) {
    picture_.aspect = picture.aspect;
    picture_.orbit.fov_deg = picture.orbit.fov_deg;
    frame_ = fitted_frame (scene.frame (), picture_.orbit, picture_.aspect, points_);
  }
  return frame_;
}

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

} // namespace rangecast
