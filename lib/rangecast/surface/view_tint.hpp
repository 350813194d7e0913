/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <vector>

#include "../geometry/image_view.hpp"
#include "camera_lines.hpp"

namespace rangecast {

/** A copy of a picture in shades of one colour: the hue identifies the camera, and brightness is
 *  kept. Half of each value is the colour's at the pixel's brightness, half the colour's own, so
 *  that dark clothes have a hue, too.
 *  @param[out] memory  of the copy; keeps its capacity
 *  @return the copy, of the same size, valid as long as `memory` is left alone */
ImageView<Rgbx> tinted (
    const ImageView<const Rgbx> &picture, const LineColour &colour, std::vector<Rgbx> &memory);

} // namespace rangecast
