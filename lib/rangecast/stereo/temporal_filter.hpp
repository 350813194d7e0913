/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <opencv2/core.hpp>

#include "moving_blocks.hpp"

namespace rangecast {

/** Steadies disparities over time, so that noise does not move surfaces and outlines, and holes of
 *  one image do not show.
 *
 *  Finds the motion of each moving block since the previous image, starting from the motions of
 * neighbouring blocks and of the previous image, and searching only if these leave more than 2 grey
 * levels per pixel (G. de Haan and others, "True-motion estimation
 * with 3-D recursive search block matching", IEEE Trans. CSVT 3, 1993). The disparities that were
 * matched and output there, plus the mean change around the block, then vote with the new one:
 *  - A pixel has a disparity if two of the three do.
 *  - Where nothing moves it is their median; else the new one, or, in a gap, the former ones if
 * they agree.
 *  - A change by at most a pixel goes half the way.
 *
 *  Moving blocks whose disparities do not change consistently, and moving pixels whose grey level
 * changed, are output as matched. Reuses its memory. */
class TemporalFilter {
public:
  /** @param image      size of all images
   *  @param n_threads  0 = one per core */
  void set (const cv::Size &image, int n_threads);
  /** Forgets all images. */
  void reset () { now_.roi = before_.roi = {}; }

  /** @param left   CV_8UC4, R G B x, rectified
   *  @param roi    of the disparities
   *  @param still  of the left images; add() was called with this one
   *  @param disparity  CV_16U, 1/16 pixel, 0 = none; replaced */
  void apply (
      const cv::Mat &left, const cv::Rect &roi, const StillAverage &still, cv::Mat &disparity);

private:
  struct Image {
    cv::Mat grey, found, shown;     /* CV_8U; CV_16U: as matched, as output */
    cv::Rect roi;                   /* where they are known */
    std::vector<cv::Point> motions; /* of blocks: from here to the image before */
  };
  void steady_block (int bx, int by, const cv::Rect &both, bool moves, cv::Mat &disparity);
  [[nodiscard]] bool has_disparity (const cv::Rect &window) const;
  [[nodiscard]] int difference (const cv::Rect &window, const cv::Point &motion, int most) const;
  [[nodiscard]] cv::Point find_motion (int bx, int by, const cv::Rect &window) const;
  [[nodiscard]] bool follows (const cv::Rect &window, const cv::Point &motion, int &change) const;

  BlockGrid grid_;
  int n_threads_ = 0;
  Image now_, before_;
};

} // namespace rangecast
