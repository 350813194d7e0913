/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <opencv2/core.hpp>
#include <vector>

namespace rangecast {

/** Values of a small part of an image. Its memory only grows. */
class Plane {
public:
  void set_size (int width, int height)
  {
    width_ = width;
    height_ = height;
    if (const auto n = std::size_t (width) * std::size_t (height); n > data_.size ())
      data_.resize (n);
  }
  [[nodiscard]] int width () const { return width_; }
  [[nodiscard]] int height () const { return height_; }
  [[nodiscard]] std::int16_t *row (int y) { return data_.data () + std::ptrdiff_t (y) * width_; }
  [[nodiscard]] const std::int16_t *row (int y) const
  {
    return data_.data () + std::ptrdiff_t (y) * width_;
  }

private:
  std::vector<std::int16_t> data_;
  int width_ = 0, height_ = 0;
};

/** Copies a part of an image with `around` pixels on each side, mirrored at the image border.
 *  @param image  CV_8U */
inline void
cut_grey (const cv::Mat &picture, const cv::Rect &tile, int around, Plane &to)
{
  to.set_size (tile.width + 2 * around, tile.height + 2 * around);
  const auto mirrored = [] (int i, int n) {
    return n < 2 ? 0 : std::clamp (i < 0 ? -i : i >= n ? 2 * n - 2 - i : i, 0, n - 1);
  };
  for (int y = 0; y < to.height (); y++) {
    const auto from = picture.ptr<std::uint8_t> (mirrored (tile.y - around + y, picture.rows));
    std::int16_t *row = to.row (y);
    const int first = tile.x - around, begin = std::max (0, -first),
              end = std::min (to.width (), picture.cols - first);
    for (int x = 0; x < begin; x++)
      row[x] = from[mirrored (first + x, picture.cols)];
    for (int x = begin; x < end; x++)
      row[x] = from[first + x];
    for (int x = std::max (begin, end); x < to.width (); x++)
      row[x] = from[mirrored (first + x, picture.cols)];
  }
}

/** Samples the other image at the disparities of a row.
 *  @param disparity  of each pixel, 1/16 pixel
 *  @param row, width other image's row, at least two pixels wide
 *  @param x          column there of disparity 0 of the first pixel
 *  @param[out] grey  levels, interpolated linearly; clamped at the ends of the row */
inline void
look_up (const std::int16_t *disparity, int n, const std::uint8_t *row, int width, int x,
    std::int16_t *grey)
{
  constexpr int kAtOnce = 64;
  std::int16_t at[kAtOnce];
  std::uint16_t pairs[kAtOnce]; /* of neighbours: loops without gather loads are vectorized */
  const auto last = static_cast<std::int16_t> (width - 2);
  for (int begin = 0; begin < n; begin += kAtOnce) {
    const int end = std::min (n - begin, kAtOnce);
    const std::int16_t *d = disparity + begin;
    const auto first = static_cast<std::int16_t> (x + begin);
    for (int i = 0; i < end; i++) {
      const auto u = static_cast<std::int16_t> (first + i - ((d[i] >> 4) + ((d[i] & 15) != 0)));
      at[i] = std::clamp<std::int16_t> (u, 0, last);
    }
    for (int i = 0; i < end; i++)
      std::memcpy (&pairs[i], row + at[i], 2);
    for (int i = 0; i < end; i++) {
      const int a = pairs[i] & 255, b = pairs[i] >> 8, f = -d[i] & 15;
      grey[begin + i] = static_cast<std::int16_t> ((a * 16 + (b - a) * f + 8) >> 4);
    }
  }
}

/** Sums over windows of 2 * kRadius + 1 pixels squared. Sums must fit 16 bits.
 *  @param[out] to  smaller than `from` by kRadius pixels on each side
 *  @param columns  scratch memory */
template <int kRadius>
void
sum_windows (const Plane &from, Plane &to, std::vector<std::int16_t> &columns)
{
  constexpr int kSide = 2 * kRadius + 1;
  const int width = from.width (), height = from.height ();
  to.set_size (width - kSide + 1, height - kSide + 1);
  columns.assign (std::size_t (width), 0);
  std::int16_t *sums = columns.data ();
  const auto add = [&] (const std::int16_t *row) {
    for (int x = 0; x < width; x++)
      sums[x] = std::int16_t (sums[x] + row[x]);
  };
  for (int y = 0; y < kSide - 1; y++)
    add (from.row (y));
  for (int y = 0; y < to.height (); y++) {
    add (from.row (y + kSide - 1));
    std::int16_t *out = to.row (y);
    for (int x = 0; x < to.width (); x++) {
      int sum = 0;
      for (int k = 0; k < kSide; k++)
        sum += sums[x + k];
      out[x] = std::int16_t (sum);
    }
    const std::int16_t *gone = from.row (y);
    for (int x = 0; x < width; x++)
      sums[x] = std::int16_t (sums[x] - gone[x]);
  }
}

/** Absolute difference of each pixel from the mean of its window.
 *  @param grey  levels, 0 to 255; @param[out] to  smaller by kRadius on each side
 *  @param sums, columns  scratch memory */
template <int kRadius>
void
differ_from_mean (const Plane &grey, Plane &to, Plane &sums, std::vector<std::int16_t> &columns)
{
  constexpr int kArea = (2 * kRadius + 1) * (2 * kRadius + 1);
  constexpr std::uint32_t kInverse = (65536 + kArea - 1) / kArea;
  sum_windows<kRadius> (grey, sums, columns);
  to.set_size (sums.width (), sums.height ());
  for (int y = 0; y < sums.height (); y++) {
    const std::int16_t *sum = sums.row (y), *own = grey.row (y + kRadius) + kRadius;
    std::int16_t *out = to.row (y);
    for (int x = 0; x < sums.width (); x++) {
      const auto mean = std::uint16_t ((std::uint16_t (sum[x] + kArea / 2) * kInverse) >> 16);
      out[x] = std::int16_t (std::abs (std::int16_t (own[x] - mean)));
    }
  }
}

} // namespace rangecast
