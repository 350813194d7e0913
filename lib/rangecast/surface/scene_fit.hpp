/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <span>
#include <vector>

#include "../geometry/range_image.hpp"
#include "orbit.hpp"

namespace rangecast {

/** Appends world points, metres, of every `step`-th valid pixel, row by row. */
void append_points (
    const ConstRangeImage &image, const View &view, std::size_t step, std::vector<Vec3> &points);

/** The scene with another target and distance: the points, seen from the orbit's direction with its
 *  field of view, are in the middle of the picture and fill 85 % of its width or height, whichever
 *  they reach first. The target is in the middle of their depth, and the principal point in the
 *  middle of the picture. The outermost 0.2 % of the points at each edge are treated as noise.
 *  @param aspect  width / height of the picture
 *  @param points  world, metres; if there are none, the scene stays as it is */
SceneFrame fitted_frame (
    const SceneFrame &scene, const Orbit &orbit, double aspect, std::span<const Vec3> points);

/** Whether two frames show the scene at about the same size and place: within a tenth of the
 *  distance and of the picture's height. */
bool is_similar (const SceneFrame &a, const SceneFrame &b, double fov_deg);

} // namespace rangecast
