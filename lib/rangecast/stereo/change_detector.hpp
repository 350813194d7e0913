/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "../geometry/range_image.hpp"

namespace rangecast {

/** Detects changes outside of the region that is matched. Compares means of blocks of 8 x 8 pixels,
 *  whose noise is an eighth of a pixel's. Reuses its memory between images. */
class ChangeDetector {
public:
  static constexpr int kBlock = 8; ///< pixels
  /** Computes the blocks of an image. @param image  CV_8UC4, R G B x */
  void update (const cv::Mat &picture);
  /** Means of the blocks, CV_8UC4: of every second row, rounded half to even. */
  [[nodiscard]] const cv::Mat &blocks () const { return blocks_; }
  /** Makes the last image the reference for later ones; blocks() are then unspecified. */
  void set_reference () { cv::swap (blocks_, reference_); }
  void reset () { reference_.release (); }

  /** Whether two or more blocks completely outside of the ROI (pixels) differ from the reference by
   * more than 10 grey levels in one channel. True without reference. */
  [[nodiscard]] bool changed_outside (const Roi &roi) const;

  /** Whether a block (index from the top left) differs from the reference by more than 4 grey
   * levels in one channel, as a low-contrast object may. True without reference. */
  [[nodiscard]] bool block_changed (int bx, int by) const;

private:
  cv::Mat blocks_, reference_; /* CV_8UC4 */
  std::vector<std::uint16_t> sums_;
};

} // namespace rangecast
