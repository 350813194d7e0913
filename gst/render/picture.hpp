/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <rangecast/geometry/rig.hpp>
#include <rangecast/surface/orbit.hpp>
#include <rangecast/surface/painting.hpp>

/** What StripPainter and BlendPainter draw: one picture of a frame set. */
struct RenderPicture {
  rangecast::Mat4 clip_from_world;
  float background[4];        ///< R, G, B, A
  float background_shade = 0; ///< see set_background_uniforms()
  float point_size;           ///< in footprints of a pixel
  float pixels_per_unit;      ///< pixels that a length of 1 at a distance of 1 covers
  rangecast::StripMode mode;
  double depth_step;
  bool back_faces = false;     ///< mode strips: where no front is; mode blend shows all
  bool keeps_depth = false;    ///< mode blend: writes the surfaces' depth, for what is drawn later
  rangecast::Roi covered = {}; ///< mode blend: all pixels that may show something, and a margin of
                               ///< one pixel

  /** Metres by which a view's surfaces are moved away from the viewer, times 1 - cosine of the
   *  angle between the two's directions; not in mode blend. */
  double view_gap_m = rangecast::kViewGap_m;
  /** Mode blend: metres behind the nearest surface within which views are blended. */
  double blend_range_m = rangecast::kBlendRange_m;
  int width, height;   ///< of the framebuffer, pixels
  rangecast::Roi part; ///< of it that the picture fills
};

using RenderLayer = rangecast::SurfaceLayer;
