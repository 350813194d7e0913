/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <opencv2/core.hpp>

#include "../geometry/range_image.hpp"
#include "../geometry/rig.hpp"
#include "change_detector.hpp"
#include "depth.hpp"
#include "disparity_finder.hpp"
#include "mirror_check.hpp"
#include "occupancy.hpp"
#include "rectification.hpp"
#include "still_average.hpp"
#include "temporal_filter.hpp"
#include "third_pair.hpp"

namespace rangecast {

/** A stereo pair's pictures to a range image: rectifies, matches, filters, converts. Keeps its
 *  memory between frames. */
class StereoDepth {
public:
  /** @param view        a raw view with a right camera; its near and far set the disparity range
   *  @param with_third  the view's third camera takes part: take() gets its pictures
   *  @return what Rectifier, DisparityFinder and ThirdPair say about the view */
  Status set (const View &view, const StereoSettings &settings, bool with_third = false);

  /** The view of the range images. */
  [[nodiscard]] const View &range_view () const { return rectifier_.range_view (); }

  /** @name One pair
   *  Either process(), or take() and match(), between which the caller may choose the ROI. @{ */

  /** Takes and rectifies both pictures. Their memory must stay until match() is done.
   *  @param left, right  of the view's size
   *  @param third        the same; empty if there is none, then this pair goes without
   *  @return kBadSize if a picture has another size */
  Status take (
      ImageView<const Rgbx> left, ImageView<const Rgbx> right, ImageView<const Rgbx> third = {});

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

  Status process (ImageView<const Rgbx> left, ImageView<const Rgbx> right, const RangeImage &image,
      ImageView<const Rgbx> third = {})
  {
    const Status status = take (left, right, third);
    return status.ok () ? match (image) : status;
  }
  /** @} */

  /** Whether left and right look exchanged (MirrorCheck): known after the first whole pictures. */
  [[nodiscard]] bool looks_mirrored () const { return mirror_.mirrored (); }

  /** What was held still is not compared with what comes: after a gap in the stream. */
  void forget ()
  {
    changes_.forget ();
    steady_.forget ();
    for (StillAverage &still : still_)
      still.forget ();
    occupancy_.forget ();
    near_now_m_ = far_now_m_ = 0;
  }

  /** The disparities of the last picture, 1/16 pixel with equal principal points, 0 = no match; of
   *  its ROI. */
  [[nodiscard]] ImageView<const std::uint16_t> disparity () const;

private:
  void rectify (int camera, ImageView<const Rgbx> picture);
  Status find (const RangeImage &image, bool everywhere);
  void clear_rims_of_third (const Roi &roi);
  void check_mirror ();
  void learn_range (const RangeImage &image);
  [[nodiscard]] bool is_suspect (const RangeImage &image) const;

  View view_;
  StereoSettings settings_;
  Rectifier rectifier_;
  DisparityFinder finder_;
  ThirdPair third_;
  SilhouetteFilter rims_; /* of what both pairs know */
  Pieces pieces_;
  bool with_third_ = false, has_third_ = false; /* set up; in this pair */
  DisparityToDepth to_depth_;
  ChangeDetector changes_;
  Occupancy occupancy_;
  MirrorCheck mirror_;
  SteadyFilter steady_;
  cv::Mat raw_[2];      /* the caller's memory */
  cv::Mat pictures_[2]; /* rectified; may be the caller's memory */
  cv::Mat matched_[2];  /* the same with less noise */
  StillAverage still_[2];
  cv::Mat rectified_[2], before_fusion_;
  std::vector<int> histogram_;            /* of the last depths, by pixels of disparity */
  double near_now_m_ = 0, far_now_m_ = 0; /* where the ROI's surfaces were; 0 = not known */
  Roi last_roi_;                          /* that was not the whole picture */
  double seen_share_ = 0;                 /* of the ROI's pixels, the last time */
};

} // namespace rangecast
