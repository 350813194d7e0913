/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What render_bench makes of pictures whose likeness is known. */
#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <random>

#include "truth.hpp"

using namespace bench;

namespace {

constexpr int kSide = 160;

cv::Mat
grey_noise (unsigned seed)
{
  cv::Mat grey (kSide, kSide, CV_8U), colours[4];
  std::mt19937 random (seed);
  for (auto &level : cv::Mat_<uchar> (grey))
    level = static_cast<uchar> (100 + random () % 100);
  for (int i = 0; i < 3; i++)
    colours[i] = grey;
  colours[3] = cv::Mat (kSide, kSide, CV_8U, cv::Scalar (255));
  cv::Mat rgba;
  cv::merge (colours, 4, rgba);
  return rgba;
}

/* Lines so wide, with gaps of the same width between them; 0: everywhere. */
cv::Mat
lines (int width)
{
  cv::Mat mask (kSide, kSide, CV_8U, cv::Scalar (255));
  for (int x = 0; width > 0 && x < kSide; x++)
    mask.col (x) = cv::Scalar (x / width % 2 ? 255 : 0);
  return mask;
}

double
ssim_of (const cv::Mat &truth, const cv::Mat &picture, const cv::Mat &mask)
{
  Score score;
  score.add ({0, truth, mask}, picture);
  return score.ssim ();
}

TEST (RenderScore, ssim_of_unrelated_pictures_is_as_low_along_outlines_as_inside)
{
  const cv::Mat truth = grey_noise (1), picture = grey_noise (2);
  const double inside = ssim_of (truth, picture, lines (0));
  EXPECT_LT (inside, 0.1);
  for (int width : {3, 8, 20})
    EXPECT_NEAR (ssim_of (truth, picture, lines (width)), inside, 0.05) << width;
}

TEST (RenderScore, ssim_is_1_of_equal_pictures_whatever_lies_beside_the_figure)
{
  const cv::Mat truth = grey_noise (1), mask = lines (5);
  cv::Mat picture = grey_noise (2);
  truth.copyTo (picture, mask);
  EXPECT_NEAR (ssim_of (truth, picture, mask), 1, 1e-4);
}

TEST (RenderScore, holes_and_spill_are_shares_of_the_figure)
{
  const cv::Mat truth = grey_noise (1);
  cv::Mat mask (kSide, kSide, CV_8U, cv::Scalar (0)), picture = truth.clone ();
  mask (cv::Rect (20, 20, 100, 100)) = 255;
  picture.setTo (0);
  cv::Mat drawn = picture (cv::Rect (30, 20, 100, 100)); /* ten columns too far right */
  truth (cv::Rect (30, 20, 100, 100)).copyTo (drawn);
  Score score;
  score.add ({0, truth, mask}, picture);
  EXPECT_DOUBLE_EQ (score.holes (), 0.1);
  EXPECT_DOUBLE_EQ (score.spill (), 0.1);
  EXPECT_GT (score.psnr (), 100);
}

} // namespace
