/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace rangecast {

/** Temporal noise filter of one camera's images: the mean of the last ones where nothing moves.
 * Blocks of 8 x 8 pixels that differ from the mean by more than noise, and their neighbours,
 * restart. */
class StillAverage {
public:
  /** @param frames  number to average, 2 to 64; the latest ones have the highest weight */
  void set (int frames);
  void reset () { blocks_.clear (); }

  /** @param image  CV_8UC4; a change of size restarts
   *  @param part   where the mean is needed; elsewhere it may be that of earlier images
   *  @return the mean, of the same type; valid until the next call */
  const cv::Mat &add (const cv::Mat &picture, const cv::Rect &part);
  const cv::Mat &add (const cv::Mat &picture)
  {
    return add (picture, cv::Rect ({}, picture.size ()));
  }

private:
  struct Block {
    float drift = 0, change = 0; /* grey levels: change of the block's mean, and of its pixels */
    int pictures = 0;            /* since the restart */
    bool moves = false;
  };
  /* Rectangles of blocks. */
  void compare (const cv::Mat &picture, const cv::Rect &part);
  void find_motion (const cv::Rect &part);
  void average (const cv::Mat &picture, const cv::Rect &part);

  int frames_ = 2, columns_ = 0, rows_ = 0;
  cv::Mat sum_, mean_; /* CV_16SC4, levels times 128; CV_8UC4 */
  std::vector<Block> blocks_;
  std::vector<float> changes_;
};

} // namespace rangecast
