/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "point_cloud.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace rangecast {

std::size_t
count_points (const ConstRangeImage &image)
{
  std::size_t points = 0;
  for (int y = 0; y < image.depth.height; y++) {
    const std::uint16_t *row = image.depth.row (y);
    points += static_cast<std::size_t> (
        image.depth.width - std::count (row, row + image.depth.width, kInvalidDepth));
  }
  return points;
}

std::uint16_t
depth_units (double metres, double unit_m)
{
  return static_cast<std::uint16_t> (std::clamp (std::round (metres / unit_m), 1.0, 65535.0));
}

Status
rescale_depth (ImageView<const std::uint16_t> in, double factor, std::uint16_t near,
    std::uint16_t far, ImageView<std::uint16_t> out)
{
  if (!in.same_size (out))
    return {StatusCode::kBadSize, "rescale_depth: input and output differ in size"};
  for (int y = 0; y < in.height; y++) {
    const std::uint16_t *from = in.row (y);
    std::uint16_t *to = out.row (y);
    for (int x = 0; x < in.width; x++) {
      const double depth = std::floor (from[x] * factor + 0.5);
      const bool valid = from[x] != kInvalidDepth && depth >= near && depth <= far;
      to[x] = valid ? static_cast<std::uint16_t> (depth) : kInvalidDepth;
    }
  }
  return {};
}

DepthRange
find_depth_range (ImageView<const std::uint16_t> depth)
{
  DepthRange range = {65536, 0, 0};
  for (int y = 0; y < depth.height; y++)
    for (const std::uint16_t *z = depth.row (y); z < depth.row (y) + depth.width; z++)
      if (*z != 0)
        range = {std::min<int> (range.min, *z), std::max<int> (range.max, *z), range.count + 1};
  return range.max == 0 ? DepthRange{} : range;
}

/* ---- normals ---- */

namespace {

constexpr int kNormalRadius = 2; /* pixels to each side through which the plane is fitted */
constexpr double kNormalDepthStep = 0.03; /* share of the depth; beyond it is another surface */

/* Sums for the plane 1 / depth = a u + b v + c, u and v from the pixel in the middle. */
struct PlaneSums {
  double n = 0, u = 0, v = 0, uu = 0, uv = 0, vv = 0, w = 0, uw = 0, vw = 0;

  void add (double du, double dv, double inverse_depth)
  {
    n += 1;
    u += du;
    v += dv;
    uu += du * du;
    uv += du * dv;
    vv += dv * dv;
    w += inverse_depth;
    uw += du * inverse_depth;
    vw += dv * inverse_depth;
  }
};

PlaneSums
sum_around (const ConstRangeImage &image, int x, int y)
{
  const double depth = image.depth.at (x, y);
  const int left = std::max (x - kNormalRadius, 0), top = std::max (y - kNormalRadius, 0);
  const int right = std::min (x + kNormalRadius, image.depth.width - 1);
  const int bottom = std::min (y + kNormalRadius, image.depth.height - 1);
  PlaneSums sums;
  for (int row = top; row <= bottom; row++) {
    const std::uint16_t *depths = image.depth.row (row);
    for (int column = left; column <= right; column++)
      if (depths[column] != kInvalidDepth &&
          std::abs (depths[column] - depth) < kNormalDepthStep * depth)
        sums.add (column - x, row - y, depth / depths[column]);
  }
  return sums;
}

} // namespace

Vec3
surface_normal (const ConstRangeImage &image, const Intrinsics &intrinsics, int x, int y)
{
  const double column = image.roi.x + x, row = image.roi.y + y;
  const Vec3 ray = intrinsics.unproject (column, row, 1);
  const PlaneSums s = sum_around (image, x, y);
  /* Centred, so that two equations are left. Their determinant is a whole number, at least 1 where
   * the pixels do not all lie on one line. */
  const double uu = s.n * s.uu - s.u * s.u, vv = s.n * s.vv - s.v * s.v,
               uv = s.n * s.uv - s.u * s.v;
  const double determinant = uu * vv - uv * uv;
  const Vec3 to_camera = -1.0 / norm (ray) * ray;
  if (determinant < 0.5)
    return to_camera;
  const double uw = s.n * s.uw - s.u * s.w, vw = s.n * s.vw - s.v * s.w;
  const double a = (uw * vv - vw * uv) / determinant, b = (vw * uu - uw * uv) / determinant;
  const double c = (s.w - a * s.u - b * s.v) / s.n; /* 1 / depth at the pixel itself */
  /* N . X = 1 is the plane, so 1 / depth = N . ((u - cx) / fx, (v - cy) / fy, 1): compared term by
   * term. N points away from the camera. */
  const double nx = a * intrinsics.fx, ny = b * intrinsics.fy;
  const Vec3 away = {nx, ny, c - nx * ray.x - ny * ray.y};
  const double length = norm (away);
  return dot (away, ray) > 0 && length > 0 ? -1.0 / length * away : to_camera;
}

/* ---- files ---- */

namespace {

std::uint8_t *
write_vector (Vec3 vector, std::uint8_t *to)
{
  const float xyz[] = {
      static_cast<float> (vector.x), static_cast<float> (vector.y), static_cast<float> (vector.z)};
  std::memcpy (to, xyz, sizeof xyz);
  return to + sizeof xyz;
}

} // namespace

std::string
PointCloudWriter::header (std::size_t points) const
{
  std::string text = "ply\nformat binary_little_endian 1.0\ncomment world, metres, y up\n"
                     "element vertex " +
                     std::to_string (points) +
                     "\nproperty float x\nproperty float y\nproperty float z\n";
  if (format_.with_normals)
    text += "property float nx\nproperty float ny\nproperty float nz\n";
  text += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  if (format_.with_view_id)
    text += "property uchar view_id\n";
  return text + "end_header\n";
}

std::size_t
PointCloudWriter::size (std::size_t points) const
{
  const std::size_t point_size =
      15 + (format_.with_normals ? 12 : 0) + (format_.with_view_id ? 1 : 0);
  return header (points).size () + points * point_size;
}

std::uint8_t *
PointCloudWriter::write_point (
    const RangeImage &image, const View &view, int x, int y, std::uint8_t *to) const
{
  const Vec3 point = view.intrinsics.unproject (
      image.roi.x + x, image.roi.y + y, image.depth.at (x, y) * view.depth_unit_m);
  to = write_vector (view.world_from_view * point, to);
  if (format_.with_normals)
    to = write_vector (
        view.world_from_view.rotation * surface_normal (image, view.intrinsics, x, y), to);
  std::memcpy (to, &image.colour.at (x, y), 3);
  to += 3;
  if (format_.with_view_id)
    *to++ = static_cast<std::uint8_t> (image.view_id);
  return to;
}

Status
PointCloudWriter::write (
    std::span<const RangeImage> images, const Rig &rig, std::span<std::uint8_t> out) const
{
  std::size_t points = 0;
  for (const RangeImage &image : images)
    points += count_points (image);
  const std::string head = header (points);
  if (out.size () != size (points))
    return {
        StatusCode::kBadSize, "point cloud: the output does not have the size of that many points"};
  std::uint8_t *to = std::copy (head.begin (), head.end (), out.data ());

  for (const RangeImage &image : images) {
    const View *view = rig.find (image.view_id);
    if (!view)
      return {StatusCode::kNotFound,
          "point cloud: the rig has no view " + std::to_string (image.view_id)};
    for (int y = 0; y < image.depth.height; y++)
      for (int x = 0; x < image.depth.width; x++)
        if (image.depth.at (x, y) != kInvalidDepth)
          to = write_point (image, *view, x, y, to);
  }
  return {};
}

} // namespace rangecast
