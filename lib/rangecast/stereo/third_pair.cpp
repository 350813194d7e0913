/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "third_pair.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

namespace rangecast {
namespace {

cv::Matx33d
camera_matrix (const Intrinsics &k)
{
  return {k.fx, 0, k.cx, 0, k.fy, k.cy, 0, 0, 1};
}

Status
bad_third (const View &view, const char *what)
{
  return {StatusCode::kBadValue, "view " + std::to_string (view.id) + ": third camera " + what};
}

/* Number of pixels around (x, y) that agree with disparity d. */
int
support (const cv::Mat &of, int x, int y, int d)
{
  int n = 0;
  for (int v = std::max (0, y - 2); v <= std::min (of.rows - 1, y + 2); v++)
    for (int u = std::max (0, x - 2); u <= std::min (of.cols - 1, x + 2); u++) {
      const int other = of.at<std::uint16_t> (v, u);
      n += other != 0 && std::abs (other - d) <= 20;
    }
  return n;
}

} // namespace

/* Axes of the rectified images: x towards the third camera, z as close as possible to the left
 * camera's.
 */
Status
ThirdPair::choose_axes (const View &view)
{
  const Pose &pose = view.third->partner_from_left;
  const Vec3 to_third = -1.0 * (transposed (pose.rotation) * pose.translation);
  baseline_m_ = norm (to_third);
  if (!(baseline_m_ > 1e-4))
    return bad_third (view, "stands where the left one is");
  const Vec3 x = 1 / baseline_m_ * to_third, across = cross ({0, 0, 1}, x);
  if (norm (across) < 0.5)
    return bad_third (view, "stands before or behind the left one, not beside or above");
  const Vec3 y = 1 / norm (across) * across, z = cross (x, y);
  rectified_from_left_ = {x.x, x.y, x.z, y.x, y.y, y.z, z.x, z.y, z.z};
  return {};
}

/* Places the rectified image around the range view, outside of which nothing is sampled. Both are
 * pinhole cameras, so the corners of the range view determine it. */
Status
ThirdPair::place (const View &view, const View &range_view)
{
  const Mat3 left_from_range =
      transposed (view.world_from_view.rotation) * range_view.world_from_view.rotation;
  const double fx = range_view.intrinsics.fx;
  picture_from_range_ = cv::Matx33d (fx, 0, 0, 0, fx, 0, 0, 0, 1) * rectified_from_left_ *
                        cv::Matx33d (left_from_range.data ()) *
                        camera_matrix (range_view.intrinsics).inv ();
  cv::Vec2d low, high;
  if (!bounds ({0, 0, range_view.width, range_view.height}, low, high))
    return bad_third (view, "looks elsewhere");
  const int max_length = 2 * std::max (view.width, view.height);
  const auto length = [&] (int i) {
    return static_cast<int> (std::lround (std::min<double> (max_length - 1, high[i] - low[i]))) + 1;
  };
  pair_ = {length (0), length (1), fx * baseline_m_, 0};
  rectified_camera_ = {fx, 0, -low[0], 0, fx, -low[1], 0, 0, 1};
  picture_from_range_ = cv::Matx33d (1, 0, -low[0], 0, 1, -low[1], 0, 0, 1) * picture_from_range_;
  return {};
}

/* Bounds of a ROI of the range view in the rectified image.
 * @return false if a part of it is behind the camera, or nearly */
bool
ThirdPair::bounds (const Roi &roi, cv::Vec2d &low, cv::Vec2d &high) const
{
  low = {1e9, 1e9};
  high = {-1e9, -1e9};
  for (int x : {roi.x, roi.x + roi.width - 1})
    for (int y : {roi.y, roi.y + roi.height - 1}) {
      const cv::Vec3d p = picture_from_range_ * cv::Vec3d (x, y, 1);
      if (!(p[2] > 0.1))
        return false;
      for (int i = 0; i < 2; i++) {
        low[i] = std::min (low[i], p[i] / p[2]);
        high[i] = std::max (high[i], p[i] / p[2]);
      }
    }
  return true;
}

Status
ThirdPair::make_maps (const View &view)
{
  const cv::Matx33d rotations[2] = {rectified_from_left_,
      rectified_from_left_ * cv::Matx33d (view.third->partner_from_left.rotation.data ()).t ()};
  const cv::Size size (pair_.width, pair_.height);
  try {
    cv::initUndistortRectifyMap (camera_matrix (view.intrinsics), view.distortion, rotations[0],
        rectified_camera_, size, CV_16SC2, maps_[0][0], maps_[0][1]);
    cv::initUndistortRectifyMap (camera_matrix (view.third->intrinsics), view.third->distortion,
        rotations[1], rectified_camera_, size, CV_16SC2, maps_[1][0], maps_[1][1]);
  } catch (const cv::Exception &) {
    return bad_third (view, "cannot be rectified; calibrate it again");
  }
  return {};
}

/* Computes where each pixel of the range view is in the rectified image. */
void
ThirdPair::map_range_view (const View &range_view, double focal_baseline)
{
  where_.create (range_view.height, range_view.width, CV_16SC2);
  factor_.create (range_view.height, range_view.width, CV_32F);
  for (int y = 0; y < where_.rows; y++)
    for (int x = 0; x < where_.cols; x++) {
      const cv::Vec3d p = picture_from_range_ * cv::Vec3d (x, y, 1);
      const int u = cvRound (p[0] / p[2]), v = cvRound (p[1] / p[2]);
      const bool inside = u >= 0 && v >= 0 && u < pair_.width && v < pair_.height;
      where_.at<cv::Vec2s> (y, x) =
          inside ? cv::Vec2s (static_cast<short> (u), static_cast<short> (v)) : cv::Vec2s (-1, -1);
      /* Depth in the rectified image is p[2] times depth in the range view. */
      factor_.at<float> (y, x) = static_cast<float> (p[2] * focal_baseline / pair_.focal_baseline);
    }
}

Status
ThirdPair::set (const View &view, const View &range_view, double focal_baseline, int n_threads)
{
  if (!view.third)
    return {StatusCode::kNotFound, "view " + std::to_string (view.id) + ": has no third camera"};
  if (Status s = choose_axes (view); !s.ok ())
    return s;
  if (Status s = place (view, range_view); !s.ok ())
    return s;
  if (Status s = make_maps (view); !s.ok ())
    return s;
  map_range_view (range_view, focal_baseline);
  precision_ = pair_.focal_baseline / focal_baseline;
  const DepthFactors there = depth_factors ({0, 0, range_view.width, range_view.height});
  if (Status s = finder_.set (
          pair_, range_view.near_m * there.min, range_view.far_m * there.max, n_threads);
      !s.ok ())
    return bad_third (view, s.message ().c_str ());
  return {};
}

void
ThirdPair::rectify (const cv::Mat &left, const cv::Mat &third)
{
  cv::remap (left, pictures_[0], maps_[0][0], maps_[0][1], cv::INTER_LINEAR);
  cv::remap (third, pictures_[1], maps_[1][0], maps_[1][1], cv::INTER_LINEAR);
}

Roi
ThirdPair::bounding_box (const Roi &roi) const
{
  cv::Vec2d low, high;
  if (!bounds (roi, low, high))
    return {};
  const int x = std::max (0, cvRound (low[0])), y = std::max (0, cvRound (low[1]));
  const int right = cvRound (std::min<double> (pair_.width - 1, high[0])),
            bottom = cvRound (std::min<double> (pair_.height - 1, high[1]));
  return right < x || bottom < y ? Roi{} : Roi{x, y, right - x + 1, bottom - y + 1};
}

/* The ratio of depth in the rectified image and in the range view is linear in pixel coordinates.
 */
ThirdPair::DepthFactors
ThirdPair::depth_factors (const Roi &roi) const
{
  DepthFactors factors = {1e9, 0};
  for (int x : {roi.x, roi.x + roi.width - 1})
    for (int y : {roi.y, roi.y + roi.height - 1}) {
      const double factor = factor_.at<float> (y, x) * precision_;
      factors = {std::min (factors.min, factor), std::max (factors.max, factor)};
    }
  return factors;
}

void
ThirdPair::find (const Roi &roi, double near_m, double far_m)
{
  disparity_.create (roi.height, roi.width, CV_16U);
  const Roi there = bounding_box (roi);
  if (there.empty ()) {
    disparity_.setTo (0);
    return;
  }
  const DepthFactors factors = depth_factors (roi);
  finder_.find (pictures_[0], pictures_[1], there, near_m * factors.min, far_m * factors.max);
  for (int y = 0; y < roi.height; y++) {
    const auto where = where_.ptr<cv::Vec2s> (roi.y + y) + roi.x;
    const auto factor = factor_.ptr<float> (roi.y + y) + roi.x;
    auto to = disparity_.ptr<std::uint16_t> (y);
    for (int x = 0; x < roi.width; x++) {
      const int u = where[x][0] - there.x, v = where[x][1] - there.y;
      const bool inside = u >= 0 && v >= 0 && u < there.width && v < there.height;
      const int d = inside ? finder_.disparity ().at<std::uint16_t> (v, u) : 0;
      to[x] = static_cast<std::uint16_t> (std::min (65535L, std::lround (d * factor[x])));
    }
  }
}

void
fuse_disparities (cv::Mat &disparity, const cv::Mat &other, double precision, cv::Mat &mine)
{
  constexpr int kAgree = 16, kOneSurface = 48; /* 1/16 pixel */
  const double weight = precision * precision / (1 + precision * precision);
  disparity.copyTo (mine);
  for (int y = 0; y < disparity.rows; y++) {
    const std::uint16_t *a = mine.ptr<std::uint16_t> (y), *b = other.ptr<std::uint16_t> (y);
    auto to = disparity.ptr<std::uint16_t> (y);
    for (int x = 0; x < disparity.cols; x++) {
      if (!b[x] || !a[x]) {
        to[x] = std::max (a[x], b[x]);
        continue;
      }
      if (std::abs (a[x] - b[x]) <= kAgree) {
        to[x] = static_cast<std::uint16_t> (std::lround (a[x] + weight * (b[x] - a[x])));
        continue;
      }
      const int for_a = support (mine, x, y, a[x]) + support (other, x, y, a[x]),
                for_b = support (other, x, y, b[x]) + support (mine, x, y, b[x]);
      const bool one_surface = std::abs (a[x] - b[x]) <= kOneSurface;
      if (one_surface ? for_a > for_b : for_a > 2 * for_b)
        to[x] = a[x];
      else if (one_surface || for_b > 2 * for_a)
        to[x] = b[x];
      else
        to[x] = 0;
    }
  }
}

} // namespace rangecast
