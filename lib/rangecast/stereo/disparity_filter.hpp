/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "../geometry/connected_components.hpp"
#include "box_sum.hpp"
#include "tiles.hpp"

namespace rangecast {

/** Maximum difference of neighbours in one surface, as a share of their depth. 2 % clears parts of
 * slanted surfaces, 5 % leaves rims of the background. */
inline constexpr double kSurfaceStep = 0.03;

/** Clears wrong disparities. Disparities are CV_16S in 1/16 pixel, left x minus right x; values
 * below `min` mean none; cleared ones become min - 16. Only pixels in `tiles` are read and written;
 * there must be no disparities around them. Reuses its memory between images. */
class DisparityFilter {
public:
  /** Clears pixels that are occluded in the right image: of all pixels that map to one right pixel,
   * those more than 1.5 pixels of disparity behind the nearest one. */
  void clear_hidden (int min, const Tiles &tiles, cv::Mat &disparity);

  /** Clears flying pixels: fewer than four of the eight neighbours have a disparity within
   * kSurfaceStep or 0.5 pixel.
   *  @param offset   1/16 pixel, to be added to disparities
   *  @param[out] to  of the same size, not the same memory */
  void clear_flying (
      int offset, int min, const Tiles &tiles, const cv::Mat &disparity, cv::Mat &to);

  /** Clears components of up to 100 pixels, in which four-connected neighbours differ by at most
   * two pixels of disparity, like cv::filterSpeckles().
   *  @param nearest  at least `min`; farther pixels are ignored */
  void clear_specks (int min, int nearest, const Tiles &tiles, cv::Mat &disparity);

  /** Fills gaps of up to 12 pixels in a row or column between disparities that differ by at most
   * one pixel, if the colours are approximately between those of the ends. */
  void fill_gaps (const cv::Mat &colour, int min, const Tiles &tiles, cv::Mat &disparity);

private:
  /* Scratch memory of one thread for one tile. */
  struct Memory {
    Plane disparities;
    std::vector<std::int16_t> nearest;
    std::vector<std::uint16_t> max, support; /* of a row: see clear_flying() */
    std::vector<std::uint8_t> known;         /* by column of a tile: 1 = has a disparity */
  };
  static void fill_gaps_of_columns (
      const cv::Mat &colour, int min, const Tiles &tiles, cv::Mat &disparity);

  WorkerMemory<Memory> memory_;
  ConnectedComponents components_;
};

} // namespace rangecast
