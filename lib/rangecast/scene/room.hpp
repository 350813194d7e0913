/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>

#include "../geometry/camera.hpp"
#include "../geometry/image_view.hpp"

namespace rangecast {

/** Draws the empty room, a textured round wall with floor and ceiling about the y axis: four rays a
 *  pixel, as slow as it is exact, for pictures that are kept.
 *  @param radius_m  of the wall; the camera stands inside
 *  @param[out] colour  H x W. Reentrant. */
void draw_room (const Intrinsics &camera, const Pose &world_from_camera, double radius_m,
    std::uint32_t seed, ImageView<Rgbx> colour);

} // namespace rangecast
