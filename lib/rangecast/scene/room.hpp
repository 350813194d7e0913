/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <vector>

#include "../geometry/camera.hpp"
#include "../geometry/image_view.hpp"

namespace rangecast {

/** Draws the empty room, a textured round wall with floor and ceiling about the y axis: four rays a
 *  pixel, as slow as it is exact, for pictures that are kept.
 *  @param radius_m  of the wall; the camera stands inside
 *  @param contrast  of the texture, 1 = as it is, 0 = plain walls
 *  @param[out] colour  H x W. Reentrant. */
void draw_room (const Intrinsics &camera, const Pose &world_from_camera, double radius_m,
    std::uint32_t seed, double contrast, ImageView<Rgbx> colour);

/** How far the empty room is: 1/z at pixel centres, 1/m, row by row. Reentrant. */
std::vector<float> room_inverse_depth (const Intrinsics &camera, const Pose &world_from_camera,
    double radius_m, int width, int height);

} // namespace rangecast
