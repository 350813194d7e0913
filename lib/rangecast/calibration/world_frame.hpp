/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <span>

#include "../geometry/camera.hpp"

namespace rangecast {

/** Origin and orientation of the rig's world: right-handed, y up, metres. */
enum class WorldFrame {
  kCentre,    ///< origin at the point that the cameras look at, y is their mean up direction, the
              ///< first one on the +z side
  kFirstView, ///< origin in the first camera, which looks along -z
  kBoard, ///< origin in the centre of a board that lies on the floor, y is its normal towards the
          ///< cameras, z points towards the first camera
};

/** @param first_from_camera  poses of the left cameras in the frame of the first one, which is
 * included; not empty
 *  @param boards  centres of all boards in the first camera's frame, not empty
 *  @param board   pose of the board for kBoard, with the origin in its centre
 *  @return world_from_first */
[[nodiscard]] Pose place_world (WorldFrame frame, std::span<const Pose> first_from_camera,
    std::span<const Vec3> boards, const Pose &first_from_board);

} // namespace rangecast
