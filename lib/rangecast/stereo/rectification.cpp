/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "rectification.hpp"

#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "../geometry/rectified_pose.hpp"

namespace rangecast {
namespace {

cv::Mat
camera_matrix (const Intrinsics &k)
{
  return (cv::Mat_<double> (3, 3) << k.fx, 0, k.cx, 0, k.fy, k.cy, 0, 0, 1);
}

Status
bad_pair (const View &view, const char *what)
{
  return {StatusCode::kBadValue, "view " + std::to_string (view.id) + ": " + what};
}

} // namespace

Status
Rectifier::set (const View &view)
{
  if (!view.right)
    return {StatusCode::kNotFound, "view " + std::to_string (view.id) + ": has no right camera"};
  range_view_ = view;
  range_view_.distortion.clear ();
  range_view_.right.reset ();
  range_view_.third.reset ();
  for (auto &maps : maps_)
    for (cv::Mat &map : maps)
      map.release ();
  if (!is_rectified (view))
    return compute_rectification (view);
  baseline_m_ = -view.right->partner_from_left.translation.x;
  principal_offset_ = view.right->intrinsics.cx - view.intrinsics.cx;
  if (baseline_m_ <= 0)
    return bad_pair (view, "left and right cameras are swapped");
  return {};
}

Status
Rectifier::compute_rectification (const View &view)
{
  const PartnerCamera &right = *view.right;
  const Vec3 &t = right.partner_from_left.translation;
  const cv::Size size (view.width, view.height);
  const cv::Mat k1 = camera_matrix (view.intrinsics), k2 = camera_matrix (right.intrinsics);
  const cv::Mat rotation (cv::Matx33d (right.partner_from_left.rotation.data ())),
      translation = (cv::Mat_<double> (3, 1) << t.x, t.y, t.z);
  cv::Mat r1, r2, p1, p2, q;
  try {
    cv::stereoRectify (k1, view.distortion, k2, right.distortion, size, rotation, translation, r1,
        r2, p1, p2, q, cv::CALIB_ZERO_DISPARITY, 0);
    cv::initUndistortRectifyMap (
        k1, view.distortion, r1, p1, size, CV_16SC2, maps_[0][0], maps_[0][1]);
    cv::initUndistortRectifyMap (
        k2, right.distortion, r2, p2, size, CV_16SC2, maps_[1][0], maps_[1][1]);
  } catch (const cv::Exception &) {
    return bad_pair (view, "cannot be rectified; calibrate it again");
  }
  const double fx = p1.at<double> (0, 0);
  if (std::abs (p2.at<double> (1, 3)) > std::abs (p2.at<double> (0, 3)))
    return bad_pair (view, "its cameras stand one above the other, or one lies on its side or is "
                           "upside down; put them side by side and the same way up");
  baseline_m_ = -p2.at<double> (0, 3) / fx;
  principal_offset_ = p2.at<double> (0, 2) - p1.at<double> (0, 2);
  if (!(baseline_m_ > 0))
    return bad_pair (view, "left and right cameras are swapped");
  range_view_.intrinsics = {fx, p1.at<double> (1, 1), p1.at<double> (0, 2), p1.at<double> (1, 2)};
  Pose left_from_rectified;
  for (int i = 0; i < 9; i++)
    left_from_rectified.rotation[i] = r1.at<double> (i % 3, i / 3); /* transposed */
  range_view_.world_from_view = view.world_from_view * left_from_rectified;
  return validate ({{range_view_}});
}

void
Rectifier::rectify (int camera, const cv::Mat &in, cv::Mat &out) const
{
  if (is_identity ())
    in.copyTo (out);
  else
    cv::remap (in, out, maps_[camera][0], maps_[camera][1], cv::INTER_LINEAR);
}

} // namespace rangecast
