/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "change_detector.hpp"

#include <cstdlib>
#include <opencv2/imgproc.hpp>

namespace rangecast {

constexpr int kBlock = ChangeDetector::kBlock;
constexpr int kDifference = 10; /* grey levels */
constexpr int kSlight = 4;      /* the same, that may be something */
constexpr int kEnough = 2;      /* blocks; one may be a reflection or a lamp */

void
ChangeDetector::look (const cv::Mat &picture)
{
  const cv::Size size ((picture.cols + kBlock - 1) / kBlock, (picture.rows + kBlock - 1) / kBlock);
  /* Every second row: noise of half as many pixels is still far below what counts. */
  const cv::Mat rows (
      (picture.rows + 1) / 2, picture.cols, picture.type (), picture.data, 2 * picture.step);
  cv::resize (rows, blocks_, size, 0, 0, cv::INTER_AREA);
}

void
ChangeDetector::remember ()
{
  cv::swap (blocks_, remembered_);
}

static bool
differ (const cv::Vec4b &a, const cv::Vec4b &b, int most)
{
  for (int c = 0; c < 3; c++)
    if (std::abs (a[c] - b[c]) > most)
      return true;
  return false;
}

bool
ChangeDetector::changed_outside (const Roi &roi) const
{
  if (remembered_.size () != blocks_.size ())
    return true;
  const cv::Rect inside (roi.x, roi.y, roi.width, roi.height);
  int changed = 0;
  for (int y = 0; y < blocks_.rows; y++)
    for (int x = 0; x < blocks_.cols; x++) {
      const cv::Rect block (x * kBlock, y * kBlock, kBlock, kBlock);
      if ((block & inside).empty ())
        changed +=
            differ (blocks_.at<cv::Vec4b> (y, x), remembered_.at<cv::Vec4b> (y, x), kDifference);
    }
  return changed >= kEnough;
}

bool
ChangeDetector::block_changed (int bx, int by) const
{
  return remembered_.size () != blocks_.size () ||
         differ (blocks_.at<cv::Vec4b> (by, bx), remembered_.at<cv::Vec4b> (by, bx), kSlight);
}

} // namespace rangecast
