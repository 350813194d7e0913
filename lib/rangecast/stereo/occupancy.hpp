/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "../geometry/range_image.hpp"
#include "change_detector.hpp"

namespace rangecast {

/** Predicts which blocks of 8 x 8 pixels may have depth in the next image: those that had depth in
 * the last one, their neighbours, and those in which the image has changed. Reuses its memory
 * between images. */
class Occupancy {
public:
  /** Resets for a view of this size. */
  void set (int width, int height);
  void reset () { known_ = false; }

  /** Records the blocks with depth. @param image  of a view of the size that was set */
  void learn (const RangeImage &image);

  /** Rectangles of blocks, one below the other, each as wide as its rows need. Few, because rows
   * above and below each one must be matched, too.
   *  @param roi  inside the view; rectangles may extend one block beyond it
   *  @return null if nothing is known: the whole image */
  const std::vector<cv::Rect> *find (const ChangeDetector &changes, const Roi &roi);

private:
  void mark (const ChangeDetector &changes, const Roi &roi);
  void divide ();

  /* Columns of interest in a row of blocks, without x1. */
  struct Row {
    int x0, x1;
  };
  int columns_ = 0, rows_ = 0; /* blocks */
  bool known_ = false;
  std::vector<std::uint8_t> had_depth_;
  int first_row_ = 0;
  std::vector<Row> of_interest_; /* from first_row_ on */
  std::vector<float> cost_;      /* of covering the rows from here to the end */
  std::vector<int> next_;        /* first row of the next rectangle */
  std::vector<cv::Rect> parts_;
};

} // namespace rangecast
