/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The numbers that the shaders of shaders.hpp take, for painters in OpenGL and WebGL2. */
#pragma once

#include <cstddef>

#include "surface_scene.hpp"
#include "view_matrices.hpp"

namespace rangecast {

/** Metres by which a view's surfaces move away from the viewer, times 1 - cosine of the angle
 *  between the two's directions; not in mode kBlend. */
inline constexpr double kViewGap_m = 0.012;
/** Mode kBlend: metres behind the nearest surface within which views are blended. */
inline constexpr double kBlendRange_m = 0.02;
/** The background, sRGB, 0xRRGGBB. */
inline constexpr unsigned kBackgroundColour = 0x20242a;

/** Up to so many views half floats keep 8 bits of colour: each addition is rounded to 11 bits. */
inline constexpr std::size_t kMaxHalfFloatViews = 16;

/** u_weights of pass 2. The inside of a surface weighs so little that the sum tells a pixel in
 *  which all views show an inside from one in which a view shows an outside. */
struct BlendWeights {
  float max, min, inside;
  /** Minimum weight of an outside, less rounding: u_outside of pass 3. */
  [[nodiscard]] float outside () const { return 0.9f * min; }
};
/** @param precise  the sums are floats of 32 bits, not 16 */
BlendWeights blend_weights (std::size_t rig_views, bool precise);

/** Where a layer is drawn: u_clip_from_pixel and u_behind. */
struct LayerPlace {
  Mat4 clip_from_pixel;
  float behind[2];
};
LayerPlace place_layer (const Mat4 &clip_from_pixel, const Mat4 &clip_from_world, double gap_m);

/** Metres by which pass 1 and pass 2 of mode kBlend move a view's surfaces away from the viewer.
 *  Views that look against the viewer show the inside of surfaces, which fills holes, but must not
 *  hide an outside a little behind it. */
double depth_pass_gap (const Mat4 &clip_from_world, const View &view, double blend_range_m);
double sum_pass_gap (const Mat4 &clip_from_world, const View &view);
/** The same in the other modes. Where two views see one surface, the one that looks more as the
 *  viewer does is in front: it has more pixels there, and noise must not let both show. */
double strip_gap (const Mat4 &clip_from_world, const View &view, double view_gap_m);

/** The angle between a view's ray and the viewer's: u_lens, u_viewer and u_unit of pass 2. */
struct LayerAngles {
  float lens[4];   ///< principal point in the ROI, 1 / focal lengths; pixels
  float viewer[3]; ///< in the view's camera coordinates, metres
  float unit;      ///< metres per depth unit
};
LayerAngles layer_angles (const Mat4 &clip_from_world, const View &view, const Roi &roi);

/** Longest gap that pass 3 fills, pixels: gaps up to half of it take the colours around them, wider
 *  ones a share of those. */
int fill_reach (int picture_height);

/** Pixels that a length of 1 at a distance of 1 covers. @param height  of the picture, pixels */
double pixels_per_unit (const SceneFrame &scene, const Orbit &orbit, int height);

} // namespace rangecast
