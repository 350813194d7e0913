/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "world_points.hpp"

namespace rangecast {

/** Maps pixels of one view's plane to another view's plane. The pixel at column, row with depth d
 * is mapped to origin + d * (corner + column * right + row * down): column times depth, row times
 * depth, and depth in the other plane. Planes are cropped to their ROIs. */
struct PixelTransfer {
  PixelTransfer () = default;
  PixelTransfer (const PixelRays &rays, const Roi &from, const PixelLookup &lookup, const Roi &to)
  {
    const int box[] = {to.x, to.y, 0};
    const auto &rows = lookup.rows;
    for (int k = 0; k < 3; k++) {
      const auto turned = [&] (const float *ray) {
        double sum = 0;
        for (int c = 0; c < 3; c++)
          sum += (double{rows[k][c]} - box[k] * double{rows[2][c]}) * ray[c];
        return sum;
      };
      const double to_right = turned (rays.right), to_down = turned (rays.down);
      origin[k] =
          static_cast<float> (turned (rays.origin) + rows[k][3] - box[k] * double{rows[2][3]});
      corner[k] = static_cast<float> (turned (rays.corner) + from.x * to_right + from.y * to_down);
      right[k] = static_cast<float> (to_right);
      down[k] = static_cast<float> (to_down);
    }
  }

  /** @param[out] place  column and row times depth, and depth, of the other plane */
  void find (int x, int y, std::uint16_t depth, float place[3]) const
  {
    for (int k = 0; k < 3; k++)
      place[k] =
          origin[k] + static_cast<float> (depth) * (corner[k] + static_cast<float> (x) * right[k] +
                                                       static_cast<float> (y) * down[k]);
  }

  float origin[3] = {}, corner[3] = {}, right[3] = {}, down[3] = {};
};

} // namespace rangecast
