/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <opencv2/core.hpp>

#include "../geometry/range_image.hpp"
#include "../geometry/rig.hpp"
#include "depth.hpp"
#include "matching.hpp"
#include "rectification.hpp"

namespace rangecast {

struct StereoSettings {
  MatchSettings match;
  double flying_pixel_step = 0.02; ///< share of the depth that neighbours may differ; 0 = off

  friend bool operator== (const StereoSettings &, const StereoSettings &) = default;
};

/** A stereo pair's pictures to a range image: rectifies, matches, filters, converts. Keeps its
 *  memory between frames. */
class StereoDepth {
public:
  /** @param view  a raw view with a right camera; its near and far set the disparity range */
  Status set (const View &view, const StereoSettings &settings);

  /** The view of the range images. */
  [[nodiscard]] const View &range_view () const { return rectifier_.range_view (); }

  /** @param left, right  of the view's size
   *  @param image  its ROI (not empty, inside the view) says what to compute; depth and colour are
   *  written in full
   *  @return kBadSize if a picture has another size */
  Status process (ImageView<const Rgbx> left, ImageView<const Rgbx> right, const RangeImage &image);

  /** The disparities of the last picture, 1/16 pixel with equal principal points, 0 = no match; of
   *  its ROI. */
  [[nodiscard]] ImageView<const std::uint16_t> disparity () const;

private:
  void prepare (int camera, ImageView<const Rgbx> picture, const RangeImage &image);
  void take_disparities (const RangeImage &image);

  View view_;
  StereoSettings settings_;
  Rectifier rectifier_;
  Matcher matcher_;
  DisparityToDepth to_depth_;
  cv::Mat rectified_, grey_, window_[2], raw_disparity_, disparity_, depth_;
};

} // namespace rangecast
