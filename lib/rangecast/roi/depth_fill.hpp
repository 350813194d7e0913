/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "../geometry/range_image.hpp"

namespace rangecast {

/** Gives depth to pixels that have none, a few pixels far from what has: what stereo does not match
 *  at the rim of a person, on surfaces that turn away, and in small holes. Pixel by pixel from the
 *  edge of what is known outwards, each gets the depth of the plane that the known pixels around it
 *  make, weighted by how near and how like it in colour they are (the weights of J. Kopf and
 * others, "Joint bilateral upsampling", ACM Trans. Graphics 26, 2007), so that a surface goes on as
 * it slopes. Of two surfaces on both sides of a depth step the one that looks like the pixel goes
 * on. What looks like neither stays without depth. Keeps its memory between pictures. */
class DepthFill {
public:
  /** @param image  depth is written where there was none and `allowed` is other than 0
   *  @param allowed  CV_8U, of the ROI's size
   *  @param reach  pixels from what had depth, at most
   *  @param any_colour  a surface goes on whatever the pixel looks like
   *  @return how many pixels got depth */
  int fill (const RangeImage &image, const cv::Mat &allowed, int reach, bool any_colour = false);

private:
  void begin (const RangeImage &image, const cv::Mat &allowed);
  void advance (const RangeImage &image, const cv::Mat &allowed);

  std::vector<cv::Point> front_, next_front_; /* pixels beside what is known */
  std::vector<std::uint16_t> found_;          /* their depths */
  cv::Mat seen_;                              /* CV_8U: 1 = has been in the front */
};

} // namespace rangecast
