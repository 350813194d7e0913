/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "rectified_pose.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace rangecast {
namespace {

/* Axis times angle, of rotations by less than 180 degrees. */
Vec3
rotation_vector (const Mat3 &r)
{
  const Vec3 axis = {r[7] - r[5], r[2] - r[6], r[3] - r[1]}; /* times 2 sin (angle) */
  const double sine = norm (axis) / 2, cosine = (r[0] + r[4] + r[8] - 1) / 2;
  return sine > 0 ? (std::atan2 (sine, cosine) / (2 * sine)) * axis : Vec3{};
}

/* Rodrigues' formula. */
Mat3
rotation_matrix (const Vec3 &vector)
{
  const double angle = norm (vector);
  if (angle == 0)
    return kIdentity3;
  const Vec3 a = (1 / angle) * vector;
  const double c = std::cos (angle), s = std::sin (angle), d = 1 - c;
  return {c + d * a.x * a.x, d * a.x * a.y - s * a.z, d * a.x * a.z + s * a.y,
      d * a.y * a.x + s * a.z, c + d * a.y * a.y, d * a.y * a.z - s * a.x, d * a.z * a.x - s * a.y,
      d * a.z * a.y + s * a.x, c + d * a.z * a.z};
}

} // namespace

bool
is_rectified (const View &view)
{
  const PartnerCamera &right = *view.right;
  const Vec3 &t = right.partner_from_left.translation;
  for (int i = 0; i < 9; i++)
    if (std::abs (right.partner_from_left.rotation[i] - kIdentity3[i]) > 1e-9)
      return false;
  const auto is_zero = [] (double v) { return v == 0; };
  return std::ranges::all_of (view.distortion, is_zero) &&
         std::ranges::all_of (right.distortion, is_zero) && std::abs (t.y) < 1e-9 &&
         std::abs (t.z) < 1e-9 && view.intrinsics.fx == right.intrinsics.fx &&
         view.intrinsics.fy == right.intrinsics.fy && view.intrinsics.cy == right.intrinsics.cy;
}

std::string
describe_misalignment (const View &view)
{
  constexpr double kMaxTurnDeg = 10;
  const auto degrees = [] (double sine) { return std::asin (std::min (sine, 1.)) * 180 / M_PI; };
  const Pose left_from_right = view.right->partner_from_left.inverse ();
  const Vec3 axis = left_from_right.rotation * Vec3{0, 0, 1}, ahead = Vec3{0, 0, 1} + axis;
  const Vec3 right = left_from_right.translation;
  const double baseline = norm (right), forward = dot (right, ahead) / norm (ahead);
  char text[200] = "";
  if (const double turn = 2 * degrees (norm (axis - Vec3{0, 0, 1}) / 2); turn > kMaxTurnDeg)
    std::snprintf (text, sizeof text,
        "the cameras look in directions that differ by %.1f degrees; mount them parallel", turn);
  else if (degrees (std::abs (forward) / baseline) > kMaxTurnDeg)
    std::snprintf (text, sizeof text,
        "the right camera stands %.3f m %s the left one, at a distance of %.3f m; mount them side "
        "by side",
        std::abs (forward), forward > 0 ? "ahead of" : "behind", baseline);
  return text[0] ? "view " + std::to_string (view.id) + ": " + text : "";
}

Mat3
rectifying_rotation (const Pose &partner_from_left)
{
  const Mat3 half = rotation_matrix (-0.5 * rotation_vector (partner_from_left.rotation));
  const Vec3 baseline = half * partner_from_left.translation;
  const Vec3 turn = cross (baseline, {baseline.x > 0 ? 1. : -1., 0, 0});
  const double sine = norm (turn);
  const double angle = std::atan2 (sine, std::abs (baseline.x));
  return (sine > 0 ? rotation_matrix ((angle / sine) * turn) : kIdentity3) * transposed (half);
}

} // namespace rangecast
