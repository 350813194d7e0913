/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "axis.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

namespace rangecast {
namespace {

/* Below this ratio of the two largest variances the points are as good as round. */
constexpr double kMinSpreadRatio = 1.3;
/* Weight of the new frame's axis, from `min` where it is nearly the same, which is noise, to `max`
 * where it is `far` off, which is motion. Three frames after a step a tenth of it is left. */
struct Follow {
  double min, max, far;
  [[nodiscard]] double share (double off) const
  {
    return min + (max - min) * std::min (1.0, off / far);
  }
};
constexpr Follow kFollowPosition{0.2, 0.8, 0.02};             /* metres */
constexpr Follow kFollowDirection{0.05, 0.7, 8 * M_PI / 180}; /* radians */

/* One Jacobi rotation that makes a[p][q] zero; v collects the eigenvectors in its columns. */
void
rotate (double (&a)[3][3], double (&v)[3][3], int p, int q)
{
  if (a[p][q] == 0)
    return;
  const double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
  const double t = (theta >= 0 ? 1 : -1) / (std::abs (theta) + std::sqrt (theta * theta + 1));
  const double c = 1 / std::sqrt (t * t + 1), s = t * c;
  for (auto &row : a)
    std::tie (row[p], row[q]) = std::pair (c * row[p] - s * row[q], s * row[p] + c * row[q]);
  for (int k = 0; k < 3; k++)
    std::tie (a[p][k], a[q][k]) = std::pair (c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]);
  for (auto &row : v)
    std::tie (row[p], row[q]) = std::pair (c * row[p] - s * row[q], s * row[p] + c * row[q]);
}

/* Eigenvalues, largest first, and unit eigenvectors of a symmetric matrix (xx xy xz yy yz zz), by
 * cyclic Jacobi rotations. */
void
eigen_symmetric (const double (&m)[6], double (&values)[3], Vec3 (&vectors)[3])
{
  double a[3][3] = {{m[0], m[1], m[2]}, {m[1], m[3], m[4]}, {m[2], m[4], m[5]}};
  double v[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  for (int sweep = 0; sweep < 12; sweep++)
    for (auto [p, q] : {std::pair (0, 1), std::pair (0, 2), std::pair (1, 2)})
      rotate (a, v, p, q);
  int order[3] = {0, 1, 2};
  std::sort (order, order + 3, [&] (int i, int j) { return a[i][i] > a[j][j]; });
  for (int k = 0; k < 3; k++) {
    values[k] = a[order[k]][order[k]];
    vectors[k] = {v[0][order[k]], v[1][order[k]], v[2][order[k]]};
  }
}

/* The largest |cosine| between a direction and a camera's optical axis: 1 = some camera looks along
 * it. */
double
max_cosine (Vec3 direction, std::span<const PixelRays> cameras)
{
  double max = 0;
  for (const PixelRays &camera : cameras) {
    const float *a = camera.optical_axis;
    max = std::max (max, std::abs (dot (direction, {a[0], a[1], a[2]})));
  }
  return max;
}

} // namespace

void
Moments::add (double x, double y, double z)
{
  n++;
  sum[0] += x, sum[1] += y, sum[2] += z;
  product[0] += x * x, product[1] += x * y, product[2] += x * z;
  product[3] += y * y, product[4] += y * z, product[5] += z * z;
}

Moments &
Moments::operator+= (const Moments &other)
{
  n += other.n;
  for (int k = 0; k < 3; k++)
    sum[k] += other.sum[k];
  for (int k = 0; k < 6; k++)
    product[k] += other.product[k];
  return *this;
}

Vec3
Moments::centroid () const
{
  return n > 0 ? Vec3{sum[0] / n, sum[1] / n, sum[2] / n} : Vec3{};
}

Axis
axis_of_points (AxisMode mode, const Moments &moments, std::span<const PixelRays> cameras)
{
  Axis axis;
  axis.position = moments.centroid ();
  if (mode != AxisMode::kPrincipal || moments.n < 3)
    return axis;
  const Vec3 c = axis.position;
  const double n = moments.n, *p = moments.product;
  const double covariance[6] = {p[0] / n - c.x * c.x, p[1] / n - c.x * c.y, p[2] / n - c.x * c.z,
      p[3] / n - c.y * c.y, p[4] / n - c.y * c.z, p[5] / n - c.z * c.z};
  double values[3];
  Vec3 vectors[3];
  eigen_symmetric (covariance, values, vectors);
  if (!(values[0] > kMinSpreadRatio * values[1]) || !(values[0] > 1e-12))
    return axis;
  const Vec3 direction = vectors[0].y < 0 ? -1.0 * vectors[0] : vectors[0];
  const double along = max_cosine (direction, cameras);
  if (along > 0.8 && along > max_cosine (axis.direction, cameras))
    return axis;
  axis.direction = direction;
  return axis;
}

const Axis &
AxisTracker::follow (const Axis &measured)
{
  if (!started_) {
    started_ = true;
    axis_ = measured;
    return axis_;
  }
  const Vec3 move = measured.position - axis_.position;
  axis_.position = axis_.position + kFollowPosition.share (norm (move)) * move;
  /* A nearly level axis may come back the other way round; it is the same line. */
  const double cosine = dot (axis_.direction, measured.direction);
  const double share = kFollowDirection.share (std::acos (std::min (1.0, std::abs (cosine))));
  const Vec3 blend =
      (1 - share) * axis_.direction + (cosine < 0 ? -share : share) * measured.direction;
  axis_.direction = 1 / norm (blend) * blend;
  return axis_;
}

} // namespace rangecast
