/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "../geometry/range_image.hpp"

namespace rangecast {

/** Extrapolates depth over a few pixels: at the rim of a person, on slanted surfaces and in small
 * holes, where stereo finds no match. From the border of known depth outwards, each pixel gets the
 * depth of a plane through the known pixels around it, weighted by distance and similarity of
 * colour (the weights of J. Kopf and others, "Joint bilateral upsampling", ACM Trans. Graphics 26,
 * 2007), which continues slanted surfaces. At a depth step the surface with the more similar colour
 * is continued. Pixels similar to neither stay invalid. Reuses its memory between images. */
class DepthFill {
public:
  /** @param image  depth is written where it was invalid and `allowed` is not 0
   *  @param allowed  CV_8U, of the ROI's size
   *  @param reach  maximum distance from known depth, pixels
   *  @param any_colour  continue surfaces regardless of colour
   *  @return number of pixels filled */
  int fill (const RangeImage &image, const cv::Mat &allowed, int reach, bool any_colour = false);

private:
  void begin (const RangeImage &image, const cv::Mat &allowed);
  void advance (const RangeImage &image, const cv::Mat &allowed);

  std::vector<cv::Point> front_, next_front_; /* pixels next to known ones */
  std::vector<std::uint16_t> found_;          /* their depths */
  cv::Mat known_, seen_;                      /* CV_8U: with depth; was in the front */
};

} // namespace rangecast
