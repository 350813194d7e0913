/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../test-support.hpp"

#include <opencv2/imgproc.hpp>
#include <random>
#include <rangecast/base/cpu.hpp>
#include <rangecast/stereo/change_detector.hpp>

using namespace rangecast;

namespace {

/* A grey picture of 163 x 120 pixels (not a multiple of blocks) with sensor noise. */
cv::Mat
picture (unsigned seed, double noise = 6)
{
  cv::Mat picture (120, 163, CV_8UC4);
  std::mt19937 random (seed);
  std::normal_distribution<double> grey (120, noise);
  for (int y = 0; y < picture.rows; y++)
    for (int x = 0; x < picture.cols; x++)
      for (int c = 0; c < 4; c++)
        picture.at<cv::Vec4b> (y, x)[c] = cv::saturate_cast<uchar> (grey (random));
  return picture;
}

/* Of one picture and then another with a brighter rectangle. */
bool
changed (cv::Rect brighter, const Roi &roi, int levels = 30)
{
  ChangeDetector detector;
  detector.update (picture (1));
  detector.set_reference ();
  cv::Mat next = picture (2);
  next (brighter) += cv::Scalar (0, levels, 0, 0);
  detector.update (next);
  return detector.changed_outside (roi);
}

constexpr Roi kRoi = {40, 30, 80, 60};

} // namespace

TEST (ChangeDetector, noise_is_no_change)
{
  EXPECT_FALSE (changed ({0, 0, 1, 1}, kRoi));
}

TEST (ChangeDetector, somebody_beside_the_roi_is_one)
{
  EXPECT_TRUE (changed ({125, 20, 30, 80}, kRoi));
}

TEST (ChangeDetector, what_moves_inside_is_not)
{
  EXPECT_FALSE (changed ({45, 35, 70, 50}, kRoi));
}

TEST (ChangeDetector, one_block_is_not_enough_and_little_light_neither)
{
  EXPECT_FALSE (changed ({8, 8, 8, 8}, kRoi));
  EXPECT_FALSE (changed ({0, 0, 163, 120}, kRoi, 6));
}

TEST (ChangeDetector, without_memory_or_after_a_new_size_everything_has_changed)
{
  ChangeDetector detector;
  detector.update (picture (1));
  EXPECT_TRUE (detector.changed_outside (kRoi));
  detector.set_reference ();
  detector.update (picture (2));
  EXPECT_FALSE (detector.changed_outside (kRoi));
  detector.update (picture (3) (cv::Rect (0, 0, 100, 100)));
  EXPECT_TRUE (detector.changed_outside (kRoi));
  detector.update (picture (2));
  detector.reset ();
  EXPECT_TRUE (detector.changed_outside (kRoi));
}

/* Of a part of a larger picture: rows do not follow each other at once. */
TEST (ChangeDetector, whole_blocks_are_those_that_opencv_makes)
{
  cv::Mat larger (128, 176, CV_8UC4);
  cv::RNG random (3);
  for (int most : {256, 4}) { /* few levels make many halves */
    random.fill (larger, cv::RNG::UNIFORM, 0, most);
    const cv::Mat part = larger (cv::Rect (5, 3, 168, 120));
    const cv::Mat rows (60, 168, CV_8UC4, part.data, 2 * part.step);
    cv::Mat expected;
    cv::resize (rows, expected, {21, 15}, 0, 0, cv::INTER_AREA);
    for (CpuLevel level : kCpuLevels) {
      limit_cpu (level);
      ChangeDetector detector;
      detector.update (part);
      ASSERT_EQ (detector.blocks ().size (), expected.size ());
      EXPECT_EQ (cv::norm (detector.blocks (), expected, cv::NORM_INF), 0) << most << " levels";
    }
  }
}
