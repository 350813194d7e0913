/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What refining makes of disparities whose truth is known. */
#include "../test-support.hpp"

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <rangecast/base/cpu.hpp>
#include <rangecast/stereo/disparity_refiner.hpp>

using namespace rangecast;

namespace {

constexpr int kWidth = 160, kHeight = 96, kRightX = 32;

/* A slanted surface with texture, seen by two cameras, and what a matcher may say of it. */
struct Pair {
  cv::Mat left = cv::Mat (kHeight, kWidth, CV_8U),
          right = cv::Mat (kHeight, kWidth + kRightX, CV_8U),
          colour = cv::Mat (kHeight, kWidth, CV_8UC4, cv::Scalar (120, 100, 90, 0)),
          disparity = cv::Mat (kHeight, kWidth, CV_16S);

  static double truth (int x, int y) { return 12.3 + 0.03 * x - 0.02 * y; }

  explicit Pair (double brighter = 0)
  {
    cv::RNG random (5);
    cv::Mat texture (kHeight, 3 * kWidth, CV_32F);
    random.fill (texture, cv::RNG::NORMAL, 0, 60);
    cv::GaussianBlur (texture, texture, {}, 1.5);
    for (int y = 0; y < kHeight; y++) {
      const auto row = texture.ptr<float> (y);
      const auto grey_at = [&] (double x) {
        const int a = int (std::floor (x));
        return 128 + row[a] + (x - a) * (row[a + 1] - row[a]);
      };
      for (int x = 0; x < kWidth + kRightX; x++)
        right.at<std::uint8_t> (y, x) = cv::saturate_cast<std::uint8_t> (grey_at (x + 40));
      for (int x = 0; x < kWidth; x++) {
        left.at<std::uint8_t> (y, x) =
            cv::saturate_cast<std::uint8_t> (brighter + grey_at (x + kRightX - truth (x, y) + 40));
        const double d = truth (x, y) + random.uniform (-0.4, 0.4);
        disparity.at<std::int16_t> (y, x) = std::int16_t (std::lround (16 * d));
      }
    }
  }
  void refine (const std::vector<cv::Rect> &parts = {{0, 0, kWidth, kHeight}}, int threads = 2)
  {
    Tiles tiles;
    tiles.set (parts, threads);
    DisparityRefiner ().apply ({left, right, colour, kRightX, 16}, tiles, disparity);
  }
  /* Root of the mean square, pixels, away from the picture's edge. */
  [[nodiscard]] double error () const
  {
    double sum = 0;
    int n = 0;
    for (int y = 8; y < kHeight - 8; y++)
      for (int x = 8; x < kWidth - 8; x++, n++)
        sum += std::pow (disparity.at<std::int16_t> (y, x) / 16.0 - truth (x, y), 2);
    return std::sqrt (sum / n);
  }
};

} // namespace

TEST (DisparityRefiner, noise_becomes_a_third_on_a_slanted_surface_whatever_the_brightness)
{
  Pair pair (10);
  const double before = pair.error ();
  pair.refine ();
  EXPECT_GT (before, 0.2);
  EXPECT_LT (pair.error (), before / 3);
}

TEST (DisparityRefiner, pictures_say_more_than_planes_do)
{
  Pair pair;
  pair.disparity += 8; /* half a pixel too near, which no plane can know */
  pair.refine ();
  EXPECT_LT (pair.error (), 0.1);
}

/* Groups of pixels near steps end at, and reach beyond, the edges of parts. */
TEST (DisparityRefiner, rungs_and_threads_agree_at_steps_and_in_parts_of_any_width)
{
  for (const int width : {1, 2, 7, 8, 9, 31, 33, 100}) {
    std::vector<cv::Mat> results;
    for (const CpuLevel level : kCpuLevels) {
      limit_cpu (level);
      Pair pair;
      pair.disparity (cv::Rect (44, 0, 9, kHeight)) += 16 * 4;
      pair.disparity (cv::Rect (36, 40, 6, 3)).setTo (0);
      pair.disparity (cv::Rect (58, 20, 1, 30)).setTo (0);
      const cv::Mat before = pair.disparity.clone ();
      /* Around the parts there are no disparities. */
      cv::Mat inside = cv::Mat::zeros (pair.disparity.size (), CV_8U);
      const std::vector<cv::Rect> parts = {{40, 4, width, 37}, {kWidth - width, 52, width, 40}};
      for (const cv::Rect &part : parts)
        inside (part).setTo (255);
      pair.disparity.setTo (0, ~inside);
      pair.refine (parts, level == kCpuLevels[0] ? 1 : 3);
      cv::Mat beside = pair.disparity.clone ();
      beside.setTo (0, inside);
      EXPECT_EQ (cv::countNonZero (beside), 0);
      EXPECT_GT (cv::norm (pair.disparity, before, cv::NORM_INF, inside), 0);
      results.push_back (pair.disparity.clone ());
    }
    limit_cpu (kCpuLevels[std::size (kCpuLevels) - 1]);
    for (const cv::Mat &result : results)
      EXPECT_EQ (cv::norm (result, results[0], cv::NORM_INF), 0) << width;
  }
}

TEST (DisparityRefiner, what_has_no_disparity_or_is_too_far_stays_as_it_is)
{
  Pair pair;
  pair.disparity (cv::Rect (40, 30, 20, 20)).setTo (0);
  pair.disparity (cv::Rect (80, 30, 20, 20)).setTo (15);
  pair.refine ();
  EXPECT_EQ (cv::countNonZero (pair.disparity (cv::Rect (40, 30, 20, 20))), 0);
  EXPECT_EQ (cv::countNonZero (pair.disparity (cv::Rect (80, 30, 20, 20)) != 15), 0);
}

/* Of columns x to x + n, pixels, against the slanted surface. */
static double
mean_offset (const Pair &pair, int x, int n)
{
  double sum = 0;
  for (int y = 8; y < kHeight - 8; y++)
    for (int u = x; u < x + n; u++)
      sum += pair.disparity.at<std::int16_t> (y, u) / 16.0 - Pair::truth (u, y);
  return sum / (n * (kHeight - 16));
}

TEST (DisparityRefiner, step_of_less_than_a_pixel_stays_where_colour_shows_it)
{
  Pair pair, plain;
  for (Pair *p : {&pair, &plain}) {
    cv::Mat near = p->disparity.colRange (80, kWidth);
    near += 13;           /* 0.8 pixels: less than the noise of neighbours */
    p->right.setTo (128); /* nothing to see: planes alone */
    p->left.setTo (128);
  }
  pair.colour.colRange (80, kWidth).setTo (cv::Scalar (40, 40, 40, 0));
  pair.refine ();
  plain.refine ();
  EXPECT_NEAR (mean_offset (pair, 78, 2), 0, 0.1);
  EXPECT_NEAR (mean_offset (pair, 80, 2), 0.8125, 0.1);
  EXPECT_GT (mean_offset (plain, 78, 2), 0.15); /* one colour: one surface */
}

TEST (DisparityRefiner, disparities_beyond_the_right_picture_do_not_crash)
{
  Pair pair;
  pair.disparity.setTo (30000);
  pair.disparity.colRange (0, 50).setTo (-3000);
  pair.refine ();
  SUCCEED ();
}
