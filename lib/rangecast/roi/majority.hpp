/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace rangecast {

/** Smooths masks of 0 and 255. Equal to cv::medianBlur(), but counts pixels instead of sorting
 *  them. Reuses its memory between images. */
class Majority {
public:
  /** @param radius  1 or 2: the window of each pixel has (2 * radius + 1) squared pixels; the
   * image's border is repeated
   *  @param[out] to  255 where most pixels of the window are 255; not the same as `mask` */
  void find (const cv::Mat &mask, int radius, cv::Mat &to);

private:
  std::vector<std::uint8_t> counts_; /* by column, with a border */
};

} // namespace rangecast
