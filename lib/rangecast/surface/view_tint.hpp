/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "../geometry/image_view.hpp"

namespace rangecast {

/** A colour, distinct from its neighbours in the list, and its English name. */
struct ViewColour {
  std::uint8_t red, green, blue;
  std::string_view name;
};

/** Colour of the `index`-th view of a rig; the list of colours repeats. */
ViewColour view_colour (std::size_t index);

/** A copy of a picture in shades of one colour: the hue identifies the camera, and brightness is
 *  kept. Half of each value is the colour's at the pixel's brightness, half the colour's own, so
 *  that dark clothes have a hue, too.
 *  @param[out] memory  of the copy; keeps its capacity
 *  @return the copy, of the same size, valid as long as `memory` is left alone */
ImageView<Rgbx> tinted (
    const ImageView<const Rgbx> &picture, const ViewColour &colour, std::vector<Rgbx> &memory);

} // namespace rangecast
