/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* OpenCV's labels and its speckle filter are the reference. */
#include "../test-support.hpp"

#include <algorithm>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <rangecast/geometry/connected_components.hpp>

using namespace rangecast;

namespace {

/* Random pixels, in patches, so that components of all sizes and shapes occur. */
cv::Mat
random_levels (cv::Size size, int levels, cv::RNG &random)
{
  cv::Mat noise (size, CV_32F);
  random.fill (noise, cv::RNG::UNIFORM, 0, 1);
  cv::GaussianBlur (noise, noise, {3, 3}, 0);
  cv::Mat image;
  cv::normalize (noise, noise, 0, levels, cv::NORM_MINMAX);
  noise.convertTo (image, CV_16S, 1, -levels / 2.0);
  return cv::max (image, 0);
}

const cv::Size kSizes[] = {{1, 1}, {1, 20}, {20, 1}, {7, 5}, {64, 48}, {129, 90}};

} // namespace

TEST (ConnectedComponents, of_masks_have_the_sizes_of_opencvs_labels)
{
  cv::RNG random (5);
  for (const cv::Size size : kSizes) {
    const cv::Mat mask = random_levels (size, 2, random) > 0;
    cv::Mat labels, stats, centroids;
    const int n = cv::connectedComponentsWithStats (mask, labels, stats, centroids, 8);
    ConnectedComponents components;
    for (int round = 0; round < 2; round++) { /* memory is used again */
      components.clear ();
      for (int y = 0; y < mask.rows; y++)
        components.add_mask_row (mask.ptr (y), mask.cols);
    }
    EXPECT_EQ (std::ranges::count_if (components.runs (),
                   [&] (const ConnectedComponents::Run &run) { return components.is_root (run); }),
        n - 1);
    int pixels = 0;
    for (int y = 0; y < mask.rows; y++)
      for (const ConnectedComponents::Run &run : components.row (y))
        for (int x = run.x0; x < run.x1; x++, pixels++)
          ASSERT_EQ (components.size_of (run),
              mask.at<std::uint8_t> (y, x) ? stats.at<int> (labels.at<int> (y, x), cv::CC_STAT_AREA)
                                           : 0)
              << size << " at " << x << ", " << y;
    EXPECT_EQ (pixels, cv::countNonZero (mask));
  }
}

TEST (ConnectedComponents, of_levels_are_opencvs_speckles)
{
  constexpr int kRange = 16, kMaxSpeckle = 12;
  cv::RNG random (6);
  for (const cv::Size size : kSizes) {
    const cv::Mat levels = random_levels (size, 400, random);
    cv::Mat expected = levels.clone (), got = levels.clone (), memory;
    cv::filterSpeckles (expected, 0, kMaxSpeckle, kRange, memory);
    ConnectedComponents components;
    components.clear ();
    for (int y = 0; y < levels.rows; y++)
      components.add_level_row (levels.ptr<std::int16_t> (y),
          levels.ptr<std::int16_t> (std::max (0, y - 1)), 0, levels.cols, 1, kRange);
    for (int y = 0; y < levels.rows; y++)
      for (const ConnectedComponents::Run &run : components.row (y))
        if (components.size_of (run) <= kMaxSpeckle)
          got.row (y).colRange (run.x0, run.x1).setTo (0);
    EXPECT_EQ (cv::norm (got, expected, cv::NORM_INF), 0) << size;
  }
}

TEST (ConnectedComponents, rows_without_pixels_separate)
{
  const std::uint8_t mask[] = {255, 255, 0};
  ConnectedComponents components;
  components.clear ();
  components.add_mask_row (mask, 3);
  components.add_empty_row ();
  components.add_mask_row (mask, 3);
  ASSERT_EQ (components.runs ().size (), 2u);
  EXPECT_TRUE (components.row (1).empty ());
  for (const ConnectedComponents::Run &run : components.runs ())
    EXPECT_EQ (components.size_of (run), 2);
}
