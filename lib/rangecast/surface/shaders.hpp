/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* GLSL of what draws frame sets: the same for OpenGL 3.3, OpenGL ES 3.0 and WebGL2, without the
 * line that says the version. The numbers that it takes: painting.hpp. */
#pragma once

#include <string>

namespace rangecast {

/** Shaders, each of one stage. */
enum class Shader {
  kCoveringVertex,     ///< three vertices without attributes that cover the viewport
  kColourFragment,     ///< the colour of v_colour
  kBackgroundFragment, ///< background-shade
  kStripVertex,        ///< StripVertex of mode kStrips
  kRectangleVertex,    ///< of mode kRectangles
  kPointVertex,        ///< of mode kPoints
  kBlendDepthVertex,   ///< BlendVertex, pass 1: depth
  kBlendDepthFragment,
  kBlendSumVertex, ///< pass 2: colour times weight
  kBlendSumFragment,
  kDivideFragment,      ///< pass 3: the picture
  kDivideDepthFragment, ///< the same, with depth
};
inline constexpr int kShaders = 12;

/** The source of a shader. */
std::string shader_source (Shader shader);

} // namespace rangecast
