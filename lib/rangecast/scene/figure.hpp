/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>

#include "../geometry/camera.hpp"
#include "mesh.hpp"

namespace rangecast {

/** Half axes of the built-in figure's cross-section at a height, metres. */
struct Section {
  double y, side, front, back, centre_z;
};

/** Without features: nose, ears and hair stand out of it. */
Section smooth_section_at (double y);

/** A vertex without normal that turns with the head if it is above the neck. u, v: texture, 0 to 1.
 */
MeshVertex figure_vertex (Vec3 p, double u, double v);

/** @name Clothing and hair, appended to the figure's meshes. @{ */
void add_long_hair (std::uint32_t seed, Figure &figure);
void add_glasses (Figure &figure);
void add_collar (std::uint32_t seed, Figure &figure);
void add_hand (std::uint32_t seed, Figure &figure);
/** @} */

} // namespace rangecast
