/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <optional>

#include "../geometry/pixel_transfer.hpp"
#include "../geometry/range_image.hpp"
#include "surface_planes.hpp"

namespace rangecast {

/** One view of a frame set, its planes and its camera. */
struct FusedView {
  RangeImage image;
  const SurfacePlanes *planes = nullptr;
  PixelRays rays;
  PixelLookup lookup;
  float focal_px = 1; ///< pixels
  float unit_m = 1;   ///< metres per depth unit
  /** Factors of its colours; without, they are not compared with those of other views. */
  std::optional<std::array<float, 3>> gains;
};

/** Whether two cameras may see one surface well: they are at most 120 degrees apart. */
inline bool
may_share_surfaces (const PixelRays &a, const PixelRays &b)
{
  constexpr float kMinAxes = -0.5f;
  const float *p = a.optical_axis, *q = b.optical_axis;
  return p[0] * q[0] + p[1] * q[1] + p[2] * q[2] >= kMinAxes;
}

} // namespace rangecast
