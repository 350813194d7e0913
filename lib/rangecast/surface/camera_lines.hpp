/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "../geometry/rig.hpp"

namespace rangecast {

/** One end of a line, as OpenGL takes it. */
struct LineVertex {
  float x, y, z;                 ///< world, metres
  std::uint8_t red, green, blue; ///< the same at both ends
  std::uint8_t unused = 0;
};

/** A colour, distinct from its neighbours in the list, and its English name. */
struct LineColour {
  std::uint8_t red, green, blue;
  std::string_view name;
};

/** Colour of the `index`-th view of a rig; the list of colours repeats. */
LineColour camera_colour (std::size_t index);

/** Appends the lines, two vertices each, that show where a view's camera stands and what it sees:
 *  a pyramid from the camera to its picture's corners at the near distance, with a triangle on the
 *  picture's top edge; and, darker, the rest of the frustum up to the far distance. */
void append_camera_lines (
    const View &view, const LineColour &colour, std::vector<LineVertex> &lines);

} // namespace rangecast
