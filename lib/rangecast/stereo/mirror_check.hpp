/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <opencv2/core.hpp>

namespace rangecast {

/** Detects exchanged left and right cameras: matches are then beyond infinity, and in front of the
 *  cameras if the images are exchanged. Uses small images and only unambiguous matches. */
class MirrorCheck {
public:
  /** A rectified pair, CV_8UC4. */
  struct Pair {
    cv::Mat left, right;
  };

  void reset () { *this = {}; }
  /** Whether evaluate() has reached a decision and need not be called again. */
  [[nodiscard]] bool decided () const { return decided_; }
  [[nodiscard]] bool mirrored () const { return mirrored_; }
  /** Whether to examine the next images: all at first, then fewer and fewer, to save time if there
   * is nothing to match. Counts the calls. */
  [[nodiscard]] bool is_due ();

  /** @param as_is      rectified in the given order
   *  @param exchanged  the same images, exchanged and then rectified
   *  @param infinity   disparity of infinity, pixels
   *  @param max        maximum disparity to search, pixels */
  void evaluate (const Pair &as_is, const Pair &exchanged, double infinity, double max);

private:
  int seen_ = 0, next_ = 0;
  bool decided_ = false, mirrored_ = false;
};

} // namespace rangecast
