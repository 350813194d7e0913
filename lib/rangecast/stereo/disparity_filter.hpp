/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace rangecast {

/** Clears disparities that cannot be right. Disparities are CV_16S in 1/16 pixel, left x minus
 *  right x; below `least` = none, and `none` is what is written. Greys are CV_8U, rectified, of the
 *  disparities' size. Keeps its memory between pictures. */
class DisparityFilter {
public:
  /** Threads for what takes long; 0 = as many as there are cores. */
  void set_threads (int n_threads) { n_threads_ = n_threads; }

  /** Clears pixels whose surroundings look otherwise in the right picture than in the left one: of
   *  7 x 7 pixels, those with a disparity differ on average, after the mean difference is taken off
   *  (cameras may be of different brightness), by more than `tolerance` of the patch's contrast and
   *  what noise does. Foreign parts of the picture, of which a matcher makes what it can, go.
   *  @param right  of the same height; its column `right_x` is the left picture's column 0 */
  void clear_unlike (const cv::Mat &left, const cv::Mat &right, int right_x, double tolerance,
      int least, cv::Mat &disparity);

  /** Clears what the right camera cannot see because something nearer stands before it: of the
   *  pixels that land on one of the right picture, those more than 1.5 pixels of disparity behind
   *  the nearest. */
  void clear_hidden (int least, cv::Mat &disparity);

  /** Clears flying pixels: those of whose eight neighbours fewer than `support` have a disparity
   *  within `step` (a share of disparity + offset: the same share of the depth) or 0.5 pixel. */
  void clear_flying (double step, int support, int offset, int least, cv::Mat &disparity);

  /** Clears the rim that block matching hangs around what stands before something farther: pixels
   *  near a step down, or near pixels without disparity, that are more like these in colour than
   *  like the pixels of their own depth, as far as `radius` around. Fills what has no disparity
   * where the pixels around that look like it agree on one.
   *  @param colour  CV_8UC4, of the disparities' size
   *  @param step    as clear_flying() has it */
  void clear_rims (
      const cv::Mat &colour, int radius, double step, int offset, int least, cv::Mat &disparity);

  /** Fills gaps of up to `width` pixels in a row or a column between disparities that differ by at
   *  most one pixel, where colours lie between those of the ends, or nearly: specks on a surface.
   */
  void fill_gaps (const cv::Mat &colour, int width, int least, cv::Mat &disparity);

private:
  struct Votes;
  void sample (const cv::Mat &colour, const cv::Mat &disparity, int radius);
  template <typename Count>
  void for_window (const cv::Vec4b &own, int x, int y, int radius, const Count &count) const;
  [[nodiscard]] Votes vote (
      const cv::Vec4b &own, int x, int y, int d, int radius, int most, int least) const;
  void clear_rims_of_row (const cv::Mat &colour, int y, int radius, int share, int offset,
      int least, cv::Mat &disparity) const;
  [[nodiscard]] int likely (const cv::Vec4b &own, int x, int y, int radius, int least) const;

  cv::Mat samples_[4]; /* CV_16S: three colours and disparity at half the size, padded by pad_ */
  int pad_ = 0, n_threads_ = 0;
  cv::Mat difference_, contrast_, valid_, blurred_, count_, means_, copy_, lowest_, highest_;
  std::vector<std::int16_t> nearest_;
};

} // namespace rangecast
