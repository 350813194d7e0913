/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What semi-global matching finds in pictures whose disparities are known. */
#include "../test-support.hpp"

#include <opencv2/imgproc.hpp>
#include <rangecast/base/cpu.hpp>
#include <rangecast/stereo/semi_global_matcher.hpp>

using namespace rangecast;

namespace {

constexpr int kWidth = 200, kHeight = 120, kDisparities = 32;
constexpr int kFar = 6, kNear = 19; /* pixels; the near one is a square in the middle */
const cv::Rect kSquare (90, 30, 60, 60);

/* Smooth texture of little contrast, and noise of the cameras. */
struct Pair {
  cv::Mat left = cv::Mat (kHeight, kWidth, CV_8U), right = left.clone ();
  explicit Pair (double contrast, double brighter = 0, double noise = 0.3, double scale = 1)
  {
    cv::RNG random (7);
    cv::Mat texture (kHeight, 2 * kWidth, CV_32F);
    random.fill (texture, cv::RNG::NORMAL, 0, 1);
    cv::GaussianBlur (texture, texture, {}, scale);
    cv::Scalar mean, spread;
    cv::meanStdDev (texture, mean, spread);
    texture *= contrast / spread[0];
    for (int y = 0; y < kHeight; y++)
      for (int x = 0; x < kWidth; x++) {
        const float *row = texture.ptr<float> (y),
                    *of_square = texture.ptr<float> ((y + kHeight / 2) % kHeight);
        const float there = kSquare.contains ({x, y}) ? of_square[x] : row[x + 40 - kFar];
        left.at<std::uint8_t> (y, x) =
            cv::saturate_cast<std::uint8_t> (100 + there + random.gaussian (noise));
        right.at<std::uint8_t> (y, x) = cv::saturate_cast<std::uint8_t> (
            100 + brighter + row[x + 40] + random.gaussian (noise));
      }
    /* The square hides what lies behind it. */
    for (int y = kSquare.y; y < kSquare.br ().y; y++)
      for (int x = kSquare.x; x < kSquare.br ().x; x++)
        right.at<std::uint8_t> (y, x - kNear) =
            cv::saturate_cast<std::uint8_t> (brighter + left.at<std::uint8_t> (y, x));
  }
  [[nodiscard]] cv::Mat match (int disparities = kDisparities, int n_threads = 1) const
  {
    cv::Mat disparity;
    SemiGlobalMatcher ().match (left, right, 0, disparities, n_threads, disparity);
    return disparity;
  }
};

/* Share of a part whose disparities are right to half a pixel, or `most` 1/16 pixel. */
double
share_right (const cv::Mat &disparity, const cv::Rect &part, int truth, int most = 8)
{
  const cv::Mat d = disparity (part);
  return cv::countNonZero ((d >= 16 * truth - most) & (d <= 16 * truth + most)) /
         double (d.total ());
}

const cv::Rect kInSquare (kSquare.x + 6, kSquare.y + 6, kSquare.width - 12, kSquare.height - 12),
    kBeside (kSquare.br ().x + 8, 8, 36, kHeight - 16);

} // namespace

TEST (SemiGlobalMatcher, texture_of_three_levels_is_enough_whatever_the_brightness)
{
  const cv::Mat disparity = Pair (3, 30).match ();
  EXPECT_GT (share_right (disparity, kInSquare, kNear), 0.97);
  EXPECT_GT (share_right (disparity, kBeside, kFar), 0.97);
}

TEST (SemiGlobalMatcher, half_the_size_sees_smooth_texture_in_noise)
{
  const Pair pair (2, 0, 1, 4);
  const cv::Mat alone = pair.match (15), with_half = pair.match (16);
  EXPECT_GT (share_right (with_half, kBeside, kFar, 16), 0.9);
  EXPECT_GT (
      share_right (with_half, kBeside, kFar, 16), share_right (alone, kBeside, kFar, 16) + 0.15);
}

TEST (SemiGlobalMatcher, both_surfaces_are_found_at_half_the_size_first)
{
  const Pair pair (20);
  for (int n : {64, 73, 80}) {
    const cv::Mat disparity = pair.match (n);
    EXPECT_GT (share_right (disparity, kInSquare, kNear), 0.97) << n;
    EXPECT_GT (share_right (disparity, kBeside, kFar), 0.97) << n;
  }
}

/* A tile at the edge of a near surface spans more disparities than a tile may search. */
TEST (SemiGlobalMatcher, nearest_disparities_of_a_tile_are_searched_if_it_spans_too_many)
{
  constexpr int kVeryNear = 700, kAll = 720;
  const cv::Rect surface (1010, 16, 200, 96); /* its edges lie within tiles */
  cv::Mat texture (128, 2200, CV_8U);
  cv::theRNG ().state = 3;
  cv::randu (texture, 0, 255);
  cv::GaussianBlur (texture, texture, {}, 1.5);
  const cv::Mat right = texture (cv::Rect (kFar, 0, 1400, 128)).clone ();
  cv::Mat left = texture (cv::Rect (0, 0, 1400, 128)).clone ();
  cv::Mat shown = right (surface - cv::Point (kVeryNear, 0));
  cv::randu (shown, 0, 255);
  cv::GaussianBlur (shown, shown, {}, 1.5);
  shown.copyTo (left (surface));
  SemiGlobalMatcher matcher;
  cv::Mat disparity;
  matcher.match (left, right, 0, kAll, 2, disparity);
  EXPECT_GT (share_right (disparity, {1020, 26, 180, 76}, kVeryNear), 0.95);
  EXPECT_GT (share_right (disparity, {1250, 10, 140, 108}, kFar), 0.95);
  /* In the tile of the surface's right edge, the background is too far to be searched. */
  EXPECT_EQ (share_right (disparity, {1214, 26, 14, 76}, kFar), 0);
}

TEST (SemiGlobalMatcher, large_pictures_are_matched_in_stripes_without_a_seam)
{
  cv::Mat left (1000, 700, CV_8U), right;
  cv::RNG (3).fill (left, cv::RNG::UNIFORM, 0, 255);
  cv::copyMakeBorder (left.colRange (9, left.cols), right, 0, 0, 0, 9, cv::BORDER_REPLICATE);
  SemiGlobalMatcher matcher;
  cv::Mat disparity;
  matcher.match (left, right, 0, 63, 1, disparity);
  EXPECT_EQ (share_right (disparity, {63, 0, 637, 1000}, 9), 1);
}

TEST (SemiGlobalMatcher, pictures_of_one_row_or_too_few_columns_are_matched_or_not)
{
  SemiGlobalMatcher matcher;
  for (const cv::Size size : {cv::Size (80, 1), cv::Size (80, 2), cv::Size (33, 9),
           cv::Size (32, 9), cv::Size (5, 5), cv::Size (1, 1)}) {
    const cv::Mat grey (size, CV_8U, cv::Scalar (77));
    cv::Mat disparity;
    matcher.match (grey, grey, 0, 32, 2, disparity);
    EXPECT_EQ (disparity.size (), size);
    if (size.width <= 32) {
      EXPECT_EQ (cv::countNonZero (disparity != -16), 0);
    }
  }
}
