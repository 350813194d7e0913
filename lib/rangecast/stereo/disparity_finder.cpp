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

Status
too_near (double near_m, double pixels)
{
  char text[120];
  std::snprintf (text, sizeof text,
      "near = %g m needs disparities of %g pixels, more than the image is wide", near_m, pixels);
  return {StatusCode::kBadValue, text};
}

} // namespace

Status
DisparityFinder::set (
    const PairGeometry &pair, const StereoSettings &settings, double near_m, double far_m)
{
  pair_ = pair;
  settings_ = settings;
  for (cv::Mat &whole : whole_)
    whole.create (pair.height, pair.width, CV_16S);
  const double farthest =
      settings.search_far_m > 0 ? std::max (settings.search_far_m, far_m) : INFINITY;
  const double nearest = pair.focal_baseline / near_m - pair.offset; /* may exceed int */
  if (!(nearest < pair.width))
    return too_near (near_m, nearest);
  min_disparity_ = static_cast<int> (std::floor (pair.focal_baseline / farthest - pair.offset));
  max_disparity_ = static_cast<int> (std::ceil (pair.focal_baseline / near_m - pair.offset));
  max_disparity_ = std::max (max_disparity_, min_disparity_ + 1);
  far_ = static_cast<int> (std::ceil (16 * (pair.focal_baseline / far_m - pair.offset)));
  background_.reset ();
  if (Status s = all_.set (settings.match, min_disparity_, max_disparity_); !s.ok ())
    return s;
  if (all_.reach () >= pair.width)
    return too_near (near_m, all_.reach ());
  return some_.set (settings.match, min_disparity_, max_disparity_);
}

/* Configures the matcher for a range of depths. OpenCV's numbers of disparities are multiples of
 * 16; the excess is on the near side. */
Status
DisparityFinder::choose_range (double near_m, double far_m)
{
  matcher_ = &all_;
  if (!(near_m > 0) || !(far_m > near_m))
    return {};
  const int low = std::max (
      min_disparity_, static_cast<int> (std::floor (pair_.focal_baseline / far_m - pair_.offset)));
  const int high = std::min (
      max_disparity_, static_cast<int> (std::ceil (pair_.focal_baseline / near_m - pair_.offset)));
  if ((high - low + 16) / 16 >= (max_disparity_ - min_disparity_ + 16) / 16)
    return {};
  matcher_ = &some_;
  return some_.set_range (low, std::max (high, low + 1));
}

/* Places the window that contains all matches of the ROI. Columns outside of the image repeat its
 * border, near which OpenCV would match nothing otherwise. */
void
DisparityFinder::place_window (const Roi &roi)
{
  const int reach = matcher_->reach (), reach_right = matcher_->reach_right ();
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
  const int left = kAround + (camera > 0 ? all_.reach () : 0),
            right = kAround + (camera > 0 ? all_.reach_right () : 0);
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
  tiles_.set (parts_, settings_.n_threads);
}

/* Matches each part with some rows around it and copies it to core_. */
Status
DisparityFinder::match ()
{
  const cv::Rect all (0, 0, core_at_.width, core_at_.height);
  for (int i = 0; i < 2; i++) {
    cv::Mat &core = i ? next_ : core_;
    core = whole_[i](all);
    core.setTo (16 * min_disparity_ - 16);
  }
  const int reach = matcher_->reach (), beside = reach + matcher_->reach_right (),
            above = kMargin - 2, below = matcher_->looks_down () ? above : 2;
  for (const cv::Rect &part : parts_) {
    const int top = std::max (0, part.y - above),
              bottom = std::min (all.height, part.br ().y + below);
    const cv::Rect window (part.x, top, part.width + beside, bottom - top);
    const cv::Mat left = window_[0](window), right = window_[1](window);
    if (Status s = matcher_->match (left, right, settings_.n_threads, raw_); !s.ok ())
      return s;
    raw_ (cv::Rect (reach, part.y - top, part.width, part.height)).copyTo (core_ (part));
  }
  return {};
}

/* After matching a limited range: sets the disparities of known background beyond it, or none. */
void
DisparityFinder::restore_background (const cv::Mat &grey, int right_x)
{
  const int none = 16 * min_disparity_ - 16, found = 16 * matcher_->min_disparity ();
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
  const MatchSettings &m = settings_.match;
  const int min = 16 * min_disparity_;
  const int offset = static_cast<int> (std::lround (16 * pair_.offset));
  const int right_x = matcher_->reach ();
  const cv::Mat grey = window_[0](cv::Rect (right_x, 0, core_at_.width, core_at_.height)),
                colour = left (core_at_);
  const bool limited = matcher_ != &all_;
  const int nearest = limited ? std::max (min, far_) : min; /* of interest */
  if (limited)
    restore_background (grey, right_x);
  if (settings_.patch_tolerance > 0) {
    filter_.clear_unlike (
        grey, window_[1], right_x, settings_.patch_tolerance, min, tiles_, core_, next_);
    cv::swap (core_, next_);
  }
  filter_.clear_hidden (min, tiles_, core_);
  constexpr int kSupport = 4; /* of eight neighbours; at a straight edge there are five */
  if (settings_.flying_pixel_step > 0) {
    filter_.clear_flying (settings_.flying_pixel_step, kSupport, offset, min, tiles_, core_, next_);
    cv::swap (core_, next_);
  }
  if (m.speckle_window_size > 0)
    filter_.clear_specks (m.speckle_window_size, 16 * m.speckle_range, min, nearest, tiles_, core_);
  if (settings_.gap_width > 0)
    filter_.fill_gaps (colour, settings_.gap_width, min, tiles_, core_);
  if (settings_.silhouette_radius > 0) {
    SilhouetteFilter::Settings rims = {
        settings_.silhouette_radius, settings_.flying_pixel_step, offset, min, nearest};
    silhouettes_.apply (rims, colour, tiles_, core_, next_);
    cv::swap (core_, next_);
    if (limited && !background_.empty ()) {
      background_.extend (core_at_.tl (), min, far_, tiles_, core_);
      rims.only_beyond = true;
      rims.same_picture = true;
      rims.look_near = min;
      silhouettes_.apply (rims, colour, tiles_, core_, next_);
      cv::swap (core_, next_);
    }
  }
  if (!limited)
    filter_.clear_doubled (grey, window_[1], right_x, min, tiles_, core_);
  if (settings_.refine > 0)
    refiner_.apply (
        {grey, window_[1], colour, right_x, std::max (min, far_), settings_.refine}, tiles_, core_);
  if (!limited && core_.cols == pair_.width && core_.rows == pair_.height)
    background_.remember (grey, core_, min, far_);
}

/* Converts OpenCV's disparities of the window to disparity_. The farthest one means none: see
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

Status
DisparityFinder::find (const cv::Mat &left, const cv::Mat &right, const Roi &roi, double near_m,
    double far_m, const std::vector<cv::Rect> *parts)
{
  if (Status s = choose_range (near_m, far_m); !s.ok ())
    return s;
  place_window (roi);
  choose_parts (parts);
  for (int i = 0; i < 2; i++) {
    cv::cvtColor ((i ? right : left) (window_at_), grey_, cv::COLOR_RGBA2GRAY);
    cv::copyMakeBorder (grey_, window_[i], 0, 0, missing_[0], missing_[1], cv::BORDER_REPLICATE);
  }
  if (Status s = match (); !s.ok ())
    return s;
  filter (left);
  write_disparity (roi);
  return {};
}

} // namespace rangecast
