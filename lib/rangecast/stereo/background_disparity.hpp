/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace rangecast {

/** What lay beyond far when the whole picture was matched at all depths. Where only some depths are
 *  matched, a matcher takes that for something else; here it is known again by its disparity.
 *  Disparities are CV_16S in 1/16 pixel, greys CV_8U. */
class BackgroundDisparity {
public:
  void forget () { known_.release (); }
  [[nodiscard]] bool empty () const { return known_.empty (); }

  /** @param grey       the whole left picture
   *  @param disparity  of it; from `least` on and below `far` it is background
   *  Where something else stands now, what was known stays; where nothing ever was, the rest of the
   *  row says what may be there. */
  void remember (const cv::Mat &grey, const cv::Mat &disparity, int least, int far);

  /** Gives pixels the background's disparity if that fits the pictures better than theirs.
   *  @param left, right  the same rows; column `right_x` of `right` is column 0 of `left`
   *  @param at           where `left` lies in the whole picture
   *  @param none         written into `disparity` where it is below `least` and stays so */
  void restore (const cv::Mat &left, const cv::Mat &right, int right_x, const cv::Point &at,
      int least, int none, cv::Mat &disparity);

private:
  void compare (const cv::Mat &left, const cv::Mat &right, int right_x, const cv::Mat &disparity,
      int least, cv::Mat &unlike);

  cv::Mat known_;                    /* CV_16S, kUnknown where nothing is */
  cv::Mat likely_;                   /* the same, with guesses from the row */
  cv::Mat picture_;                  /* CV_8U: the left picture where something is known */
  std::vector<std::uint8_t> claims_; /* by column of the right picture: how well it fits */
  cv::Mat own_, other_, contrast_, change_, mean_;
};

} // namespace rangecast
