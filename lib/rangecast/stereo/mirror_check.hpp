/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <opencv2/core.hpp>

namespace rangecast {

/** Tells cameras whose pictures come on each other's pads: then hardly anything matches, and much
 *  does with left and right exchanged. Looks at small pictures. */
class MirrorCheck {
public:
  void reset () { decided_ = mirrored_ = false; }
  /** Whether look() has seen enough; it is not needed after that. */
  [[nodiscard]] bool decided () const { return decided_; }
  [[nodiscard]] bool mirrored () const { return mirrored_; }

  /** @param left, right  CV_8UC4, rectified
   *  @param least, most  disparities to look for, pixels */
  void look (const cv::Mat &left, const cv::Mat &right, int least, int most);

private:
  bool decided_ = false, mirrored_ = false;
};

} // namespace rangecast
