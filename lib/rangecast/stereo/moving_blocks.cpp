/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "moving_blocks.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "../base/simd.hpp"

namespace rangecast {
namespace {

constexpr int kBlock = BlockGrid::kBlock;

/* ---- StillAverage ---- */

constexpr int kFrames = 10; /* more gain little noise, but the mean adapts more slowly */
constexpr int kScale = 128; /* of sums to levels */
/* Maximum noise, grey levels; more is motion. */
constexpr float kMaxNoise = 6;

using Pixels = Lanes<kBlock>;

/* R + 2 G + B of pixels in memory order. */
inline Pixels::I
luma_of (const Pixels::I &pixels)
{
  return (pixels & 255) + 2 * (pixels >> 8 & 255) + (pixels >> 16 & 255);
}

/* In 16 bits, which vectors hold twice as many of. The sums of one image are not kept, but follow
 * from its mean: the first one leaves no sums.
 * @param images  since the restart, with this one */
inline void
add_to_mean (const std::uint8_t *__restrict image, int n, int images, std::int16_t *__restrict sums,
    std::uint8_t *__restrict means)
{
  const auto share = std::int16_t (std::min (65536 / images, 32767));
  const auto add = [&] (int i, std::int16_t before) {
    const auto step = std::int16_t (kScale * image[i] - before);
    sums[i] = std::int16_t (before + std::int16_t (step * share >> 16));
    means[i] = std::uint8_t (std::uint16_t (sums[i] + kScale / 2) / kScale);
  };
  if (images == 1)
    std::copy_n (image, n, means);
  else if (images == 2)
    for (int i = 0; i < n; i++)
      add (i, std::int16_t (kScale * means[i]));
  else
    for (int i = 0; i < n; i++)
      add (i, sums[i]);
}

} // namespace

/* Differences from the mean. */
void
StillAverage::compare (const cv::Mat &image, const cv::Rect &part)
{
  for (int i = 0; i < part.area (); i++) {
    const int bx = part.x + i % part.width, by = part.y + i / part.width;
    const int bottom = std::min (image.rows, (by + 1) * kBlock);
    const int x0 = bx * kBlock, n = std::min (kBlock, image.cols - x0);
    Pixels::I sums = {}, sizes = {}; /* by column */
    for (int y = by * kBlock; y < bottom; y++) {
      std::int32_t last[2][kBlock] = {}; /* of a part of a block */
      const std::int32_t *now = image.ptr<std::int32_t> (y) + x0,
                         *mean = mean_.ptr<std::int32_t> (y) + x0;
      if (n < kBlock) {
        now = std::copy_n (now, n, last[0]) - n;
        mean = std::copy_n (mean, n, last[1]) - n;
      }
      const Pixels::I d = luma_of (Pixels::at (now)) - luma_of (Pixels::at (mean));
      sums += d;
      sizes += d > 0 ? d : -d;
    }
    int sum = 0, size = 0;
    for (int x = 0; x < kBlock; x++) {
      sum += sums[x];
      size += sizes[x];
    }
    const float scale = 1.f / float (4 * n * (bottom - by * kBlock));
    Block &block = blocks_[grid_.at (bx, by)];
    block.drift = std::abs (float (sum)) * scale;
    block.change = float (size) * scale;
  }
}

/* Noise is estimated from the quarter of all blocks that change least. The mean of 64 pixels has an
 * eighth of their standard deviation, which is 1.25 times their mean deviation. */
void
StillAverage::find_motion (const cv::Rect &part)
{
  changes_.clear ();
  for (const Block &block : blocks_)
    changes_.push_back (block.change);
  const auto quarter = changes_.begin () + std::ptrdiff_t (changes_.size () / 4);
  std::ranges::nth_element (changes_, quarter);
  const float noise = std::min (*quarter, kMaxNoise);
  const float max_change = 0.3f + 1.4f * noise, max_drift = 0.3f + 4 * 1.25f * noise / kBlock;
  for (Block &block : blocks_)
    block.moves = block.change > max_change || block.drift > max_drift;
  const auto moves = [&] (int bx, int by) {
    for (int y = std::max (0, by - 1); y <= std::min (grid_.rows - 1, by + 1); y++)
      for (int x = std::max (0, bx - 1); x <= std::min (grid_.columns - 1, bx + 1); x++)
        if (blocks_[grid_.at (x, y)].moves)
          return true;
    return false;
  };
  for (int by = part.y; by < part.br ().y; by++)
    for (int bx = part.x; bx < part.br ().x; bx++) {
      Block &block = blocks_[grid_.at (bx, by)];
      block.images = moves (bx, by) ? 1 : std::min (block.images + 1, kFrames);
    }
}

void
StillAverage::average (const cv::Mat &image, const cv::Rect &part)
{
  constexpr int kBytes = 4 * kBlock; /* of a row of a block: a constant makes better loops */
  const int bottom = std::min (image.rows, part.br ().y * kBlock);
  for (int y = part.y * kBlock; y < bottom; y++)
    for (int bx = part.x; bx < part.br ().x; bx++) {
      const int begin = bx * kBytes, n = std::min (kBytes, 4 * image.cols - begin);
      const std::uint8_t *from = image.ptr<std::uint8_t> (y) + begin;
      std::int16_t *sum = sum_.ptr<std::int16_t> (y) + begin;
      std::uint8_t *mean = mean_.ptr<std::uint8_t> (y) + begin;
      const int images = blocks_[grid_.at (bx, y / kBlock)].images;
      if (n < kBytes)
        add_to_mean (from, n, images, sum, mean);
      else
        add_to_mean (from, kBytes, images, sum, mean);
    }
}

const cv::Mat &
StillAverage::add (const cv::Mat &image, const cv::Rect &part)
{
  const bool restart = blocks_.empty () || image.size () != mean_.size ();
  if (restart) {
    grid_ = BlockGrid (image.size ());
    blocks_.assign (grid_.count (), {});
    mean_.create (image.size (), CV_8UC4);
    sum_.create (image.size (), CV_16SC4);
  }
  const cv::Rect blocks = grid_.touched (restart ? cv::Rect ({}, image.size ()) : part);
  for_this_cpu ([&] {
    if (!restart) {
      compare (image, blocks);
      find_motion (blocks);
    }
    average (image, blocks);
  });
  return mean_;
}

/* ---- ChangedBlocks ---- */

namespace {

constexpr int kDifference = 10; /* grey levels, for changed_outside() */
constexpr int kSlight = 4;      /* the same for find(): a low-contrast object may change no more */
constexpr int kMinChanged = 2;  /* blocks */
constexpr int kMinPixels = 4;   /* with depth in a block; fewer may be noise */

} // namespace

void
ChangedBlocks::set (const cv::Size &image)
{
  grid_ = BlockGrid (image);
  means_.assign (grid_.count (), {});
  reference_.assign (grid_.count (), {});
  had_depth_.assign (grid_.count (), 0);
  sums_.resize (4 * std::size_t (image.width));
  reset ();
}

/* Every second row is enough: the noise of the mean is still far below the thresholds. */
void
ChangedBlocks::update (const cv::Mat &image)
{
  for_this_cpu ([&] {
    const int width = 4 * image.cols;
    std::uint16_t *__restrict sums = sums_.data ();
    for (int by = 0; by < grid_.rows; by++) {
      const int top = by * kBlock, rows = (std::min (kBlock, image.rows - top) + 1) / 2;
      std::fill_n (sums, width, std::uint16_t{0});
      for (int i = 0; i < rows; i++) {
        const std::uint8_t *__restrict from = image.ptr<std::uint8_t> (top + 2 * i);
        for (int x = 0; x < width; x++)
          sums[x] = std::uint16_t (sums[x] + from[x]);
      }
      for (int bx = 0; bx < grid_.columns; bx++) {
        const int x0 = bx * kBlock, n = std::min (kBlock, image.cols - x0);
        int of_block[4] = {};
        for (int i = 0; i < 4 * n; i++)
          of_block[i % 4] += sums[4 * x0 + i];
        for (int c = 0; c < 4; c++)
          means_[grid_.at (bx, by)][c] =
              std::uint8_t (cvRound (float (of_block[c]) / float (n * rows)));
      }
    }
  });
}

void
ChangedBlocks::set_reference ()
{
  std::swap (means_, reference_);
  has_reference_ = true;
}

bool
ChangedBlocks::differs (std::size_t block, int max_levels) const
{
  const cv::Vec4b &a = means_[block], &b = reference_[block];
  return !has_reference_ || std::abs (a[0] - b[0]) > max_levels ||
         std::abs (a[1] - b[1]) > max_levels || std::abs (a[2] - b[2]) > max_levels;
}

bool
ChangedBlocks::changed_outside (const Roi &roi) const
{
  const cv::Rect inside = grid_.touched ({roi.x, roi.y, roi.width, roi.height});
  int changed = 0;
  for (int by = 0; by < grid_.rows; by++)
    for (int bx = 0; bx < grid_.columns; bx++)
      changed += !inside.contains ({bx, by}) && differs (grid_.at (bx, by), kDifference);
  return !has_reference_ || changed >= kMinChanged;
}

void
ChangedBlocks::learn (const RangeImage &image)
{
  const cv::Rect roi (image.roi.x, image.roi.y, image.roi.width, image.roi.height),
      blocks = grid_.touched (roi);
  for (int by = blocks.y; by < blocks.br ().y; by++)
    for (int bx = blocks.x; bx < blocks.br ().x; bx++) {
      const cv::Rect part = cv::Rect (bx * kBlock, by * kBlock, kBlock, kBlock) & roi;
      int n = 0;
      for (int y = part.y; y < part.br ().y; y++) {
        const std::uint16_t *depth = image.depth.row (y - roi.y) - roi.x;
        for (int x = part.x; x < part.br ().x; x++)
          n += depth[x] != 0;
      }
      had_depth_[grid_.at (bx, by)] = n >= kMinPixels;
    }
  knows_depth_ = true;
}

/* Marks the columns of interest in each row of blocks, with a margin of one block. */
void
ChangedBlocks::mark (const Roi &roi)
{
  const cv::Rect blocks = grid_.touched ({roi.x, roi.y, roi.width, roi.height});
  first_row_ = std::max (0, blocks.y - 1);
  const int end = std::min (grid_.rows, blocks.br ().y + 1);
  of_interest_.assign (std::size_t (end - first_row_), {grid_.columns, 0});
  for (int by = blocks.y; by < blocks.br ().y; by++) {
    Row row = {grid_.columns, 0};
    for (int bx = blocks.x; bx < blocks.br ().x; bx++)
      if (had_depth_[grid_.at (bx, by)] || differs (grid_.at (bx, by), kSlight))
        row = {std::min (row.x0, bx), bx + 1};
    if (row.x0 >= row.x1)
      continue;
    for (int y = std::max (0, by - 1); y <= std::min (grid_.rows - 1, by + 1); y++) {
      Row &to = of_interest_[std::size_t (y - first_row_)];
      to.x0 = std::min (to.x0, std::max (0, row.x0 - 1));
      to.x1 = std::max (to.x1, std::min (grid_.columns, row.x1 + 1));
    }
  }
}

/* Finds the cheapest cover of all rows by dynamic programming, from the last row to the first. */
void
ChangedBlocks::divide ()
{
  constexpr float kSeam = 1.5f; /* height that is matched outside of a rectangle, blocks */
  constexpr float kBegin = 8;   /* fixed cost of a rectangle, in blocks */
  const auto n = of_interest_.size ();
  const auto join = [this] (Row &row, std::size_t i) {
    row = {std::min (row.x0, of_interest_[i].x0), std::max (row.x1, of_interest_[i].x1)};
  };
  cost_.assign (n + 1, 0);
  next_.assign (n, n);
  for (std::size_t i = n; i-- > 0;) {
    cost_[i] = 1e30f;
    Row row = {grid_.columns, 0};
    for (std::size_t j = i; j < n; j++) {
      join (row, j);
      float cost = cost_[j + 1];
      if (row.x0 < row.x1)
        cost += kBegin + (float (j - i + 1) + kSeam) * float (row.x1 - row.x0);
      if (cost < cost_[i]) {
        cost_[i] = cost;
        next_[i] = j + 1;
      }
    }
  }
  parts_.clear ();
  for (std::size_t i = 0; i < n; i = next_[i]) {
    Row row = {grid_.columns, 0};
    for (std::size_t j = i; j < next_[i]; j++)
      join (row, j);
    if (row.x0 < row.x1)
      parts_.emplace_back (row.x0 * kBlock, (first_row_ + int (i)) * kBlock,
          (row.x1 - row.x0) * kBlock, int (next_[i] - i) * kBlock);
  }
}

const std::vector<cv::Rect> *
ChangedBlocks::find (const Roi &roi)
{
  if (!knows_depth_)
    return nullptr;
  mark (roi);
  divide ();
  return &parts_;
}

} // namespace rangecast
