/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Depth and colour of two cameras, of a wall and a box whose truth is known for every ray. */
#include "../test-support.hpp"

#include <opencv2/calib3d.hpp>
#include <rangecast/registration/registration.hpp>
#include <rangecast/scene/scene.hpp>

using namespace rangecast;
using rangecast::testing::Image;

namespace {

/* A slanted wall 2 m away and a box of 0.4 x 0.4 m whose front is 1 m away. */
struct Hit {
  double z;   /* metres along the camera's axis; 0 = nothing */
  Vec3 world; /* where */
  bool box;
};

Hit
cast (const View &camera, double nx, double ny)
{
  const Vec3 from = camera.world_from_view.translation;
  const Vec3 ray = camera.world_from_view.rotation * Vec3{nx, ny, 1};
  const double box = (-1 - from.z) / ray.z;
  const Vec3 at = from + box * ray;
  if (std::abs (at.x) < 0.2 && std::abs (at.y) < 0.2)
    return {box, at, true};
  /* The wall: z = -2 - 0.3 x. */
  const double wall = (-2 - 0.3 * from.x - from.z) / (ray.z + 0.3 * ray.x);
  return {wall, from + wall * ray, false};
}

Rgbx
paint (const Hit &hit)
{
  const auto wave = [] (double v) {
    return static_cast<std::uint8_t> (90 + 60 * std::sin (12 * v));
  };
  return {wave (hit.world.x), wave (hit.world.y), std::uint8_t (hit.box ? 250 : 10), 0};
}

View
camera (int id, int width, int height, double focal, Vec3 place, double turn)
{
  View view;
  view.id = id;
  view.width = width;
  view.height = height;
  view.intrinsics = {focal, focal, (width - 1) / 2.0 + 2, (height - 1) / 2.0 - 1};
  const double c = std::cos (turn), s = std::sin (turn);
  /* Level, looking along -z, turned about y. */
  view.world_from_view.rotation = {c, 0, -s, 0, -1, 0, -s, 0, -c};
  view.world_from_view.translation = place;
  view.near_m = 0.3;
  view.far_m = 4;
  return view;
}

/* Directions of a camera's pixels, distortion taken out. */
cv::Vec2d
direction (const View &view, double x, double y)
{
  const Intrinsics &k = view.intrinsics;
  std::vector<cv::Point2d> in = {{x, y}}, out;
  cv::undistortPoints (
      in, out, cv::Matx33d (k.fx, 0, k.cx, 0, k.fy, k.cy, 0, 0, 1), view.distortion);
  return {out[0].x, out[0].y};
}

struct Pictures {
  Image<std::uint16_t> depth;
  Image<Rgbx> colour;

  Pictures (const View &d, const View &c, double metres)
      : depth (d.width, d.height), colour (c.width, c.height)
  {
    for (int y = 0; y < d.height; y++)
      for (int x = 0; x < d.width; x++) {
        const cv::Vec2d n = direction (d, x, y);
        depth.view ().at (x, y) =
            static_cast<std::uint16_t> (std::lround (cast (d, n[0], n[1]).z / metres));
      }
    for (int y = 0; y < c.height; y++)
      for (int x = 0; x < c.width; x++) {
        const cv::Vec2d n = direction (c, x, y);
        colour.view ().at (x, y) = paint (cast (c, n[0], n[1]));
      }
  }
};

/* How a range image compares with the truth of its view. */
struct Verdict {
  int valid = 0, wrong_depth = 0, wrong_colour = 0, wrong_thing = 0;
};

Verdict
judge (const View &view, const RangeImage &image)
{
  Verdict v;
  for (int y = 0; y < view.height; y++)
    for (int x = 0; x < view.width; x++) {
      if (image.depth.at (x, y) == kInvalidDepth)
        continue;
      v.valid++;
      const auto &k = view.intrinsics;
      const Hit truth = cast (view, (x - k.cx) / k.fx, (y - k.cy) / k.fy);
      const Rgbx c = image.colour.at (x, y), t = paint (truth);
      v.wrong_depth += std::abs (image.depth.at (x, y) * view.depth_unit_m - truth.z) > 0.004;
      v.wrong_colour += std::abs (c.r - t.r) > 12 || std::abs (c.g - t.g) > 12;
      v.wrong_thing +=
          std::abs (c.b - t.b) > 120; /* colour of the wall on the box, or the reverse */
    }
  return v;
}

struct Result {
  View view;
  Image<std::uint16_t> depth;
  Image<Rgbx> colour;
  RangeImage image;
  Verdict verdict;
};

std::unique_ptr<Result>
register_pictures (const View &d, const View &c, RegisterInto into, double metres = 0.001)
{
  Registration registration;
  EXPECT_TRUE (registration.set (d, c, into).ok ());
  const View &view = registration.range_view ();
  EXPECT_TRUE (view.is_range_view ());
  auto result = std::make_unique<Result> (
      Result{view, {view.width, view.height}, {view.width, view.height}, {}, {}});
  result->image = {
      view.id, {0, 0, view.width, view.height}, result->depth.view (), result->colour.view (), 0};
  Pictures pictures (d, c, metres);
  const Status status =
      registration.process (pictures.depth.view (), metres, pictures.colour.view (), result->image);
  EXPECT_TRUE (status.ok ()) << status.message ();
  result->verdict = judge (view, result->image);
  return result;
}

View
depth_camera ()
{
  return camera (3, 160, 120, 140, {0, 0, 0}, 0);
}

View
colour_camera ()
{
  return camera (5, 320, 240, 300, {0.06, 0.01, 0.005}, 0.03);
}

} // namespace

TEST (Registration, into_colour_draws_depth_as_the_colour_camera_sees_it)
{
  const auto r = register_pictures (depth_camera (), colour_camera (), RegisterInto::kColour);
  EXPECT_EQ (r->view.id, 5);
  EXPECT_EQ (r->view.width, 320);
  const int pixels = 320 * 240;
  EXPECT_GT (r->verdict.valid, pixels * 90 / 100);
  EXPECT_LT (r->verdict.wrong_depth, pixels * 15 / 1000); /* at the box's edges: two pixels wide */
  EXPECT_EQ (r->verdict.wrong_colour, 0);
  EXPECT_EQ (r->verdict.wrong_thing, 0);
}

TEST (Registration, into_depth_keeps_depth_and_hides_what_the_colour_camera_does_not_see)
{
  const View d = depth_camera (), c = colour_camera ();
  const auto r = register_pictures (d, c, RegisterInto::kDepth);
  EXPECT_EQ (r->view.id, 3);
  EXPECT_GT (r->verdict.valid, 160 * 120 * 80 / 100);
  EXPECT_EQ (r->verdict.wrong_depth, 0);
  EXPECT_LT (r->verdict.wrong_thing, r->verdict.valid / 200);
  /* Points behind the box, as the colour camera sees it, are invalid. */
  int hidden = 0, kept = 0;
  for (int y = 0; y < d.height; y++)
    for (int x = 0; x < d.width; x++) {
      const Hit hit = cast (
          d, (x - d.intrinsics.cx) / d.intrinsics.fx, (y - d.intrinsics.cy) / d.intrinsics.fy);
      const Vec3 p = c.world_from_view.inverse () * hit.world;
      const Hit seen = cast (c, p.x / p.z, p.y / p.z);
      if (seen.z > 0.9 * p.z)
        continue;
      hidden++;
      kept += r->image.depth.at (x, y) != kInvalidDepth;
    }
  EXPECT_GT (hidden, 100);
  EXPECT_LE (kept, hidden / 50); /* at the rim */
}

TEST (Registration, lens_distortion_of_both_cameras_is_taken_out)
{
  View d = depth_camera (), c = colour_camera ();
  d.distortion = {-0.12, 0.03, 0.001, -0.002};
  c.distortion = {0.15, -0.1, -0.001, 0.001, 0.02};
  for (const RegisterInto into : {RegisterInto::kDepth, RegisterInto::kColour}) {
    const auto r = register_pictures (d, c, into);
    const int pixels = r->view.width * r->view.height;
    EXPECT_GT (r->verdict.valid, pixels * 75 / 100);
    EXPECT_LT (r->verdict.wrong_depth, pixels * 25 / 1000);
    EXPECT_LT (r->verdict.wrong_colour, pixels * 2 / 100); /* at the box's edges */
    EXPECT_LT (r->verdict.wrong_thing, pixels / 100);
  }
}

TEST (Registration, colour_of_more_pixels_and_the_same_view_loses_nothing)
{
  View d = depth_camera (), c = d;
  ASSERT_TRUE (scale_view (c, 480, 360).ok ());
  for (const RegisterInto into : {RegisterInto::kDepth, RegisterInto::kColour}) {
    const auto r = register_pictures (d, c, into);
    EXPECT_GT (r->verdict.valid, r->view.width * r->view.height * 985 / 1000);
    EXPECT_LT (r->verdict.wrong_depth, r->verdict.valid / 100);
    EXPECT_LT (r->verdict.wrong_colour, r->verdict.valid / 100);
  }
}

TEST (Registration, cameras_that_look_apart_or_magnify_absurdly_give_nothing_and_take_no_time)
{
  View d = depth_camera (), away = camera (1, 320, 240, 300, {}, M_PI), huge = colour_camera ();
  huge.intrinsics.fx = huge.intrinsics.fy = 1e6;
  for (const RegisterInto into : {RegisterInto::kDepth, RegisterInto::kColour}) {
    EXPECT_EQ (register_pictures (d, away, into)->verdict.valid, 0);
    register_pictures (d, huge, into);
  }
}

TEST (Registration, person_of_the_test_scene_is_where_the_other_camera_sees_it)
{
  SceneSettings settings;
  settings.far_m = 4.5;
  std::unique_ptr<Scene> scene;
  ASSERT_TRUE (Scene::create (settings, scene).ok ());
  View d = scene->range_rig ().views[0], c = d;
  c.id = 1;
  c.world_from_view = d.world_from_view * Pose{kIdentity3, {settings.baseline_m, 0, 0}};
  Image<std::uint16_t> depth (320, 240), truth (320, 240), drawn (320, 240);
  Image<Rgbx> left (320, 240), right (320, 240), out (320, 240);
  Image<std::uint8_t> mask (320, 240);
  ASSERT_TRUE (
      scene->render (0, SceneCamera::kLeft, 1, false, left.view (), depth.view (), {}).ok ());
  ASSERT_TRUE (
      scene->render (0, SceneCamera::kRight, 1, false, right.view (), truth.view (), mask.view ())
          .ok ());
  Registration registration;
  ASSERT_TRUE (registration.set (d, c, RegisterInto::kColour).ok ());
  const RangeImage image = {1, {0, 0, 320, 240}, drawn.view (), out.view (), 0};
  ASSERT_TRUE (registration.process (depth.view (), d.depth_unit_m, right.view (), image).ok ());
  int person = 0, right_depth = 0, missing = 0, ghosts = 0;
  for (int y = 0; y < 240; y++)
    for (int x = 0; x < 320; x++) {
      const int z = drawn.view ().at (x, y), t = truth.view ().at (x, y);
      const bool is_person = mask.view ().at (x, y);
      person += is_person;
      missing += is_person && z == 0; /* what the depth camera did not see */
      right_depth += is_person && z && std::abs (z - t) < 50;
      ghosts += !is_person && z && z < 15000;
    }
  EXPECT_GT (person, 15000);
  EXPECT_LT (missing, person * 8 / 100);
  EXPECT_GT (right_depth, (person - missing) * 98 / 100);
  EXPECT_LT (ghosts, person / 100);
}
