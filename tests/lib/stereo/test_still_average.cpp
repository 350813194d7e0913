/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../test-support.hpp"

#include <opencv2/imgproc.hpp>
#include <rangecast/base/cpu.hpp>
#include <rangecast/stereo/still_average.hpp>

using namespace rangecast;

namespace {

constexpr int kWidth = 125, kHeight = 77; /* no whole blocks at the edges */
constexpr double kNoise = 2;

/* Smooth texture, `shift` pixels further left. */
cv::Mat
scene (double shift = 0)
{
  cv::RNG random (3);
  cv::Mat texture (kHeight, 2 * kWidth, CV_32FC4), picture;
  random.fill (texture, cv::RNG::NORMAL, 128, 500);
  cv::GaussianBlur (texture, texture, {}, 4);
  const cv::Matx23d from (1, 0, shift, 0, 1, 0);
  cv::warpAffine (texture, picture, from, {kWidth, kHeight}, cv::INTER_CUBIC | cv::WARP_INVERSE_MAP,
      cv::BORDER_REPLICATE);
  return picture;
}

cv::Mat
shot (const cv::Mat &scene, cv::RNG &random)
{
  cv::Mat noise (scene.size (), CV_32FC4), picture;
  random.fill (noise, cv::RNG::NORMAL, 0, kNoise);
  cv::Mat (scene + noise).convertTo (picture, CV_8U);
  return picture;
}

/* Root of the mean square, levels. */
double
difference (const cv::Mat &picture, const cv::Mat &truth, const cv::Rect &part)
{
  cv::Mat exact;
  picture.convertTo (exact, CV_32F);
  return cv::norm (exact (part), truth (part)) / std::sqrt (4.0 * part.area ());
}

const cv::Rect kAll (0, 0, kWidth, kHeight);

} // namespace

TEST (StillAverage, noise_of_a_still_scene_is_less_than_half_after_ten_frames)
{
  StillAverage still;
  still.set (10);
  cv::RNG random (1);
  const cv::Mat truth = scene ();
  cv::Mat last;
  for (int i = 0; i < 12; i++)
    last = still.add (shot (truth, random));
  EXPECT_LT (difference (last, truth, kAll), 0.45 * kNoise);
}

TEST (StillAverage, mean_of_two_frames_reaches_a_change_of_one_level)
{
  StillAverage still;
  still.set (2);
  const cv::Mat before (kHeight, kWidth, CV_8UC4, cv::Scalar::all (100));
  cv::Mat after = before.clone ();
  for (int y = 0; y < kHeight; y++)
    for (int x = y % 2; x < kWidth; x += 2) /* too little of each block to be motion */
      after.at<cv::Vec4b> (y, x) += cv::Vec4b::all (1);
  for (int i = 0; i < 4; i++)
    (void)still.add (before);
  cv::Mat last;
  for (int i = 0; i < 12; i++)
    last = still.add (after);
  EXPECT_EQ (cv::norm (last, after, cv::NORM_INF), 0);
}

TEST (StillAverage, first_picture_comes_out_as_it_is)
{
  StillAverage still;
  still.set (10);
  cv::RNG random (1);
  const cv::Mat picture = shot (scene (), random);
  EXPECT_EQ (cv::norm (still.add (picture), picture, cv::NORM_INF), 0);
}

TEST (StillAverage, what_moves_and_what_is_beside_it_start_over)
{
  StillAverage still;
  still.set (10);
  cv::RNG random (1);
  const cv::Mat truth = scene ();
  for (int i = 0; i < 10; i++)
    (void)still.add (shot (truth, random));
  cv::Mat moved = shot (truth, random);
  const cv::Rect thing (56, 32, 16, 16);
  moved (thing) += cv::Scalar::all (12);
  const cv::Mat mean = still.add (moved);
  const cv::Rect around (48, 24, 32, 32), far (0, 0, 40, kHeight);
  EXPECT_EQ (cv::norm (mean (around), moved (around), cv::NORM_INF), 0);
  EXPECT_LT (difference (mean, truth, far), 0.45 * kNoise);
}

TEST (StillAverage, what_drifts_slowly_does_not_trail)
{
  StillAverage still;
  still.set (10);
  cv::RNG random (1);
  double with = 0, without = 0;
  for (int i = 0; i < 40; i++) {
    const cv::Mat truth = scene (0.25 * i), picture = shot (truth, random),
                  mean = still.add (picture);
    if (i < 10)
      continue;
    with += difference (mean, truth, kAll);
    without += difference (picture, truth, kAll);
  }
  EXPECT_LT (with, 1.1 * without);
}

TEST (StillAverage, picture_of_another_size_starts_over)
{
  StillAverage still;
  still.set (10);
  cv::RNG random (1);
  const cv::Mat truth = scene ();
  for (int i = 0; i < 3; i++)
    (void)still.add (shot (truth, random));
  const cv::Mat smaller = shot (truth (cv::Rect (0, 0, 40, 30)).clone (), random);
  EXPECT_EQ (cv::norm (still.add (smaller), smaller, cv::NORM_INF), 0);
}

TEST (StillAverage, outside_of_the_part_the_mean_stays)
{
  StillAverage still;
  still.set (10);
  cv::RNG random (1);
  const cv::Mat truth = scene ();
  const cv::Mat first = still.add (shot (truth, random)).clone ();
  const cv::Rect part (40, 24, 32, 16); /* whole blocks */
  const cv::Mat second = still.add (shot (truth, random), part);
  EXPECT_GT (cv::norm (second (part), first (part), cv::NORM_INF), 0);
  cv::Mat rest = second.clone ();
  first (part).copyTo (rest (part));
  EXPECT_EQ (cv::norm (rest, first, cv::NORM_INF), 0);
}

TEST (StillAverage, rungs_agree)
{
  cv::Mat means[2];
  for (CpuLevel level : {CpuLevel::kScalar, CpuLevel::kAvx2}) {
    limit_cpu (level);
    StillAverage still;
    still.set (10);
    cv::RNG random (1);
    for (int i = 0; i < 5; i++)
      still.add (shot (scene (), random)).copyTo (means[int (level)]);
  }
  EXPECT_EQ (cv::norm (means[0], means[1], cv::NORM_INF), 0);
}
