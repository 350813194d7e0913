/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "../geometry/range_image.hpp"
#include "change_detector.hpp"

namespace rangecast {

/** Remembers which blocks of 8 x 8 pixels had depth, to say where there may be some in the next
 *  picture: there, one block around, and where the picture has changed. Keeps its memory. */
class Occupancy {
public:
  /** Nothing is known of a view of that size. */
  void set (int width, int height);
  void reset () { known_ = false; }

  /** Takes the depth of one picture. @param image  of a view of the size that was set */
  void learn (const RangeImage &image);

  /** Rectangles of blocks, one below the other, each as wide as its rows need. They are few, as
   *  what lies above and below each must be matched, too.
   *  @param roi  in the view; rectangles may reach one block further
   *  @return null if nothing is known: everywhere */
  const std::vector<cv::Rect> *find (const ChangeDetector &changes, const Roi &roi);

private:
  void mark (const ChangeDetector &changes, const Roi &roi);
  void divide ();

  /* Columns of a row of blocks that are of interest, x1 is not one of them. */
  struct Row {
    int x0, x1;
  };
  int columns_ = 0, rows_ = 0; /* blocks */
  bool known_ = false;
  std::vector<std::uint8_t> had_depth_;
  int first_row_ = 0;
  std::vector<Row> of_interest_; /* from first_row_ on */
  std::vector<float> cost_;      /* of the rows from here to the end */
  std::vector<int> next_;        /* row that the next rectangle begins with */
  std::vector<cv::Rect> parts_;
};

} // namespace rangecast
