/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Where the viewer's eyes, planes and parts of a picture are; tints and panels. */
#include <gtest/gtest.h>

#include <cmath>
#include <rangecast/surface/orbit.hpp>
#include <rangecast/surface/scene_hull.hpp>
#include <rangecast/surface/view_fit.hpp>
#include <rangecast/surface/view_tint.hpp>

using namespace rangecast;

namespace {

/* One camera at the origin that looks along z, 320x240, 320 pixels of focal length. */
Rig
one_camera ()
{
  View view;
  view.width = 320;
  view.height = 240;
  view.intrinsics = {320, 320, 159.5, 119.5};
  view.near_m = 0.5;
  view.far_m = 1.5;
  return {{view}};
}

struct Clip {
  double x, y, z, w;
};

Clip
clip (const Mat4 &m, Vec3 p)
{
  const auto row = [&] (int i) { return m[i] * p.x + m[4 + i] * p.y + m[8 + i] * p.z + m[12 + i]; };
  return {row (0), row (1), row (2), row (3)};
}

/* Pixels of a picture 320 wide. */
double
column (const Mat4 &m, Vec3 p)
{
  const Clip c = clip (m, p);
  return (c.x / c.w + 1) / 2 * 320;
}

} // namespace

TEST (Eyes, disparity_is_that_of_two_parallel_cameras_less_that_of_the_convergence)
{
  const SceneFrame scene = scene_frame (one_camera ());
  const double e = 0.06;
  for (double convergence : {0.0, 0.6, 1000.0})
    for (double z : {0.4, 0.75, 2.0}) {
      const Mat4 left =
          orbit_matrices (scene, {}, 4.0 / 3, true, {-e / 2, convergence}).clip_from_world;
      const Mat4 right =
          orbit_matrices (scene, {}, 4.0 / 3, true, {e / 2, convergence}).clip_from_world;
      const double from = convergence > 0 ? convergence : scene.distance_m;
      EXPECT_NEAR (column (left, {0.1, 0.05, z}) - column (right, {0.1, 0.05, z}),
          320 * e * (1 / z - 1 / from), 1e-3);
    }
}

TEST (Planes, all_of_the_hull_is_between_them_and_they_are_close_round_it)
{
  const SceneFrame scene = scene_frame (one_camera ());
  for (const auto &[nearest, farthest] :
      {std::pair{0.02, 0.03}, {0.5, 0.9}, {1.0, 60.0}, {5.0, 6.0}}) {
    const Vec3 hull[] = {{0.3, 0.1, nearest}, {-1, 2, farthest}};
    const Mat4 m = orbit_matrices (scene, {}, 1, true, {}, hull).clip_from_world;
    for (const Vec3 &p : hull) {
      const Clip c = clip (m, p);
      EXPECT_LT (std::abs (c.z / c.w), 1) << p.z;
    }
    const Clip before = clip (m, {0, 0, 0.45 * nearest}), behind = clip (m, {0, 0, 2.2 * farthest});
    EXPECT_LT (before.z / before.w, -1);
    EXPECT_GT (behind.z / behind.w, 1);
  }
}

TEST (Planes, near_one_stays_before_the_eye_when_points_are_behind_it)
{
  const SceneFrame scene = scene_frame (one_camera ());
  const Vec3 hull[] = {{0, 0, -1}, {0, 0, 2}};
  const Mat4 m = orbit_matrices (scene, {}, 1, true, {}, hull).clip_from_world;
  const Clip close_by = clip (m, {0, 0, 0.01}), far_off = clip (m, {0, 0, 2});
  EXPECT_LT (std::abs (close_by.z / close_by.w), 1);
  EXPECT_LT (std::abs (far_off.z / far_off.w), 1);
  const Vec3 all_behind[] = {{0, 0, -1}};
  const Mat4 fallback = orbit_matrices (scene, {}, 1, true, {}, all_behind).clip_from_world;
  EXPECT_EQ (fallback, orbit_matrices (scene, {}, 1, true).clip_from_world);
}

TEST (ViewTint, hue_is_the_colours_and_brightness_follows_the_picture)
{
  const Rgbx pixels[] = {{0, 0, 0}, {255, 255, 255}, {0, 255, 0}};
  std::vector<Rgbx> memory;
  const auto copy = tinted ({pixels, 3, 1, 12}, {200, 100, 50, "test"}, memory);
  EXPECT_EQ (copy.at (0, 0).r, 100);
  EXPECT_EQ (copy.at (0, 0).g, 50);
  EXPECT_EQ (copy.at (1, 0).r, 200);
  EXPECT_EQ (copy.at (1, 0).b, 50);
  EXPECT_GT (copy.at (2, 0).r, copy.at (0, 0).r);
  EXPECT_LT (copy.at (2, 0).r, copy.at (1, 0).r);
}

/* ---- fits ---- */

namespace {

struct Extent {
  double left = 1, right = -1, top = 1, bottom = -1; /* -1 to 1 */

  Extent (const Mat4 &m, std::span<const Vec3> points)
  {
    for (const Vec3 &p : points) {
      const Clip c = clip (m, p);
      left = std::min (left, c.x / c.w);
      right = std::max (right, c.x / c.w);
      top = std::min (top, c.y / c.w);
      bottom = std::max (bottom, c.y / c.w);
    }
  }
};

/* A slanted slab of points that lies beside what the camera looks at; its corners are no noise. */
std::vector<Vec3>
slab ()
{
  std::vector<Vec3> points;
  for (int i = 0; i < 40; i++)
    for (int j = 0; j < 40; j++)
      for (int k = 0; k < (i % 39 == 0 && j % 39 == 0 ? 10 : 1); k++)
        points.push_back ({0.3 + 0.01 * i, -0.1 + 0.004 * j, 0.7 + 0.008 * i + 0.002 * j});
  return points;
}

} // namespace

TEST (Fit, points_touch_the_margins_from_any_side)
{
  const SceneFrame scene = scene_frame (one_camera ());
  const std::vector<Vec3> points = slab ();
  for (double azimuth : {0.0, 40.0, -120.0, 180.0})
    for (double elevation : {0.0, 50.0, -89.0})
      for (double aspect : {0.3, 1.0, 3.0})
        for (double fov : {0.0, 20.0, 80.0}) {
          const Orbit orbit{
              .azimuth_deg = azimuth, .elevation_deg = elevation, .fov_deg = fov, .pan = {}};
          const SceneFrame fitted = fitted_frame (scene, orbit, aspect, points);
          const auto matrices = orbit_matrices (fitted, orbit, aspect, true, {}, points);
          SCOPED_TRACE (
              ::testing::Message () << azimuth << " " << elevation << " " << aspect << " " << fov);
          const Extent extent (matrices.clip_from_world, points);
          EXPECT_NEAR (
              std::max (extent.right - extent.left, extent.bottom - extent.top), 1.7, 0.02);
          EXPECT_NEAR (extent.left, -extent.right, 0.02);
          EXPECT_NEAR (extent.top, -extent.bottom, 0.02);
        }
}

TEST (Fit, one_in_a_thousand_is_noise)
{
  const SceneFrame scene = scene_frame (one_camera ());
  std::vector<Vec3> points = slab ();
  const SceneFrame before = fitted_frame (scene, {}, 1, points);
  points.push_back ({-40, 3, 0.5});
  const SceneFrame after = fitted_frame (scene, {}, 1, points);
  EXPECT_NEAR (after.distance_m, before.distance_m, 0.01);
  EXPECT_LT (norm (after.target - before.target), 0.01);
}

TEST (Fit, nothing_and_a_single_point_leave_a_view)
{
  const SceneFrame scene = scene_frame (one_camera ());
  EXPECT_EQ (fitted_frame (scene, {}, 1, {}).distance_m, scene.distance_m);
  const std::vector<Vec3> one (100, Vec3{0.2, 0.3, 0.9});
  const SceneFrame fitted = fitted_frame (scene, {}, 1, one);
  EXPECT_NEAR (norm (fitted.target - one[0]), 0, 1e-6);
  EXPECT_GT (fitted.distance_m, 0);
}
