/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <opencv2/core.hpp>

#include "../base/status.hpp"
#include "../geometry/rig.hpp"

namespace rangecast {

/** Rectifies stereo pairs and removes lens distortion.
 *  Method: cv::stereoRectify (J.-Y. Bouguet's) with zero disparity at infinity, scaled so that
 * every pixel is covered; maps are computed once. Pairs that are rectified already are not changed.
 */
class Rectifier {
public:
  /** @return kNotFound if the view has no right camera, kBadValue if the cameras are one above the
   * other, or left and right are exchanged */
  Status set (const View &view);

  /** The rectified left camera, a range view with its pose. */
  [[nodiscard]] const View &range_view () const { return range_view_; }
  /** Distance of the cameras, metres, > 0. */
  [[nodiscard]] double baseline_m () const { return baseline_m_; }
  /** Principal point of right minus left, pixels: disparity + offset = fx * baseline / z. */
  [[nodiscard]] double principal_offset () const { return principal_offset_; }
  /** Whether images are not changed. */
  [[nodiscard]] bool is_identity () const { return maps_[0][0].empty (); }

  /** @param camera  0 left, 1 right; @param in  of the view's size; @param[out] out  same type and
   * size; reuses memory of that size */
  void rectify (int camera, const cv::Mat &in, cv::Mat &out) const;

private:
  Status compute_rectification (const View &view);

  View range_view_;
  double baseline_m_ = 0, principal_offset_ = 0;
  cv::Mat maps_[2][2];
};

} // namespace rangecast
