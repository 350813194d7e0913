/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "rig.hpp"

namespace rangecast {

/** Number of valid pixels of a range image. */
std::size_t count_points (const ConstRangeImage &image);

/** A distance in whole depth units, the nearest from 1 to 65535. */
[[nodiscard]] std::uint16_t depth_units (double metres, double unit_m);

/** Depth of one unit as depth of another: out = round (in * factor), 0 where `in` is 0 or the
 *  result lies outside near..far.
 *  @param in      H x W, 0 = invalid
 *  @param factor  output units per input unit, > 0
 *  @param near    output units, inclusive
 *  @param far     output units, inclusive
 *  @param[out] out H x W, depth units
 *  @return kOk, or kBadSize if the images differ in size (out is then untouched). Reentrant. */
Status rescale_depth (ImageView<const std::uint16_t> in, double factor, std::uint16_t near,
    std::uint16_t far, ImageView<std::uint16_t> out);

/** Least and greatest value of a depth image's pixels other than 0, and how many those are; all 0
 *  if there are none. */
struct DepthRange {
  int min = 0, max = 0, count = 0;
};
[[nodiscard]] DepthRange find_depth_range (ImageView<const std::uint16_t> depth);

/** Surface normal at a pixel, from a least-squares plane through the valid pixels of the
 * surrounding 5x5 that differ by less than 3 % of its depth. On a plane 1 / depth is linear in the
 * pixel's column and row, so the fit is exact there, at any slant.
 *  @param x, y  column and row of a valid pixel in the range image
 *  @return length 1, in the view's frame (x right, y down, z forward), facing the camera; the
 *  direction to the camera if there are too few pixels. Reentrant. */
[[nodiscard]] Vec3 surface_normal (
    const ConstRangeImage &image, const Intrinsics &intrinsics, int x, int y);

/** What the points of a binary PLY file have besides x y z (float, world, metres) and red green
 * blue (uchar). */
struct PointCloudFormat {
  bool with_normals = false; ///< surface_normal() in world coordinates
  bool with_view_id = false;
};

/** Writes point clouds as PLY files. */
class PointCloudWriter {
public:
  explicit PointCloudWriter (PointCloudFormat format) : format_ (format) {}

  /** Bytes of a file of that many points. */
  [[nodiscard]] std::size_t size (std::size_t points) const;

  /** Writes a file of all valid pixels.
   *  @param images  each with its camera in `rig`
   *  @param[out] out  exactly size (number of valid pixels) bytes
   *  @return kNotFound if the rig lacks a view, kBadSize if `out` has another size. Reentrant. */
  Status write (
      std::span<const RangeImage> images, const Rig &rig, std::span<std::uint8_t> out) const;

private:
  [[nodiscard]] std::string header (std::size_t points) const;
  std::uint8_t *write_point (
      const RangeImage &image, const View &view, int x, int y, std::uint8_t *to) const;

  PointCloudFormat format_;
};

} // namespace rangecast
