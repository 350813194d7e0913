/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <opencv2/core.hpp>

#include "../base/status.hpp"
#include "../geometry/rig.hpp"
#include "disparity_finder.hpp"

namespace rangecast {

/** The pair of the left and the third camera, which may stand anywhere beside or above the left
 * one: rectified on its own, so that the third camera lies to the right, and its disparities
 * brought into the picture of the first pair. Keeps its memory between pictures. */
class ThirdPair {
public:
  /** @param view        a raw view with a third camera
   *  @param range_view  the rectified left camera of the first pair
   *  @param focal_baseline  of the first pair, pixels times metres
   *  @return kNotFound without a third camera, kBadValue if it stands where the left one is, or
   *  before or behind it */
  Status set (const View &view, const View &range_view, double focal_baseline,
      const StereoSettings &settings);

  /** Rectifies. @param left, third  CV_8UC4, of the view's size, as the cameras saw them */
  void take (const cv::Mat &left, const cv::Mat &third);

  /** @param roi  of the range view
   *  @param near_m, far_m  depths of the range view; else as DisparityFinder::find() */
  Status find (const Roi &roi, double near_m, double far_m);

  /** Of the last ROI, CV_16U, in 1/16 pixel of disparity that the first pair would have. */
  [[nodiscard]] const cv::Mat &disparity () const { return disparity_; }
  /** How many times as precise as the first pair's it is: baselines by focal lengths. */
  [[nodiscard]] double precision () const { return precision_; }

private:
  struct DepthFactors {
    double least = 1, most = 1; /* depth in the rectified picture over depth in the range view */
  };
  Status choose_axes (const View &view);
  Status place (const View &view, const View &range_view);
  Status rectify (const View &view);
  void map_range_view (const View &range_view, double focal_baseline);
  bool bounds (const Roi &roi, cv::Vec2d &low, cv::Vec2d &high) const;
  [[nodiscard]] Roi bounding_box (const Roi &roi) const;
  [[nodiscard]] DepthFactors depth_factors (const Roi &roi) const;

  DisparityFinder finder_;
  PairGeometry pair_;
  cv::Matx33d rectified_from_left_; /* rotation */
  cv::Matx33d rectified_camera_;    /* matrix of both rectified pictures */
  cv::Matx33d picture_from_range_;  /* a pixel (x, y, 1) of the range view to (u w, v w, w) */
  double baseline_m_ = 0, precision_ = 1;
  cv::Mat maps_[2][2], pictures_[2];
  cv::Mat where_; /* CV_16SC2: pixels of the range view in the rectified picture, x < 0 = outside */
  cv::Mat factor_; /* CV_32F: from disparities there to the first pair's */
  cv::Mat disparity_;
};

/** Two opinions on the same pixels become one: the mean, by precision, where they agree to one
 *  pixel; the one there is where there is but one; the one that more of the neighbours in the other
 *  share where they contradict each other, or none if neither is much better.
 *  @param[in,out] disparity  CV_16U, 1/16 pixel, 0 = none; @param other  the same
 *  @param precision  of the other, times this one's; @param memory  keep it for the next call */
void fuse_disparities (cv::Mat &disparity, const cv::Mat &other, double precision, cv::Mat &memory);

} // namespace rangecast
