/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "disparity_filter.hpp"

#include <algorithm>
#include <cstdlib>
#include <opencv2/core/hal/intrin.hpp>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgproc.hpp>

namespace rangecast {
namespace {

/* Sum of three colours' differences, levels, above which two pixels do not look alike. */
constexpr short kLike = 60;
/* Of weights, each kLike at most: four pixels of nearly the same colour. */
constexpr int kEnough = 160;
/* Of patches, pixels. */
constexpr int kPatch = 7;
/* Grey levels that two pictures of one patch differ by from noise and interpolation alone. */
constexpr int kNoise = 4;

/* The right picture's grey at 1/16 pixels, linear between two. */
int
grey_at (const std::uint8_t *row, int x16, int width)
{
  const int x = std::clamp (x16 >> 4, 0, width - 1), f = x16 & 15;
  return (row[x] * (16 - f) + row[std::min (x + 1, width - 1)] * f + 8) >> 4;
}

/* What cv::parallel_for_ wants to hear: as many pieces as threads; it has as many as cores. */
double
n_stripes (int n_threads)
{
  return n_threads > 0 ? n_threads : cv::getNumThreads ();
}

} // namespace

void
DisparityFilter::clear_unlike (const cv::Mat &left, const cv::Mat &right, int right_x,
    double tolerance, int least, cv::Mat &disparity)
{
  const cv::Size size = disparity.size (), patch (kPatch, kPatch);
  difference_.create (size, CV_16S);
  valid_.create (size, CV_16S);
  for (int y = 0; y < size.height; y++) {
    const auto l = left.ptr<std::uint8_t> (y), r = right.ptr<std::uint8_t> (y);
    const auto d = disparity.ptr<std::int16_t> (y);
    auto e = difference_.ptr<std::int16_t> (y), v = valid_.ptr<std::int16_t> (y);
    for (int x = 0; x < size.width; x++) {
      v[x] = d[x] >= least;
      e[x] = std::int16_t (v[x] ? l[x] - grey_at (r, 16 * (x + right_x) - d[x], right.cols) : 0);
    }
  }
  /* Sums over patches: how many there are, their mean difference, their mean absolute one. */
  cv::boxFilter (valid_, count_, CV_16S, patch, {-1, -1}, false);
  cv::boxFilter (difference_, means_, CV_16S, patch, {-1, -1}, false);
  cv::blur (left, blurred_, patch);
  cv::absdiff (left, blurred_, contrast_);
  cv::boxFilter (contrast_, contrast_, CV_16S, patch, {-1, -1}, false);
  difference_ = cv::abs (difference_);
  cv::boxFilter (difference_, blurred_, CV_16S, patch, {-1, -1}, false);
  const int share = int (256 * tolerance);
  for (int y = 0; y < size.height; y++) {
    const auto n = count_.ptr<std::int16_t> (y), m = means_.ptr<std::int16_t> (y),
               e = blurred_.ptr<std::int16_t> (y), c = contrast_.ptr<std::int16_t> (y);
    auto d = disparity.ptr<std::int16_t> (y);
    for (int x = 0; x < size.width; x++) {
      if (d[x] < least)
        continue;
      const int unlike = e[x] - std::abs (int (m[x])) / 2;
      if (256 * unlike * kPatch * kPatch > (share * c[x] + 256 * kNoise * kPatch * kPatch) * n[x])
        d[x] = std::int16_t (least - 16);
    }
  }
}

void
DisparityFilter::clear_hidden (int least, cv::Mat &disparity)
{
  constexpr int kTolerance = 24; /* 1/16 pixel */
  constexpr int kBeyond = 2049;  /* columns that a match may lie outside of the part, pixels */
  const int width = disparity.cols;
  nearest_.resize (static_cast<std::size_t> (width) + 2 * kBeyond);
  for (int y = 0; y < disparity.rows; y++) {
    auto d = disparity.ptr<std::int16_t> (y);
    std::ranges::fill (nearest_, std::int16_t (least - 16));
    const auto there = [&] (int x) { return x + kBeyond - ((d[x] + 8) >> 4); };
    for (int x = 0; x < width; x++)
      if (d[x] >= least)
        nearest_[std::size_t (there (x))] = std::max (nearest_[std::size_t (there (x))], d[x]);
    for (int x = 0; x < width; x++)
      if (d[x] >= least && d[x] + kTolerance < nearest_[std::size_t (there (x))])
        d[x] = std::int16_t (least - 16);
  }
}

void
DisparityFilter::clear_flying (double step, int support, int offset, int least, cv::Mat &disparity)
{
  cv::copyMakeBorder (disparity, copy_, 1, 1, 1, 1, cv::BORDER_CONSTANT, cv::Scalar (least - 16));
  const int share = int (65536 * step);
  for (int y = 0; y < disparity.rows; y++) {
    const std::int16_t *rows[3] = {copy_.ptr<std::int16_t> (y), copy_.ptr<std::int16_t> (y + 1),
        copy_.ptr<std::int16_t> (y + 2)};
    auto to = disparity.ptr<std::int16_t> (y);
    for (int x = 0; x < disparity.cols; x++) {
      const int d = to[x];
      if (d < least)
        continue;
      const int most = std::max (8, (d + offset) * share >> 16);
      int n = -1; /* itself */
      for (const std::int16_t *row : rows)
        for (int u = x; u < x + 3; u++)
          n += row[u] >= least && std::abs (row[u] - d) <= most;
      if (n < support)
        to[x] = std::int16_t (least - 16);
    }
  }
}

void
DisparityFilter::sample (const cv::Mat &colour, const cv::Mat &disparity, int radius)
{
  /* Every second pixel of every second row; around that so much that no window leaves it. Colours
   * there are like no colour. */
  constexpr std::int16_t kNoColour = 10000;
  pad_ = radius / 2 + 1;
  const int rows = (disparity.rows + 1) / 2, cols = (disparity.cols + 1) / 2;
  for (cv::Mat &plane : samples_)
    plane.create (rows + 2 * pad_, cols + 2 * pad_ + 8, CV_16S);
  for (int c = 0; c < 3; c++)
    samples_[c].setTo (kNoColour);
  samples_[3].setTo (0);
  for (int y = 0; y < rows; y++) {
    const auto from = colour.ptr<cv::Vec4b> (2 * y);
    const auto d = disparity.ptr<std::int16_t> (2 * y);
    std::int16_t *to[4];
    for (int c = 0; c < 4; c++)
      to[c] = samples_[c].ptr<std::int16_t> (y + pad_) + pad_;
    for (int x = 0; x < cols; x++) {
      for (int c = 0; c < 3; c++)
        to[c][x] = from[2 * x][c];
      to[3][x] = d[2 * x];
    }
  }
}

/* Calls `count (weight, disparity)` with eight samples of a window at a time. */
template <typename Count>
void
DisparityFilter::for_window (
    const cv::Vec4b &own, int x, int y, int radius, const Count &count) const
{
  const cv::v_int16x8 lanes (0, 1, 2, 3, 4, 5, 6, 7), most = cv::v_setall_s16 (kLike);
  const int x0 = x / 2 - radius / 2 + pad_, y0 = y / 2 - radius / 2 + pad_;
  for (int v = y0; v < y0 + radius; v++)
    for (int u = 0; u < radius; u += 8) {
      cv::v_int16x8 unlike = cv::v_setzero_s16 ();
      for (int c = 0; c < 3; c++) {
        const cv::v_int16x8 p = cv::v_load (samples_[c].ptr<std::int16_t> (v) + x0 + u);
        unlike = unlike + cv::v_reinterpret_as_s16 (cv::v_absdiff (p, cv::v_setall_s16 (own[c])));
      }
      const cv::v_int16x8 inside = lanes < cv::v_setall_s16 (static_cast<short> (radius - u));
      count (cv::v_max (most - unlike, cv::v_setzero_s16 ()) & inside,
          cv::v_load (samples_[3].ptr<std::int16_t> (v) + x0 + u));
    }
}

/* How much the samples around a pixel are like it in colour, by their depth. */
struct DisparityFilter::Votes {
  int same, near, far, none; /* of disparity d, nearer, farther, without depth */
};

DisparityFilter::Votes
DisparityFilter::vote (
    const cv::Vec4b &own, int x, int y, int d, int radius, int most, int least) const
{
  const cv::v_int16x8 low = cv::v_setall_s16 (static_cast<short> (d - most)),
                      high = cv::v_setall_s16 (static_cast<short> (std::min (d + most, 32767))),
                      valid = cv::v_setall_s16 (static_cast<short> (least));
  cv::v_int16x8 same = cv::v_setzero_s16 (), near = same, far = same, none = same;
  for_window (own, x, y, radius, [&] (const cv::v_int16x8 &weight, const cv::v_int16x8 &depth) {
    const cv::v_int16x8 without = depth<valid, above = depth> high,
                        below = (depth < low) & ~without;
    none = none + (weight & without);
    near = near + (weight & above);
    far = far + (weight & below);
    same = same + (weight & ~(without | above | below));
  });
  return {cv::v_reduce_sum (same), cv::v_reduce_sum (near), cv::v_reduce_sum (far),
      cv::v_reduce_sum (none)};
}

/* The mean disparity of the samples around a pixel that are like it, or `least` - 1. */
int
DisparityFilter::likely (const cv::Vec4b &own, int x, int y, int radius, int least) const
{
  const cv::v_int16x8 valid = cv::v_setall_s16 (static_cast<short> (least)),
                      one = cv::v_setall_s16 (1);
  cv::v_int32x4 sum = cv::v_setzero_s32 (), weights = sum;
  for_window (own, x, y, radius, [&] (const cv::v_int16x8 &weight, const cv::v_int16x8 &depth) {
    const cv::v_int16x8 counting = weight & (depth >= valid);
    sum = sum + cv::v_dotprod (counting, depth);
    weights = weights + cv::v_dotprod (counting, one);
  });
  const int total = cv::v_reduce_sum (weights);
  return total < kEnough ? least - 1 : cv::v_reduce_sum (sum) / total;
}

void
DisparityFilter::clear_rims (
    const cv::Mat &colour, int radius, double step, int offset, int least, cv::Mat &disparity)
{
  const int share = static_cast<int> (65536 * step), reach = radius * 2 / 3;
  const cv::Mat around = cv::getStructuringElement (cv::MORPH_RECT, {2 * reach + 1, 2 * reach + 1});
  sample (colour, disparity, radius);
  cv::erode (disparity, lowest_, around);
  cv::dilate (disparity, highest_, around);
  const auto work = [&] (const cv::Range &rows) {
    for (int y = rows.start; y < rows.end; y++)
      clear_rims_of_row (colour, y, radius, share, offset, least, disparity);
  };
  cv::parallel_for_ (cv::Range (0, disparity.rows), work, n_stripes (n_threads_));
}

void
DisparityFilter::clear_rims_of_row (const cv::Mat &colour, int y, int radius, int share, int offset,
    int least, cv::Mat &disparity) const
{
  auto to = disparity.ptr<std::int16_t> (y);
  const auto lowest = lowest_.ptr<std::int16_t> (y), highest = highest_.ptr<std::int16_t> (y);
  const auto pixels = colour.ptr<cv::Vec4b> (y);
  for (int x = 0; x < disparity.cols; x++) {
    const bool valid = to[x] >= least;
    if (valid ? lowest[x] >= to[x] - std::max (16, (to[x] + offset) * share >> 16)
              : highest[x] < least)
      continue; /* a surface, or nothing near */
    const int d = valid ? to[x] : likely (pixels[x], x, y, radius, least);
    if (d < least)
      continue;
    const int most = std::max (16, (d + offset) * share >> 16);
    const Votes votes = vote (pixels[x], x, y, d, radius, most, least);
    if (valid && votes.far + votes.none > votes.same)
      to[x] = static_cast<std::int16_t> (least - 16);
    else if (!valid && votes.same > 4 * (votes.near + votes.far) && votes.same > votes.none)
      to[x] = static_cast<std::int16_t> (d);
  }
}

namespace {

/* Whether a colour lies between two others, or nearly. */
bool
is_between (const cv::Vec4b &p, const cv::Vec4b &a, const cv::Vec4b &b)
{
  constexpr int kLike = 16; /* levels */
  for (int c = 0; c < 3; c++)
    if (p[c] < std::min (a[c], b[c]) - kLike || p[c] > std::max (a[c], b[c]) + kLike)
      return false;
  return true;
}

/* A row or a column: steps are in elements. */
void
fill_line (const cv::Vec4b *colour, std::size_t colour_step, std::int16_t *disparity,
    std::size_t step, int length, int width, int least)
{
  int last = -1; /* with a disparity */
  for (int i = 0; i < length; i++) {
    const int d = disparity[std::size_t (i) * step];
    if (d < least)
      continue;
    const int gap = i - last - 1, a = last < 0 ? 0 : disparity[std::size_t (last) * step];
    bool like = last >= 0 && gap > 0 && gap <= width && std::abs (a - d) <= 16;
    for (int k = last + 1; k < i && like; k++)
      like = is_between (colour[std::size_t (k) * colour_step],
          colour[std::size_t (last) * colour_step], colour[std::size_t (i) * colour_step]);
    for (int k = last + 1; k < i && like; k++)
      disparity[std::size_t (k) * step] =
          static_cast<std::int16_t> (a + (d - a) * (k - last) / (gap + 1));
    last = i;
  }
}

} // namespace

void
DisparityFilter::fill_gaps (const cv::Mat &colour, int width, int least, cv::Mat &disparity)
{
  const auto rows = [&] (const cv::Range &range) {
    for (int y = range.start; y < range.end; y++)
      fill_line (colour.ptr<cv::Vec4b> (y), 1, disparity.ptr<std::int16_t> (y), 1, disparity.cols,
          width, least);
  };
  const auto columns = [&] (const cv::Range &range) {
    for (int x = range.start; x < range.end; x++)
      fill_line (colour.ptr<cv::Vec4b> (0) + x, colour.step / sizeof (cv::Vec4b),
          disparity.ptr<std::int16_t> (0) + x, disparity.step1 (), disparity.rows, width, least);
  };
  cv::parallel_for_ (cv::Range (0, disparity.rows), rows, n_stripes (n_threads_));
  cv::parallel_for_ (cv::Range (0, disparity.cols), columns, n_stripes (n_threads_));
}

} // namespace rangecast
