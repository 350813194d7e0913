/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "stereo_depth.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace rangecast {
namespace {

/* Rows and columns around the ROI that matching looks at, so that its edge is as good as its
 * middle. */
constexpr int kMargin = 8;

cv::Mat
as_mat (ImageView<const Rgbx> picture)
{
  return cv::Mat (picture.height, picture.width, CV_8UC4, const_cast<Rgbx *> (picture.data),
      static_cast<std::size_t> (picture.stride));
}

template <typename T>
ImageView<T>
as_view (const cv::Mat &mat)
{
  return {
      reinterpret_cast<T *> (mat.data), mat.cols, mat.rows, static_cast<std::ptrdiff_t> (mat.step)};
}

} // namespace

Status
StereoDepth::set (const View &view, const StereoSettings &settings)
{
  if (Status s = rectifier_.set (view); !s.ok ())
    return s;
  const View &range = rectifier_.range_view ();
  const double focal_baseline = range.intrinsics.fx * rectifier_.baseline_m ();
  const double offset = rectifier_.principal_offset ();
  const double farthest =
      settings.search_far_m > 0 ? std::max (settings.search_far_m, range.far_m) : INFINITY;
  const int least = static_cast<int> (std::floor (focal_baseline / farthest - offset));
  const int most = static_cast<int> (std::ceil (focal_baseline / range.near_m - offset));
  if (Status s = matcher_.set (settings.match, least, std::max (most, least + 1)); !s.ok ())
    return {s.code (), "view " + std::to_string (view.id) + ": " + s.message ()};
  if (matcher_.reach () >= view.width)
    return {StatusCode::kBadValue,
        "view " + std::to_string (view.id) + ": near = " + std::to_string (range.near_m) +
            " m needs disparities of " + std::to_string (matcher_.reach ()) +
            " pixels, more than the picture is wide"};
  view_ = view;
  settings_ = settings;
  changes_.forget ();
  pictures_[0].release ();
  return to_depth_.set (
      range.intrinsics.fx, rectifier_.baseline_m (), range.depth_unit_m, range.near_m, range.far_m);
}

void
StereoDepth::rectify (int camera, ImageView<const Rgbx> picture)
{
  pictures_[camera] = as_mat (picture);
  if (rectifier_.is_identity ())
    return;
  rectifier_.rectify (camera, pictures_[camera], rectified_[camera]);
  pictures_[camera] = rectified_[camera];
}

/* Lays out the window that the ROI's matches lie in. Columns that would lie left or right of the
 * picture repeat its edge: without them OpenCV matches nothing near the edges. */
void
StereoDepth::place_window (const Roi &roi)
{
  const int before = matcher_.reach () + kMargin, after = matcher_.reach_right () + kMargin;
  const int left = std::max (0, roi.x - before);
  const int right = std::min (view_.width, roi.x + roi.width + after);
  const int top = std::max (0, roi.y - kMargin);
  const int bottom = std::min (view_.height, roi.y + roi.height + kMargin);
  window_at_ = cv::Rect (left, top, right - left, bottom - top);
  const int x0 = std::max (0, roi.x - kMargin);
  core_at_ =
      cv::Rect (x0, top, std::min (view_.width, roi.x + roi.width + kMargin) - x0, bottom - top);
  missing_[0] = std::max (0, matcher_.reach () - (roi.x - left));
  missing_[1] = std::max (0, matcher_.reach_right () - (right - roi.x - roi.width));
}

void
StereoDepth::cut_window (int camera)
{
  cv::cvtColor (pictures_[camera](window_at_), grey_, cv::COLOR_RGBA2GRAY);
  cv::copyMakeBorder (grey_, window_[camera], 0, 0, missing_[0], missing_[1], cv::BORDER_REPLICATE);
}

/* Takes away what cannot be right of the disparities of the ROI and its margin. */
void
StereoDepth::filter_disparities ()
{
  const MatchSettings &m = settings_.match;
  const int least = 16 * matcher_.min_disparity ();
  const int offset = static_cast<int> (std::lround (16 * rectifier_.principal_offset ()));
  const cv::Rect in_window (core_at_.x - window_at_.x + missing_[0], core_at_.y - window_at_.y,
      core_at_.width, core_at_.height);
  core_disparity_ = raw_disparity_ (in_window);
  const cv::Mat grey = window_[0](in_window);
  if (settings_.patch_tolerance > 0)
    filter_.clear_unlike (grey, window_[1].rowRange (in_window.y, in_window.y + in_window.height),
        in_window.x, settings_.patch_tolerance, least, core_disparity_);
  filter_.clear_hidden (least, core_disparity_);
  constexpr int kSupport = 4; /* of eight neighbours: a straight edge has five */
  if (settings_.flying_pixel_step > 0)
    filter_.clear_flying (settings_.flying_pixel_step, kSupport, offset, least, core_disparity_);
  if (m.speckle_window_size > 0)
    cv::filterSpeckles (
        core_disparity_, least - 16, m.speckle_window_size, 16 * m.speckle_range, specks_);
  if (settings_.gap_width > 0)
    filter_.fill_gaps (pictures_[0](core_at_), settings_.gap_width, least, core_disparity_);
  if (settings_.silhouette_radius > 0)
    filter_.clear_rims (pictures_[0](core_at_), settings_.silhouette_radius,
        settings_.flying_pixel_step, offset, least, core_disparity_);
}

/* OpenCV's disparities of the window to ours of the ROI. */
void
StereoDepth::take_disparities (const RangeImage &image)
{
  const Roi &roi = image.roi;
  const int x0 = roi.x - core_at_.x, y0 = roi.y - core_at_.y;
  const int least = 16 * matcher_.min_disparity ();
  const int offset = static_cast<int> (std::lround (16 * rectifier_.principal_offset ()));
  disparity_.create (roi.height, roi.width, CV_16U);
  for (int y = 0; y < roi.height; y++) {
    const auto from = core_disparity_.ptr<std::int16_t> (y0 + y) + x0;
    auto to = disparity_.ptr<std::uint16_t> (y);
    for (int x = 0; x < roi.width; x++) {
      const int d = from[x] + offset;
      const int there = 16 * (roi.x + x) - from[x]; /* not where the right picture is repeated */
      const bool seen = there >= 0 && there <= 16 * (view_.width - 1);
      to[x] = from[x] >= least && d > 0 && seen ? static_cast<std::uint16_t> (d) : 0;
    }
  }
}

ImageView<const std::uint16_t>
StereoDepth::disparity () const
{
  return as_view<std::uint16_t> (disparity_);
}

Status
StereoDepth::take (ImageView<const Rgbx> left, ImageView<const Rgbx> right)
{
  for (const auto &picture : {left, right})
    if (picture.width != view_.width || picture.height != view_.height)
      return {StatusCode::kBadSize, "stereo: a picture does not have the view's size"};
  try {
    rectify (0, left);
    rectify (1, right);
    changes_.look (pictures_[0]);
  } catch (const cv::Exception &) {
    return {StatusCode::kNoSpace, "stereo: OpenCV failed to rectify"};
  }
  return {};
}

Status
StereoDepth::match (const RangeImage &image)
{
  const Roi &roi = image.roi;
  if (pictures_[0].empty () || roi.empty () || roi.x < 0 || roi.y < 0 ||
      roi.x + roi.width > view_.width || roi.y + roi.height > view_.height)
    return {StatusCode::kBadSize, "stereo: the ROI does not lie in the view"};
  const cv::Mat to (roi.height, roi.width, CV_8UC4, image.colour.data,
      static_cast<std::size_t> (image.colour.stride));
  try {
    pictures_[0](cv::Rect (roi.x, roi.y, roi.width, roi.height)).copyTo (to);
    place_window (roi);
    cut_window (0);
    cut_window (1);
  } catch (const cv::Exception &) {
    return {StatusCode::kNoSpace, "stereo: OpenCV failed to cut the pictures"};
  }
  if (roi.width == view_.width && roi.height == view_.height)
    changes_.remember ();
  if (Status s = matcher_.match (window_[0], window_[1], raw_disparity_); !s.ok ())
    return s;
  filter_disparities ();
  take_disparities (image);
  return to_depth_.convert (disparity (), image.depth);
}

} // namespace rangecast
