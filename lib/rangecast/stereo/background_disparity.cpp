/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "background_disparity.hpp"

#include <algorithm>
#include <cstdlib>

namespace rangecast {
namespace {

constexpr std::int16_t kUnknown = -32768, kHidden = -32767;
constexpr int kRadius = 2, kArea = 25; /* of a patch, pixels */
/* Mean difference of a patch that is noise, grey levels; the same as a sum over the patch. */
constexpr int kNoise = 3, kNoiseSum = kNoise * kArea + kArea / 2;

/* Fills unknown pixels of a row with the farther one of the neighbouring disparities. */
void
guess_row (std::int16_t *row, int width)
{
  for (int x = 0; x < width;) {
    if (row[x] > kHidden) {
      x++;
      continue;
    }
    int end = x;
    while (end < width && row[end] <= kHidden)
      end++;
    std::int16_t guess = kUnknown;
    if (x > 0 && end < width)
      guess = std::min (row[x - 1], row[end]);
    else if (x > 0 || end < width)
      guess = x > 0 ? row[x - 1] : row[end];
    std::fill (row + x, row + end, guess);
    x = end;
  }
}

} // namespace

/* Marks pixels without disparity next to the background as hidden from one camera. */
void
BackgroundDisparity::mark_hidden (
    const std::int16_t *d, const std::uint8_t *grey, int y, int min, int far)
{
  auto known = known_.ptr<std::int16_t> (y);
  auto picture = picture_.ptr<std::uint8_t> (y);
  const int width = known_.cols;
  const auto is_background = [&] (int x) {
    return x >= 0 && x < width && d[x] >= min && d[x] < far;
  };
  for (int x = 0; x < width;) {
    if (d[x] >= min) {
      x++;
      continue;
    }
    const int begin = x;
    while (x < width && d[x] < min)
      x++;
    if (!is_background (begin - 1) && !is_background (x))
      continue;
    for (int i = begin; i < x; i++)
      if (known[i] <= kHidden) {
        known[i] = kHidden;
        picture[i] = grey[i];
      }
  }
}

void
BackgroundDisparity::remember (const cv::Mat &grey, const cv::Mat &disparity, int min, int far)
{
  if (known_.size () != grey.size ()) {
    known_.create (grey.size (), CV_16S);
    known_.setTo (kUnknown);
    grey.copyTo (picture_);
  }
  for (int y = 0; y < grey.rows; y++) {
    const auto d = disparity.ptr<std::int16_t> (y);
    const auto g = grey.ptr<std::uint8_t> (y);
    auto known = known_.ptr<std::int16_t> (y);
    auto picture = picture_.ptr<std::uint8_t> (y);
    for (int x = 0; x < grey.cols; x++)
      if (d[x] >= min && d[x] < far) {
        known[x] = d[x];
        picture[x] = g[x];
      } else if (d[x] >= far && known[x] == kHidden)
        known[x] = kUnknown;
    mark_hidden (d, g, y, min, far);
  }
  known_.copyTo (likely_);
  for (int y = 0; y < grey.rows; y++)
    guess_row (likely_.ptr<std::int16_t> (y), grey.cols);
}

void
BackgroundDisparity::extend (
    const cv::Point &at, int min, int far, const Tiles &tiles, cv::Mat &disparity) const
{
  constexpr std::int16_t kNothing = 32767;
  tiles.each ([&] (const cv::Rect &tile, std::size_t) {
    for (int y = tile.y; y < tile.br ().y; y++) {
      auto d = disparity.ptr<std::int16_t> (y);
      const auto back = likely_.ptr<std::int16_t> (at.y + y) + at.x;
      /* Whether the pixels next to the tile are known background. */
      const auto beside = [&] (int x) {
        const bool inside = at.x + x >= 0 && at.x + x < likely_.cols;
        return inside && back[x] > kHidden ? back[x] : kNothing;
      };
      for (int x = tile.x; x < tile.br ().x;) {
        if (d[x] >= min) {
          x++;
          continue;
        }
        const int begin = x;
        while (x < tile.br ().x && d[x] < min)
          x++;
        const std::int16_t farther = std::min (begin > tile.x ? d[begin - 1] : beside (begin - 1),
            x < tile.br ().x ? d[x] : beside (x));
        if (farther >= min && farther < far)
          std::fill (d + begin, d + x, static_cast<std::int16_t> (min));
      }
    }
  });
}

/* Compares patches of both images where there is a disparity. memory.grey is the left image. @param
 * disparity  of the size of job.left */
void
BackgroundDisparity::compare (const Job &job, const cv::Rect &tile, const cv::Mat &disparity,
    int min, Memory &m, Plane &unlike) const
{
  const int x0 = tile.x - kRadius, y0 = tile.y - kRadius;
  const auto lowest = static_cast<std::int16_t> (min);
  m.pixels.set_size (tile.width + 2 * kRadius, tile.height + 2 * kRadius);
  const int width = m.pixels.width (), begin = std::max (0, -x0),
            end = std::min (width, disparity.cols - x0);
  for (int y = 0; y < m.pixels.height (); y++) {
    const int row = std::clamp (y0 + y, 0, disparity.rows - 1);
    const auto d = disparity.ptr<std::int16_t> (row) + x0;
    const std::int16_t *l = m.grey.row (y + kRadius) + kRadius;
    std::int16_t *out = m.pixels.row (y);
    look_up (d + begin, end - begin, job.right.ptr<std::uint8_t> (row), job.right.cols,
        x0 + begin + job.right_x, out + begin);
    for (int x = begin; x < end; x++) {
      const auto unlike_here = static_cast<std::int16_t> (std::abs (l[x] - out[x]));
      out[x] = d[x] < lowest ? std::int16_t{255} : unlike_here;
    }
    std::fill (out, out + begin, out[begin]);
    std::fill (out + end, out + width, out[end - 1]);
  }
  sum_windows<kRadius> (m.pixels, unlike, m.columns);
}

/* Restores row y of the part (row i of the tile), from column x on. */
void
BackgroundDisparity::restore_row (
    const Job &job, int x0, int y, int i, int width, Memory &m, std::int16_t *d) const
{
  const std::int16_t *own = m.own.row (i), *other = m.other.row (i), *contrast = m.contrast.row (i),
                     *change = m.change.row (i);
  const auto back = likely_.ptr<std::int16_t> (job.at.y + y) + job.at.x + x0,
             seen = known_.ptr<std::int16_t> (job.at.y + y) + job.at.x + x0;
  m.claims.assign (std::size_t (job.right.cols), 32767);
  const auto there = [&] (int x) {
    return std::size_t (
        std::clamp (x0 + x + job.right_x - ((d[x] + 8) >> 4), 0, job.right.cols - 1));
  };
  for (int x = 0; x < width; x++) {
    const bool still = seen[x] != kUnknown && change[x] <= kNoiseSum,
               fits = back[x] != kUnknown && other[x] <= kNoiseSum + contrast[x] / 2;
    if (still && seen[x] == kHidden)
      d[x] = static_cast<std::int16_t> (job.none);
    else if (still || (fits && (d[x] < job.min || other[x] + kNoise * kArea < own[x]))) {
      d[x] = back[x];
      m.claims[there (x)] = std::min (m.claims[there (x)], other[x]);
    } else if (d[x] < job.min)
      d[x] = static_cast<std::int16_t> (job.none);
  }
  /* A right pixel that matches the background better cannot match something else as well. */
  for (int x = 0; x < width; x++)
    if (d[x] >= job.min && m.claims[there (x)] < own[x])
      d[x] = static_cast<std::int16_t> (job.none);
}

void
BackgroundDisparity::restore_tile (
    const Job &job, const cv::Rect &tile, const cv::Mat &disparity, Memory &m, cv::Mat &to) const
{
  const cv::Rect part (job.at, job.left.size ());
  cut_grey (job.left, tile, 2 * kRadius, m.grey);
  differ_from_mean<kRadius> (m.grey, m.pixels, m.sums, m.columns);
  sum_windows<kRadius> (m.pixels, m.contrast, m.columns);
  compare (job, tile, disparity, job.min, m, m.own);
  compare (job, tile, likely_ (part), kHidden + 1, m, m.other);
  cut_grey (picture_ (part), tile, kRadius, m.before);
  m.pixels.set_size (m.before.width (), m.before.height ());
  for (int y = 0; y < m.pixels.height (); y++) {
    const std::int16_t *now = m.grey.row (y + kRadius) + kRadius, *before = m.before.row (y);
    std::int16_t *out = m.pixels.row (y);
    for (int x = 0; x < m.pixels.width (); x++)
      out[x] = static_cast<std::int16_t> (std::abs (now[x] - before[x]));
  }
  sum_windows<kRadius> (m.pixels, m.change, m.columns);
  for (int i = 0; i < tile.height; i++) {
    auto out = to.ptr<std::int16_t> (tile.y + i) + tile.x;
    std::copy_n (disparity.ptr<std::int16_t> (tile.y + i) + tile.x, tile.width, out);
    restore_row (job, tile.x, tile.y + i, i, tile.width, m, out);
  }
}

void
BackgroundDisparity::restore (const cv::Mat &left, const cv::Mat &right, int right_x,
    const cv::Point &at, int min, int none, const Tiles &tiles, const cv::Mat &disparity,
    cv::Mat &to)
{
  const Job job = {left, right, right_x, at, min, none};
  memory_.reserve (tiles.workers ());
  tiles.each ([&] (const cv::Rect &tile, std::size_t worker) {
    restore_tile (job, tile, disparity, memory_.of (worker), to);
  });
}

} // namespace rangecast
