/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../test-support.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <rangecast/roi/box_sums.hpp>

using namespace rangecast;

namespace {

template <typename T>
cv::Mat
box_sums (const cv::Mat &image, int reach, int border)
{
  cv::Mat result (image.size (), image.type ());
  BoxSums<T> sums;
  for (int round = 0; round < 2; round++) /* again, in used memory */
    sums.find (
        image.size (), reach, border,
        [&] (int y, T *row) { std::copy_n (image.ptr<T> (y), image.cols, row); },
        [&] (int y, const T *row) { std::copy_n (row, image.cols, result.ptr<T> (y)); });
  return result;
}

} // namespace

TEST (BoxSums, equal_those_of_opencv)
{
  cv::RNG random (3);
  for (const cv::Size size : {cv::Size (1, 1), {1, 9}, {3, 2}, {33, 5}, {64, 40}, {381, 30}})
    for (int reach : {0, 1, 3, 9, 15})
      for (int border : {int (cv::BORDER_CONSTANT), int (cv::BORDER_DEFAULT)}) {
        cv::Mat counts (size, CV_16U), values (size, CV_32F), expected;
        random.fill (counts, cv::RNG::UNIFORM, 0, 2);
        random.fill (values, cv::RNG::UNIFORM, 0, 2);
        const cv::Size window (2 * reach + 1, 2 * reach + 1);
        counts.convertTo (expected, CV_32F);
        cv::boxFilter (expected, expected, CV_32F, window, {-1, -1}, false, border);
        cv::Mat got = box_sums<std::uint16_t> (counts, reach, border);
        got.convertTo (got, CV_32F);
        EXPECT_EQ (cv::norm (got, expected, cv::NORM_INF), 0) << size << ' ' << reach;
        cv::boxFilter (values, expected, CV_32F, window, {-1, -1}, false, border);
        EXPECT_LT (cv::norm (box_sums<float> (values, reach, border), expected, cv::NORM_INF),
            1e-5 * window.area ())
            << size << ' ' << reach;
      }
}
