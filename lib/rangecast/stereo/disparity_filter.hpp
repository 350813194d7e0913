/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
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
 * below `min` mean none; cleared ones become min - 16. Greys are CV_8U, rectified, of the
 * disparities' size. Only pixels in `tiles` are read and written; there must be no disparities
 * around them. Reuses its memory between images. */
class DisparityFilter {
public:
  /** Clears pixels whose patches of 7 x 7 pixels differ between both images: the mean absolute
   * difference of pixels with disparity, after subtracting the mean difference (cameras may differ
   * in brightness), exceeds the patch's contrast plus noise. Removes false matches of parts that
   * only one camera sees.
   *  @param right  of the same height; its column `right_x` corresponds to column 0 of `left`
   *  @param[out] to  of the same size, not the same memory */
  void clear_unlike (const cv::Mat &left, const cv::Mat &right, int right_x, int min,
      const Tiles &tiles, const cv::Mat &disparity, cv::Mat &to);

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

  /** Clears narrow surfaces whose right pixels also match, in disparity and grey level, a wide
   * surface farther away: false matches of a repetitive pattern whose true match is occluded. */
  void clear_doubled (const cv::Mat &left, const cv::Mat &right, int right_x, int min,
      const Tiles &tiles, cv::Mat &disparity);

private:
  /* Scratch memory of one thread for one tile. */
  struct Memory {
    Plane grey, contrast, valid, difference, size; /* of pixels, and sums over patches */
    Plane contrasts, counts, differences, sizes, sums;
    std::vector<std::int16_t> columns, nearest;
    std::vector<std::uint16_t> max, support;  /* of a row: see clear_flying() */
    std::vector<std::uint8_t> known;          /* by column of a tile: 1 = has a disparity */
    std::vector<std::array<int, 2>> surfaces; /* of a row: first column, last column + 1 */
  };
  void compare_patches (const cv::Mat &left, const cv::Mat &right, int right_x, int min,
      const cv::Rect &tile, const cv::Mat &disparity, Memory &memory) const;
  static void fill_gaps_of_columns (
      const cv::Mat &colour, int min, const Tiles &tiles, cv::Mat &disparity);
  static void clear_doubled_of_row (const std::uint8_t *left, const std::uint8_t *right,
      int right_width, int right_x, int min, int width, Memory &memory, std::int16_t *disparity);

  WorkerMemory<Memory> memory_;
  ConnectedComponents components_;
};

} // namespace rangecast
