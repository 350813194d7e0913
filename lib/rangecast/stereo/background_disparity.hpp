/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "box_sum.hpp"
#include "tiles.hpp"

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

  /** Gives pixels the background's disparity if that fits the pictures better than theirs, and none
   *  to those beside the background that had none and still look the same: the right camera does
   *  not see them.
   *  @param left, right  the same rows; column `right_x` of `right` is column 0 of `left`
   *  @param at           where `left` lies in the whole picture
   *  @param none         written where `disparity` is below `least` and stays so
   *  @param[out] to      as `disparity`, not the same memory; written in `pieces` */
  void restore (const cv::Mat &left, const cv::Mat &right, int right_x, const cv::Point &at,
      int least, int none, const Pieces &pieces, const cv::Mat &disparity, cv::Mat &to);

  /** Gives what has no disparity, but is beside the background in its row, the farthest one there
   *  is, `least`: one camera does not see it. */
  void extend (
      const cv::Point &at, int least, int far, const Pieces &pieces, cv::Mat &disparity) const;

private:
  /* What one thread needs for one piece: pixels, and sums over the patches around them. */
  struct Memory {
    Plane grey, before, pixels, own, other, contrast, change, sums;
    std::vector<std::int16_t> columns;
    std::vector<std::int16_t> claims; /* by column of the right picture: how well it fits */
  };
  /* Where the pictures of one call lie. */
  struct Job {
    const cv::Mat &left, &right;
    int right_x;
    cv::Point at;
    int least, none;
  };
  void compare (const Job &job, const cv::Rect &piece, const cv::Mat &disparity, int least,
      Memory &memory, Plane &unlike) const;
  void restore_piece (const Job &job, const cv::Rect &piece, const cv::Mat &disparity,
      Memory &memory, cv::Mat &to) const;
  void restore_row (const Job &job, int x0, int y, int i, int width, Memory &memory,
      std::int16_t *disparity) const;
  void mark_hidden (
      const std::int16_t *disparity, const std::uint8_t *grey, int y, int least, int far);

  cv::Mat known_;   /* CV_16S, kUnknown where nothing is, kHidden where there was no disparity */
  cv::Mat likely_;  /* the same, with guesses from the row */
  cv::Mat picture_; /* CV_8U: the left picture where something is known */
  WorkerMemory<Memory> memory_;
};

} // namespace rangecast
