/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "rig.hpp"

namespace rangecast {

/** How many pixels of a range image are valid. */
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

/** A point cloud in binary little-endian PLY: x y z (float, world, metres), red green blue (uchar)
 *  and, if asked for, view_id (uchar). */
class PlyWriter {
public:
  explicit PlyWriter (bool with_view_id) : with_view_id_ (with_view_id) {}

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
  bool with_view_id_;
};

} // namespace rangecast
