/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>

#include "mesh.hpp"

namespace rangecast {

/** Half axes of the built-in figure's cross-section at a height, metres. */
struct Section {
  double y, side, front, back, centre_z;
};

/** Without features: nose, ears and hair stand out of it. */
Section smooth_section_at (double y);

/** @name What the figure wears, added behind its other meshes. @{ */
void add_long_hair (std::uint32_t seed, Figure &figure);
void add_glasses (Figure &figure);
void add_collar (std::uint32_t seed, Figure &figure);
void add_hand (std::uint32_t seed, Figure &figure);
/** @} */

} // namespace rangecast
