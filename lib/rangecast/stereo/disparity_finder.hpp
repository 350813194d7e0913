/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <opencv2/core.hpp>

#include "../base/status.hpp"
#include "../geometry/range_image.hpp"
#include "background_disparity.hpp"
#include "disparity_filter.hpp"
#include "disparity_refiner.hpp"
#include "semi_global_matcher.hpp"
#include "silhouette_filter.hpp"
#include "tiles.hpp"

namespace rangecast {

/** Geometry of a rectified pair. */
struct PairGeometry {
  int width = 0, height = 0; ///< pixels, of both images
  double focal_baseline = 0; ///< pixels times metres
  double offset = 0;         ///< pixels, principal point of right minus left
};

/** Matches rectified pairs and clears wrong disparities: the whole image at all depths, or a part
 * of it in a range of depths. Reuses its memory between images. */
class DisparityFinder {
public:
  /** @param n_threads  0 = one per core
   *  @return kBadValue if near needs a disparity beyond the image width or 2000 pixels */
  Status set (const PairGeometry &pair, double near_m, double far_m, int n_threads);

  /** Forgets what was learnt from earlier images: the background, and the cameras' brightness. */
  void reset ()
  {
    background_.reset ();
    gain_ = 1;
  }

  /** Throws cv::Exception.
   *  @param left, right  CV_8UC4, R G B x, of the pair's size
   *  @param roi          inside the image, not empty
   *  @param parts        rectangles one below the other in which to match; null = the whole ROI
   *  @param near_m, far_m  depth range, 0 = unlimited; with limits, background that was seen beyond
   * them in earlier images is still recognized */
  void find (const cv::Mat &left, const cv::Mat &right, const Roi &roi, double near_m, double far_m,
      const std::vector<cv::Rect> *parts = nullptr);

  /** The part of the left (0) or right (1) image that find() may need for a ROI. */
  [[nodiscard]] cv::Rect needed (const Roi &roi, int camera) const;

  /** CV_16U of the ROI, 1/16 pixel with equal principal points, 0 = none. */
  [[nodiscard]] const cv::Mat &disparity () const { return disparity_; }
  [[nodiscard]] cv::Mat &disparity () { return disparity_; }
  /** Finds where the left image of the last find() looks like remembered background beyond the
   * range that was searched, so that a disparity there may be a false match.
   *  @param[out] doubtful  CV_8U of the ROI: 255 there, else 0 */
  void find_doubtful (const Roi &roi, cv::Mat &doubtful) const;
  /** Disparity 1/16 pixel with equal principal points at that depth. */
  [[nodiscard]] double disparity_at (double depth_m) const
  {
    return 16 * pair_.focal_baseline / depth_m;
  }

private:
  /* Disparities to search, pixels. */
  struct Range {
    int min = 0, count = 0;

    /* Numbers of columns left and right of a pixel that its match may need. */
    [[nodiscard]] int reach () const { return min + count > 0 ? min + count : 0; }
    [[nodiscard]] int reach_right () const { return min < 0 ? -min : 0; }
  };
  static Range range_of (int min, int max);
  [[nodiscard]] Range choose_range (double near_m, double far_m) const;
  void place_window (const Roi &roi);
  void choose_parts (const std::vector<cv::Rect> *parts);
  void match ();
  [[nodiscard]] double find_gain () const;
  void filter (const cv::Mat &left);
  void restore_background (const cv::Mat &grey, int right_x);
  void write_disparity (const Roi &roi);

  PairGeometry pair_;
  SemiGlobalMatcher matcher_;
  Range range_; /* of this image; a part of that of all depths if limited_ */
  bool limited_ = false;
  double gain_ = 1; /* brightness of left over that of right, in images matched completely */
  int n_threads_ = 0;
  int min_disparity_ = 0, max_disparity_ = 0; /* disparity range of all depths, pixels */
  int far_ = 0; /* disparity, 1/16 pixel, of the farthest depth of interest */
  DisparityFilter filter_;
  SilhouetteFilter silhouettes_;
  DisparityRefiner refiner_;
  BackgroundDisparity background_;
  cv::Rect window_at_, core_at_; /* in the image: all columns needed; the ROI and its margin */
  Tiles tiles_;                  /* in core_: where to match */
  int missing_[2] = {0, 0};      /* columns of the window outside of the image, left and right */
  std::vector<cv::Rect> parts_;
  cv::Mat grey_, window_[2], scaled_, raw_, disparity_; /* scaled_: window_[1], as bright as left */
  cv::Mat whole_[2];    /* of the size of the image: memory for the others */
  cv::Mat core_, next_; /* CV_16S of core_at_: disparities, and output of the next filter */
};

} // namespace rangecast
