/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

/* What is drawn below and above the surfaces. All functions on the OpenGL thread. */

#include <rangecast/geometry/image_view.hpp>
#include <rangecast/surface/orbit.hpp>

#include "glhelpers.hpp"

/** Uniforms of the background, in the fragment shaders of shaders.hpp that paint it.
 *  @param colour  R, G, B, A, straight
 *  @param shade   0 to 1: share by which the colour is lighter in the first row and darker in the
 *                 last one
 *  @param part    pixels that the picture fills */
void set_background_uniforms (
    GstGLShader *shader, const float (&colour)[4], float shade, const rangecast::Roi &part);

/** Paints the background of pictures that are not blended. */
class BackgroundPainter {
public:
  /** Draws where the bound framebuffer's depth is as it was cleared.
   *  @param colour, shade, part  see set_background_uniforms() */
  void draw (
      GstGLContext *context, const float (&colour)[4], float shade, const rangecast::Roi &part);
  /** Deletes everything that OpenGL has of it. */
  void stop () { shader_.stop (); }

private:
  LazyShader shader_;
};

/** Lays a small opaque picture, as that of show-stats, over the upper left corner of a larger one.
 *  */
class PanelPainter {
public:
  /** Draws into the bound framebuffer; nothing if OpenGL has no shader for it.
   *  @param panel    R, G, B, unused; at most 4096 pixels wide and high
   *  @param changed  it differs from the last one
   *  @param x, y     pixels: the origin of the picture below
   *  @param scale    output pixels per pixel of the panel, each way
   *  @return bytes uploaded */
  guint64 draw (GstGLContext *context, const rangecast::ImageView<const rangecast::Rgbx> &panel,
      bool changed, int x, int y, int scale);
  /** Deletes everything that OpenGL has of it. */
  void stop ();

private:
  LazyShader shader_;
  guint texture_ = 0;
};
