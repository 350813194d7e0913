/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>

#include "../geometry/rig.hpp"

namespace rangecast {

/** What a rig's pictures are of, as far as its cameras tell. */
struct SceneFrame {
  Vec3 target;              ///< what the cameras look at, world, metres
  Vec3 to_first;            ///< unit vector from the target to the first view, level
  Vec3 up;                  ///< unit vector
  double distance_m = 1;    ///< of the first view from the target
  double elevation_deg = 0; ///< of the first view above the level through the target
  double fov_deg = 45;      ///< vertical field of view of the first view
  double off_centre_x = 0;  ///< the first view's principal point, right of the picture's middle
  double off_centre_y = 0;  ///< and below it, both in halves of the picture's height
};

/** Several views: the target is the point of the first view's axis that is nearest to where all
 *  optical axes meet, up is the world's y. One view (or axes that are parallel): the target lies on
 *  the first view's axis at the harmonic mean of near and far, up is that camera's own. The first
 *  view is the one with the lowest view-id. So the orbit begins with the first view's own picture,
 *  but upright if there are several views and the first is rolled. */
SceneFrame scene_frame (const Rig &rig);

/** Where an orbiting camera stands. */
struct Orbit {
  double azimuth_deg = 0;   ///< from the first view, to the right as seen from there
  double elevation_deg = 0; ///< above the first view's elevation, kept within 89 degrees of level
  double distance_m = 0;    ///< from the target; 0 = the first view's
  double fov_deg = 0;       ///< vertical; 0 = the first view's
  Vec3 pan;                 ///< moves the target: right, up, towards the first view; metres
};

/** 4x4, column-major, as OpenGL takes it. */
using Mat4 = std::array<float, 16>;

struct OrbitMatrices {
  Mat4 clip_from_world;
  double distance_m = 0;    ///< that is in force
  Vec3 pan_right, pan_down; ///< the Orbit::pan that goes right by the picture's width, down by its
                            ///< height, as seen at the target
};

/** @param aspect      width / height of the picture
 *  @param flip_y      the picture's first row is its top (GStreamer's GL memory) */
OrbitMatrices orbit_matrices (
    const SceneFrame &scene, const Orbit &orbit, double aspect, bool flip_y);

} // namespace rangecast
