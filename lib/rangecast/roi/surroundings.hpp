/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace rangecast {

/** What is known of a pixel: whether it shows something that stands before the background. */
enum class Side : std::uint8_t { kUnknown, kBackground, kForeground };

/** Finds unknown pixels that foreground surrounds: looks from their block of 2x2 pixels in eight
 *  directions for the first block of which more is known to be the one than the other. Keeps its
 *  memory between pictures. */
class Surroundings {
public:
  /** @param sides  CV_8U, values of Side
   *  @param reach  pixels that are looked at in each direction, 1 to 255
   *  @param inside  CV_8U, becomes 255 where an unknown pixel sees foreground in at least
   *                 three quarters of the directions and in four at least. A direction that ends
   *                 at the picture's edge counts for neither; one in which nothing is known within
   *                 reach counts for the background. */
  void find_inside (const cv::Mat &sides, int reach, cv::Mat &inside);

private:
  struct Sight {
    Side side = Side::kUnknown; /* that is beyond the edge of the picture */
    std::uint8_t distance = 1;
  };
  void halve (const cv::Mat &sides);
  void look (int reach, int step);

  std::vector<Sight> before_[3], row_[3]; /* of the row before, and of this one: three directions */
  cv::Mat blocks_;                        /* CV_8U: sides of 2x2 pixels */
  cv::Mat foreground_, background_;       /* CV_8U: directions in which it is seen */
};

} // namespace rangecast
