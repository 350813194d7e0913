/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace rangecast {

/** Takes the noise off one camera's pictures where nothing moves: the mean of the last few. Blocks
 *  of 8 x 8 pixels that differ from it by more than noise, and those beside them, begin anew. */
class StillAverage {
public:
  /** @param frames  that are averaged, 2 to 64; the latest ones count most */
  void set (int frames);
  void reset () { blocks_.clear (); }

  /** @param picture  CV_8UC4; another size than before begins anew
   *  @return the mean, of the same kind; valid until the next call */
  const cv::Mat &add (const cv::Mat &picture);

private:
  struct Block {
    float drift = 0, change = 0; /* grey levels: of the block's mean, and of its pixels */
    int frames = 0;              /* in its mean */
    bool moves = false;
  };
  void compare (const cv::Mat &picture, int by);
  void average (const cv::Mat &picture, int by);
  void find_motion ();

  int frames_ = 2, columns_ = 0, rows_ = 0;
  cv::Mat sum_, mean_; /* CV_16UC4, levels times 128; CV_8UC4 */
  std::vector<Block> blocks_;
  std::vector<float> changes_;
};

} // namespace rangecast
