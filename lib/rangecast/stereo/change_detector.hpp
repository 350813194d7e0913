/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "../geometry/range_image.hpp"

namespace rangecast {

/** Tells whether anything moves in the part of the pictures that is not looked at closely. Compares
 *  means of blocks of 8 x 8 pixels, whose noise is an eighth of a pixel's. Keeps its memory. */
class ChangeDetector {
public:
  static constexpr int kBlock = 8; ///< pixels
  /** Takes the blocks of one camera's picture. @param picture  CV_8UC4, R G B x */
  void look (const cv::Mat &picture);
  /** Means of the blocks, CV_8UC4: with every second row, halves rounded to the even number. */
  [[nodiscard]] const cv::Mat &blocks () const { return blocks_; }
  /** What was looked at last is what later pictures are compared with. */
  void remember ();
  void reset () { remembered_.release (); }

  /** Whether two or more blocks that lie wholly outside of the ROI (pixels) differ from what was
   *  remembered by more than 10 grey levels in one colour. True if nothing is remembered. */
  [[nodiscard]] bool changed_outside (const Roi &roi) const;

  /** Whether a block (counted from the top left one) differs from what was remembered by more than
   *  4 grey levels in one colour: something that hardly stands out may be there. True if nothing is
   *  remembered. */
  [[nodiscard]] bool block_changed (int bx, int by) const;

private:
  cv::Mat blocks_, remembered_; /* CV_8UC4 */
  std::vector<std::uint16_t> sums_;
};

} // namespace rangecast
