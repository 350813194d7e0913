/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "../geometry/range_image.hpp"
#include "../geometry/rig.hpp"
#include "orbit.hpp"

namespace rangecast {

/** Clip coordinates of (column, row, 1) times depth, and 1: pixels of the ROI, depth units. */
Mat4 clip_from_pixel (const Mat4 &clip_from_world, const View &view, const Roi &roi);

/** The matrix whose depths are all in the nearer half of the depth buffer, or in the farther one.
 */
Mat4 in_half_of_depths (Mat4 clip_matrix, bool farther);

/** Position of the camera of a perspective matrix, world, metres. */
Vec3 viewer_position (const Mat4 &clip_from_world);

/** Cosine of the angle between the directions in which the viewer and a view look. */
double view_alignment (const Mat4 &clip_from_world, const View &view);

/** Whether a clip matrix of pixels mirrors. If it does not, triangles that are counter-clockwise in
 *  their view's picture (y down) are so for OpenGL, too. */
bool mirrors (const Mat4 &clip_from_world);

/** Moves z in normalised device coordinates, a + b / w, to that of a point g farther from the
 * viewer, a + b / (w + g). Unlike an equivalent offset of z it never crosses the far plane when the
 * near plane is close. */
struct DepthShift {
  float a, b, g;
};
/** @param clip_matrix  a matrix whose w is the distance along the viewer's direction
 *  @param gap_m        metres */
DepthShift depth_shift (const Mat4 &clip_matrix, const Mat4 &clip_from_world, double gap_m);

} // namespace rangecast
