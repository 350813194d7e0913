/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Conversions of poses and lenses to OpenCV types, for .cpp files of this folder. */
#pragma once

#include <opencv2/calib3d.hpp>

#include "lens.hpp"

namespace rangecast {

inline cv::Point3f
opencv_point (const Vec3 &p)
{
  return {float (p.x), float (p.y), float (p.z)};
}

inline Pose
pose_from_opencv (const cv::Mat &rotation, const cv::Mat &translation)
{
  cv::Mat r = rotation;
  if (rotation.total () == 3)
    cv::Rodrigues (rotation, r);
  Pose pose;
  for (int i = 0; i < 9; i++)
    pose.rotation[i] = r.at<double> (i / 3, i % 3);
  pose.translation = {
      translation.at<double> (0), translation.at<double> (1), translation.at<double> (2)};
  return pose;
}

inline cv::Matx33d
camera_matrix (const LensParameters &lens)
{
  return {lens[0], 0, lens[2], 0, lens[1], lens[3], 0, 0, 1};
}

inline std::vector<double>
coefficients (const LensParameters &lens)
{
  return {lens.begin () + 4, lens.end ()};
}

} // namespace rangecast
