/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Where the viewer's eyes, planes and parts of a picture are; tints and panels. */
#include <gtest/gtest.h>

#include <cmath>
#include <rangecast/strips/orbit.hpp>
#include <rangecast/strips/scene_hull.hpp>
#include <rangecast/strips/stats_panel.hpp>
#include <rangecast/strips/view_tint.hpp>

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

TEST (Eyes, both_eyes_see_a_point_at_one_height)
{
  const SceneFrame scene = scene_frame (one_camera ());
  const Clip left =
      clip (orbit_matrices (scene, {}, 1, true, {-0.1, 0}).clip_from_world, {0.1, 0.2, 0.5});
  const Clip right =
      clip (orbit_matrices (scene, {}, 1, true, {0.1, 0}).clip_from_world, {0.1, 0.2, 0.5});
  EXPECT_NEAR (left.y / left.w, right.y / right.w, 1e-6);
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

TEST (Planes, hull_holds_every_valid_point_of_the_roi)
{
  const Rig rig = one_camera ();
  std::vector<std::uint16_t> depth (20 * 10, 0);
  std::vector<Rgbx> colour (20 * 10);
  depth[0] = 0xffff;
  depth[57] = 4321;
  depth[199] = 1;
  const ConstRangeImage image{
      0, {100, 50, 20, 10}, {depth.data (), 20, 10, 40}, {colour.data (), 20, 10, 80}, 0};
  const DepthSpan span = depth_span (image.depth);
  EXPECT_EQ (span.nearest, 1);
  EXPECT_EQ (span.farthest, 0xffff);
  std::vector<Vec3> hull;
  append_hull (image, rig.views[0], hull);
  ASSERT_EQ (hull.size (), 8u);
  double least = 1e9, most = 0;
  for (const Vec3 &p : hull) {
    least = std::min (least, p.z);
    most = std::max (most, p.z);
  }
  EXPECT_NEAR (least, 1e-4, 1e-9);
  EXPECT_NEAR (most, 6.5535, 1e-6);
  std::fill (depth.begin (), depth.end (), 0);
  hull.clear ();
  append_hull (image, rig.views[0], hull);
  EXPECT_TRUE (hull.empty ());
}

TEST (PicturePart, whole_picture_goes_into_its_part)
{
  const Mat4 m = orbit_matrices (scene_frame (one_camera ()), {}, 1, true).clip_from_world;
  const Mat4 right_half = in_part (m, {0.5, 1, 0.5, 0});
  const Vec3 p{0.1, -0.2, 0.9};
  const Clip whole = clip (m, p), part = clip (right_half, p);
  EXPECT_NEAR (part.x / part.w, 0.5 + 0.5 * whole.x / whole.w, 1e-6);
  EXPECT_NEAR (part.y / part.w, whole.y / whole.w, 1e-6);
  EXPECT_EQ (part.z, whole.z);
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

TEST (StatsPanel, is_as_large_as_its_text_and_no_larger_than_said)
{
  StatsPanel panel;
  EXPECT_TRUE (panel.picture ().empty ());
  panel.draw (std::vector<std::string>{"a", "longer"});
  const auto two = panel.picture ();
  EXPECT_GT (two.height, 30);
  const auto *memory = two.data;
  panel.draw (std::vector<std::string> (20, std::string (500, 'w')));
  EXPECT_EQ (panel.picture ().width, StatsPanel::kMaxWidth);
  EXPECT_LE (panel.picture ().height, (StatsPanel::kMaxLines + 1) * 20);
  EXPECT_EQ (panel.picture ().data, memory); /* nothing new was allocated */
}
