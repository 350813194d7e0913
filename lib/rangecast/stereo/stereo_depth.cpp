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
  const int least = static_cast<int> (std::floor (focal_baseline / range.far_m - offset));
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

/* Cuts the window that the ROI's matches lie in. Columns that would lie left of the picture repeat
 * its edge: without them OpenCV matches nothing near the left edge. */
void
StereoDepth::cut_window (int camera, const RangeImage &image)
{
  const Roi &roi = image.roi;
  const cv::Mat &colour = pictures_[camera];
  const int left = std::max (0, roi.x - matcher_.reach () - kMargin);
  const int right = std::min (view_.width, roi.x + roi.width + kMargin);
  const int top = std::max (0, roi.y - kMargin);
  const int bottom = std::min (view_.height, roi.y + roi.height + kMargin);
  const int missing = std::max (0, matcher_.reach () - (roi.x - left));
  cv::cvtColor (
      colour (cv::Rect (left, top, right - left, bottom - top)), grey_, cv::COLOR_RGBA2GRAY);
  cv::copyMakeBorder (grey_, window_[camera], 0, 0, missing, 0, cv::BORDER_REPLICATE);
}

/* OpenCV's disparities of the window to ours of the ROI. */
void
StereoDepth::take_disparities (const RangeImage &image)
{
  const Roi &roi = image.roi;
  const int right = std::min (view_.width, roi.x + roi.width + kMargin);
  const int x0 = raw_disparity_.cols - (right - roi.x);
  const int y0 = roi.y - std::max (0, roi.y - kMargin);
  const int least = 16 * matcher_.min_disparity ();
  const int offset = static_cast<int> (std::lround (16 * rectifier_.principal_offset ()));
  disparity_.create (roi.height, roi.width, CV_16U);
  for (int y = 0; y < roi.height; y++) {
    const auto from = raw_disparity_.ptr<std::int16_t> (y0 + y) + x0;
    auto to = disparity_.ptr<std::uint16_t> (y);
    for (int x = 0; x < roi.width; x++) {
      const int d = from[x] + offset;
      const bool seen =
          16 * (roi.x + x) >= from[x]; /* not in the repeated edge of the right picture */
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
    cut_window (0, image);
    cut_window (1, image);
  } catch (const cv::Exception &) {
    return {StatusCode::kNoSpace, "stereo: OpenCV failed to cut the pictures"};
  }
  if (roi.width == view_.width && roi.height == view_.height)
    changes_.remember ();
  if (Status s = matcher_.match (window_[0], window_[1], raw_disparity_); !s.ok ())
    return s;
  take_disparities (image);
  if (settings_.flying_pixel_step <= 0)
    return to_depth_.convert (disparity (), image.depth);
  depth_.create (roi.height, roi.width, CV_16U);
  if (Status s = to_depth_.convert (disparity (), as_view<std::uint16_t> (depth_)); !s.ok ())
    return s;
  constexpr int kSupport = 4; /* of eight neighbours: a straight edge has five */
  return remove_flying_pixels (
      as_view<const std::uint16_t> (depth_), settings_.flying_pixel_step, kSupport, image.depth);
}

} // namespace rangecast
