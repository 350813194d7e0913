/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "disparity_finder.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/imgproc.hpp>

#include "../base/simd.hpp"

namespace rangecast {
namespace {

/* Margin around the ROI in which to match, for the same quality at its border, pixels. */
constexpr int kMargin = 8;
/* Maximum ratio of both cameras' brightness, and by how much it must change to count. */
constexpr double kMaxGain = 2, kGainStep = 0.005;

Status
too_near (double near_m, double pixels)
{
  char text[120];
  std::snprintf (text, sizeof text,
      "near = %g m needs disparities of %g pixels, more than the image is wide", near_m, pixels);
  return {StatusCode::kBadValue, text};
}

} // namespace

/* The excess over `max` is where background that is beyond the range matches as often as within it,
 * and so is cleared as inconsistent. */
DisparityFinder::Range
DisparityFinder::range_of (int min, int max)
{
  return {min, (max - min + 16) / 16 * 16};
}

Status
DisparityFinder::set (const PairGeometry &pair, double near_m, double far_m, int n_threads)
{
  constexpr int kMaxDisparity = 2000; /* of 16-bit disparities in 1/16 pixel */
  pair_ = pair;
  n_threads_ = n_threads;
  for (cv::Mat &whole : whole_)
    whole.create (pair.height, pair.width, CV_16S);
  const double nearest = pair.focal_baseline / near_m - pair.offset; /* may exceed int */
  if (!(nearest < pair.width))
    return too_near (near_m, nearest);
  /* Depths beyond far are matched, too, and then cleared, so that they are not mistaken for
   * something nearer. */
  min_disparity_ = static_cast<int> (std::floor (-pair.offset));
  max_disparity_ = std::max (static_cast<int> (std::ceil (nearest)), min_disparity_ + 1);
  far_ = static_cast<int> (std::ceil (16 * (pair.focal_baseline / far_m - pair.offset)));
  reset ();
  if (max_disparity_ > kMaxDisparity || min_disparity_ < -kMaxDisparity)
    return {StatusCode::kBadValue, "stereo: disparities " + std::to_string (min_disparity_) +
                                       " to " + std::to_string (max_disparity_) +
                                       " pixels exceed 2000; increase near"};
  if (const int reach = range_of (min_disparity_, max_disparity_).reach (); reach >= pair.width)
    return too_near (near_m, reach);
  return {};
}

/* The disparities of a range of depths; those of all depths if that saves nothing. */
DisparityFinder::Range
DisparityFinder::choose_range (double near_m, double far_m) const
{
  const Range all = range_of (min_disparity_, max_disparity_);
  if (!(near_m > 0) || !(far_m > near_m))
    return all;
  const int low = std::max (
      min_disparity_, static_cast<int> (std::floor (pair_.focal_baseline / far_m - pair_.offset)));
  const int high = std::min (
      max_disparity_, static_cast<int> (std::ceil (pair_.focal_baseline / near_m - pair_.offset)));
  const Range some = range_of (low, std::max (high, low + 1));
  return some.count < all.count ? some : all;
}

/* Places the window that contains all matches of the ROI. Columns outside of the image repeat its
 * border, near which nothing would match otherwise. */
void
DisparityFinder::place_window (const Roi &roi)
{
  const int reach = range_.reach (), reach_right = range_.reach_right ();
  const int top = std::max (0, roi.y - kMargin);
  const int bottom = std::min (pair_.height, roi.y + roi.height + kMargin);
  const int x0 = std::max (0, roi.x - kMargin),
            x1 = std::min (pair_.width, roi.x + roi.width + kMargin);
  core_at_ = cv::Rect (x0, top, x1 - x0, bottom - top);
  const int left = std::max (0, x0 - reach), right = std::min (pair_.width, x1 + reach_right);
  window_at_ = cv::Rect (left, top, right - left, bottom - top);
  missing_[0] = reach - (x0 - left);
  missing_[1] = reach_right - (right - x1);
}

cv::Rect
DisparityFinder::needed (const Roi &roi, int camera) const
{
  constexpr int kAround = 2 * kMargin; /* blocks and descriptors of pixels in the margin */
  const Range all = range_of (min_disparity_, max_disparity_);
  const int left = kAround + (camera > 0 ? all.reach () : 0),
            right = kAround + (camera > 0 ? all.reach_right () : 0);
  return cv::Rect (
             roi.x - left, roi.y - kAround, roi.width + left + right, roi.height + 2 * kAround) &
         cv::Rect (0, 0, pair_.width, pair_.height);
}

void
DisparityFinder::choose_parts (const std::vector<cv::Rect> *parts)
{
  parts_.clear ();
  const cv::Rect all (0, 0, core_at_.width, core_at_.height);
  if (!parts)
    parts_.push_back (all);
  else
    for (const cv::Rect &part : *parts)
      if (const cv::Rect inside = (part - core_at_.tl ()) & all; !inside.empty ())
        parts_.push_back (inside);
  tiles_.set (parts_, n_threads_);
}

/* Matches each part with some rows around it and copies it to core_. */
void
DisparityFinder::match ()
{
  constexpr int kAround = kMargin - 2;
  window_[1].convertTo (scaled_, CV_8U, gain_);
  const cv::Rect all (0, 0, core_at_.width, core_at_.height);
  for (int i = 0; i < 2; i++) {
    cv::Mat &core = i ? next_ : core_;
    core = whole_[i](all);
    core.setTo (16 * min_disparity_ - 16);
  }
  const int reach = range_.reach (), beside = reach + range_.reach_right ();
  for (const cv::Rect &part : parts_) {
    const int top = std::max (0, part.y - kAround),
              bottom = std::min (all.height, part.br ().y + kAround);
    const cv::Rect window (part.x, top, part.width + beside, bottom - top);
    matcher_.match (
        window_[0](window), scaled_ (window), range_.min, range_.count, n_threads_, raw_);
    raw_ (cv::Rect (reach, part.y - top, part.width, part.height)).copyTo (core_ (part));
  }
}

/* How much brighter the left image is than the right one, where they match and neither is black or
 * burnt out; that of before if that is little. Cameras differ by some per cent, which on a plain
 * surface exceeds its contrast. */
double
DisparityFinder::find_gain () const
{
  const auto counts = [] (int grey) { return grey > 5 && grey < 250; };
  const int reach = range_.reach (), least = 16 * min_disparity_;
  std::int64_t n = 0, sums[2] = {0, 0};
  for (int y = 0; y < core_.rows; y += 4) { /* a mean */
    const auto d = core_.ptr<std::int16_t> (y);
    const auto left = window_[0].ptr<std::uint8_t> (y) + reach,
               right = window_[1].ptr<std::uint8_t> (y) + reach;
    for (int x = 0; x < core_.cols; x++) {
      const int there = x - ((d[x] + 8) >> 4);
      if (d[x] < least || there < 0 || there >= core_.cols || !counts (left[x]) ||
          !counts (right[there]))
        continue;
      n++;
      sums[0] += left[x];
      sums[1] += right[there];
    }
  }
  if (n <= std::int64_t (core_.total () / 64))
    return gain_;
  return std::clamp (double (sums[0]) / double (sums[1]), 1 / kMaxGain, kMaxGain);
}

/* After matching a limited range: sets the disparities of known background beyond it, or none. */
void
DisparityFinder::restore_background (const cv::Mat &grey, int right_x)
{
  const int none = 16 * min_disparity_ - 16, found = 16 * range_.min;
  if (background_.empty ()) {
    core_.setTo (none, core_ < found);
    return;
  }
  background_.restore (
      grey, window_[1], right_x, core_at_.tl (), found, none, tiles_, core_, next_);
  cv::swap (core_, next_);
}

/* Clears wrong disparities in the ROI and its margin. */
void
DisparityFinder::filter (const cv::Mat &left)
{
  const int min = 16 * min_disparity_;
  const int offset = static_cast<int> (std::lround (16 * pair_.offset));
  const int right_x = range_.reach ();
  const cv::Mat grey = window_[0](cv::Rect (right_x, 0, core_at_.width, core_at_.height)),
                colour = left (core_at_);
  const int nearest = limited_ ? std::max (min, far_) : min; /* of interest */
  if (limited_)
    restore_background (grey, right_x);
  filter_.clear_hidden (min, tiles_, core_);
  filter_.clear_flying (offset, min, tiles_, core_, next_);
  cv::swap (core_, next_);
  filter_.clear_specks (min, nearest, tiles_, core_);
  filter_.fill_gaps (colour, min, tiles_, core_);
  SilhouetteFilter::Settings rims = {.offset = offset, .min = min, .nearest = nearest};
  silhouettes_.apply (rims, colour, tiles_, core_, next_);
  cv::swap (core_, next_);
  if (limited_ && !background_.empty ()) {
    background_.extend (core_at_.tl (), min, far_, tiles_, core_);
    rims.only_beyond = true;
    silhouettes_.apply (rims, colour, tiles_, core_, next_);
    cv::swap (core_, next_);
  }
  refiner_.apply ({grey, scaled_, colour, right_x, std::max (min, far_)}, tiles_, core_);
  if (!limited_ && core_.cols == pair_.width && core_.rows == pair_.height)
    background_.remember (grey, core_, min, far_);
}

/* Converts the matcher's disparities of the window to disparity_. The farthest one means none: see
 * BackgroundDisparity::extend(). */
void
DisparityFinder::write_disparity (const Roi &roi)
{
  const int x0 = roi.x - core_at_.x, y0 = roi.y - core_at_.y;
  const int min = 16 * min_disparity_;
  const int offset = static_cast<int> (std::lround (16 * pair_.offset));
  const int border = 16 * (pair_.width - 1);
  disparity_.create (roi.height, roi.width, CV_16U);
  for_this_cpu ([&] {
    for (int y = 0; y < roi.height; y++) {
      const std::int16_t *__restrict from = core_.ptr<std::int16_t> (y0 + y) + x0;
      std::uint16_t *__restrict to = disparity_.ptr<std::uint16_t> (y);
      for (int x = 0; x < roi.width; x++) {
        const int d = from[x] + offset;
        const int there = 16 * (roi.x + x) - from[x]; /* must not be in the border */
        const bool seen = (there >= 0) & (there <= border) & (from[x] > min) & (d > 0);
        to[x] = static_cast<std::uint16_t> (seen ? d : 0);
      }
    }
  });
}

void
DisparityFinder::find_doubtful (const Roi &roi, cv::Mat &doubtful) const
{
  const cv::Rect part (roi.x, roi.y, roi.width, roi.height);
  doubtful.create (part.size (), CV_8U);
  if (limited_ && !background_.empty ())
    background_.find_still (
        window_[0](part - core_at_.tl () + cv::Point (range_.reach (), 0)), part.tl (), doubtful);
  else
    doubtful.setTo (0);
}

void
DisparityFinder::find (const cv::Mat &left, const cv::Mat &right, const Roi &roi, double near_m,
    double far_m, const std::vector<cv::Rect> *parts)
{
  range_ = choose_range (near_m, far_m);
  limited_ = range_.count < range_of (min_disparity_, max_disparity_).count;
  place_window (roi);
  choose_parts (parts);
  for (int i = 0; i < 2; i++) {
    cv::cvtColor ((i ? right : left) (window_at_), grey_, cv::COLOR_RGBA2GRAY);
    cv::copyMakeBorder (grey_, window_[i], 0, 0, missing_[0], missing_[1], cv::BORDER_REPLICATE);
  }
  match ();
  const bool is_whole = !limited_ && !parts && core_.size () == left.size ();
  const double gain = is_whole ? find_gain () : gain_;
  if (std::abs (gain / gain_ - 1) > kGainStep) {
    gain_ = gain;
    match ();
  }
  filter (left);
  write_disparity (roi);
}

} // namespace rangecast
