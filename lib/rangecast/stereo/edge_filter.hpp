/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace rangecast {

/** Smooths the disparities of pixels at depth edges, where patches see two surfaces, along the
 * edge. Each becomes that of the least-squares plane through all pixels at edges that are within
 * seven rows and columns and on the same surface (kSurfaceStep). Reuses its memory. */
class EdgeFilter {
public:
  /** @param min        at least 1; smaller disparities stay, none is made smaller
   *  @param n_threads  0 = one per core
   *  @param disparity  CV_16U, 1/16 pixel, 0 = none; replaced */
  void apply (int min, int n_threads, cv::Mat &disparity);

private:
  struct Pixel {
    std::int16_t x;
    std::uint16_t disparity;
  };
  std::vector<std::vector<Pixel>> edges_; /* by row */
};

} // namespace rangecast
