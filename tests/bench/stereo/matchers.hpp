/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <opencv2/calib3d.hpp>
#include <rangecast/stereo/stereo_depth.hpp>
#include <string>
#include <vector>

namespace bench {

/** A pair and what is known about it. */
struct Pair {
  rangecast::View view;      ///< raw, with a right camera; near and far are what all look for
  cv::Mat left, right;       ///< CV_8UC4, as the cameras saw them
  cv::Mat greys[2];          ///< CV_8U, rectified: what OpenCV's matchers get
  cv::Mat truth;             ///< CV_32F, disparity in pixels, 0 = unknown; empty without truth
  double focal_baseline = 0; ///< pixels times metres: (disparity + offset) * depth
  double offset = 0;         ///< pixels, right minus left principal point, of the rectified pair
  int least = 0, count = 0;  ///< disparities to look for
};

/** What a matcher came to. Shares are 0 to 1; errors and bad shares are of pixels that have a
 *  disparity and a known truth, and 0 without truth. */
struct Row {
  std::string matcher;
  double density = 0;   ///< pixels with a disparity, of those with known truth (of all without)
  double bad1 = 0;      ///< further off than 1 pixel
  double bad2 = 0;      ///< further off than 2 pixels
  double median_px = 0; ///< of the absolute error
  double ms = 0;        ///< least processor time of a pair, of all threads together
};

/** The disparity range, focal length and grey pictures of a pair; view, left and right are set.
 *  @return what StereoDepth says of such a view */
rangecast::Status prepare (Pair &pair);

/** stereodepth's way from two pictures to depth, measured as disparities. */
rangecast::Status run_ours (const Pair &pair, int n_threads, int rounds, Row &row);

/** OpenCV's matchers, well tuned. */
std::vector<Row> run_peers (const Pair &pair, int rounds);

} // namespace bench
