/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <map>
#include <opencv2/core.hpp>

namespace bench {

/** What really is to be seen from somewhere. */
struct Shot {
  double azimuth_deg = 0;
  cv::Mat colour;   ///< CV_8UC3, RGB
  cv::Mat coverage; ///< CV_8U, 255 = the figure fills the pixel
  cv::Mat seen;     ///< CV_8U, 255 = some camera sees this place of the figure, too
};

/** How near pictures come to the truth: each figure is the mean over the pictures. Truth and
 *  picture are both laid over mid-grey by their own coverage. Places that no camera sees count for
 *  nothing, nor does what lies within 4 pixels of them. "Inside" is where both have the figure, 3
 *  pixels and more from either outline and from unseen places. */
class Score {
public:
  /** @param rgba  CV_8UC4 of the truth's size, alpha as coverage; drawn where that is at least half
   */
  void add (const Shot &truth, const cv::Mat &rgba);

  /** Share of the figure's seen pixels that are not drawn. */
  [[nodiscard]] double holes () const { return mean (holes_); }
  /** Pixels drawn beside the figure, as a share of the figure's. */
  [[nodiscard]] double spill () const { return mean (spill_); }
  /** Of R, G, B inside, dB. */
  [[nodiscard]] double psnr () const { return mean (psnr_); }
  /** Of R, G, B inside (Z. Wang et al., "Image quality assessment: from error visibility to
   *  structural similarity", IEEE Trans. Image Processing 13, 2004: Gaussian window of 1.5 pixels).
   */
  [[nodiscard]] double ssim () const { return mean (ssim_); }
  /** The same over all that either has, with the outline and 2 pixels round it. */
  [[nodiscard]] double ssim_all () const { return mean (ssim_all_); }
  /** Distance between the outlines, both ways, so that holes and missing strands count: mean, and
   *  what 95 % keep within, pixels. */
  [[nodiscard]] double edge_px () const { return mean (edge_); }
  [[nodiscard]] double edge95_px () const { return mean (edge95_); }
  /** Gradients inside that the truth has nowhere within 2 pixels, over those that it has. */
  [[nodiscard]] double seam () const { return mean (seam_); }
  /** Share of the pixels inside of which a channel is more than 40 levels off. */
  [[nodiscard]] double bad () const { return mean (bad_); }

private:
  [[nodiscard]] double mean (double sum) const { return shots_ > 0 ? sum / shots_ : 0; }

  double holes_ = 0, spill_ = 0, psnr_ = 0, ssim_ = 0, ssim_all_ = 0, edge_ = 0, edge95_ = 0,
         seam_ = 0, bad_ = 0;
  int shots_ = 0;
};

/** What changes from picture to picture of a film and not in the truth: means over the pictures. */
class MotionScore {
public:
  /** @param place  from which of several places, each with its own film */
  void add (int place, const Shot &truth, const cv::Mat &rgba);

  [[nodiscard]] double ssim_all () const { return score_.ssim_all (); }
  /** Share of the pixels inside both figures that change by over 20 levels more than the truth. */
  [[nodiscard]] double flicker () const { return changes_ > 0 ? flicker_ / changes_ : 0; }
  /** Pixels that are drawn in one of two pictures while the truth stays, as a share of the
   * figure's.
   */
  [[nodiscard]] double outline () const { return changes_ > 0 ? outline_ / changes_ : 0; }

private:
  struct Last {
    Shot truth;
    cv::Mat rgba;
  };
  std::map<int, Last> last_;
  Score score_;
  double flicker_ = 0, outline_ = 0;
  int changes_ = 0;
};

/** Truth, picture, and where they differ (four times the difference, about grey; holes magenta,
 *  spill cyan) side by side, over mid-grey. CV_8UC3, BGR. */
cv::Mat comparison (const Shot &truth, const cv::Mat &rgba);

} // namespace bench
