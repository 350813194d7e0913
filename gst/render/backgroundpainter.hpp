/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "glhelpers.hpp"

/** Uniforms of the background, in the fragment shaders of shaders.hpp that paint it.
 *  @param colour  R, G, B, A, straight
 *  @param shade   0 to 1: share by which the colour is lighter in the first row and darker in the
 *                 last one
 *  @param part    pixels that the picture fills */
void set_background_uniforms (
    GstGLShader *shader, const float (&colour)[4], float shade, const rangecast::Roi &part);

/** Paints the background of pictures that are not blended. All functions on the OpenGL thread. */
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
