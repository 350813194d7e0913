/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <opencv2/core.hpp>
#include <rangecast/scene/scene.hpp>
#include <vector>

namespace bench {

/** Of the pictures that are judged, pixels. */
inline constexpr int kWidth = 640, kHeight = 480;

/** What a camera of twice the resolution really sees, somewhere round the scene. */
struct Shot {
  double azimuth_deg;
  cv::Mat colour; ///< CV_8UC4, RGBx
  cv::Mat mask;   ///< CV_8U, 255 = figure
};

/** Degrees off the nearest of four cameras at which there is a truth. */
inline constexpr int kAngles[] = {0, 20, 45};

/** Renders the scene from four places that many degrees off the nearest of four cameras that stand
 *  90 degrees apart.
 *  @param settings  of the frame set; size, number of views and noise are not used
 *  @param angle_deg one of kAngles */
rangecast::Status make_truth (
    rangecast::SceneSettings settings, int angle_deg, std::vector<Shot> &shots);

/** How near pictures come to the truth, all of them together. */
class Score {
public:
  /** @param rgba  CV_8UC4; drawn where alpha is at least half */
  void add (const Shot &truth, const cv::Mat &rgba);

  /** Share of the figure's pixels that are not drawn. */
  [[nodiscard]] double holes () const { return missing_ / truth_; }
  /** Pixels drawn beside the figure, as a share of the figure's. */
  [[nodiscard]] double spill () const { return beside_ / truth_; }
  /** Of R, G, B where both have something, dB. */
  [[nodiscard]] double psnr () const;
  /** Of luma, mean over the same pixels (Z. Wang et al., "Image quality assessment: from error
   *  visibility to structural similarity", IEEE Trans. Image Processing 13, 2004: Gaussian window
   *  of 1.5 pixels, of which only the part counts where both have something). */
  [[nodiscard]] double ssim () const { return both_ > 0 ? ssim_ / both_ : 0; }

private:
  double truth_ = 0, missing_ = 0, beside_ = 0, both_ = 0, squares_ = 0, ssim_ = 0;
};

/** Truth, picture, and where they differ (four times the difference, about grey; holes magenta,
 *  spill cyan) side by side. CV_8UC3, BGR. */
cv::Mat comparison (const Shot &truth, const cv::Mat &rgba);

} // namespace bench
