/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <opencv2/core.hpp>

#include "../base/status.hpp"
#include "../geometry/rig.hpp"

namespace rangecast {

/** Turns the pictures of a stereo pair so that their rows agree and their lenses are gone.
 *  Method: cv::stereoRectify (J.-Y. Bouguet's) with zero disparity at infinity, scaled so that no
 *  pixel is without a picture; maps are made once. A pair that is ideal already is left as it is.
 */
class Rectifier {
public:
  /** @return kNotFound if the view has no right camera, kBadValue if the pair stands one above the
   *  other, or left and right are swapped */
  Status set (const View &view);

  /** The rectified left camera: a range view, with the pose that goes with it. */
  [[nodiscard]] const View &range_view () const { return range_view_; }
  /** Metres between the rectified cameras, > 0. */
  [[nodiscard]] double baseline_m () const { return baseline_m_; }
  /** Right minus left principal point, pixels: disparity + this is fx * baseline / z. */
  [[nodiscard]] double principal_offset () const { return principal_offset_; }
  /** Whether pictures stay as they are. */
  [[nodiscard]] bool is_identity () const { return maps_[0][0].empty (); }

  /** @param camera  0 left, 1 right; @param in  of the view's size; @param[out] out  the same type
   *  and size; memory of that size is used */
  void rectify (int camera, const cv::Mat &in, cv::Mat &out) const;

private:
  Status set_ideal (const View &view);
  Status set_from_rectification (const View &view);

  View range_view_;
  double baseline_m_ = 0, principal_offset_ = 0;
  cv::Mat maps_[2][2];
};

} // namespace rangecast
