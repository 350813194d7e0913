/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* GLSL of what draws frame sets: the same for OpenGL 3.3, OpenGL ES 3.0 and WebGL2, without the
 * line that says the version. The numbers that it takes: painting.hpp. */
#pragma once

#include <cstddef>
#include <string>

namespace rangecast {

/** Shaders, each of one stage. */
enum class Shader : unsigned {
  kCoveringVertex, ///< three vertices without attributes that cover the viewport
  kVertex,         ///< SurfaceVertex, pass 1: each view into its cell
  kFragment,
  kFinishFragment, ///< pass 3: the picture, with smooth outlines and small gaps filled
  kSumFragment,    ///< pass 2: colours of one cell added up by weight; see sum_shader()
};

/** Greatest number of cells that pass 2 adds up. */
inline constexpr std::size_t kMaxBlendCells = 8;
inline constexpr std::size_t kShaders =
    static_cast<std::size_t> (Shader::kSumFragment) + kMaxBlendCells;

/** The fragment shader of pass 2 for so many cells, from 1. */
constexpr Shader
sum_shader (std::size_t cells)
{
  return static_cast<Shader> (static_cast<std::size_t> (Shader::kSumFragment) + cells - 1);
}

/** The source of a shader. */
std::string shader_source (Shader shader);

} // namespace rangecast
