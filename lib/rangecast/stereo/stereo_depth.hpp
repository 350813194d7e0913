/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <opencv2/core.hpp>

#include "../geometry/range_image.hpp"
#include "../geometry/rig.hpp"
#include "disparity_finder.hpp"
#include "edge_filter.hpp"
#include "moving_blocks.hpp"
#include "rectification.hpp"
#include "temporal_filter.hpp"
#include "third_pair.hpp"

namespace rangecast {

/** Computes range images from stereo pairs: rectifies, matches, filters, converts to depth. Reuses
 * its memory between images. */
class StereoDepth {
public:
  /** @param view        a raw view with a right camera; its near and far set the disparity range
   *  @param n_threads   0 = one per core
   *  @param with_third  use the view's third camera, whose images are passed to rectify()
   *  @return the errors of Rectifier, DisparityFinder and ThirdPair */
  Status set (const View &view, int n_threads = 0, bool with_third = false);

  /** The view of the range images. */
  [[nodiscard]] const View &range_view () const { return rectifier_.range_view (); }

  /** @name One pair
   *  Either process(), or rectify() and match(), between which the caller may choose the ROI. @{ */

  /** Rectifies the images. Their memory must stay valid until match() returns.
   *  @param left, right  of the view's size
   *  @param third        the same; empty: this pair is matched without it
   *  @return kBadSize if an image has another size */
  Status rectify (
      ImageView<const Rgbx> left, ImageView<const Rgbx> right, ImageView<const Rgbx> third = {});

  /** Whether the left image has changed outside of the ROI since the last one that was matched
   * completely (ChangedBlocks). */
  [[nodiscard]] bool changed_outside (const Roi &roi) const
  {
    return blocks_.changed_outside (roi);
  }

  /** @param image  its ROI (not empty, inside the view) is computed; depth and colour are
   * completely written
   *  @return kBadSize if the ROI is not inside the view, or the image of another size */
  Status match (const RangeImage &image);

  Status process (ImageView<const Rgbx> left, ImageView<const Rgbx> right, const RangeImage &image,
      ImageView<const Rgbx> third = {})
  {
    const Status status = rectify (left, right, third);
    return status.ok () ? match (image) : status;
  }
  /** @} */

  /** After a break in the stream: discards all that was learnt from earlier images, also the
   * background. The next images should be matched completely, as changed_outside() requests. */
  void reset ()
  {
    blocks_.reset ();
    for (StillAverage &still : still_)
      still.reset ();
    finder_.reset ();
    third_.reset ();
    near_now_m_ = far_now_m_ = seen_share_ = 0;
    last_roi_ = {};
    temporal_.reset ();
  }

  /** The disparities put out for the last image's ROI, 1/16 pixel with equal principal points,
   * 0 = no match. */
  [[nodiscard]] ImageView<const std::uint16_t> disparity () const;

private:
  void map_depths (const View &range, double focal_baseline);
  void find (const RangeImage &image, bool everywhere);
  void write_depth (const RangeImage &image) const;
  void learn_range (const RangeImage &image);
  [[nodiscard]] bool is_suspect (const RangeImage &image) const;

  View view_;
  Rectifier rectifier_;
  DisparityFinder finder_;
  ThirdPair third_;
  bool with_third_ = false, has_third_ = false; /* configured; for this pair */
  std::vector<std::uint16_t> depths_;           /* by disparity */
  ChangedBlocks blocks_;
  cv::Mat pictures_[2]; /* rectified; may be the caller's memory */
  cv::Mat matched_[2];  /* the same with less noise */
  StillAverage still_[2];
  cv::Mat rectified_[2], before_fusion_;
  cv::Mat doubtful_; /* DisparityFinder::find_doubtful() of the last image */
  int n_threads_ = 0;
  EdgeFilter edges_;
  TemporalFilter temporal_;
  std::vector<int> histogram_;            /* of the last depths, by pixels of disparity */
  double near_now_m_ = 0, far_now_m_ = 0; /* where the ROI's surfaces were; 0 = not known */
  Roi last_roi_;                          /* last ROI that was not the whole image */
  double seen_share_ = 0;                 /* fraction of the last ROI with depth */
};

} // namespace rangecast
