/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cmath>
#include <vector>

namespace rangecast {

/** A point or direction; metres unless said otherwise. */
struct Vec3 {
  double x = 0, y = 0, z = 0;

  friend Vec3 operator+ (Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  friend Vec3 operator- (Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend Vec3 operator* (double s, Vec3 a) { return {s * a.x, s * a.y, s * a.z}; }
};

inline double
dot (Vec3 a, Vec3 b)
{
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
inline Vec3
cross (Vec3 a, Vec3 b)
{
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline double
norm (Vec3 a)
{
  return std::sqrt (dot (a, a));
}

/** 3x3, row-major. */
using Mat3 = std::array<double, 9>;
inline constexpr Mat3 kIdentity3 = {1, 0, 0, 0, 1, 0, 0, 0, 1};

inline Vec3
operator* (const Mat3 &m, Vec3 v)
{
  return {m[0] * v.x + m[1] * v.y + m[2] * v.z, m[3] * v.x + m[4] * v.y + m[5] * v.z,
      m[6] * v.x + m[7] * v.y + m[8] * v.z};
}
inline Mat3
operator* (const Mat3 &a, const Mat3 &b)
{
  Mat3 c{};
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++)
      for (int k = 0; k < 3; k++)
        c[3 * i + j] += a[3 * i + k] * b[3 * k + j];
  return c;
}
inline Mat3
transposed (const Mat3 &m)
{
  return {m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8]};
}

/** A rigid motion named to-from: with Pose a_from_b, X_a = rotation * X_b + translation. */
struct Pose {
  Mat3 rotation = kIdentity3;
  Vec3 translation; ///< metres

  friend Vec3 operator* (const Pose &p, Vec3 v) { return p.rotation * v + p.translation; }
  friend Pose operator* (const Pose &a, const Pose &b)
  {
    return {a.rotation * b.rotation, a.rotation * b.translation + a.translation};
  }
  [[nodiscard]] Pose inverse () const
  {
    const Mat3 rt = transposed (rotation);
    return {rt, -1.0 * (rt * translation)};
  }
};

/** Pinhole intrinsics, at the size of the image they belong to. */
struct Intrinsics {
  double fx = 0, fy = 0; ///< focal length, pixels
  double cx = 0, cy = 0; ///< principal point, pixels; (0, 0) is the centre of the top-left pixel

  /** The camera-frame point (x right, y down, z forward) of pixel (u, v) at depth z metres. */
  [[nodiscard]] Vec3 unproject (double u, double v, double z) const
  {
    return {(u - cx) / fx * z, (v - cy) / fy * z, z};
  }

  /** Of the same camera, its image scaled. (0, 0) is the centre of the first pixel, so it is that
   *  pixel's corner, at -0.5, that stays where it is. @param sx, sy  > 0 */
  [[nodiscard]] Intrinsics scaled (double sx, double sy) const
  {
    return {fx * sx, fy * sy, (cx + 0.5) * sx - 0.5, (cy + 0.5) * sy - 0.5};
  }
};

/** Lens distortion in OpenCV's order (k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4 [tx ty]]]]):
 *  0 (none), 4, 5, 8, 12 or 14 coefficients. */
using Distortion = std::vector<double>;

} // namespace rangecast
