/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <opencv2/core.hpp>

#include "../geometry/range_image.hpp"
#include "../geometry/rig.hpp"
#include "change_detector.hpp"
#include "depth.hpp"
#include "disparity_filter.hpp"
#include "matching.hpp"
#include "rectification.hpp"

namespace rangecast {

struct StereoSettings {
  MatchSettings match;
  double patch_tolerance = 1;      ///< share of its contrast that a patch may differ by; 0 = off
  double flying_pixel_step = 0.02; ///< share of the depth that neighbours may differ; 0 = off
  int silhouette_radius = 10;      ///< pixels around that say what is beside a silhouette; 0 = off
  int gap_width = 12;              ///< pixels; narrower holes in a surface are filled; 0 = off
  /** How far to match, metres; 0 = to infinity. What lies beyond far is cleared, but must be
   *  matched so as not to be taken for something nearer. */
  double search_far_m = 0;

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

  /** @name One pair
   *  Either process(), or take() and match(), between which the caller may choose the ROI. @{ */

  /** Takes and rectifies both pictures. Their memory must stay until match() is done.
   *  @param left, right  of the view's size
   *  @return kBadSize if a picture has another size */
  Status take (ImageView<const Rgbx> left, ImageView<const Rgbx> right);

  /** Whether anything outside of the ROI has changed in the left picture since the last one that
   *  was matched as a whole (ChangeDetector). */
  [[nodiscard]] bool changed_outside (const Roi &roi) const
  {
    return changes_.changed_outside (roi);
  }

  /** @param image  its ROI (not empty, inside the view) says what to compute; depth and colour are
   *  written in full
   *  @return kBadSize if the ROI is not in the view */
  Status match (const RangeImage &image);

  Status process (ImageView<const Rgbx> left, ImageView<const Rgbx> right, const RangeImage &image)
  {
    const Status status = take (left, right);
    return status.ok () ? match (image) : status;
  }
  /** @} */

  /** The disparities of the last picture, 1/16 pixel with equal principal points, 0 = no match; of
   *  its ROI. */
  [[nodiscard]] ImageView<const std::uint16_t> disparity () const;

private:
  void rectify (int camera, ImageView<const Rgbx> picture);
  void place_window (const Roi &roi);
  void cut_window (int camera);
  void filter_disparities ();
  void take_disparities (const RangeImage &image);

  View view_;
  StereoSettings settings_;
  Rectifier rectifier_;
  Matcher matcher_;
  DisparityToDepth to_depth_;
  DisparityFilter filter_;
  ChangeDetector changes_;
  cv::Rect window_at_, core_at_; /* of the picture: what is matched; the ROI and its margin */
  int missing_[2] = {0, 0};      /* columns that the window has beyond it, left and right */
  cv::Mat pictures_[2];          /* rectified; may be the caller's memory */
  cv::Mat rectified_[2], grey_, window_[2], raw_disparity_, core_disparity_, disparity_, specks_;
};

} // namespace rangecast
