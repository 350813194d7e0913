/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <vector>

#include "../geometry/range_image.hpp"

namespace rangecast {

/** The plane that touches the surface at a pixel. On a plane 1 / depth is linear in column and row,
 *  so with h = (column * z, row * z, z) of a point, in the pixel's own plane of the image, the
 *  point lies on it if across * h0 + down * h1 + constant (x, y) * h2 = depth^2, and behind it if
 *  the left side is greater. */
struct SurfacePlane {
  float depth;        ///< mean of the pixels round it, depth units
  float across, down; ///< minus the change of depth from pixel to pixel, depth units
  float weight;       ///< confidence, 0 .. 1; 0: no plane

  [[nodiscard]] float constant (float x, float y) const { return depth - across * x - down * y; }
};

/** The tangent planes of one range image. */
class SurfacePlanes {
public:
  /** Makes the planes of all pixels. A weight is the squared cosine between the surface's normal
   *  and the optical axis, less what it is at 68 degrees, and fades to 0 within some pixels (3 at
   * 320x240) of depth edges, bends and pixels without depth. Allocates only for an image larger
   * than all before.
   *  @param focal_px  focal length, pixels */
  void make (const ConstRangeImage &image, float focal_px);
  [[nodiscard]] int width () const { return width_; }
  [[nodiscard]] int height () const { return height_; }
  /** Whether a row has smooth surface at all, edges of depth apart. Rows of a lost slice have none,
   *  nor has a row of single pixels. */
  [[nodiscard]] bool is_used (int y) const { return used_[static_cast<std::size_t> (y)] != 0; }
  [[nodiscard]] const SurfacePlane &at (int x, int y) const
  {
    return planes_[static_cast<std::size_t> (y) * static_cast<std::size_t> (width_) +
                   static_cast<std::size_t> (x)];
  }

private:
  void make_row (const ConstRangeImage &image, int y, float focal_px);
  void fade_row (int y);

  int width_ = 0, height_ = 0, reach_ = 2; /* pixels */
  std::vector<SurfacePlane> planes_;
  std::vector<std::uint8_t> smooth_; /* 1: depth changes as on a plane there */
  std::vector<std::uint8_t> used_;   /* by row */
  std::vector<std::uint8_t> sums_;   /* of smooth_ along columns, of one row */
};

} // namespace rangecast
