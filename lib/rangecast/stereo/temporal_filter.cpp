/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "temporal_filter.hpp"

#include <algorithm>
#include <climits>
#include <cmath>
#include <cstdlib>
#include <opencv2/imgproc.hpp>

#include "../base/parallel.hpp"
#include "../base/simd.hpp"

namespace rangecast {
namespace {

constexpr int kBlock = BlockGrid::kBlock;
constexpr int kAround = 4, kWindow = kBlock + 2 * kAround; /* pixels that are compared */
constexpr int kMaxRounds = 16;                             /* of the search */
constexpr int kMinImages = 6; /* until a block is still: slow motion is seen late */
constexpr int kSlight = 16;   /* change on one surface, 1/16 pixel */
constexpr int kLike = 20;     /* grey levels of a pixel and the one from which it came */

bool
is_slight (int a, int b)
{
  return (a > 0) & (b > 0) & (std::abs (a - b) <= kSlight);
}

/* What to output for a disparity.
 * @param before, shown  matched and output in the previous image, in the same place */
int
steadied (int now, int before, int shown, bool moves)
{
  const int median = std::max (std::min (now, before), std::min (std::max (now, before), shown));
  int value = median; /* 0 unless two are there */
  if (moves && median > 0)
    value = now > 0 ? now : is_slight (before, shown) ? median : 0;
  return is_slight (value, shown) ? shown + (value - shown) / 2 : value;
}

} // namespace

void
TemporalFilter::set (const cv::Size &image, int n_threads)
{
  grid_ = BlockGrid (image);
  n_threads_ = n_threads;
  for (Image *i : {&now_, &before_}) {
    i->grey.create (image, CV_8U);
    i->found.create (image, CV_16U);
    i->shown.create (image, CV_16U);
    i->motions.assign (grid_.count (), {});
  }
  reset ();
}

/* The sum of differences of every second row, or more than `most`. */
int
TemporalFilter::difference (const cv::Rect &window, const cv::Point &motion, int most) const
{
  const cv::Rect there = window + motion;
  if ((there & before_.roi) != there)
    return INT_MAX;
  int sum = 0;
  const auto add_row = [&] (int y, int width) {
    const std::uint8_t *__restrict a = now_.grey.ptr (window.y + y) + window.x,
                                   *__restrict b = before_.grey.ptr (there.y + y) + there.x;
    for (int x = 0; x < width; x++)
      sum += std::abs (a[x] - b[x]);
  };
  for (int y = 0; y < window.height && sum <= most; y += 2)
    if (window.width == kWindow)
      add_row (y, kWindow); /* a constant makes a better loop */
    else
      add_row (y, window.width);
  return sum;
}

bool
TemporalFilter::has_disparity (const cv::Rect &window) const
{
  int any = 0; /* cv::countNonZero() costs as much as the search, for so few pixels */
  for (int y = window.y; y < window.br ().y; y++) {
    const auto found = now_.found.ptr<std::uint16_t> (y) + window.x;
    for (int x = 0; x < window.width; x++)
      any |= found[x];
  }
  return any > 0;
}

cv::Point
TemporalFilter::find_motion (int bx, int by, const cv::Rect &window) const
{
  cv::Point best;
  int least = difference (window, best, INT_MAX);
  const auto attempt = [&] (const cv::Point &motion) {
    const int sum = difference (window, motion, least);
    if (sum >= least)
      return false;
    least = sum;
    best = motion;
    return true;
  };
  if (bx > 0)
    attempt (now_.motions[grid_.at (bx - 1, by)]);
  attempt (before_.motions[grid_.at (bx, by)]);
  if (bx + 1 < grid_.columns && by + 1 < grid_.rows)
    attempt (before_.motions[grid_.at (bx + 1, by + 1)]);
  /* half the rows are compared: 2 grey levels per pixel are noise */
  int rounds = 0; /* along a plain gradient, a change of light looks like motion without end */
  for (const int step : {2, 1})
    for (bool is_better = true; is_better && least > window.area () && rounds < kMaxRounds;
         rounds++) {
      const cv::Point from = best;
      is_better = attempt ({from.x - step, from.y}) || attempt ({from.x + step, from.y});
      const int x = best.x;
      is_better |= attempt ({x, from.y - step}) || attempt ({x, from.y + step});
    }
  return best;
}

/* Whether at least half of the disparities changed, by about the same, and did not come, go or
 * jump.
 * @param[out] change  the mean, 1/16 pixel */
bool
TemporalFilter::follows (const cv::Rect &window, const cv::Point &motion, int &change) const
{
  constexpr int kEnough = 16, kMax = 24, kMeanError = 4; /* pixels; 1/16 pixel */
  int all = 0, n = 0, sum = 0, errors = 0;
  const auto for_changes = [&] (const auto &add) {
    for (int y = window.y; y < window.br ().y; y++) {
      const std::uint16_t *now = now_.found.ptr<std::uint16_t> (y) + window.x,
                          *then =
                              before_.shown.ptr<std::uint16_t> (y + motion.y) + window.x + motion.x;
      for (int x = 0; x < window.width; x++) {
        const int step = now[x] - then[x];
        const int counts = (now[x] > 0) & (then[x] > 0) & (step <= kMax) & (step >= -kMax);
        all += (now[x] | then[x]) > 0;
        add (step, counts);
      }
    }
  };
  for_changes ([&] (int step, int counts) { n += counts, sum += counts * step; });
  if (n < kEnough || 2 * n < all)
    return false;
  change = static_cast<int> (std::lround (float (sum) / float (n)));
  for_changes ([&] (int step, int counts) { errors += counts * std::abs (step - change); });
  return errors <= kMeanError * n;
}

void
TemporalFilter::steady_block (int bx, int by, const cv::Rect &both, bool moves, cv::Mat &disparity)
{
  const cv::Rect part = cv::Rect (bx * kBlock, by * kBlock, kBlock, kBlock) & both;
  cv::Point &motion = now_.motions[grid_.at (bx, by)];
  int change = 0;
  if (moves) {
    const cv::Rect window = cv::Rect (part.x - kAround, part.y - kAround, kWindow, kWindow) & both;
    if (!has_disparity (window))
      return;
    motion = find_motion (bx, by, window);
    if (!follows (window, motion, change))
      return;
  }
  const auto moved = [change] (int d) { return d > 0 ? std::max (d + change, 1) : 0; };
  for (int y = part.y; y < part.br ().y; y++) {
    const std::uint8_t *grey = now_.grey.ptr (y), *grey_before = before_.grey.ptr (y + motion.y);
    const auto now = now_.found.ptr<std::uint16_t> (y),
               before = before_.found.ptr<std::uint16_t> (y + motion.y),
               shown = before_.shown.ptr<std::uint16_t> (y + motion.y);
    const auto to = disparity.ptr<std::uint16_t> (y - now_.roi.y) - now_.roi.x;
    for (int x = part.x; x < part.br ().x; x++) {
      const int u = x + motion.x;
      if (!moves || std::abs (grey[x] - grey_before[u]) <= kLike)
        to[x] = static_cast<std::uint16_t> (
            steadied (now[x], moved (before[u]), moved (shown[u]), moves));
    }
  }
}

void
TemporalFilter::apply (
    const cv::Mat &left, const cv::Rect &roi, const StillAverage &still, cv::Mat &disparity)
{
  std::swap (now_, before_);
  now_.roi = {}; /* in case of an exception */
  std::ranges::fill (now_.motions, cv::Point ());
  cv::Mat grey = now_.grey (roi);
  cv::cvtColor (left (roi), grey, cv::COLOR_RGBA2GRAY);
  disparity.copyTo (now_.found (roi));
  now_.roi = roi;
  const cv::Rect both = roi & before_.roi, blocks = grid_.touched (both);
  in_parallel (both.empty () ? 0 : std::size_t (blocks.height), n_threads_, [&] (std::size_t row) {
    for_this_cpu ([&] {
      const int by = blocks.y + int (row);
      for (int bx = blocks.x; bx < blocks.br ().x; bx++)
        steady_block (
            bx, by, both, still.images_at (bx * kBlock, by * kBlock) < kMinImages, disparity);
    });
  });
  disparity.copyTo (now_.shown (roi));
}

} // namespace rangecast
