/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "still_average.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "../base/simd.hpp"

namespace rangecast {
namespace {

constexpr int kBlock = 8;
constexpr int kScale = 128; /* of sums to levels */
/* Maximum noise, grey levels; more is motion. */
constexpr float kMaxNoise = 6;

} // namespace

void
StillAverage::set (int frames)
{
  frames_ = std::clamp (frames, 2, 64);
  reset ();
}

/* Differences of a row of blocks from the mean. */
void
StillAverage::compare (const cv::Mat &picture, int by)
{
  const int bottom = std::min (picture.rows, (by + 1) * kBlock);
  Block *row = &blocks_[std::size_t (by) * std::size_t (columns_)];
  for (int bx = 0; bx < columns_; bx++) {
    const int x0 = bx * kBlock, n = std::min (kBlock, picture.cols - x0);
    int sum = 0, size = 0;
    for (int y = by * kBlock; y < bottom; y++) {
      const std::uint8_t *p = picture.ptr<std::uint8_t> (y) + 4 * x0,
                         *m = mean_.ptr<std::uint8_t> (y) + 4 * x0;
      for (int x = 0; x < n; x++) {
        const int d =
            p[4 * x] - m[4 * x] + 2 * (p[4 * x + 1] - m[4 * x + 1]) + p[4 * x + 2] - m[4 * x + 2];
        sum += d;
        size += std::abs (d);
      }
    }
    const float scale = 1.f / float (4 * n * (bottom - by * kBlock));
    row[bx].drift = std::abs (float (sum)) * scale;
    row[bx].change = float (size) * scale;
  }
}

/* Noise is estimated from the quarter of all blocks that change least. The mean of 64 pixels has an
 * eighth of their standard deviation, which is 1.25 times their mean deviation. */
void
StillAverage::find_motion ()
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
    for (int y = std::max (0, by - 1); y <= std::min (rows_ - 1, by + 1); y++)
      for (int x = std::max (0, bx - 1); x <= std::min (columns_ - 1, bx + 1); x++)
        if (blocks_[std::size_t (y * columns_ + x)].moves)
          return true;
    return false;
  };
  for (int by = 0; by < rows_; by++)
    for (int bx = 0; bx < columns_; bx++) {
      Block &block = blocks_[std::size_t (by * columns_ + bx)];
      block.frames = moves (bx, by) ? 1 : std::min (block.frames + 1, frames_);
    }
}

void
StillAverage::average (const cv::Mat &picture, int by)
{
  const int bottom = std::min (picture.rows, (by + 1) * kBlock);
  const Block *row = &blocks_[std::size_t (by) * std::size_t (columns_)];
  for (int y = by * kBlock; y < bottom; y++) {
    const auto p = picture.ptr<std::uint8_t> (y);
    auto sum = sum_.ptr<std::uint16_t> (y);
    auto mean = mean_.ptr<std::uint8_t> (y);
    for (int bx = 0; bx < columns_; bx++) {
      const int begin = 4 * bx * kBlock, end = std::min (begin + 4 * kBlock, 4 * picture.cols);
      const int share = 65536 / row[bx].frames;
      for (int i = begin; i < end; i++) {
        const int step = (kScale * p[i] - sum[i]) * (share >> 2) >> 14;
        sum[i] = std::uint16_t (sum[i] + step);
        mean[i] = std::uint8_t ((sum[i] + kScale / 2) / kScale);
      }
    }
  }
}

const cv::Mat &
StillAverage::add (const cv::Mat &picture)
{
  const bool anew = blocks_.empty () || picture.size () != mean_.size ();
  if (anew) {
    columns_ = (picture.cols + kBlock - 1) / kBlock;
    rows_ = (picture.rows + kBlock - 1) / kBlock;
    blocks_.assign (std::size_t (columns_) * std::size_t (rows_), {});
    mean_.create (picture.size (), CV_8UC4);
    sum_ = cv::Mat::zeros (picture.size (), CV_16UC4); /* average() reads it */
    for (Block &block : blocks_)
      block.frames = 1;
  }
  for_this_cpu ([&] {
    if (!anew) {
      for (int by = 0; by < rows_; by++)
        compare (picture, by);
      find_motion ();
    }
    for (int by = 0; by < rows_; by++)
      average (picture, by);
  });
  return mean_;
}

} // namespace rangecast
