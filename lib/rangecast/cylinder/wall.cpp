/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "wall.hpp"

#include <algorithm>
#include <limits>
#include <opencv2/core/hal/intrin.hpp>

namespace rangecast {

constexpr float kAtan[] = {
    0.99997726f, -0.33262347f, 0.19354346f, -0.11643287f, 0.05265332f, -0.01172120f};
constexpr float kPi = 3.14159265f;

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

/* Where a point goes, with plain arithmetic: the twin of the vector loop, and its tail. */
struct ToWall {
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
    column = std::min (
        static_cast<std::int32_t> (fast_atan2 (pz, px) * columns_per_radian), last_column);
  }
};

#if CV_SIMD128
/* Four points at a time; the same operations in the same order as ToWall. */
static std::size_t
to_wall_4 (const ToWall &to, float *x, float *y, float *z, float *radius, std::int32_t *column,
    std::size_t n, WallRange &range)
{
  using cv::v_float32x4;
  auto all = [] (float value) { return cv::v_setall_f32 (value); };
  const v_float32x4 ox = all (to.origin[0]), oy = all (to.origin[1]), oz = all (to.origin[2]);
  const v_float32x4 m0 = all (to.rotation[0]), m1 = all (to.rotation[1]), m2 = all (to.rotation[2]);
  const v_float32x4 m3 = all (to.rotation[3]), m4 = all (to.rotation[4]), m5 = all (to.rotation[5]);
  const v_float32x4 m6 = all (to.rotation[6]), m7 = all (to.rotation[7]), m8 = all (to.rotation[8]);
  const v_float32x4 zero = all (0), tiny = all (std::numeric_limits<float>::min ());
  const v_float32x4 scale = all (to.columns_per_radian);
  const cv::v_int32x4 last = cv::v_setall_s32 (to.last_column);
  v_float32x4 lowest = all (range.y_min), highest = all (range.y_max);
  std::size_t i = 0;
  for (; i + 4 <= n; i += 4) {
    const v_float32x4 wx = cv::v_load (x + i) - ox, wy = cv::v_load (y + i) - oy,
                      wz = cv::v_load (z + i) - oz;
    const v_float32x4 px = m0 * wx + m1 * wy + m2 * wz, py = m3 * wx + m4 * wy + m5 * wz,
                      pz = m6 * wx + m7 * wy + m8 * wz;
    cv::v_store (x + i, px);
    cv::v_store (y + i, py);
    cv::v_store (z + i, pz);
    lowest = cv::v_min (lowest, py);
    highest = cv::v_max (highest, py);
    cv::v_store (radius + i, cv::v_sqrt (px * px + pz * pz));
    const v_float32x4 ax = cv::v_abs (px), az = cv::v_abs (pz);
    const v_float32x4 q = cv::v_min (ax, az) / cv::v_max (cv::v_max (ax, az), tiny), s = q * q;
    v_float32x4 a = all (kAtan[5]);
    for (int k = 4; k >= 0; k--)
      a = a * s + all (kAtan[k]);
    a = a * q;
    a = cv::v_select (az > ax, all (kPi / 2) - a, a);
    a = cv::v_select (px < zero, all (kPi) - a, a);
    a = cv::v_select (pz < zero, all (2 * kPi) - a, a);
    cv::v_store (column + i, cv::v_min (cv::v_trunc (a * scale), last));
  }
  range.y_min = cv::v_reduce_min (lowest);
  range.y_max = cv::v_reduce_max (highest);
  return i;
}
#endif

WallRange
to_wall (WorldPoints &cloud, WorldPoints::Part part, const CylinderFrame &frame, int columns,
    float *radius, std::int32_t *column)
{
  ToWall to;
  const double origin[] = {frame.origin.x, frame.origin.y, frame.origin.z};
  std::copy_n (origin, 3, to.origin);
  std::copy_n (frame.rotation.begin (), 9, to.rotation);
  to.columns_per_radian = static_cast<float> (columns) / (2 * kPi);
  to.last_column = columns - 1;

  constexpr float kHuge = std::numeric_limits<float>::max ();
  WallRange range{kHuge, -kHuge};
  float *x = cloud.x.data () + part.begin, *y = cloud.y.data () + part.begin,
        *z = cloud.z.data () + part.begin;
  radius += part.begin;
  column += part.begin;
  std::size_t i = 0;
#if CV_SIMD128
  i = to_wall_4 (to, x, y, z, radius, column, part.size (), range);
#endif
  for (; i < part.size (); i++) {
    to (x[i], y[i], z[i], radius[i], column[i]);
    range.y_min = std::min (range.y_min, y[i]);
    range.y_max = std::max (range.y_max, y[i]);
  }
  return range;
}

} // namespace rangecast
