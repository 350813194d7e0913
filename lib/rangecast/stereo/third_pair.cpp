/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "third_pair.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

namespace rangecast {
namespace {

cv::Matx33d
matx (const Mat3 &m)
{
  return cv::Matx33d (m.data ());
}

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

} // namespace

/* Axes of the rectified pictures: x to the third camera, z as near to the left camera's as may be.
 */
Status
ThirdPair::rectify (const View &view)
{
  const Pose &pose = view.third->partner_from_left;
  const Vec3 to_third = -1.0 * (transposed (pose.rotation) * pose.translation);
  const double baseline = norm (to_third);
  if (!(baseline > 1e-4))
    return bad_third (view, "stands where the left one is");
  const Vec3 x = 1 / baseline * to_third, across = cross ({0, 0, 1}, x);
  if (norm (across) < 0.5)
    return bad_third (view, "stands before or behind the left one; expected beside or above");
  const Vec3 y = 1 / norm (across) * across, z = cross (x, y);
  rectified_from_left_ = {x.x, x.y, x.z, y.x, y.y, y.z, z.x, z.y, z.z};
  fx_ = view.intrinsics.fx;
  /* As large as holds the corners of the left picture. */
  double low[2] = {1e9, 1e9}, high[2] = {-1e9, -1e9};
  for (int corner = 0; corner < 4; corner++) {
    const Vec3 ray = view.intrinsics.unproject (
        corner & 1 ? view.width - 1 : 0, corner & 2 ? view.height - 1 : 0, 1);
    const double depth = dot (z, ray);
    if (!(depth > 0.1))
      return bad_third (view, "looks elsewhere");
    const double at[2] = {fx_ * dot (x, ray) / depth, fx_ * dot (y, ray) / depth};
    for (int i = 0; i < 2; i++) {
      low[i] = std::min (low[i], at[i]);
      high[i] = std::max (high[i], at[i]);
    }
  }
  cx_ = -low[0];
  cy_ = -low[1];
  const int most = 2 * std::max (view.width, view.height);
  pair_ = {std::min (most, static_cast<int> (std::lround (high[0] - low[0])) + 1),
      std::min (most, static_cast<int> (std::lround (high[1] - low[1])) + 1), fx_ * baseline, 0};
  const cv::Matx33d p (fx_, 0, cx_, 0, fx_, cy_, 0, 0, 1);
  const cv::Matx33d rotations[2] = {
      rectified_from_left_, rectified_from_left_ * matx (pose.rotation).t ()};
  const cv::Size size (pair_.width, pair_.height);
  try {
    cv::initUndistortRectifyMap (camera_matrix (view.intrinsics), view.distortion, rotations[0], p,
        size, CV_16SC2, maps_[0][0], maps_[0][1]);
    cv::initUndistortRectifyMap (camera_matrix (view.third->intrinsics), view.third->distortion,
        rotations[1], p, size, CV_16SC2, maps_[1][0], maps_[1][1]);
  } catch (const cv::Exception &) {
    return bad_third (view, "cannot be rectified; expected a calibrated pair");
  }
  return {};
}

void
ThirdPair::map_range_view (const View &view, const View &range_view, double focal_baseline)
{
  const Mat3 left_from_range =
      transposed (view.world_from_view.rotation) * range_view.world_from_view.rotation;
  const cv::Matx33d there = rectified_from_left_ * matx (left_from_range);
  where_.create (range_view.height, range_view.width, CV_16SC2);
  factor_.create (range_view.height, range_view.width, CV_32F);
  for (int y = 0; y < where_.rows; y++)
    for (int x = 0; x < where_.cols; x++) {
      const Vec3 ray = range_view.intrinsics.unproject (x, y, 1);
      const cv::Vec3d p = there * cv::Vec3d (ray.x, ray.y, ray.z);
      const int u = p[2] > 0 ? cvRound (fx_ * p[0] / p[2] + cx_) : -1,
                v = p[2] > 0 ? cvRound (fx_ * p[1] / p[2] + cy_) : -1;
      const bool inside = u >= 0 && v >= 0 && u < pair_.width && v < pair_.height;
      where_.at<cv::Vec2s> (y, x) =
          inside ? cv::Vec2s (static_cast<short> (u), static_cast<short> (v)) : cv::Vec2s (-1, -1);
      /* Depth there is p[2] times depth here. */
      factor_.at<float> (y, x) = static_cast<float> (p[2] * focal_baseline / pair_.focal_baseline);
    }
}

Status
ThirdPair::set (
    const View &view, const View &range_view, double focal_baseline, const StereoSettings &settings)
{
  if (!view.third)
    return {StatusCode::kNotFound,
        "view " + std::to_string (view.id) + ": has no third camera; expected `third` in the rig"};
  if (Status s = rectify (view); !s.ok ())
    return s;
  map_range_view (view, range_view, focal_baseline);
  double low, high;
  cv::minMaxLoc (factor_, &low, &high);
  const double scale = pair_.focal_baseline / focal_baseline;
  precision_ = scale;
  if (Status s = finder_.set (
          pair_, settings, range_view.near_m * low * scale, range_view.far_m * high * scale);
      !s.ok ())
    return bad_third (view, s.message ().c_str ());
  return {};
}

void
ThirdPair::take (const cv::Mat &left, const cv::Mat &third)
{
  cv::remap (left, pictures_[0], maps_[0][0], maps_[0][1], cv::INTER_LINEAR);
  cv::remap (third, pictures_[1], maps_[1][0], maps_[1][1], cv::INTER_LINEAR);
}

Roi
ThirdPair::bounding_box (const Roi &roi) const
{
  int low[2] = {pair_.width, pair_.height}, high[2] = {-1, -1};
  const auto look = [&] (int x, int y) {
    const cv::Vec2s &at = where_.at<cv::Vec2s> (y, x);
    for (int i = 0; i < 2 && at[0] >= 0; i++) {
      low[i] = std::min<int> (low[i], at[i]);
      high[i] = std::max<int> (high[i], at[i]);
    }
  };
  for (int x = roi.x; x < roi.x + roi.width; x++)
    for (int y : {roi.y, roi.y + roi.height - 1})
      look (x, y);
  for (int y = roi.y; y < roi.y + roi.height; y++)
    for (int x : {roi.x, roi.x + roi.width - 1})
      look (x, y);
  if (high[0] < low[0])
    return {};
  return {low[0], low[1], high[0] - low[0] + 1, high[1] - low[1] + 1};
}

Status
ThirdPair::find (const Roi &roi, double near_m, double far_m)
{
  disparity_.create (roi.height, roi.width, CV_16U);
  const Roi there = bounding_box (roi);
  if (there.empty ()) {
    disparity_.setTo (0);
    return {};
  }
  const Status status = finder_.find (pictures_[0], pictures_[1], there, near_m, far_m);
  if (!status.ok ())
    return status;
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
  return {};
}

/* Pixels around (x, y) of `of` that agree with disparity d. */
static int
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
