/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "../geometry/range_image.hpp"

namespace rangecast {

/** Holds depth still where nothing moves: each pixel's depth is a running mean. Blocks of 8 x 8
 *  pixels whose colours change by more than noise, and those beside them, begin anew, and so do
 *  blocks whose depth drifts to one side, by more than 0.15 pixel of disparity on average in two
 *  pictures running: nothing trails. */
class SteadyFilter {
public:
  /** @param width, height  of the view, pixels
   *  @param steady         0 (off) to 1: each new depth counts 1 - 0.9 * steady
   *  @param focal_baseline pixels times depth units: disparity times depth */
  void set (int width, int height, double steady, double focal_baseline);
  void forget () { held_.setTo (0); }

  /** @param image  its depth is replaced; its colour says what moves */
  void apply (const RangeImage &image);

private:
  struct Block {
    float change = 0;       /* grey levels, mean of the absolute differences */
    float drift = 0;        /* pixels of disparity, mean of the differences */
    float drift_before = 0; /* in the picture before */
    bool moves = false, drifts = false;
  };
  void look_at_block (const RangeImage &image, int bx, int by, Block &block) const;
  [[nodiscard]] float noise ();
  void average (const RangeImage &image);

  float weight_ = 1, focal_baseline_ = 0;
  int columns_ = 0, rows_ = 0; /* blocks of the view */
  cv::Mat held_, grey_;        /* CV_32F of the view: mean depth (0 = none), mean grey */
  std::vector<Block> blocks_;
  std::vector<float> changes_;
};

} // namespace rangecast
