/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "../geometry/range_image.hpp"

namespace rangecast {

/** Smooths depth over time where nothing moves: each pixel's depth is a running mean. Blocks of 8 x
 * 8 pixels whose colours change by more than noise, and their neighbours, restart, as do blocks
 * whose depth drifts by more than 0.15 pixels of disparity on average in two successive images. So
 * moving surfaces leave no trail. */
class TemporalFilter {
public:
  /** @param width, height  of the view, pixels
   *  @param steady         0 (off) to 1: the weight of new depth is 1 - 0.9 * steady
   *  @param focal_baseline focal length times baseline, pixels times depth units */
  void set (int width, int height, double steady, double focal_baseline);
  void reset ()
  {
    held_.setTo (0);
    grey_.setTo (0);
    blocks_.assign (blocks_.size (), {});
  }

  /** @param image  its depth is replaced; motion is detected in its colour */
  void apply (const RangeImage &image);

private:
  struct Block {
    float change = 0;       /* grey levels, mean of the absolute differences */
    float drift = 0;        /* pixels of disparity, mean of the differences */
    float drift_before = 0; /* in the previous image */
    bool moves = false, drifts = false;
  };
  void compare_block (const RangeImage &image, int bx, int by, Block &block) const;
  [[nodiscard]] float noise ();
  void average (const RangeImage &image);

  float weight_ = 1, focal_baseline_ = 0;
  int columns_ = 0, rows_ = 0; /* blocks of the view */
  cv::Mat held_, grey_;        /* CV_32F of the view: mean depth (0 = none), mean grey */
  std::vector<Block> blocks_;
  std::vector<float> changes_;
};

} // namespace rangecast
