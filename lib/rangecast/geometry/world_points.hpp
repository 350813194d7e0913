/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "../base/status.hpp"
#include "range_image.hpp"
#include "rig.hpp"

namespace rangecast {

/** The pixels of a range view as rays in the world: pixel (u, v) of the full image with depth d
 *  (depth units) is the point origin + d * (corner + u * right + v * down), metres. */
struct PixelRays {
  PixelRays () = default;
  explicit PixelRays (const View &view);

  float origin[3] = {}, corner[3] = {}, right[3] = {}, down[3] = {};
  float optical_axis[3] = {}; ///< unit vector

  /** The world point of a pixel of the full image at a depth (depth units), metres. */
  void point (float u, float v, float depth, float out[3]) const
  {
    for (int k = 0; k < 3; k++)
      out[k] = origin[k] + depth * (corner[k] + u * right[k] + v * down[k]);
  }
};

/** Where a range view sees points of the world: the inverse of PixelRays. */
struct PixelLookup {
  PixelLookup () = default;
  explicit PixelLookup (const View &view);

  /** @param[out] u, v   pixel of the full image, not rounded
   *  @param[out] depth  depth units; u and v are undefined if it is not positive */
  void find (const float point[3], float &u, float &v, float &depth) const
  {
    const auto row = [&] (int k) {
      return rows[k][0] * point[0] + rows[k][1] * point[1] + rows[k][2] * point[2] + rows[k][3];
    };
    depth = row (2);
    u = row (0) / depth;
    v = row (1) / depth;
  }

  float rows[3][4] = {}; ///< intrinsics * view_from_world / depth unit
};

/** The valid pixels of some range images as points in the world, one array a coordinate. Keeps its
 *  memory from frame to frame: 16 bytes a pixel of all ROIs of the largest frame set so far. */
class WorldPoints {
public:
  /** The points of one range image: elements begin to end - 1, row by row. */
  struct Part {
    std::size_t begin = 0, end = 0;
    [[nodiscard]] std::size_t size () const { return end - begin; }
  };

  /** Removes all points and makes an empty part for each image. Allocates only if the images have
   * more pixels than ever before.
   *  @return kBadSize if the images have 2^32 pixels or more together */
  Status reset (std::span<const RangeImage> images);

  /** Fills part `index` from its image. Threads may fill different parts concurrently. */
  void fill (std::size_t index, const ConstRangeImage &image, const PixelRays &rays);

  [[nodiscard]] std::span<const Part> parts () const { return parts_; }
  /** Points of all parts. */
  [[nodiscard]] std::size_t size () const;

  /** World coordinates, metres. Elements between parts are undefined. */
  std::vector<float> x, y, z;
  /** The point's pixel in the ROI: row << 16 | column. */
  std::vector<std::uint32_t> pixel;

private:
  std::vector<Part> parts_;
};

} // namespace rangecast
