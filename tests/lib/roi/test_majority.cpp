/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../test-support.hpp"

#include <opencv2/imgproc.hpp>
#include <rangecast/base/cpu.hpp>
#include <rangecast/roi/majority.hpp>

using namespace rangecast;

TEST (Majority, equals_the_median_of_a_mask)
{
  cv::RNG random (3);
  for (const cv::Size size : {cv::Size (1, 1), {1, 9}, {2, 3}, {33, 5}, {64, 40}, {381, 30}}) {
    cv::Mat mask (size, CV_8U), expected, got;
    random.fill (mask, cv::RNG::UNIFORM, 0, 2);
    mask *= 255;
    for (int radius : {1, 2})
      for (CpuLevel level : kCpuLevels) {
        limit_cpu (level);
        cv::medianBlur (mask, expected, 2 * radius + 1);
        Majority majority;
        majority.find (mask, radius, got);
        EXPECT_EQ (cv::norm (got, expected, cv::NORM_INF), 0) << size << ' ' << radius;
      }
  }
}
