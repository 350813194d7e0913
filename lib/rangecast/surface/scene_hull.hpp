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

/** Appends world points, metres, whose convex hull holds all valid points of an image and one pixel
 *  more on each side: for each tile of 32x32 pixels the corners of the part of the view's frustum
 *  that its points lie in. Nothing if no pixel is valid. */
void append_hull (const ConstRangeImage &image, const View &view, std::vector<Vec3> &hull);

} // namespace rangecast
