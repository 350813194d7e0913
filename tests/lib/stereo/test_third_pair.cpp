/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* ThirdPair on walls drawn as cameras with real lenses see them, which may stand and look askew. */
#include "../test-support.hpp"

#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <rangecast/stereo/rectification.hpp>
#include <rangecast/stereo/third_pair.hpp>

using namespace rangecast;

namespace {

constexpr int kWidth = 320, kHeight = 240;
constexpr double kBaseline = 0.05;
constexpr Roi kWhole = {0, 0, kWidth, kHeight};

/* A pattern that is smooth and never the same twice: grey at a place on a wall, metres. */
double
pattern (double x, double y)
{
  const auto dot = [] (int i, int j) {
    unsigned n = unsigned (i) * 73856093u ^ unsigned (j) * 19349663u;
    n = (n ^ n >> 13) * 1274126177u;
    return double ((n ^ n >> 16) & 255);
  };
  double grey = 0;
  for (double cell : {0.006, 0.02}) {
    const double u = x / cell, v = y / cell, fu = u - std::floor (u), fv = v - std::floor (v);
    const int i = int (std::floor (u)), j = int (std::floor (v));
    grey += 0.5 * ((1 - fv) * ((1 - fu) * dot (i, j) + fu * dot (i + 1, j)) +
                      fv * ((1 - fu) * dot (i, j + 1) + fu * dot (i + 1, j + 1)));
  }
  return grey;
}

/* In the left camera's frame: a wall, and perhaps a board before it. Metres. */
struct Walls {
  double wall = 0.8, board = 0;

  /* How far along a ray, which has z = 1 in no frame in particular. */
  double hit (Vec3 from, Vec3 along) const
  {
    if (board > 0) {
      const double t = (board - from.z) / along.z;
      const Vec3 at = from + t * along;
      if (std::abs (at.x) < 0.1 && std::abs (at.y) < 0.1)
        return t;
    }
    return (wall - from.z) / along.z;
  }
};

Mat3
turned (double about_x_deg, double about_y_deg)
{
  const double a = about_x_deg * M_PI / 180, b = about_y_deg * M_PI / 180;
  const Mat3 x = {1, 0, 0, 0, std::cos (a), -std::sin (a), 0, std::sin (a), std::cos (a)};
  const Mat3 y = {std::cos (b), 0, std::sin (b), 0, 1, 0, -std::sin (b), 0, std::cos (b)};
  return x * y;
}

/* What a camera sees, CV_8UC4. */
cv::Mat
draw (const Walls &walls, const Intrinsics &k, const Distortion &distortion,
    const Pose &camera_from_left)
{
  std::vector<cv::Point2d> pixels, rays;
  for (int y = 0; y < kHeight; y++)
    for (int x = 0; x < kWidth; x++)
      pixels.emplace_back (x, y);
  const cv::Matx33d camera (k.fx, 0, k.cx, 0, k.fy, k.cy, 0, 0, 1);
  cv::undistortPoints (pixels, rays, camera, distortion, {}, cv::noArray (),
      cv::TermCriteria (cv::TermCriteria::COUNT, 40, 0));
  cv::Mat picture (kHeight, kWidth, CV_8UC4);
  const Pose left_from_camera = camera_from_left.inverse ();
  for (int i = 0; i < kWidth * kHeight; i++) {
    const Vec3 along = left_from_camera.rotation * Vec3{rays[i].x, rays[i].y, 1};
    const double t = walls.hit (left_from_camera.translation, along);
    const Vec3 at = left_from_camera.translation + t * along;
    const auto grey = std::uint8_t (std::lround (pattern (at.x + at.z, at.y)));
    picture.at<cv::Vec4b> (i / kWidth, i % kWidth) = {grey, grey, grey, 0};
  }
  return picture;
}

View
rig_view (double k1, const Pose &third_from_left)
{
  View view;
  view.width = kWidth;
  view.height = kHeight;
  view.intrinsics = {300, 300, 159.5, 119.5};
  if (k1 != 0)
    view.distortion = {k1, 0, 0, 0};
  view.near_m = 0.45;
  view.far_m = 1.3;
  view.right = PartnerCamera{view.intrinsics, view.distortion, {kIdentity3, {-kBaseline, 0, 0}}};
  view.third = PartnerCamera{view.intrinsics, view.distortion, third_from_left};
  return view;
}

/* A third camera above the left one, so far before it and looking that much elsewhere. */
Pose
above (double before_m = 0, double about_x_deg = 0, double about_y_deg = 0)
{
  const Mat3 rotation = turned (about_x_deg, about_y_deg);
  return {rotation, -1.0 * (rotation * Vec3{0, -kBaseline, before_m})};
}

/* A rig's third pair, and the truth about what it found. */
struct Trio {
  View view;
  Rectifier rectifier;
  ThirdPair pair;

  explicit Trio (const View &of) : view (of)
  {
    EXPECT_TRUE (rectifier.set (view).ok ());
    const Status set = pair.set (view, rectifier.range_view (), focal_baseline (), 0);
    EXPECT_TRUE (set.ok ()) << set.message ();
  }
  double focal_baseline () const
  {
    return rectifier.range_view ().intrinsics.fx * rectifier.baseline_m ();
  }
  void take (const Walls &walls)
  {
    pair.rectify (draw (walls, view.intrinsics, view.distortion, {}),
        draw (
            walls, view.third->intrinsics, view.third->distortion, view.third->partner_from_left));
  }
  /* Depth of the range view's pixel. */
  double truth (const Walls &walls, int x, int y) const
  {
    const View &range = rectifier.range_view ();
    const Mat3 left_from_range =
        transposed (view.world_from_view.rotation) * range.world_from_view.rotation;
    return walls.hit ({}, left_from_range * range.intrinsics.unproject (x, y, 1));
  }
  /* Share of the ROI's pixels on whose disparity that of the truth is found to a pixel. */
  double found (const Walls &walls, const Roi &roi) const
  {
    int right = 0;
    for (int y = 0; y < roi.height; y++)
      for (int x = 0; x < roi.width; x++) {
        const double wanted = 16 * focal_baseline () / truth (walls, roi.x + x, roi.y + y);
        const int d = pair.disparity ().at<std::uint16_t> (y, x);
        right += d > 0 && std::abs (d - wanted) <= 16;
      }
    return double (right) / (roi.width * roi.height);
  }
};

} // namespace

TEST (ThirdPair, sees_what_the_range_view_shows_whatever_the_lenses_and_poses)
{
  const Pose beside = {kIdentity3, {-kBaseline, 0, 0}};
  for (const double k1 : {0.0, -0.1, -0.3, 0.05})
    for (const Pose &third :
        {above (), beside, above (0.015), above (-0.015), above (0.01, -2, 3)}) {
      Trio trio (rig_view (k1, third));
      const Walls walls;
      trio.take (walls);
      trio.pair.find (kWhole, 0, 0);
      EXPECT_GT (trio.found (walls, kWhole), 0.75) << "k1 = " << k1;
    }
}

/* Depth in the third pair's frame is up to 8 % more and 20 % less than in the range view. */
TEST (ThirdPair, limits_of_depth_are_those_of_the_range_view)
{
  const Walls walls = {0.6, 0};
  int checked = 0;
  for (const double before : {-0.04, 0.04}) {
    Trio trio (rig_view (0, {kIdentity3, {0, 0.1, -before}}));
    trio.take (walls);
    for (const Roi &part : {Roi{60, 5, 200, 30}, Roi{60, 205, 200, 30}}) {
      trio.pair.find (part, 0, 0);
      const double all = trio.found (walls, part);
      if (all < 0.8)
        continue; /* the third camera does not see it */
      trio.pair.find (part, 0.93 * walls.wall, 1.03 * walls.wall);
      EXPECT_GT (trio.found (walls, part), 0.95 * all) << before << " " << part.y;
      checked++;
    }
  }
  EXPECT_GE (checked, 2);
}

TEST (ThirdPair, wall_beyond_far_is_remembered_from_the_whole_picture)
{
  const Walls walls = {2.0, 0.6};
  for (const double k1 : {0.0, -0.1}) {
    Trio trio (rig_view (k1, above (0.01, 4, 3)));
    trio.take (walls);
    const Roi part = {90, 50, 140, 140};
    trio.pair.find (kWhole, 0, 0);
    trio.pair.find (part, 0.55, 0.65);
    int wrong = 0;
    for (int y = 0; y < part.height; y++)
      for (int x = 0; x < part.width; x++)
        wrong +=
            trio.truth (walls, part.x + x, part.y + y) > 1 &&
            trio.pair.disparity ().at<std::uint16_t> (y, x) > 16 * trio.focal_baseline () / 1.3;
    EXPECT_LT (wrong, part.width * part.height / 200) << "k1 = " << k1;
  }
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
