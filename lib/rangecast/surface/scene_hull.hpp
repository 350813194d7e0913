/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <vector>

#include "../geometry/range_image.hpp"
#include "../geometry/rig.hpp"

namespace rangecast {

/** Appends world points, metres, whose convex hull holds all valid points of an image and one pixel
 *  more on each side: for each tile of 32x32 pixels the corners of the part of the view's frustum
 *  that its points lie in. Nothing if no pixel is valid. */
void append_hull (const ConstRangeImage &image, const View &view, std::vector<Vec3> &hull);

} // namespace rangecast
