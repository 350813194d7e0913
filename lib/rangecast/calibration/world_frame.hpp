/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <span>

#include "../geometry/camera.hpp"

namespace rangecast {

/** Where the rig's world lies. Always right-handed, y up, metres. */
enum class WorldFrame {
  kCentre, ///< origin where the cameras look, y up as the cameras have it on average, the first one
           ///< on the +z side
  kFirstView, ///< origin in the first camera, which looks along -z
  kBoard, ///< origin in the middle of a board, y its normal on the cameras' side (a board on the
          ///< floor), z towards the first camera
};

/** @param first_from_camera  poses of the views' own cameras in the first one's frame, the first
 *  (the identity) included; not empty
 *  @param boards  middles of all boards, first camera's frame, not empty
 *  @param board   pose of the board that kBoard means (origin in its middle)
 *  @return world_from_first */
[[nodiscard]] Pose place_world (WorldFrame frame, std::span<const Pose> first_from_camera,
    std::span<const Vec3> boards, const Pose &first_from_board);

} // namespace rangecast
