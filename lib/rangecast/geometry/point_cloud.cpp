/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "point_cloud.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

namespace rangecast {

static_assert (std::endian::native == std::endian::little, "PLY points are copied as they lie");

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

std::string
PlyWriter::header (std::size_t points) const
{
  std::string text = "ply\nformat binary_little_endian 1.0\ncomment world, metres, y up\n"
                     "element vertex " +
                     std::to_string (points) +
                     "\nproperty float x\nproperty float y\nproperty float z\n"
                     "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  if (with_view_id_)
    text += "property uchar view_id\n";
  return text + "end_header\n";
}

std::size_t
PlyWriter::size (std::size_t points) const
{
  return header (points).size () + points * (15 + (with_view_id_ ? 1 : 0));
}

Status
PlyWriter::write (
    std::span<const RangeImage> images, const Rig &rig, std::span<std::uint8_t> out) const
{
  std::size_t points = 0;
  for (const RangeImage &image : images)
    points += count_points (image);
  const std::string head = header (points);
  if (out.size () != size (points))
    return {StatusCode::kBadSize, "PLY: the output does not have the size of that many points"};
  std::uint8_t *to = std::copy (head.begin (), head.end (), out.data ());

  for (const RangeImage &image : images) {
    const View *view = rig.find (image.view_id);
    if (!view)
      return {StatusCode::kNotFound, "PLY: the rig has no view " + std::to_string (image.view_id)};
    for (int y = 0; y < image.depth.height; y++) {
      for (int x = 0; x < image.depth.width; x++) {
        const std::uint16_t depth = image.depth.at (x, y);
        if (depth == kInvalidDepth)
          continue;
        const Vec3 point = view->world_from_view * view->intrinsics.unproject (image.roi.x + x,
                                                       image.roi.y + y, depth * view->depth_unit_m);
        const float xyz[] = {static_cast<float> (point.x), static_cast<float> (point.y),
            static_cast<float> (point.z)};
        std::memcpy (to, xyz, sizeof xyz);
        std::memcpy (to + sizeof xyz, &image.colour.at (x, y), 3);
        to += 15;
        if (with_view_id_)
          *to++ = static_cast<std::uint8_t> (image.view_id);
      }
    }
  }
  return {};
}

} // namespace rangecast
