/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "still_average.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>

#include "../base/simd.hpp"

/* luma_of() is always inlined. */
#pragma GCC diagnostic ignored "-Wpsabi"

namespace rangecast {
namespace {

constexpr int kBlock = 8;
constexpr int kMaxFrames = 64;
constexpr int kScale = 128; /* of sums to levels */
/* Maximum noise, grey levels; more is motion. */
constexpr float kMaxNoise = 6;

using Pixels = Lanes<kBlock>;

/* R + 2 G + B of pixels in memory order. */
inline Pixels::I
luma_of (const Pixels::I &pixels)
{
  constexpr bool kLittle = std::endian::native == std::endian::little;
  constexpr int kRed = kLittle ? 0 : 24, kGreen = kLittle ? 8 : 16, kBlue = kLittle ? 16 : 8;
  return (pixels >> kRed & 255) + 2 * (pixels >> kGreen & 255) + (pixels >> kBlue & 255);
}

/* In 16 bits, which vectors hold twice as many of. The sums of one picture are not kept, but follow
 * from its mean. The first one leaves no sums.
 * @param pictures  since the restart, with this one
 * @param frames    number of them in the mean */
inline void
add_to_mean (const std::uint8_t *__restrict picture, int n, int pictures, int frames,
    std::int16_t *__restrict sums, std::uint8_t *__restrict means)
{
  const auto share = std::int16_t (std::min (65536 / frames, 32767));
  const auto add = [&] (int i, std::int16_t before) {
    const auto step = std::int16_t (kScale * picture[i] - before);
    sums[i] = std::int16_t (before + std::int16_t (step * share >> 16));
    means[i] = std::uint8_t (std::uint16_t (sums[i] + kScale / 2) / kScale);
  };
  if (pictures == 1)
    std::copy_n (picture, n, means);
  else if (pictures == 2)
    for (int i = 0; i < n; i++)
      add (i, std::int16_t (kScale * means[i]));
  else
    for (int i = 0; i < n; i++)
      add (i, sums[i]);
}

} // namespace

void
StillAverage::set (int frames)
{
  frames_ = std::clamp (frames, 2, kMaxFrames);
  reset ();
}

/* Differences from the mean. */
void
StillAverage::compare (const cv::Mat &picture, const cv::Rect &part)
{
  for (int i = 0; i < part.area (); i++) {
    const int bx = part.x + i % part.width, by = part.y + i / part.width;
    const int bottom = std::min (picture.rows, (by + 1) * kBlock);
    const int x0 = bx * kBlock, n = std::min (kBlock, picture.cols - x0);
    Pixels::I sums = {}, sizes = {}; /* by column */
    for (int y = by * kBlock; y < bottom; y++) {
      std::int32_t last[2][kBlock] = {}; /* of a part of a block */
      const std::int32_t *now = picture.ptr<std::int32_t> (y) + x0,
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
    Block &block = blocks_[std::size_t (by * columns_ + bx)];
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
    for (int y = std::max (0, by - 1); y <= std::min (rows_ - 1, by + 1); y++)
      for (int x = std::max (0, bx - 1); x <= std::min (columns_ - 1, bx + 1); x++)
        if (blocks_[std::size_t (y * columns_ + x)].moves)
          return true;
    return false;
  };
  for (int by = part.y; by < part.br ().y; by++)
    for (int bx = part.x; bx < part.br ().x; bx++) {
      Block &block = blocks_[std::size_t (by * columns_ + bx)];
      block.pictures = moves (bx, by) ? 1 : std::min (block.pictures + 1, kMaxFrames);
    }
}

void
StillAverage::average (const cv::Mat &picture, const cv::Rect &part)
{
  const int bottom = std::min (picture.rows, part.br ().y * kBlock);
  for (int y = part.y * kBlock; y < bottom; y++)
    for (int bx = part.x; bx < part.br ().x; bx++) {
      const int begin = 4 * bx * kBlock, n = std::min (4 * kBlock, 4 * picture.cols - begin);
      const std::uint8_t *p = picture.ptr<std::uint8_t> (y) + begin;
      std::int16_t *sum = sum_.ptr<std::int16_t> (y) + begin;
      std::uint8_t *mean = mean_.ptr<std::uint8_t> (y) + begin;
      const int pictures = blocks_[std::size_t (y / kBlock * columns_ + bx)].pictures;
      const int frames = std::min (pictures, frames_);
      if (n < 4 * kBlock)
        add_to_mean (p, n, pictures, frames, sum, mean);
      else
        add_to_mean (p, 4 * kBlock, pictures, frames, sum, mean);
    }
}

const cv::Mat &
StillAverage::add (const cv::Mat &picture, const cv::Rect &part)
{
  const bool anew = blocks_.empty () || picture.size () != mean_.size ();
  if (anew) {
    columns_ = (picture.cols + kBlock - 1) / kBlock;
    rows_ = (picture.rows + kBlock - 1) / kBlock;
    blocks_.assign (std::size_t (columns_) * std::size_t (rows_), {});
    mean_.create (picture.size (), CV_8UC4);
    sum_.create (picture.size (), CV_16SC4);
    for (Block &block : blocks_)
      block.pictures = 1;
  }
  const int x = part.x / kBlock, y = part.y / kBlock;
  const cv::Rect all (0, 0, columns_, rows_),
      blocks = anew ? all
                    : cv::Rect (x, y, (part.br ().x + kBlock - 1) / kBlock - x,
                          (part.br ().y + kBlock - 1) / kBlock - y) &
                          all;
  for_this_cpu ([&] {
    if (!anew) {
      compare (picture, blocks);
      find_motion (blocks);
    }
    average (picture, blocks);
  });
  return mean_;
}

} // namespace rangecast
