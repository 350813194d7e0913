/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "mirror_check.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

namespace rangecast {

constexpr int kWidth = 240;      /* pixels that pictures are made small to */
constexpr int kEveryPicture = 8; /* so many at first */
/* A direction is right that has so large a share of the picture, and so many times as much as the
 * other one. On the pairs of the tests the right one has 0.1 to 0.8, the other one at most 0.37
 * times as much: a pair that was rectified with each other's lenses may match here and there. */
constexpr double kMuch = 0.04, kTimes = 2;

/* Share of pixels that lie before the cameras less those beyond infinity. As much disparity is
 * looked for on either side, so that chance is as often wrong here as there. */
static double
balance (const MirrorCheck::Pair &pair, double infinity, double most)
{
  const double scale = std::min (1.0, double (kWidth) / pair.left.cols);
  const int reach = std::clamp (int (std::ceil ((most - infinity) * scale / 8)) * 8, 16, kWidth);
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
  const int least = matcher->getMinDisparity ();
  const int front = cv::countNonZero (inside > 16 * (zero + 1));
  const int behind = cv::countNonZero ((inside >= 16 * least) & (inside < 16 * (zero - 1)));
  return (front - behind) / double (inside.total ());
}

bool
MirrorCheck::wants_next ()
{
  if (decided_ || seen_++ < next_)
    return false;
  next_ = seen_ < kEveryPicture ? seen_ : 2 * seen_;
  return true;
}

void
MirrorCheck::look (const Pair &as_is, const Pair &exchanged, double infinity, double most)
{
  const double normal = balance (as_is, infinity, most),
               mirrored = balance (exchanged, infinity, most);
  mirrored_ = mirrored > kMuch && mirrored > kTimes * normal;
  decided_ = mirrored_ || (normal > kMuch && normal > kTimes * mirrored);
}

} // namespace rangecast
