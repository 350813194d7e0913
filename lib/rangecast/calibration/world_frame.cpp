/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "world_frame.hpp"

#include <cmath>
#include <opencv2/core.hpp>

namespace rangecast {
namespace {

Vec3
normalised (Vec3 v)
{
  return 1 / norm (v) * v;
}

Vec3
column (const Pose &pose, int i)
{
  return {pose.rotation[i], pose.rotation[3 + i], pose.rotation[6 + i]};
}

/* A world with this y axis and the z axis closest to `towards`. */
Pose
world_from (Vec3 origin, Vec3 up, Vec3 towards)
{
  const Vec3 y = normalised (up);
  Vec3 flat = towards - dot (towards, y) * y;
  if (norm (flat) < 1e-6) { /* parallel: any direction is as good */
    const Vec3 any = std::abs (y.x) < 0.9 ? Vec3{1, 0, 0} : Vec3{0, 1, 0};
    flat = any - dot (any, y) * y;
  }
  const Vec3 z = normalised (flat), x = cross (y, z);
  Pose pose{{x.x, x.y, x.z, y.x, y.y, y.z, z.x, z.y, z.z}, {}};
  pose.translation = -1 * (pose.rotation * origin);
  return pose;
}

Vec3
mean (std::span<const Vec3> points)
{
  Vec3 sum;
  for (const Vec3 &p : points)
    sum = sum + p;
  return 1.0 / double (points.size ()) * sum;
}

/* The point closest to the optical axes in the least-squares sense; the centre of the boards if the
 * axes are parallel, or meet behind a camera or far beyond all boards.
 */
Vec3
looked_at (std::span<const Pose> cameras, Vec3 middle)
{
  if (cameras.size () == 1) {
    const Vec3 axis = column (cameras[0], 2), at = cameras[0].translation;
    return at + dot (axis, middle - at) * axis;
  }
  cv::Matx33d a = cv::Matx33d::zeros ();
  cv::Vec3d b (0, 0, 0);
  double farthest = 0;
  for (const Pose &camera : cameras) {
    const Vec3 d = column (camera, 2), c = camera.translation;
    const cv::Vec3d direction (d.x, d.y, d.z);
    const cv::Matx33d across = cv::Matx33d::eye () - direction * direction.t ();
    a = a + across;
    b += across * cv::Vec3d (c.x, c.y, c.z);
    farthest = std::max (farthest, norm (middle - c));
  }
  cv::Vec3d values;
  cv::Matx33d vectors;
  if (!cv::eigen (a, values, vectors) || values[2] < 0.01 * double (cameras.size ()))
    return middle;
  const cv::Vec3d p = a.inv () * b;
  const Vec3 point{p[0], p[1], p[2]};
  for (const Pose &camera : cameras) {
    const double depth = dot (column (camera, 2), point - camera.translation);
    if (!(depth > 0 && depth < 3 * farthest))
      return middle;
  }
  return point;
}

} // namespace

Pose
place_world (WorldFrame frame, std::span<const Pose> first_from_camera,
    std::span<const Vec3> boards, const Pose &first_from_board)
{
  const Vec3 first = first_from_camera[0].translation;
  if (frame == WorldFrame::kFirstView)
    return world_from (first, {0, -1, 0}, {0, 0, -1});
  const Vec3 middle = mean (boards);
  if (frame == WorldFrame::kBoard) {
    const Vec3 origin = first_from_board.translation;
    Vec3 up = column (first_from_board, 2);
    if (dot (up, first - origin) < 0)
      up = -1 * up;
    return world_from (origin, up, first - origin);
  }
  Vec3 up;
  for (const Pose &camera : first_from_camera)
    up = up - column (camera, 1);
  if (norm (up) < 1e-3)
    up = {0, -1, 0};
  const Vec3 origin = looked_at (first_from_camera, middle);
  return world_from (origin, up, first - origin);
}

} // namespace rangecast
