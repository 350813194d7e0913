/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "cylindrical_projection.hpp"

#include <algorithm>
#include <limits>

#include "../base/simd.hpp"

namespace rangecast {
namespace {

constexpr float kAtan[] = {
    0.99997726f, -0.33262347f, 0.19354346f, -0.11643287f, 0.05265332f, -0.01172120f};
constexpr float kPi = 3.14159265f;

} // namespace

CylinderFrame::CylinderFrame (const Axis &axis) : origin (axis.position)
{
  const Vec3 y = axis.direction;
  const Vec3 near_z = std::abs (y.z) < 0.9 ? Vec3{0, 0, 1} : Vec3{1, 0, 0};
  Vec3 z = near_z - dot (near_z, y) * y;
  z = 1 / norm (z) * z;
  const Vec3 x = cross (y, z);
  rotation = {x.x, x.y, x.z, y.x, y.y, y.z, z.x, z.y, z.z};
}

float
fast_atan2 (float y, float x)
{
  const float ax = std::abs (x), ay = std::abs (y);
  const float high = std::max (ax, ay), low = std::min (ax, ay);
  const float q = low / std::max (high, std::numeric_limits<float>::min ()), s = q * q;
  float a = kAtan[5];
  for (int k = 4; k >= 0; k--)
    a = a * s + kAtan[k];
  a *= q;
  a = ay > ax ? kPi / 2 - a : a;
  a = x < 0 ? kPi - a : a;
  return y < 0 ? 2 * kPi - a : a;
}

namespace {

/* The projection of one point in scalar arithmetic: the twin of the vector loop, and its tail. */
struct Projection {
  float origin[3], rotation[9], columns_per_radian;
  int last_column;

  void operator() (float &px, float &py, float &pz, float &radius, std::int32_t &column) const
  {
    const float x = px - origin[0], y = py - origin[1], z = pz - origin[2];
    const float *m = rotation;
    px = m[0] * x + m[1] * y + m[2] * z;
    py = m[3] * x + m[4] * y + m[5] * z;
    pz = m[6] * x + m[7] * y + m[8] * z;
    radius = std::sqrt (px * px + pz * pz);
    column = std::clamp (
        static_cast<std::int32_t> (fast_atan2 (pz, px) * columns_per_radian), 0, last_column);
  }
};

/* Some points at a time; the same operations in the same order as Projection. */
template <typename L> struct ProjectionLoop {
  using F = typename L::F;
  using I = typename L::I;
  static constexpr int kLanes = L::kLanes;

  const Projection &to;
  float *x, *y, *z, *radius;
  std::int32_t *column;
  std::size_t n;

  static void find_angle (F &a, const F &px, const F &pz)
  {
    F ax = px, az = pz;
    L::make_positive (ax);
    L::make_positive (az);
    const F tiny = std::numeric_limits<float>::min () + F{};
    const F high = ax > az ? ax : az, low = ax > az ? az : ax;
    const F q = low / (high > tiny ? high : tiny), s = q * q;
    a = kAtan[5] + F{};
    for (int k = 4; k >= 0; k--)
      a = a * s + kAtan[k];
    a *= q;
    a = az > ax ? kPi / 2 - a : a;
    a = px < 0 ? kPi - a : a;
    a = pz < 0 ? 2 * kPi - a : a;
  }

  std::size_t run (HeightRange &range) const
  {
    const float *m = to.rotation;
    F lowest = range.y_min + F{}, highest = range.y_max + F{};
    const I last = to.last_column + I{};
    std::size_t i = 0;
    for (; i + kLanes <= n; i += kLanes) {
      const F wx = L::at (x + i) - to.origin[0], wy = L::at (y + i) - to.origin[1],
              wz = L::at (z + i) - to.origin[2];
      const F px = m[0] * wx + m[1] * wy + m[2] * wz, py = m[3] * wx + m[4] * wy + m[5] * wz,
              pz = m[6] * wx + m[7] * wy + m[8] * wz;
      L::at (x + i) = px;
      L::at (y + i) = py;
      L::at (z + i) = pz;
      lowest = py < lowest ? py : lowest;
      highest = py > highest ? py : highest;
      F r = px * px + pz * pz;
      L::make_root (r);
      L::at (radius + i) = r;
      F angle;
      find_angle (angle, px, pz);
      const F at = angle * to.columns_per_radian;
      const I c = __builtin_convertvector(at, I);
      const I below = c < last ? c : last;
      L::at (column + i) = below > 0 ? below : I{};
    }
    for (int l = 0; l < kLanes && i > 0; l++) {
      range.y_min = std::min (range.y_min, lowest[l]);
      range.y_max = std::max (range.y_max, highest[l]);
    }
    return i;
  }
};

} // namespace

HeightRange
project_to_cylinder (WorldPoints &cloud, WorldPoints::Part part, const CylinderFrame &frame,
    int columns, float *radius, std::int32_t *column)
{
  Projection to;
  const double origin[] = {frame.origin.x, frame.origin.y, frame.origin.z};
  std::copy_n (origin, 3, to.origin);
  std::copy_n (frame.rotation.begin (), 9, to.rotation);
  to.columns_per_radian = static_cast<float> (columns) / (2 * kPi);
  to.last_column = columns - 1;

  constexpr float kHuge = std::numeric_limits<float>::max ();
  HeightRange range{kHuge, -kHuge};
  float *x = cloud.x.data () + part.begin, *y = cloud.y.data () + part.begin,
        *z = cloud.z.data () + part.begin;
  radius += part.begin;
  column += part.begin;
  const std::size_t n = part.size ();
  std::size_t i = for_this_cpu ([&]<typename L> (L) {
    return ProjectionLoop<L>{to, x, y, z, radius, column, n}.run (range);
  });
  for (; i < n; i++) {
    to (x[i], y[i], z[i], radius[i], column[i]);
    range.y_min = std::min (range.y_min, y[i]);
    range.y_max = std::max (range.y_max, y[i]);
  }
  return range;
}

} // namespace rangecast
