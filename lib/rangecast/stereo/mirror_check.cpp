/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "mirror_check.hpp"

#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

namespace rangecast {

constexpr int kWidth = 160; /* pixels that pictures are made small to */
constexpr double kMuch = 0.3, kTimes = 2;

/* Share of pixels that both directions match alike. */
static double
matched (const cv::Mat &left, const cv::Mat &right, int least, int count)
{
  cv::Mat wide[2], disparity;
  const int reach = least + count;
  cv::copyMakeBorder (left, wide[0], 0, 0, reach, 0, cv::BORDER_REPLICATE);
  cv::copyMakeBorder (right, wide[1], 0, 0, reach, 0, cv::BORDER_REPLICATE);
  cv::StereoSGBM::create (
      least, count, 3, 72, 288, 1, 31, 15, 50, 1, cv::StereoSGBM::MODE_SGBM_3WAY)
      ->compute (wide[0], wide[1], disparity);
  const cv::Mat inside = disparity.colRange (reach, disparity.cols);
  return cv::countNonZero (inside >= 16 * least) / double (inside.total ());
}

void
MirrorCheck::look (const cv::Mat &left, const cv::Mat &right, int least, int most)
{
  const double scale = std::min (1.0, double (kWidth) / left.cols);
  /* One pixel at least: at none, a picture is its own mirror's. */
  const int low = std::max (1, int (least * scale));
  const int count = std::max (16, (int (most * scale) + 1 - low + 15) / 16 * 16);
  cv::Mat small[2];
  const cv::Mat *pictures[2] = {&left, &right};
  for (int i = 0; i < 2; i++) {
    cv::resize (*pictures[i], small[i], {}, scale, scale, cv::INTER_AREA);
    cv::cvtColor (small[i], small[i], cv::COLOR_RGBA2GRAY);
  }
  const double normal = matched (small[0], small[1], low, count),
               mirrored = matched (small[1], small[0], low, count);
  if (mirrored < kMuch && normal < kMuch)
    return; /* nothing to see yet */
  mirrored_ = mirrored > kTimes * normal;
  decided_ = mirrored_ || normal > mirrored;
}

} // namespace rangecast
