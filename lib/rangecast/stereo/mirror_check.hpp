/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <opencv2/core.hpp>

namespace rangecast {

/** Tells cameras whose pictures come on each other's pads. What can be matched then seems to lie
 *  beyond infinity, which nothing does, and before the cameras with the pictures exchanged. Looks
 *  at small pictures, and only at pixels that can be matched without doubt. */
class MirrorCheck {
public:
  /** A rectified pair, CV_8UC4. */
  struct Pair {
    cv::Mat left, right;
  };

  void reset () { *this = {}; }
  /** Whether look() has seen enough; it is not needed after that. */
  [[nodiscard]] bool decided () const { return decided_; }
  [[nodiscard]] bool mirrored () const { return mirrored_; }
  /** Whether these pictures should be looked at: all at first, then fewer and fewer, so that
   * cameras which see nothing to match cost little. Counts them. */
  [[nodiscard]] bool wants_next ();

  /** @param as_is      rectified as they come
   *  @param exchanged  the same pictures, exchanged and then rectified
   *  @param infinity   disparity of what is infinitely far, pixels
   *  @param most       largest disparity to look for, pixels */
  void look (const Pair &as_is, const Pair &exchanged, double infinity, double most);

private:
  int seen_ = 0, next_ = 0;
  bool decided_ = false, mirrored_ = false;
};

} // namespace rangecast
