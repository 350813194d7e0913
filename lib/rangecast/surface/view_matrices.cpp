/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "view_matrices.hpp"

#include <algorithm>

namespace rangecast {
namespace {

/* Row of the matrix that makes one clip coordinate. */
Vec3
row_of (const Mat4 &m, std::size_t i)
{
  return {m[i], m[4 + i], m[8 + i]};
}

} // namespace

Mat4
clip_from_pixel (const Mat4 &clip_from_world, const View &view, const Roi &roi)
{
  const Mat3 &r = view.world_from_view.rotation;
  const Vec3 &t = view.world_from_view.translation;
  const Intrinsics &lens = view.intrinsics;
  const double unit = view.depth_unit_m, x = unit / lens.fx, y = unit / lens.fy;
  const double cx = lens.cx - roi.x, cy = lens.cy - roi.y;
  Mat4 product;
  for (std::size_t i = 0; i < 4; i++) {
    const Vec3 row = row_of (clip_from_world, i);
    const double right = x * dot (row, {r[0], r[3], r[6]}),
                 down = y * dot (row, {r[1], r[4], r[7]});
    product[i] = static_cast<float> (right);
    product[4 + i] = static_cast<float> (down);
    product[8 + i] =
        static_cast<float> (unit * dot (row, {r[2], r[5], r[8]}) - cx * right - cy * down);
    product[12 + i] = static_cast<float> (dot (row, t) + clip_from_world[12 + i]);
  }
  return product;
}

Mat4
in_half_of_depths (Mat4 clip_matrix, bool farther)
{
  for (std::size_t i = 0; i < 4; i++)
    clip_matrix[4 * i + 2] =
        (clip_matrix[4 * i + 2] + (farther ? 1.f : -1.f) * clip_matrix[4 * i + 3]) / 2;
  return clip_matrix;
}

/* The point that the matrix maps to x = y = w = 0. */
Vec3
viewer_position (const Mat4 &clip_from_world)
{
  const Mat4 &m = clip_from_world;
  const Vec3 x = row_of (m, 0), y = row_of (m, 1), w = row_of (m, 3);
  const double volume = dot (x, cross (y, w));
  const Vec3 sum = static_cast<double> (m[12]) * cross (y, w) +
                   static_cast<double> (m[13]) * cross (w, x) +
                   static_cast<double> (m[15]) * cross (x, y);
  return (-1 / volume) * sum;
}

double
view_alignment (const Mat4 &clip_from_world, const View &view)
{
  const Vec3 forward = row_of (clip_from_world, 3);
  const Mat3 &r = view.world_from_view.rotation;
  return dot (forward, {r[2], r[5], r[8]}) / norm (forward);
}

bool
mirrors (const Mat4 &clip_from_world)
{
  const Mat4 &m = clip_from_world;
  return dot (cross (row_of (m, 0), row_of (m, 1)), row_of (m, 3)) > 0;
}

DepthShift
depth_shift (const Mat4 &clip_matrix, const Mat4 &clip_from_world, double gap_m)
{
  const Vec3 z = row_of (clip_matrix, 2), w = row_of (clip_matrix, 3);
  const double a = dot (z, w) / dot (w, w);
  const double g = std::max (gap_m * norm (row_of (clip_from_world, 3)), 1e-6);
  return {static_cast<float> (a), static_cast<float> (clip_matrix[14] - a * clip_matrix[15]),
      static_cast<float> (g)};
}

} // namespace rangecast
