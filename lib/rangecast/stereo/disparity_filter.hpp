/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "box_sum.hpp"
#include "tiles.hpp"

namespace rangecast {

/** Clears disparities that cannot be right. Disparities are CV_16S in 1/16 pixel, left x minus
 *  right x; below `least` = none, and least - 16 is what is written. Greys are CV_8U, rectified, of
 *  the disparities' size. Only pixels in `pieces` are looked at and written: around them there must
 *  be no disparities. Keeps its memory between pictures. */
class DisparityFilter {
public:
  /** Clears pixels whose surroundings look otherwise in the right picture than in the left one: of
   *  7 x 7 pixels, those with a disparity differ on average, after the mean difference is taken off
   *  (cameras may be of different brightness), by more than `tolerance` of the patch's contrast and
   *  what noise does. Foreign parts of the picture, of which a matcher makes what it can, go.
   *  @param right  of the same height; its column `right_x` is the left picture's column 0
   *  @param[out] to  of the same size, not the same memory */
  void clear_unlike (const cv::Mat &left, const cv::Mat &right, int right_x, double tolerance,
      int least, const Pieces &pieces, const cv::Mat &disparity, cv::Mat &to);

  /** Clears what the right camera cannot see because something nearer stands before it: of the
   *  pixels that land on one of the right picture, those more than 1.5 pixels of disparity behind
   *  the nearest. */
  void clear_hidden (int least, const Pieces &pieces, cv::Mat &disparity);

  /** Clears flying pixels: those of whose eight neighbours fewer than `support` have a disparity
   *  within `step` (a share of disparity + offset: the same share of the depth) or 0.5 pixel.
   *  @param[out] to  of the same size, not the same memory */
  void clear_flying (double step, int support, int offset, int least, const Pieces &pieces,
      const cv::Mat &disparity, cv::Mat &to);

  /** Clears patches of up to `window` pixels, each within `range` (1/16 pixel) of one of its
   *  four neighbours: what cv::filterSpeckles() does.
   *  @param nearest  at least `least`: what is farther is left alone, and no part of a patch */
  void clear_specks (
      int window, int range, int least, int nearest, const Pieces &pieces, cv::Mat &disparity);

  /** Fills gaps of up to `width` pixels in a row or a column between disparities that differ by at
   *  most one pixel, where colours lie between those of the ends, or nearly: specks on a surface.
   */
  void fill_gaps (
      const cv::Mat &colour, int width, int least, const Pieces &pieces, cv::Mat &disparity);

  /** Clears narrow surfaces that the pictures show no reason for: what they land on in the right
   *  picture is seen, by its disparity and its grey, as a part of a wide surface farther off. A
   *  pattern that repeats is matched so where its true match is hidden. */
  void clear_doubled (const cv::Mat &left, const cv::Mat &right, int right_x, int least,
      const Pieces &pieces, cv::Mat &disparity);

private:
  /* What one thread needs for one piece. */
  struct Memory {
    Plane grey, contrast, valid, difference, size; /* of patches, and of their pixels */
    Plane contrasts, counts, differences, sizes, sums;
    std::vector<std::int16_t> columns, nearest;
    std::vector<std::array<int, 2>> surfaces; /* of a row: first column, and the one after it */
  };
  /* Neighbours in a row that belong together. */
  struct Run {
    int x0, x1;     /* columns, x1 is not one of them */
    int root, size; /* of the patch: the number of one of its runs; there: its pixels */
  };
  void compare_patches (const cv::Mat &left, const cv::Mat &right, int right_x, int least,
      const cv::Rect &piece, const cv::Mat &disparity, Memory &memory) const;
  void find_runs (const std::int16_t *row, int x0, int x1, int range, int least);
  void join_rows (const std::int16_t *upper, const std::int16_t *lower, std::size_t a,
      std::size_t a_end, std::size_t b_end, int range);
  [[nodiscard]] int find_root (int run);
  static void clear_doubled_of_row (const std::uint8_t *left, const std::uint8_t *right,
      int right_width, int right_x, int least, int width, Memory &memory, std::int16_t *disparity);

  WorkerMemory<Memory> memory_;
  std::vector<Run> runs_;
  std::vector<std::size_t> first_runs_; /* by row of the picture, and one more */
  std::vector<int> last_rows_;          /* by column: the lowest one that has a disparity */
};

} // namespace rangecast
