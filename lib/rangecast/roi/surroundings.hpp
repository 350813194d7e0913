/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace rangecast {

/** Whether a pixel is known to show background or foreground. */
enum class Side : std::uint8_t { kUnknown, kBackground, kForeground };

/** Finds unknown pixels that are surrounded by foreground: searches from their block of 2x2 pixels
 * in eight directions for the first block with a known majority. Reuses its memory between images.
 */
class Surroundings {
public:
  /** @param sides  CV_8U, values of Side
   *  @param reach  search distance in each direction, pixels, 1 to 255
   *  @param inside  CV_8U, 255 where an unknown pixel sees foreground in at least three quarters of
   * the directions, and in at least four. Directions that end at the image border do not count;
   * directions without known pixels within reach count as background. */
  void find_inside (const cv::Mat &sides, int reach, cv::Mat &inside);

private:
  /* What the pixels of a row see in one direction: a value of Side, and its distance. */
  struct Sights {
    std::vector<std::uint8_t> seen, distance;
  };
  void halve (const cv::Mat &sides);
  void look (int reach, int step);
  void choose (const cv::Mat &sides, cv::Mat &inside);

  Sights before_[3], row_[3]; /* previous row, current row: three directions */
  Sights along_;
  std::vector<std::uint8_t> side_before_; /* of the previous row */
  std::vector<std::int8_t> more_;         /* of a row of pixels: foreground minus background */
  std::vector<std::uint8_t> enough_;      /* of a row, by pixel: 255 = sees enough foreground */
  cv::Mat blocks_;                        /* CV_8U: sides of 2x2 pixels */
  cv::Mat foreground_, background_;       /* CV_8U: number of directions in which it is seen */
};

} // namespace rangecast
