/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "depth.hpp"

#include <algorithm>
#include <cmath>

namespace rangecast {

Status
DisparityToDepth::set (
    double fx, double baseline_m, double depth_unit_m, double near_m, double far_m)
{
  if (!(fx > 0) || !(baseline_m > 0) || !(depth_unit_m > 0) || !(near_m > 0) || !(far_m > near_m))
    return {StatusCode::kBadValue,
        "depth: expected fx, baseline and depth unit > 0 and 0 < near < far"};
  depths_.assign (65536, kInvalidDepth);
  for (int d = 1; d < 65536; d++) {
    const double z = fx * baseline_m / (d / 16.0);
    const double units = std::round (z / depth_unit_m);
    if (z >= near_m && z <= far_m && units >= 1 && units <= 65535)
      depths_[d] = static_cast<std::uint16_t> (units);
  }
  return {};
}

Status
DisparityToDepth::convert (
    ImageView<const std::uint16_t> disparity, ImageView<std::uint16_t> depth) const
{
  if (!disparity.same_size (depth))
    return {StatusCode::kBadSize, "depth: disparity and depth differ in size"};
  for (int y = 0; y < depth.height; y++) {
    const std::uint16_t *from = disparity.row (y);
    std::uint16_t *to = depth.row (y);
    for (int x = 0; x < depth.width; x++)
      to[x] = depths_[from[x]];
  }
  return {};
}

} // namespace rangecast
