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
  explicit Pair (double contrast, double brighter = 0)
  {
    cv::RNG random (7);
    cv::Mat texture (kHeight, 2 * kWidth, CV_32F);
    random.fill (texture, cv::RNG::NORMAL, 0, 1);
    cv::GaussianBlur (texture, texture, {}, 1);
    cv::Scalar mean, spread;
    cv::meanStdDev (texture, mean, spread);
    texture *= contrast / spread[0];
    for (int y = 0; y < kHeight; y++)
      for (int x = 0; x < kWidth; x++) {
        const float *row = texture.ptr<float> (y),
                    *of_square = texture.ptr<float> ((y + kHeight / 2) % kHeight);
        const float there = kSquare.contains ({x, y}) ? of_square[x] : row[x + 40 - kFar];
        left.at<std::uint8_t> (y, x) =
            cv::saturate_cast<std::uint8_t> (100 + there + random.gaussian (0.3));
        right.at<std::uint8_t> (y, x) =
            cv::saturate_cast<std::uint8_t> (100 + brighter + row[x + 40] + random.gaussian (0.3));
      }
    /* The square hides what lies behind it. */
    for (int y = kSquare.y; y < kSquare.br ().y; y++)
      for (int x = kSquare.x; x < kSquare.br ().x; x++)
        right.at<std::uint8_t> (y, x - kNear) =
            cv::saturate_cast<std::uint8_t> (brighter + left.at<std::uint8_t> (y, x));
  }
  [[nodiscard]] cv::Mat match (int n_threads = 1, SemiGlobalMatcher::Settings settings = {}) const
  {
    SemiGlobalMatcher matcher;
    matcher.set (settings);
    cv::Mat disparity;
    matcher.match (left, right, 0, kDisparities, n_threads, disparity);
    return disparity;
  }
};

/* Share of a part whose disparities are right to half a pixel. */
double
share_right (const cv::Mat &disparity, const cv::Rect &part, int truth)
{
  const cv::Mat d = disparity (part);
  return cv::countNonZero ((d >= 16 * truth - 8) & (d <= 16 * truth + 8)) / double (d.total ());
}

const cv::Rect kInSquare (kSquare.x + 6, kSquare.y + 6, kSquare.width - 12, kSquare.height - 12),
    kBeside (kSquare.br ().x + 8, 8, 36, kHeight - 16);

} // namespace

TEST (SemiGlobalMatcher, texture_of_three_levels_is_enough)
{
  const cv::Mat disparity = Pair (3).match ();
  EXPECT_GT (share_right (disparity, kInSquare, kNear), 0.97);
  EXPECT_GT (share_right (disparity, kBeside, kFar), 0.97);
}

TEST (SemiGlobalMatcher, cameras_may_differ_in_brightness)
{
  EXPECT_GT (share_right (Pair (20, 30).match (), kInSquare, kNear), 0.97);
}

TEST (SemiGlobalMatcher, steps_lie_where_they_are)
{
  const cv::Mat disparity = Pair (20).match ();
  const cv::Rect outside (kSquare.br ().x + 2, kSquare.y + 4, 6, kSquare.height - 8);
  const cv::Rect inside (kSquare.br ().x - 8, kSquare.y + 4, 6, kSquare.height - 8);
  EXPECT_GT (share_right (disparity, outside, kFar), 0.95);
  EXPECT_GT (share_right (disparity, inside, kNear), 0.95);
}

TEST (SemiGlobalMatcher, what_the_right_camera_does_not_see_has_no_disparity)
{
  const Pair pair (20);
  /* Far pixels left of the square are hidden by it. */
  const cv::Rect hidden (
      kSquare.x - (kNear - kFar) + 2, kSquare.y + 6, kNear - kFar - 5, kSquare.height - 12);
  const auto missing = [&] (const cv::Mat &disparity) {
    return cv::countNonZero (disparity (hidden) < 0) / double (hidden.area ());
  };
  EXPECT_GT (missing (pair.match ()), 0.6);
  EXPECT_LT (missing (pair.match (1, {.left_right_max_difference = -1})), 0.01);
}

TEST (SemiGlobalMatcher, threads_and_rungs_change_nothing)
{
  const Pair pair (8);
  const cv::Mat one = pair.match (1);
  EXPECT_EQ (cv::norm (one, pair.match (3), cv::NORM_INF), 0);
  limit_cpu (CpuLevel::kScalar);
  const cv::Mat scalar = pair.match (1);
  limit_cpu (CpuLevel::kAvx2);
  EXPECT_EQ (cv::norm (one, scalar, cv::NORM_INF), 0);
}

TEST (SemiGlobalMatcher, any_number_of_disparities_gives_the_same_ones)
{
  const Pair pair (20);
  SemiGlobalMatcher matcher;
  for (int n : {32, 48, 64, 80, 128}) {
    cv::Mat disparity;
    matcher.match (pair.left, pair.right, 0, n, 1, disparity);
    /* On the right of all that could be matched at any number. */
    EXPECT_GT (share_right (disparity, {kBeside.x, 30, kBeside.width, 60}, kFar), 0.97) << n;
    for (int y = 0; y < kHeight; y++)
      ASSERT_EQ (disparity.at<std::int16_t> (y, n - 1), -16) << n << " row " << y;
  }
}

TEST (SemiGlobalMatcher, both_surfaces_are_found_at_half_the_size_first)
{
  const Pair pair (20);
  SemiGlobalMatcher matcher;
  for (int n : {64, 73, 80}) {
    cv::Mat disparity;
    matcher.match (pair.left, pair.right, 0, n, 1, disparity);
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

TEST (SemiGlobalMatcher, rungs_agree_at_any_number_of_disparities)
{
  const Pair pair (8);
  SemiGlobalMatcher matcher;
  for (int n : {1, 16, 37, 48, 80, 128, 144}) {
    cv::Mat fast, scalar;
    matcher.match (pair.left, pair.right, 0, n, 1, fast);
    limit_cpu (CpuLevel::kScalar);
    matcher.match (pair.left, pair.right, 0, n, 1, scalar);
    limit_cpu (CpuLevel::kAvx2);
    EXPECT_EQ (cv::norm (fast, scalar, cv::NORM_INF), 0) << n;
  }
}

TEST (SemiGlobalMatcher, what_repeats_is_not_unique)
{
  cv::Mat stripes (40, 160, CV_8U);
  for (int x = 0; x < stripes.cols; x++)
    stripes.col (x).setTo (x / 4 % 2 ? 200 : 50);
  cv::Mat noisy[2];
  cv::RNG random (5);
  for (cv::Mat &picture : noisy) {
    picture.create (stripes.size (), CV_8U);
    random.fill (picture, cv::RNG::UNIFORM, 0, 8);
    picture += stripes;
  }
  SemiGlobalMatcher matcher;
  const auto found = [&] (int ratio) {
    matcher.set ({.uniqueness_ratio = ratio, .left_right_max_difference = -1});
    cv::Mat disparity;
    matcher.match (noisy[0], noisy[1], 0, 32, 1, disparity);
    return cv::countNonZero (disparity != -16);
  };
  EXPECT_EQ (found (0), 40 * (160 - 32));
  EXPECT_LT (found (50), 40 * (160 - 32) / 4);
  EXPECT_EQ (found (100), 0);
}

TEST (SemiGlobalMatcher, large_pictures_are_matched_in_stripes_without_a_seam)
{
  cv::Mat left (1000, 700, CV_8U), right;
  cv::RNG (3).fill (left, cv::RNG::UNIFORM, 0, 255);
  cv::copyMakeBorder (left.colRange (9, left.cols), right, 0, 0, 0, 9, cv::BORDER_REPLICATE);
  SemiGlobalMatcher matcher;
  cv::Mat disparity;
  matcher.match (left, right, 0, 63, 1, disparity); /* not at half the size first */
  EXPECT_EQ (share_right (disparity, {63, 0, 637, 1000}, 9), 1);
}

TEST (SemiGlobalMatcher, nearest_disparity_may_be_negative)
{
  const Pair pair (20);
  SemiGlobalMatcher matcher;
  cv::Mat disparity; /* left and right exchanged: what lay 19 pixels left lies as far right */
  matcher.match (pair.right, pair.left, -32, 32, 1, disparity);
  EXPECT_GT (share_right (disparity, kInSquare - cv::Point (kNear, 0), -kNear), 0.97);
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
