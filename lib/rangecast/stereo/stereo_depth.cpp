/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "stereo_depth.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "../base/guarded.hpp"
#include "../base/simd.hpp"
#include "../opencv/image.hpp"

namespace rangecast {
namespace {

/* First and last bin of interest. */
struct BinRange {
  int low = 0, high = 0;
};

/* The range of bins without the lowest and highest 0.2 % of all counts, of which there is one at
 * least. */
BinRange
without_outliers (const std::vector<int> &histogram)
{
  std::int64_t total = 0; /* 500 times as many pixels may exceed an int */
  for (int n : histogram)
    total += n;
  BinRange range = {0, int (histogram.size ()) - 1};
  for (std::int64_t n = 0; (n += histogram[std::size_t (range.low)]) * 500 < total;)
    range.low++;
  for (std::int64_t n = 0; (n += histogram[std::size_t (range.high)]) * 500 < total;)
    range.high--;
  return range;
}

} // namespace

Status
StereoDepth::set (const View &view, int n_threads, bool with_third)
{
  if (Status s = rectifier_.set (view); !s.ok ())
    return s;
  const View &range = rectifier_.range_view ();
  const PairGeometry pair = {view.width, view.height,
      range.intrinsics.fx * rectifier_.baseline_m (), rectifier_.principal_offset ()};
  if (Status s = finder_.set (pair, range.near_m, range.far_m, n_threads); !s.ok ())
    return {s.code (), "view " + std::to_string (view.id) + ": " + s.message ()};
  with_third_ = with_third;
  if (with_third)
    if (Status s = third_.set (view, range, pair.focal_baseline, n_threads); !s.ok ())
      return s;
  view_ = view;
  n_threads_ = n_threads;
  blocks_.set ({view.width, view.height});
  temporal_.set ({view.width, view.height}, n_threads);
  reset ();
  pictures_[0].release ();
  map_depths (range, pair.focal_baseline);
  return {};
}

void
StereoDepth::map_depths (const View &range, double focal_baseline)
{
  depths_.assign (65536, kInvalidDepth);
  for (int d = 1; d < 65536; d++) {
    const double z = focal_baseline / (d / 16.0), units = std::round (z / range.depth_unit_m);
    if (z >= range.near_m && z <= range.far_m && units >= 1 && units <= 65535)
      depths_[std::size_t (d)] = static_cast<std::uint16_t> (units);
  }
}

ImageView<const std::uint16_t>
StereoDepth::disparity () const
{
  const cv::Mat &mat = finder_.disparity ();
  return {reinterpret_cast<const std::uint16_t *> (mat.data), mat.cols, mat.rows,
      static_cast<std::ptrdiff_t> (mat.step)};
}

Status
StereoDepth::rectify (
    ImageView<const Rgbx> left, ImageView<const Rgbx> right, ImageView<const Rgbx> third)
{
  has_third_ = with_third_ && !third.empty ();
  for (const auto &picture : {left, right, has_third_ ? third : left})
    if (picture.width != view_.width || picture.height != view_.height)
      return {StatusCode::kBadSize, "stereo: an image does not have the view's size"};
  return guarded ("stereo", [&] () -> Status {
    for (int i = 0; i < 2; i++) {
      pictures_[i] = opencv_image (i ? right : left);
      if (!rectifier_.is_identity ()) {
        rectifier_.rectify (i, pictures_[i], rectified_[i]);
        pictures_[i] = rectified_[i];
      }
    }
    if (has_third_)
      third_.rectify (opencv_image (left), opencv_image (third));
    blocks_.update (pictures_[0]);
    return {};
  });
}

/* Records the coverage of the last ROI, and its depth range without what may be background, and
 * without 0.2 % at both ends, which may be wrong. */
void
StereoDepth::learn_range (const RangeImage &image)
{
  const bool whole = image.roi.width == view_.width && image.roi.height == view_.height;
  if (!whole || last_roi_.empty ())
    last_roi_ = image.roi;
  const Roi part = {
      last_roi_.x - image.roi.x, last_roi_.y - image.roi.y, last_roi_.width, last_roi_.height};
  const cv::Mat &disparity = finder_.disparity ();
  histogram_.assign (4096, 0);
  int seen = 0;
  for (int y = part.y; y < part.y + part.height; y++) {
    const auto d = disparity.ptr<std::uint16_t> (y);
    const auto doubtful = doubtful_.ptr<std::uint8_t> (y);
    const std::uint16_t *depth = image.depth.row (y);
    for (int x = part.x; x < part.x + part.width; x++)
      if (depth[x]) {
        seen++;
        histogram_[d[x] >> 4] += !doubtful[x];
      }
  }
  seen_share_ = double (seen) / (double (part.width) * part.height);
  near_now_m_ = far_now_m_ = 0;
  if (seen < 64)
    return;
  const auto [low, high] = without_outliers (histogram_);
  /* Walking at 1.5 m/s is 6 cm per frame at 25 Hz: 7 % at 0.85 m. */
  constexpr double kStep = 0.07;
  near_now_m_ = finder_.disparity_at (1) / 16 / (high + 2 + kStep * high);
  far_now_m_ = finder_.disparity_at (1) / 16 / std::max (0.5, low - 1 - kStep * low);
}

/* Whether the result of a limited depth range suggests that something is outside of it: pixels are
 * missing, or those that are not background accumulate at the near end. */
bool
StereoDepth::is_suspect (const RangeImage &image) const
{
  const cv::Mat &disparity = finder_.disparity ();
  const int nearest = static_cast<int> (finder_.disparity_at (near_now_m_)) - 24;
  int seen = 0, crowd = 0;
  for_this_cpu ([&] {
    for (int y = 0; y < disparity.rows; y++) {
      const auto d = disparity.ptr<std::uint16_t> (y);
      const auto doubtful = doubtful_.ptr<std::uint8_t> (y);
      const std::uint16_t *depth = image.depth.row (y);
      for (int x = 0; x < disparity.cols; x++) {
        const bool has_depth = depth[x] != 0;
        seen += has_depth;
        crowd += has_depth & (doubtful[x] == 0) & (d[x] > nearest);
      }
    }
  });
  return seen < 0.95 * seen_share_ * disparity.rows * disparity.cols || crowd > 0.01 * seen;
}

void
StereoDepth::find (const RangeImage &image, bool everywhere)
{
  const double near_m = everywhere ? 0 : near_now_m_, far_m = everywhere ? 0 : far_now_m_;
  const auto parts = everywhere ? nullptr : blocks_.find (image.roi);
  finder_.find (matched_[0], matched_[1], image.roi, near_m, far_m, parts);
  finder_.find_doubtful (image.roi, doubtful_);
  if (has_third_) {
    third_.find (image.roi, near_m, far_m);
    fuse_disparities (
        finder_.disparity (), third_.disparity (), third_.precision (), before_fusion_);
  }
  write_depth (image);
}

void
StereoDepth::write_depth (const RangeImage &image) const
{
  for (int y = 0; y < image.roi.height; y++) {
    const std::uint16_t *from = disparity ().row (y);
    std::uint16_t *to = image.depth.row (y);
    for (int x = 0; x < image.roi.width; x++)
      to[x] = depths_[from[x]];
  }
}

Status
StereoDepth::match (const RangeImage &image)
{
  const Roi &roi = image.roi;
  if (pictures_[0].empty () || roi.empty () || roi.x < 0 || roi.y < 0 ||
      roi.x + roi.width > view_.width || roi.y + roi.height > view_.height ||
      image.depth.width != roi.width || image.depth.height != roi.height)
    return {StatusCode::kBadSize, "stereo: the ROI does not lie in the view"};
  return guarded ("stereo", [&] () -> Status {
    const cv::Mat to (roi.height, roi.width, CV_8UC4, image.colour.data,
        static_cast<std::size_t> (image.colour.stride));
    pictures_[0](cv::Rect (roi.x, roi.y, roi.width, roi.height)).copyTo (to);
    for (int i = 0; i < 2; i++)
      matched_[i] = still_[i].add (pictures_[i], finder_.needed (roi, i));
    const bool whole = roi.width == view_.width && roi.height == view_.height;
    if (whole)
      blocks_.set_reference ();
    const bool everywhere = whole || near_now_m_ <= 0;
    find (image, everywhere);
    if (!everywhere && is_suspect (image))
      find (image, true);
    learn_range (image);
    edges_.apply (
        static_cast<int> (std::ceil (finder_.disparity_at (rectifier_.range_view ().far_m))),
        n_threads_, finder_.disparity ());
    temporal_.apply (
        pictures_[0], {roi.x, roi.y, roi.width, roi.height}, still_[0], finder_.disparity ());
    write_depth (image);
    blocks_.learn (image);
    return {};
  });
}

} // namespace rangecast
