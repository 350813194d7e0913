/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "occupancy.hpp"

#include <algorithm>

namespace rangecast {

namespace {
constexpr int kBlock = ChangeDetector::kBlock;
constexpr int kMinPixels = 4; /* with depth in a block; fewer may be noise */
} // namespace

void
Occupancy::set (int width, int height)
{
  columns_ = (width + kBlock - 1) / kBlock;
  rows_ = (height + kBlock - 1) / kBlock;
  had_depth_.assign (std::size_t (columns_) * std::size_t (rows_), 0);
  known_ = false;
}

void
Occupancy::learn (const RangeImage &image)
{
  const Roi &roi = image.roi;
  for (int by = roi.y / kBlock; by <= (roi.y + roi.height - 1) / kBlock; by++) {
    const int y0 = std::max (by * kBlock, roi.y),
              y1 = std::min ((by + 1) * kBlock, roi.y + roi.height);
    for (int bx = roi.x / kBlock; bx <= (roi.x + roi.width - 1) / kBlock; bx++) {
      const int x0 = std::max (bx * kBlock, roi.x),
                x1 = std::min ((bx + 1) * kBlock, roi.x + roi.width);
      int n = 0;
      for (int y = y0; y < y1; y++) {
        const std::uint16_t *depth = image.depth.row (y - roi.y) - roi.x;
        for (int x = x0; x < x1; x++)
          n += depth[x] != 0;
      }
      had_depth_[std::size_t (by * columns_ + bx)] = n >= kMinPixels;
    }
  }
  known_ = true;
}

/* Marks the columns of interest in each row of blocks, with a margin of one block. */
void
Occupancy::mark (const ChangeDetector &changes, const Roi &roi)
{
  const int bx0 = roi.x / kBlock, bx1 = (roi.x + roi.width - 1) / kBlock, by0 = roi.y / kBlock,
            by1 = (roi.y + roi.height - 1) / kBlock;
  first_row_ = std::max (0, by0 - 1);
  const int end = std::min (rows_, by1 + 2);
  of_interest_.assign (std::size_t (end - first_row_), {columns_, 0});
  for (int by = by0; by <= by1; by++) {
    Row row = {columns_, 0};
    for (int bx = bx0; bx <= bx1; bx++)
      if (had_depth_[std::size_t (by * columns_ + bx)] || changes.block_changed (bx, by))
        row = {std::min (row.x0, bx), bx + 1};
    if (row.x0 >= row.x1)
      continue;
    for (int y = std::max (0, by - 1); y <= std::min (rows_ - 1, by + 1); y++) {
      Row &to = of_interest_[std::size_t (y - first_row_)];
      to.x0 = std::min (to.x0, std::max (0, row.x0 - 1));
      to.x1 = std::max (to.x1, std::min (columns_, row.x1 + 1));
    }
  }
}

/* Finds the cheapest cover of all rows by dynamic programming, from the last row to the first. */
void
Occupancy::divide ()
{
  constexpr float kSeam = 1.5f; /* height that is matched outside of a rectangle, blocks */
  constexpr float kBegin = 8;   /* fixed cost of a rectangle, in blocks */
  const int n = int (of_interest_.size ());
  cost_.assign (std::size_t (n) + 1, 0);
  next_.assign (std::size_t (n), n);
  for (int i = n - 1; i >= 0; i--) {
    cost_[std::size_t (i)] = 1e30f;
    int x0 = columns_, x1 = 0;
    for (int j = i; j < n; j++) {
      x0 = std::min (x0, of_interest_[std::size_t (j)].x0);
      x1 = std::max (x1, of_interest_[std::size_t (j)].x1);
      float cost = cost_[std::size_t (j) + 1];
      if (x0 < x1)
        cost += kBegin + (float (j - i + 1) + kSeam) * float (x1 - x0);
      if (cost < cost_[std::size_t (i)]) {
        cost_[std::size_t (i)] = cost;
        next_[std::size_t (i)] = j + 1;
      }
    }
  }
  parts_.clear ();
  for (int i = 0; i < n; i = next_[std::size_t (i)]) {
    int x0 = columns_, x1 = 0;
    for (int j = i; j < next_[std::size_t (i)]; j++) {
      x0 = std::min (x0, of_interest_[std::size_t (j)].x0);
      x1 = std::max (x1, of_interest_[std::size_t (j)].x1);
    }
    if (x0 < x1)
      parts_.emplace_back (x0 * kBlock, (first_row_ + i) * kBlock, (x1 - x0) * kBlock,
          (next_[std::size_t (i)] - i) * kBlock);
  }
}

const std::vector<cv::Rect> *
Occupancy::find (const ChangeDetector &changes, const Roi &roi)
{
  if (!known_)
    return nullptr;
  mark (changes, roi);
  divide ();
  return &parts_;
}

} // namespace rangecast
