/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <opencv2/core.hpp>

#include "moving_blocks.hpp"

namespace rangecast {

/** Steadies disparities over time. Noise would move edges and surfaces in each image, and make
 *  holes come and go.
 *
 *  Each block of the left image is found again in the image before: of the motions of neighbours,
 * and of the image before, the one that differs least, improved step by step (G. de Haan and
 * others, "True-motion estimation with 3-D recursive search block matching", IEEE Trans. CSVT 3,
 * 1993). Disparities found and put out there, less the mean change of the block, then count:
 *  - a pixel has a disparity if two of these three have: found now, found before, put out before;
 *  - a gap gets it only if the two from before agree; where nothing moves, it is the median of all;
 *  - a change by less than a pixel goes half the way.
 *
 *  Blocks whose disparities do not follow their motion stay as they are. Reuses its memory. */
class TemporalFilter {
public:
  /** @param image      size of all images
   *  @param n_threads  0 = one per core */
  void set (const cv::Size &image, int n_threads);
  /** Forgets all images. */
  void reset () { now_.roi = {}; }

  /** @param left   CV_8UC4, R G B x, rectified
   *  @param roi    of the disparities
   *  @param still  what moves in the left image
   *  @param disparity  CV_16U, 1/16 pixel, 0 = none; replaced */
  void apply (
      const cv::Mat &left, const cv::Rect &roi, const StillAverage &still, cv::Mat &disparity);

private:
  struct Image {
    cv::Mat grey, found, shown;     /* CV_8U; CV_16U: as matched, and as put out */
    cv::Rect roi;                   /* where they are known */
    std::vector<cv::Point> motions; /* of blocks: from here to the image before */
  };
  void steady_block (int bx, int by, const cv::Rect &both, bool moves);
  [[nodiscard]] int difference (const cv::Rect &window, const cv::Point &motion, int most) const;
  [[nodiscard]] cv::Point find_motion (int bx, int by, const cv::Rect &window) const;
  [[nodiscard]] bool follows (const cv::Rect &window, const cv::Point &motion, int &change) const;

  BlockGrid grid_;
  int n_threads_ = 0;
  Image now_, before_;
};

} // namespace rangecast
