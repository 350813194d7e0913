/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <vector>

#include "../base/status.hpp"
#include "../geometry/range_image.hpp"

namespace rangecast {

/** Depth from disparity: z = fx * baseline / disparity. */
class DisparityToDepth {
public:
  /** @param fx            focal length, pixels, > 0
   *  @param baseline_m    metres, > 0
   *  @param depth_unit_m  metres per depth unit
   *  @param near_m, far_m depths outside become invalid */
  Status set (double fx, double baseline_m, double depth_unit_m, double near_m, double far_m);

  /** @param disparity  H x W, 1/16 pixel, 0 = no match; principal points equal (offset added)
   *  @param[out] depth H x W, depth units, 0 where there is no match or z is outside near..far
   *  @return kBadSize if the images differ in size (depth is then untouched). Reentrant. */
  Status convert (ImageView<const std::uint16_t> disparity, ImageView<std::uint16_t> depth) const;

private:
  std::vector<std::uint16_t> depths_; /* by disparity */
};

} // namespace rangecast
