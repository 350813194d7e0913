/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <vector>

#include "../geometry/range_image.hpp"
#include "../geometry/rig.hpp"

namespace rangecast {

/** Nearest and farthest valid depth of a range image, depth units; farthest = 0 if none is valid.
 */
struct DepthSpan {
  std::uint16_t nearest = 0, farthest = 0;
};
DepthSpan depth_span (const ImageView<const std::uint16_t> &depth);

/** Appends the eight corners of the part of a view's frustum that holds all valid points of an
 *  image, world, metres; nothing if there are none. */
void append_hull (const ConstRangeImage &image, const View &view, std::vector<Vec3> &hull);

} // namespace rangecast
