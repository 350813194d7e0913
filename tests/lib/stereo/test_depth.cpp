/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Rectification, matching and depth: the way from a stereo pair to a range image. */
#include "../test-support.hpp"

#include <opencv2/imgproc.hpp>
#include <random>
#include <rangecast/scene/scene.hpp>
#include <rangecast/stereo/histogram_range.hpp>
#include <rangecast/stereo/silhouette_filter.hpp>
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

TEST (Depth, is_focal_length_times_baseline_over_disparity)
{
  DisparityToDepth convert;
  ASSERT_TRUE (convert.set (320, 0.1, 1e-4, 0.3, 3).ok ());
  Image<std::uint16_t> disparity (4, 1), depth (4, 1);
  const std::uint16_t d[] = {0, 40 * 16, 40 * 16 + 8, 5 * 16};
  for (int i = 0; i < 4; i++)
    disparity.view ().at (i, 0) = d[i];
  ASSERT_TRUE (convert.convert (disparity.view (), depth.view ()).ok ());
  EXPECT_EQ (depth.view ().at (0, 0), 0);
  EXPECT_EQ (depth.view ().at (1, 0), 8000);
  EXPECT_EQ (depth.view ().at (2, 0), 7901);
  EXPECT_EQ (depth.view ().at (3, 0), 0) << "6.4 m is beyond far";
  Image<std::uint16_t> other (3, 1);
  EXPECT_EQ (convert.convert (disparity.view (), other.view ()).code (), StatusCode::kBadSize);
}

static Tiles
all_of (const cv::Mat &picture)
{
  const cv::Rect all ({0, 0}, picture.size ());
  Tiles tiles;
  tiles.set ({&all, 1}, 1);
  return tiles;
}

TEST (DisparityFilter, pixel_in_the_air_is_cleared_and_an_edge_stays)
{
  cv::Mat disparity (5, 6, CV_16S, cv::Scalar (-16));
  disparity.colRange (0, 3).setTo (640);
  disparity.at<std::int16_t> (2, 4) = 560;
  cv::Mat cleared = disparity.clone ();
  DisparityFilter ().clear_flying (0.02, 4, 0, 0, all_of (disparity), disparity, cleared);
  EXPECT_LT (cleared.at<std::int16_t> (2, 4), 0);
  EXPECT_EQ (cleared.at<std::int16_t> (2, 2), 640);
}

TEST (DisparityFilter, what_the_right_camera_cannot_see_is_cleared)
{
  cv::Mat disparity (1, 60, CV_16S, cv::Scalar (16 * 5)); /* a wall */
  disparity.colRange (40, 50).setTo (16 * 20);            /* lands on columns 20 to 29 */
  DisparityFilter ().clear_hidden (0, all_of (disparity), disparity);
  for (int x = 0; x < 60; x++)
    EXPECT_EQ (disparity.at<std::int16_t> (0, x) < 0, x >= 25 && x < 35) << x;
}

TEST (DisparityFilter, gap_in_one_surface_is_filled_and_one_between_two_is_not)
{
  cv::Mat disparity (1, 40, CV_16S, cv::Scalar (320));
  cv::Mat colour (1, 40, CV_8UC4, cv::Scalar (90, 100, 110, 0));
  disparity.colRange (5, 10).setTo (-16);
  disparity.colRange (20, 40).setTo (400); /* a step of 5 pixels */
  disparity.colRange (18, 22).setTo (-16);
  disparity.colRange (30, 34).setTo (-16);
  colour.colRange (31, 33).setTo (cv::Scalar (200, 10, 10, 0)); /* something else is there */
  DisparityFilter ().fill_gaps (colour, 12, 0, all_of (disparity), disparity);
  for (int x = 0; x < 40; x++)
    EXPECT_EQ (disparity.at<std::int16_t> (0, x) < 0, (x >= 18 && x < 22) || (x >= 30 && x < 34))
        << x;
}

TEST (DisparityFilter, rim_of_the_walls_colour_is_cleared)
{
  cv::Mat disparity (40, 60, CV_16S, cv::Scalar (160));
  cv::Mat colour (40, 60, CV_8UC4, cv::Scalar (40, 40, 40, 0));
  colour.colRange (30, 60).setTo (cv::Scalar (200, 180, 160, 0));
  disparity.colRange (27, 60).setTo (480); /* what is near has grown by 3 columns */
  cv::Mat cleared = disparity.clone ();
  SilhouetteFilter::Settings settings;
  settings.step = 0.02;
  SilhouetteFilter ().apply (settings, colour, all_of (disparity), disparity, cleared);
  for (int x = 0; x < 60; x++)
    EXPECT_EQ (cleared.at<std::int16_t> (20, x), x < 27 ? 160 : x < 30 ? -16 : 480) << x;
}

TEST (DisparityFilter, patch_that_looks_otherwise_is_cleared_and_a_darker_one_is_not)
{
  cv::Mat left (40, 80, CV_8U), right (40, 80, CV_8U);
  cv::randu (left, 0, 255);
  cv::randu (right, 0, 255);
  for (int y = 0; y < 40; y++)
    for (int x = 40; x < 80; x++) /* seen 10 pixels further left, and darker */
      right.at<std::uint8_t> (y, x - 10) = std::uint8_t (left.at<std::uint8_t> (y, x) * 7 / 8);
  cv::Mat disparity (40, 80, CV_16S, cv::Scalar (160));
  cv::Mat cleared = disparity.clone ();
  DisparityFilter ().clear_unlike (left, right, 0, 1, 0, all_of (disparity), disparity, cleared);
  EXPECT_LT (cv::countNonZero (cleared.colRange (15, 35) >= 0), 40 * 20 / 10);
  EXPECT_GT (cv::countNonZero (cleared.colRange (45, 75) >= 0), 40 * 30 * 95 / 100);
}

TEST (ThirdPair, opinions_that_agree_are_weighed_and_those_that_do_not_are_counted)
{
  cv::Mat a (9, 9, CV_16U, cv::Scalar (320)), b (9, 9, CV_16U, cv::Scalar (328));
  a.at<std::uint16_t> (4, 4) = 0;
  a.at<std::uint16_t> (4, 6) = 900; /* alone with that */
  b.at<std::uint16_t> (2, 2) = 0;
  cv::Mat memory;
  fuse_disparities (a, b, 1, memory);
  EXPECT_EQ (a.at<std::uint16_t> (0, 0), 324);
  EXPECT_EQ (a.at<std::uint16_t> (4, 4), 328);
  EXPECT_EQ (a.at<std::uint16_t> (2, 2), 320);
  EXPECT_EQ (a.at<std::uint16_t> (4, 6), 328);
  cv::Mat c (9, 9, CV_16U, cv::Scalar (320)), d (9, 9, CV_16U, cv::Scalar (900));
  fuse_disparities (c, d, 1, memory);
  EXPECT_EQ (c.at<std::uint16_t> (4, 4), 0) << "nobody knows";
}

TEST (Matching, every_algorithm_finds_the_disparity_of_displaced_dots)
{
  for (MatchAlgorithm algorithm : {MatchAlgorithm::kBm, MatchAlgorithm::kSgbm,
           MatchAlgorithm::kSgbm3Way, MatchAlgorithm::kSgm}) {
    StereoSettings settings;
    settings.match.algorithm = algorithm;
    StereoDepth stereo;
    ASSERT_TRUE (stereo.set (ideal_pair (), settings).ok ());
    Dots dots (40);
    Output output ({0, 0, 320, 240});
    ASSERT_TRUE (stereo.process (dots.left.view (), dots.right.view (), output.image ()).ok ());
    int right = 0, wrong = 0;
    for (int y = 10; y < 230; y++)
      for (int x = 60; x < 310; x++) {
        const int d = stereo.disparity ().at (x, y);
        right += std::abs (d - 640) <= 4;
        wrong += d != 0 && std::abs (d - 640) > 4;
      }
    EXPECT_GT (right, 220 * 250 * 98 / 100);
    EXPECT_LT (wrong, 220 * 250 / 200);
    EXPECT_EQ (output.colour.view ().at (7, 9).g, dots.left.view ().at (7, 9).g);
  }
}

TEST (Matching, part_of_the_picture_is_matched_as_in_the_whole)
{
  SceneSettings scene_settings;
  std::unique_ptr<Scene> scene;
  ASSERT_TRUE (Scene::create (scene_settings, scene).ok ());
  Image<Rgbx> left (320, 240), right (320, 240);
  ASSERT_TRUE (scene->render (0, SceneCamera::kLeft, 0, false, left.view (), {}, {}).ok ());
  ASSERT_TRUE (scene->render (0, SceneCamera::kRight, 0, false, right.view (), {}, {}).ok ());
  StereoDepth stereo;
  ASSERT_TRUE (stereo.set (scene->rig ().views[0], {}).ok ());
  Output whole ({0, 0, 320, 240}), part ({50, 10, 220, 220});
  ASSERT_TRUE (stereo.process (left.view (), right.view (), whole.image ()).ok ());
  ASSERT_TRUE (stereo.process (left.view (), right.view (), part.image ()).ok ());
  int both = 0, lost = 0, different = 0;
  for (int y = 20; y < 200; y++)
    for (int x = 20; x < 200; x++) {
      const int a = whole.depth.view ().at (50 + x, 10 + y), b = part.depth.view ().at (x, y);
      both += a && b;
      lost += a && !b;
      different += a && b && std::abs (a - b) > 100;
    }
  EXPECT_GT (both, 10000);
  EXPECT_LT (lost, both / 50);
  EXPECT_LT (different, both / 100);
}

TEST (Matching, depth_of_the_figure_is_near_the_true_one)
{
  SceneSettings scene_settings;
  std::unique_ptr<Scene> scene;
  ASSERT_TRUE (Scene::create (scene_settings, scene).ok ());
  Image<Rgbx> left (320, 240), right (320, 240);
  Image<std::uint16_t> truth (320, 240);
  ASSERT_TRUE (
      scene->render (0, SceneCamera::kLeft, 0, false, left.view (), truth.view (), {}).ok ());
  ASSERT_TRUE (scene->render (0, SceneCamera::kRight, 0, false, right.view (), {}, {}).ok ());
  StereoDepth stereo;
  ASSERT_TRUE (stereo.set (scene->rig ().views[0], {}).ok ());
  Output output ({0, 0, 320, 240});
  ASSERT_TRUE (stereo.process (left.view (), right.view (), output.image ()).ok ());
  std::vector<double> errors; /* pixels of disparity; 1/10 mm depth: d = 320 * 0.1 / z */
  int visible = 0;
  for (int y = 0; y < 240; y++)
    for (int x = 0; x < 320; x++) {
      const int t = truth.view ().at (x, y), z = output.depth.view ().at (x, y);
      visible += t != 0;
      if (t && z)
        errors.push_back (std::abs (320000.0 / t - 320000.0 / z));
    }
  std::ranges::sort (errors);
  EXPECT_GT (errors.size (), visible * 0.9);
  EXPECT_LT (errors[errors.size () / 2], 0.25) << "median disparity error, pixels";
  EXPECT_LT (errors[errors.size () * 95 / 100], 1.5);
}

TEST (Rectification, ideal_pair_stays_as_it_is)
{
  Rectifier rectifier;
  ASSERT_TRUE (rectifier.set (ideal_pair ()).ok ());
  EXPECT_TRUE (rectifier.is_identity ());
  EXPECT_DOUBLE_EQ (rectifier.baseline_m (), 0.1);
  EXPECT_TRUE (rectifier.range_view ().is_range_view ());
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
  ASSERT_TRUE (pair.set (odd, scene->range_rig ().views[0], 32, {}).ok ());
  const auto mat = [] (Image<Rgbx> &image) {
    return cv::Mat (240, 320, CV_8UC4, image.view ().data, std::size_t (image.view ().stride));
  };
  pair.rectify (mat (left), mat (turned));
  ASSERT_TRUE (pair.find ({0, 0, 320, 240}, 0, 0).ok ());
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

TEST (Rectification, near_that_needs_more_disparity_than_there_is_picture_is_named)
{
  View view = ideal_pair ();
  view.near_m = 0.05;
  StereoDepth stereo;
  EXPECT_NE (stereo.set (view, {}).message ().find ("near"), std::string::npos);
}

TEST (Depth, range_of_disparities_leaves_out_half_a_per_cent_at_either_end)
{
  std::vector<int> histogram (4096);
  EXPECT_EQ (without_half_a_per_cent (histogram).high, 4095);
  histogram[3] = 4;
  histogram[20] = 496;
  histogram[30] = 495;
  histogram[4095] = 5;
  EXPECT_EQ (without_half_a_per_cent (histogram).low, 20);
  EXPECT_EQ (without_half_a_per_cent (histogram).high, 4095);
}

TEST (Depth, range_of_disparities_knows_pictures_of_many_pixels)
{
  std::vector<int> histogram (4096);
  histogram[5] = 12'000'000; /* 200 times that is more than an int holds */
  histogram[9] = 120'000'000;
  EXPECT_EQ (without_half_a_per_cent (histogram).low, 5);
  EXPECT_EQ (without_half_a_per_cent (histogram).high, 9);
}

TEST (Depth, near_that_no_disparity_can_show_is_refused_however_near)
{
  for (const double near_m : {1e-9, 1e-7, 1e-3}) {
    View view = ideal_pair ();
    view.near_m = near_m;
    StereoDepth stereo;
    const Status status = stereo.set (view, {});
    EXPECT_EQ (status.code (), StatusCode::kBadValue) << near_m;
    EXPECT_NE (status.message ().find ("near = "), std::string::npos) << status.message ();
  }
}
