/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "background_disparity.hpp"

#include <algorithm>
#include <cstdlib>
#include <opencv2/imgproc.hpp>

namespace rangecast {

constexpr std::int16_t kUnknown = -32768;
constexpr int kNoise = 3; /* grey levels, mean of a patch, that mean nothing */
static const cv::Size kPatch (5, 5);

/* Fills what is not known of a row with the farther one of its neighbours. */
static void
guess_row (std::int16_t *row, int width)
{
  for (int x = 0; x < width;) {
    if (row[x] != kUnknown) {
      x++;
      continue;
    }
    int end = x;
    while (end < width && row[end] == kUnknown)
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

void
BackgroundDisparity::remember (const cv::Mat &grey, const cv::Mat &disparity, int least, int far)
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
      if (d[x] >= least && d[x] < far) {
        known[x] = d[x];
        picture[x] = g[x];
      }
  }
  known_.copyTo (likely_);
  for (int y = 0; y < grey.rows; y++)
    guess_row (likely_.ptr<std::int16_t> (y), grey.cols);
}

/* Mean differences of patches between both pictures, where there is a disparity. */
void
BackgroundDisparity::compare (const cv::Mat &left, const cv::Mat &right, int right_x,
    const cv::Mat &disparity, int least, cv::Mat &unlike)
{
  unlike.create (left.size (), CV_8U);
  for (int y = 0; y < left.rows; y++) {
    const auto l = left.ptr<std::uint8_t> (y), r = right.ptr<std::uint8_t> (y);
    const auto d = disparity.ptr<std::int16_t> (y);
    auto to = unlike.ptr<std::uint8_t> (y);
    for (int x = 0; x < left.cols; x++) {
      const int there = std::clamp (16 * (x + right_x) - d[x], 0, 16 * (right.cols - 2));
      const int u = there >> 4, f = there & 15;
      const int grey = (r[u] * (16 - f) + r[u + 1] * f + 8) >> 4;
      to[x] = static_cast<std::uint8_t> (d[x] < least ? 255 : std::abs (l[x] - grey));
    }
  }
  cv::blur (unlike, unlike, kPatch);
}

void
BackgroundDisparity::restore (const cv::Mat &left, const cv::Mat &right, int right_x,
    const cv::Point &at, int least, int none, cv::Mat &disparity)
{
  const cv::Rect part (at, left.size ());
  const cv::Mat likely = likely_ (part), known = known_ (part);
  compare (left, right, right_x, disparity, least, own_);
  compare (left, right, right_x, likely, kUnknown + 1, other_);
  cv::blur (left, mean_, kPatch);
  cv::absdiff (left, mean_, contrast_);
  cv::blur (contrast_, contrast_, kPatch);
  cv::absdiff (left, picture_ (part), change_);
  cv::blur (change_, change_, kPatch);
  for (int y = 0; y < left.rows; y++) {
    const auto own = own_.ptr<std::uint8_t> (y), other = other_.ptr<std::uint8_t> (y),
               contrast = contrast_.ptr<std::uint8_t> (y), change = change_.ptr<std::uint8_t> (y);
    const auto back = likely.ptr<std::int16_t> (y), seen = known.ptr<std::int16_t> (y);
    auto d = disparity.ptr<std::int16_t> (y);
    claims_.assign (static_cast<std::size_t> (right.cols), 255);
    const auto there = [&] (int x) {
      return static_cast<std::size_t> (
          std::clamp (x + right_x - ((d[x] + 8) >> 4), 0, right.cols - 1));
    };
    for (int x = 0; x < left.cols; x++) {
      const bool still = seen[x] != kUnknown && change[x] <= kNoise,
                 fits = back[x] != kUnknown && other[x] <= kNoise + contrast[x] / 2;
      if (still || (fits && (d[x] < least || other[x] + kNoise < own[x]))) {
        d[x] = back[x];
        claims_[there (x)] = std::min (claims_[there (x)], other[x]);
      } else if (d[x] < least)
        d[x] = static_cast<std::int16_t> (none);
    }
    /* What the right camera sees as background cannot be seen as something else as well. */
    for (int x = 0; x < left.cols; x++)
      if (d[x] >= least && claims_[there (x)] < own[x])
        d[x] = static_cast<std::int16_t> (none);
  }
}

} // namespace rangecast
