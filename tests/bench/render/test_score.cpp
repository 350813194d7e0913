/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What render_bench makes of pictures whose likeness is known. */
#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <random>

#include "score.hpp"

using namespace bench;

namespace {

constexpr int kSide = 160;

cv::Mat
grey_noise (unsigned seed)
{
  cv::Mat grey (kSide, kSide, CV_8U), rgb;
  std::mt19937 random (seed);
  for (auto &level : cv::Mat_<uchar> (grey))
    level = static_cast<uchar> (100 + random () % 100);
  cv::cvtColor (grey, rgb, cv::COLOR_GRAY2RGB);
  return rgb;
}

cv::Mat
mask_of (cv::Rect box)
{
  cv::Mat mask (kSide, kSide, CV_8U, cv::Scalar (0));
  mask (box) = 255;
  return mask;
}

/* A figure that some camera sees wholly. */
Shot
shot_of (const cv::Mat &rgb, const cv::Mat &mask)
{
  return {0, rgb, mask, mask.clone ()};
}

cv::Mat
drawn (const cv::Mat &rgb, const cv::Mat &alpha)
{
  const int channels[] = {0, 0, 1, 1, 2, 2, 3, 3};
  cv::Mat parts[] = {rgb, alpha};
  cv::Mat rgba (rgb.size (), CV_8UC4);
  cv::mixChannels (parts, 2, &rgba, 1, channels, 4);
  return rgba;
}

Score
score_of (const Shot &shot, const cv::Mat &rgba)
{
  Score score;
  score.add (shot, rgba);
  return score;
}

const cv::Rect kBox{20, 30, 100, 80};

TEST (RenderScore, perfect_picture_has_ssim_1_and_no_faults)
{
  const cv::Mat rgb = grey_noise (1), mask = mask_of (kBox);
  const Score score = score_of (shot_of (rgb, mask), drawn (rgb, mask));
  EXPECT_NEAR (score.ssim (), 1, 1e-6);
  EXPECT_NEAR (score.ssim_all (), 1, 1e-6);
  EXPECT_GT (score.psnr (), 100);
  EXPECT_EQ (score.holes () + score.spill () + score.edge_px () + score.seam () + score.bad (), 0);
}

TEST (RenderScore, what_lies_beside_the_figure_does_not_count_where_nothing_is_drawn)
{
  const cv::Mat mask = mask_of (kBox), truth = grey_noise (1);
  cv::Mat picture = grey_noise (2);
  truth.copyTo (picture, mask);
  EXPECT_NEAR (score_of (shot_of (truth, mask), drawn (picture, mask)).ssim_all (), 1, 1e-6);
}

TEST (RenderScore, unrelated_textures_have_no_ssim)
{
  const cv::Mat mask = mask_of (kBox);
  const Score score = score_of (shot_of (grey_noise (1), mask), drawn (grey_noise (2), mask));
  EXPECT_LT (score.ssim (), 0.1);
  EXPECT_GT (score.bad (), 0.2);
}

TEST (RenderScore, picture_beside_its_place_has_holes_spill_and_a_distant_edge)
{
  const cv::Mat rgb = grey_noise (1), mask = mask_of (kBox),
                beside = mask_of (kBox + cv::Point (10, 0));
  const Score score = score_of (shot_of (rgb, mask), drawn (rgb, beside));
  EXPECT_DOUBLE_EQ (score.holes (), 0.1);
  EXPECT_DOUBLE_EQ (score.spill (), 0.1);
  EXPECT_NEAR (score.edge95_px (), 10, 1);
  EXPECT_GT (score.edge_px (), 3);
  EXPECT_LT (score.ssim_all (), 0.95);
}

TEST (RenderScore, what_no_camera_saw_is_no_hole)
{
  const cv::Mat rgb = grey_noise (1), mask = mask_of (kBox);
  cv::Mat alpha = mask.clone ();
  const cv::Rect unseen (60, 60, 20, 20);
  alpha (unseen) = 0;
  Shot shot = shot_of (rgb, mask);
  EXPECT_NEAR (score_of (shot, drawn (rgb, alpha)).holes (), 0.05, 1e-9);
  shot.seen (unseen) = 0;
  const Score score = score_of (shot, drawn (rgb, alpha));
  EXPECT_EQ (score.holes (), 0);
  EXPECT_EQ (score.edge_px (), 0);
  EXPECT_NEAR (score.psnr (), score_of (shot, drawn (rgb, mask)).psnr (), 1e-9);
}

TEST (RenderScore, line_across_the_figure_is_a_seam)
{
  const cv::Mat mask = mask_of (kBox);
  cv::Mat shaded (kSide, kSide, CV_8UC3); /* so that the truth has gradients of its own */
  for (int x = 0; x < kSide; x++)
    shaded.col (x) = cv::Scalar::all (80 + x / 2);
  cv::Mat picture = shaded.clone ();
  picture.colRange (70, kSide) += cv::Scalar::all (20);
  EXPECT_EQ (score_of (shot_of (shaded, mask), drawn (shaded, mask)).seam (), 0);
  EXPECT_GT (score_of (shot_of (shaded, mask), drawn (picture, mask)).seam (), 0.1);
}

TEST (RenderScore, half_covered_outline_is_no_fault_where_the_truth_is_half_covered_too)
{
  const cv::Mat rgb = grey_noise (1);
  cv::Mat soft = mask_of (kBox);
  soft.col (kBox.x) *= 0.4;
  const Score same = score_of (shot_of (rgb, soft), drawn (rgb, soft));
  EXPECT_NEAR (same.ssim_all (), 1, 1e-6);
  const Score hard = score_of (shot_of (rgb, soft), drawn (rgb, mask_of (kBox)));
  EXPECT_LT (hard.ssim_all (), same.ssim_all ());
}

TEST (RenderScore, figures_are_means_over_the_pictures)
{
  const cv::Mat rgb = grey_noise (1), mask = mask_of (kBox);
  Score score;
  score.add (shot_of (rgb, mask), drawn (rgb, mask));
  score.add (shot_of (rgb, mask), drawn (rgb, mask_of (kBox + cv::Point (10, 0))));
  EXPECT_DOUBLE_EQ (score.holes (), 0.05);
}

TEST (RenderScore, empty_picture_is_all_hole)
{
  const cv::Mat rgb = grey_noise (1), mask = mask_of (kBox);
  const Score score = score_of (shot_of (rgb, mask), drawn (rgb, mask_of ({0, 0, 0, 0})));
  EXPECT_EQ (score.holes (), 1);
  EXPECT_EQ (score.ssim (), 0);
}

} // namespace
