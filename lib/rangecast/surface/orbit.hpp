/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <span>

#include "../geometry/range_image.hpp"
#include "../geometry/rig.hpp"

namespace rangecast {

/** The scene in front of a rig's cameras. */
struct SceneFrame {
  Vec3 target;              ///< point that the cameras look at, world, metres
  Vec3 to_first;            ///< unit vector from the target to the first view, level
  Vec3 up;                  ///< unit vector
  double distance_m = 1;    ///< of the first view from the target
  double elevation_deg = 0; ///< of the first view above the level through the target
  double fov_deg = 45;      ///< vertical field of view of the first view
  double off_centre_x = 0;  ///< the first view's principal point, right of the image centre
  double off_centre_y = 0;  ///< and below it, both in halves of the image height
};

/** Several views: the target is the point of the first view's axis that is nearest to where all
 *  optical axes meet, up is the world's y. One view (or axes that are parallel): the target lies on
 *  the first view's axis at the harmonic mean of near and far, up is that camera's own. The first
 *  view is the one with the lowest view-id. So the orbit begins at the first view's own picture,
 *  turned upright if there are several views and the first is rolled. */
SceneFrame scene_frame (const Rig &rig);

/** Position of an orbiting camera. */
struct Orbit {
  double azimuth_deg = 0;   ///< from the first view, to the right as seen from there
  double elevation_deg = 0; ///< above the first view's elevation, kept within 89 degrees of level
  double distance_m = 0;    ///< from the target; 0 = the first view's
  double fov_deg = 0;       ///< vertical; 0 = the first view's
  Vec3 pan;                 ///< moves the target: right, up, towards the first view; metres
};

/** Unit vectors of the orbiting camera, world: to its right, up, and away from the target. */
struct OrbitAxes {
  Vec3 right, up, back;
};
OrbitAxes orbit_axes (const SceneFrame &scene, const Orbit &orbit);

/** 4x4, column-major, as OpenGL takes it. */
using Mat4 = std::array<float, 16>;

struct OrbitMatrices {
  Mat4 clip_from_world;
  double distance_m = 0;    ///< the effective Orbit::distance_m
  Vec3 pan_right, pan_down; ///< the Orbit::pan that goes right by the picture's width, down by its
                            ///< height, as seen at the target
};

/** One eye of a stereoscopic camera. */
struct Eye {
  double right_m = 0;       ///< offset to the right of the orbiting camera, metres
  double convergence_m = 0; ///< distance from the camera at which both eyes' pictures agree; 0 =
                            ///< the target's distance
};

/** @param aspect  width / height of the picture
 *  @param flip_y  the picture's first row is its top (GStreamer's GL memory)
 *  @param hull    world points that surround all that is drawn: the near plane is at half the
 *                 distance of the nearest, the far plane at twice that of the farthest; empty: at
 *                 1/50 and 20 times the target's. The near plane is no nearer than 1/2000 of the
 *                 far one's distance, where a depth buffer would be too coarse
 *  @param room_m  added to the far plane's distance, for what is drawn behind its true position */
OrbitMatrices orbit_matrices (const SceneFrame &scene, const Orbit &orbit, double aspect,
    bool flip_y, const Eye &eye = {}, std::span<const Vec3> hull = {}, double room_m = 0);

/** A part of a picture: its share of the width and height, and its middle in clip coordinates, -1
 * to 1. */
struct PicturePart {
  double width = 1, height = 1;
  double x = 0, y = 0;
};

/** The matrix that draws into a part of the picture what `clip_from_world` draws into the whole.
 * The caller sets scissors to clip at the part's borders. */
Mat4 in_part (const Mat4 &clip_from_world, const PicturePart &part);

/** The pixels of part of a framebuffer of width x height pixels that a hull covers, and two more on
 *  each side; row 0 is at y = -1 in clip coordinates. The whole part if some of the hull
 *  is not in front of the camera. */
Roi covered_part (const Mat4 &clip_from_world, std::span<const Vec3> hull, int width, int height,
    const Roi &part);

/** An orbiting camera that pointers and keys move, within the ranges of striprender's properties.
 */
class OrbitMotion {
public:
  Orbit orbit;                ///< azimuth -360 to 360 degrees
  unsigned home_requests = 0; ///< how often the first view was requested

  /** Sets what is on the screen, for drags, and the camera's position while members of `orbit` are
   *  0. @param width, height  of the picture, pixels */
  void set_shown (const OrbitMatrices &matrices, const SceneFrame &scene, int width, int height);

  void turn (double azimuth_deg, double elevation_deg);
  /** Multiplies the distance. */
  void zoom (double factor);
  /** A drag by pixels: half a circle over the width of the picture, a quarter over its height. */
  void orbit_by (double dx, double dy);
  /** A drag by pixels: the scene follows the pointer. */
  void pan_by (double dx, double dy);
  /** Two fingers move: to distance `after` between them, pixels, and their middle by (dx, dy). */
  void pinch (double dx, double dy, double before, double after);
  /** What a key or a notch of the wheel does: turns by steps, moves nearer or farther by one. */
  void step (int right, int up);
  void step_nearer (bool nearer);
  /** Back to the first view; the field of view stays. */
  void go_home ();

private:
  double home_distance_m_ = 1, home_elevation_deg_ = 0;
  Vec3 pan_right_, pan_down_;
  int width_ = 640, height_ = 480;
};

/** Clip coordinates of (column, row, 1) times depth, and 1: pixels of the ROI, depth units. */
Mat4 clip_from_pixel (const Mat4 &clip_from_world, const View &view, const Roi &roi);

/** Position of the camera of a perspective matrix, world, metres. */
Vec3 viewer_position (const Mat4 &clip_from_world);

/** Cosine of the angle between the directions in which the viewer and a view look. */
double view_alignment (const Mat4 &clip_from_world, const View &view);

/** Where a view's camera is beside the viewer: the rays of both meet on the viewer's axis at w at
 * an angle whose cotangent is per_w * w - offset. The blend range is divided by that angle's sine:
 * a surface that is drawn too near or too far is displaced in the picture by that sine. From a
 * right angle on it counts as 1. */
struct ViewCotangent {
  float per_w = 0, offset = 0;
};
/** {} if the cell, the last one, has several layers. @param layers  number of all */
ViewCotangent view_cotangent (const Mat4 &clip_from_world, const View &view, std::size_t cell,
    std::size_t cells, std::size_t layers);

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
