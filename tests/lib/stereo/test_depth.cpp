/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Rectification, matching and depth: the way from a stereo pair to a range image. */
#include "../test-support.hpp"

#include <random>
#include <rangecast/scene/scene.hpp>
#include <rangecast/stereo/stereo_depth.hpp>

using namespace rangecast;
using rangecast::testing::Image;
using rangecast::testing::ring_view;

namespace {

View
ideal_pair (int width = 320, int height = 240)
{
  View view = ring_view (0, 0, 0.8, width, height);
  view.near_m = 0.45;
  view.far_m = 1.3;
  PartnerCamera right;
  right.intrinsics = view.intrinsics;
  right.partner_from_left.translation = {-0.1, 0, 0};
  view.right = right;
  return view;
}

/* Random dots, the right picture displaced by a whole number of pixels. */
struct Dots {
  Image<Rgbx> left{320, 240}, right{320, 240};
  explicit Dots (int disparity)
  {
    std::mt19937 random (1);
    for (int y = 0; y < 240; y++) {
      std::vector<std::uint8_t> row (500);
      for (auto &c : row)
        c = static_cast<std::uint8_t> (random ());
      for (int x = 0; x < 320; x++) {
        left.view ().at (x, y) = {row[x + 100], row[x + 100], row[x + 100], 0};
        const auto r = row[x + 100 + disparity];
        right.view ().at (x, y) = {r, r, r, 0};
      }
    }
  }
};

struct Output {
  Image<std::uint16_t> depth;
  Image<Rgbx> colour;
  Roi roi;
  explicit Output (Roi r) : depth (r.width, r.height), colour (r.width, r.height), roi (r) {}
  RangeImage image () { return {0, roi, depth.view (), colour.view (), 0}; }
};

} // namespace

/* 40 pixels are 0.8 m. */
TEST (Matching, depth_is_focal_length_times_baseline_over_disparity)
{
  StereoDepth stereo;
  ASSERT_TRUE (stereo.set (ideal_pair ()).ok ());
  Dots dots (40);
  Output output ({0, 0, 320, 240});
  ASSERT_TRUE (stereo.process (dots.left.view (), dots.right.view (), output.image ()).ok ());
  int right = 0, wrong = 0;
  for (int y = 10; y < 230; y++)
    for (int x = 60; x < 310; x++) {
      const int z = output.depth.view ().at (x, y);
      right += std::abs (z - 8000) <= 50;
      wrong += z != 0 && std::abs (z - 8000) > 50;
    }
  EXPECT_GT (right, 220 * 250 * 98 / 100);
  EXPECT_LT (wrong, 220 * 250 / 200);
  EXPECT_EQ (output.colour.view ().at (7, 9).g, dots.left.view ().at (7, 9).g);
  output.roi.x = 1;
  EXPECT_EQ (stereo.match (output.image ()).code (), StatusCode::kBadSize);
}

/* The lower half is a shaded wall whose texture is weaker than the difference between the cameras.
 */
TEST (Matching, camera_that_is_brighter_does_not_move_a_plain_surface)
{
  StereoDepth stereo;
  ASSERT_TRUE (stereo.set (ideal_pair ()).ok ());
  Dots dots (40);
  for (Image<Rgbx> *picture : {&dots.left, &dots.right})
    for (int y = 0; y < 240; y++)
      for (int x = 0; x < 320; x++) {
        const bool is_right = picture == &dots.right;
        const double at = (x + (is_right ? 40 : 0)) / 320.0, texture = picture->view ().at (x, y).g,
                     grey = 50 + 50 * at * at + (texture - 128) / (y < 120 ? 4 : 64);
        const auto level = static_cast<std::uint8_t> (std::lround (is_right ? 1.08 * grey : grey));
        picture->view ().at (x, y) = {level, level, level, 0};
      }
  Output output ({0, 0, 320, 240});
  ASSERT_TRUE (stereo.process (dots.left.view (), dots.right.view (), output.image ()).ok ());
  int right = 0;
  for (int y = 130; y < 230; y++)
    for (int x = 60; x < 310; x++)
      right += std::abs (output.depth.view ().at (x, y) - 8000) <= 100;
  EXPECT_GT (right, 100 * 250 * 95 / 100);
}

TEST (Rectification, turned_pair_gets_rows_that_agree_and_a_pose_that_fits)
{
  View view = ideal_pair ();
  const double a = 0.05; /* the right camera is turned about its optical axis and tilted */
  view.right->partner_from_left.rotation =
      Mat3{std::cos (a), -std::sin (a), 0, std::sin (a), std::cos (a), 0, 0, 0, 1} *
      Mat3{1, 0, 0, 0, std::cos (a), -std::sin (a), 0, std::sin (a), std::cos (a)};
  view.distortion = {0.05, -0.02, 0, 0};
  Rectifier rectifier;
  ASSERT_TRUE (rectifier.set (view).ok ());
  EXPECT_FALSE (rectifier.is_identity ());
  EXPECT_NEAR (rectifier.baseline_m (), 0.1, 1e-9);
  /* The optical centre does not move, and both optical axes become parallel: the baseline lies
   * along the new x axis. */
  const Pose &pose = rectifier.range_view ().world_from_view;
  EXPECT_NEAR (norm (pose.translation - view.world_from_view.translation), 0, 1e-9);
  const Pose left_from_right = view.right->partner_from_left.inverse ();
  const Vec3 right_centre = pose.inverse () * (view.world_from_view * left_from_right.translation);
  EXPECT_NEAR (right_centre.x, 0.1, 1e-6);
  EXPECT_NEAR (right_centre.y, 0, 1e-6);
  EXPECT_NEAR (right_centre.z, 0, 1e-6);
}

TEST (Rectification, swapped_vertical_and_single_cameras_are_named)
{
  Rectifier rectifier;
  View view = ideal_pair ();
  view.right->partner_from_left.translation = {0.1, 0, 0};
  EXPECT_NE (rectifier.set (view).message ().find ("swapped"), std::string::npos);
  view.right->partner_from_left.translation = {0, 0.1, 0};
  EXPECT_NE (rectifier.set (view).message ().find ("above"), std::string::npos);
  view.right.reset ();
  EXPECT_EQ (rectifier.set (view).code (), StatusCode::kNotFound);
}

TEST (Rectification, third_camera_may_stand_anywhere_beside_and_turned)
{
  SceneSettings scene_settings;
  std::unique_ptr<Scene> scene;
  ASSERT_TRUE (Scene::create (scene_settings, scene).ok ());
  const View &view = scene->rig ().views[0];
  Image<Rgbx> left (320, 240), right (320, 240);
  Image<std::uint16_t> truth (320, 240);
  ASSERT_TRUE (
      scene->render (0, SceneCamera::kLeft, 0, false, left.view (), truth.view (), {}).ok ());
  ASSERT_TRUE (scene->render (0, SceneCamera::kRight, 0, false, right.view (), {}, {}).ok ());
  /* The right camera as the third one, its picture and its axes turned by half a turn. */
  Image<Rgbx> turned (320, 240);
  for (int y = 0; y < 240; y++)
    for (int x = 0; x < 320; x++)
      turned.view ().at (x, y) = right.view ().at (319 - x, 239 - y);
  View odd = view;
  odd.third = *view.right;
  odd.third->partner_from_left.rotation = {-1, 0, 0, 0, -1, 0, 0, 0, 1};
  odd.third->partner_from_left.translation = {0.1, 0, 0};
  ThirdPair pair;
  ASSERT_TRUE (pair.set (odd, scene->range_rig ().views[0], 32, 0).ok ());
  const auto mat = [] (Image<Rgbx> &image) {
    return cv::Mat (240, 320, CV_8UC4, image.view ().data, std::size_t (image.view ().stride));
  };
  pair.rectify (mat (left), mat (turned));
  pair.find ({0, 0, 320, 240}, 0, 0);
  int person = 0, right_ones = 0;
  for (int y = 0; y < 240; y++)
    for (int x = 0; x < 320; x++)
      if (const int t = truth.view ().at (x, y)) {
        person++;
        right_ones +=
            std::abs (pair.disparity ().at<std::uint16_t> (y, x) / 16.0 - 320000.0 / t) < 1;
      }
  EXPECT_GT (right_ones, person * 0.95);
}

TEST (Depth, near_that_no_disparity_can_show_is_refused_however_near)
{
  for (const double near_m : {1e-9, 1e-3, 0.05}) {
    View view = ideal_pair ();
    view.near_m = near_m;
    StereoDepth stereo;
    const Status status = stereo.set (view);
    EXPECT_EQ (status.code (), StatusCode::kBadValue) << near_m;
    EXPECT_NE (status.message ().find ("near = "), std::string::npos) << status.message ();
  }
}
