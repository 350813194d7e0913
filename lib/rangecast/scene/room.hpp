/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <vector>

#include "../geometry/camera.hpp"
#include "../geometry/image_view.hpp"

namespace rangecast {

/** Appearance of the room. */
struct RoomPaint {
  std::uint32_t seed = 1;
  double contrast = 1; ///< of the texture, 1 = as it is, 0 = plain walls
  double warmth = 0;   ///< 0 = blue-grey walls .. 1 = as wood, skin and hair
};

/** Draws the empty room, a textured round wall with floor and ceiling about the y axis: four rays a
 *  pixel. Slow: for pictures that are kept.
 *  @param radius_m  of the wall; the camera stands inside
 *  @param[out] colour  H x W. Reentrant. */
void draw_room (const Intrinsics &camera, const Pose &world_from_camera, double radius_m,
    const RoomPaint &paint, ImageView<Rgbx> colour);

/** How far the empty room is: 1/z at pixel centres, 1/m, row by row. Reentrant. */
std::vector<float> room_inverse_depth (const Intrinsics &camera, const Pose &world_from_camera,
    double radius_m, int width, int height);

} // namespace rangecast
