/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <opencv2/core.hpp>

#include "../base/status.hpp"
#include "../geometry/rig.hpp"
#include "disparity_finder.hpp"

namespace rangecast {

/** The pair of the left and the third camera, which may be anywhere beside or above the left one.
 * Rectified separately, with the third camera to the right; its disparities are mapped to the first
 * pair. Reuses its memory between images. */
class ThirdPair {
public:
  /** @param view        a raw view with a third camera
   *  @param range_view  the rectified left camera of the first pair
   *  @param focal_baseline  of the first pair, pixels times metres
   *  @return kNotFound without a third camera, kBadValue if its position is that of the left one,
   * or in front of or behind it */
  Status set (const View &view, const View &range_view, double focal_baseline, int n_threads);

  /** As DisparityFinder::reset(). */
  void reset () { finder_.reset (); }

  /** @param left, third  CV_8UC4, of the view's size, not rectified */
  void rectify (const cv::Mat &left, const cv::Mat &third);

  /** @param roi  of the range view
   *  @param near_m, far_m  depths of the range view; else as DisparityFinder::find() */
  void find (const Roi &roi, double near_m, double far_m);

  /** Of the last ROI, CV_16U, in 1/16 pixel of disparity of the first pair. */
  [[nodiscard]] const cv::Mat &disparity () const { return disparity_; }
  /** Precision relative to the first pair: the ratio of baseline times focal length. */
  [[nodiscard]] double precision () const { return precision_; }

private:
  struct DepthFactors {
    double min = 1, max = 1; /* ratio of depth in the rectified image and in the range view */
  };
  Status choose_axes (const View &view);
  Status place (const View &view, const View &range_view);
  Status make_maps (const View &view);
  void map_range_view (const View &range_view, double focal_baseline);
  bool bounds (const Roi &roi, cv::Vec2d &low, cv::Vec2d &high) const;
  [[nodiscard]] Roi bounding_box (const Roi &roi) const;
  [[nodiscard]] DepthFactors depth_factors (const Roi &roi) const;

  DisparityFinder finder_;
  PairGeometry pair_;
  cv::Matx33d rectified_from_left_; /* rotation */
  cv::Matx33d rectified_camera_;    /* camera matrix of both rectified images */
  cv::Matx33d picture_from_range_;  /* maps (x, y, 1) of the range view to (u w, v w, w) */
  double baseline_m_ = 0, precision_ = 1;
  cv::Mat maps_[2][2], pictures_[2];
  cv::Mat where_;  /* CV_16SC2: position in the rectified image by pixel of the range view, x < 0 =
                      outside */
  cv::Mat factor_; /* CV_32F: factor to disparities of the first pair */
  cv::Mat disparity_;
};

/** Fuses two disparity images: the mean weighted by precision where they agree to one pixel; the
 * only one where there is one; where they contradict, the one that more neighbours in the other
 * image support, or none if neither is clearly better.
 *  @param[in,out] disparity  CV_16U, 1/16 pixel, 0 = none; @param other  the same
 *  @param precision  of the other, relative to this one; @param memory  scratch, for reuse */
void fuse_disparities (cv::Mat &disparity, const cv::Mat &other, double precision, cv::Mat &memory);

} // namespace rangecast
