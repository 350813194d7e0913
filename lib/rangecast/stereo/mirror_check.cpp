/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "mirror_check.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

namespace rangecast {
namespace {

constexpr int kWidth = 240;      /* width to which images are scaled down, pixels */
constexpr int kEveryPicture = 8; /* number of images that are all examined at first */
/* An order is right if it matches at least this fraction of the image, and by this factor more than
 * the other order. On test data, the right order has 0.1 to 0.8, the other one at most 0.37 times
 * as much: a pair rectified with exchanged lenses may match in places. */
constexpr double kMuch = 0.04, kTimes = 2;

/* Fraction of pixels in front of the cameras minus those beyond infinity. The same disparity range
 * is searched on both sides, so that random matches cancel. */
double
balance (const MirrorCheck::Pair &pair, double infinity, double max)
{
  const double scale = std::min (1.0, double (kWidth) / pair.left.cols);
  const int reach = std::clamp (int (std::ceil ((max - infinity) * scale / 8)) * 8, 16, kWidth);
  const int zero = int (std::lround (infinity * scale)), margin = reach + std::abs (zero);
  cv::Mat wide[2], disparity;
  for (int i = 0; i < 2; i++) {
    cv::Mat small;
    cv::resize (i == 0 ? pair.left : pair.right, small, {}, scale, scale, cv::INTER_AREA);
    cv::cvtColor (small, small, cv::COLOR_RGBA2GRAY);
    cv::copyMakeBorder (small, wide[i], 0, 0, margin, margin, cv::BORDER_REPLICATE);
  }
  const auto matcher = cv::StereoBM::create (2 * reach, 15);
  matcher->setMinDisparity (zero - reach);
  matcher->setTextureThreshold (100);
  matcher->setUniquenessRatio (20);
  matcher->setDisp12MaxDiff (1);
  matcher->setSpeckleWindowSize (50);
  matcher->setSpeckleRange (2);
  matcher->compute (wide[0], wide[1], disparity);
  const cv::Mat inside = disparity.colRange (margin, disparity.cols - margin);
  const int min = matcher->getMinDisparity ();
  const int front = cv::countNonZero (inside > 16 * (zero + 1));
  const int behind = cv::countNonZero ((inside >= 16 * min) & (inside < 16 * (zero - 1)));
  return (front - behind) / double (inside.total ());
}

} // namespace

bool
MirrorCheck::is_due ()
{
  if (decided_ || seen_++ < next_)
    return false;
  next_ = seen_ < kEveryPicture ? seen_ : 2 * seen_;
  return true;
}

void
MirrorCheck::evaluate (const Pair &as_is, const Pair &exchanged, double infinity, double max)
{
  const double normal = balance (as_is, infinity, max),
               mirrored = balance (exchanged, infinity, max);
  mirrored_ = mirrored > kMuch && mirrored > kTimes * normal;
  decided_ = mirrored_ || (normal > kMuch && normal > kTimes * mirrored);
}

} // namespace rangecast
