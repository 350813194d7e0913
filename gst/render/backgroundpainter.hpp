/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gl/gl.h>

#include <rangecast/geometry/range_image.hpp>

/** For fragment shaders: `vec4 background (vec2 at)`, the background's colour at that pixel of the
 *  framebuffer; first in the shader. Its uniforms: set_background_uniforms(). */
extern const char *const kBackgroundFunction;
/** @param colour  R, G, B, A, straight
 *  @param shade   see BackgroundPainter::draw()
 *  @param part    pixels that the picture fills */
void set_background_uniforms (
    GstGLShader *shader, const float (&colour)[4], float shade, const rangecast::Roi &part);

/** Paints the background of pictures that are drawn without blending. All functions in the GL
 *  thread. */
class BackgroundPainter {
public:
  /** Draws where the bound framebuffer's depth is as it was cleared; makes what it needs when first
   *  called.
   *  @param colour  R, G, B, A
   *  @param shade   0 to 1: share by which the colour is lighter in the first row, and darker in
   * the last one
   *  @param part    pixels that the picture fills */
  void draw (
      GstGLContext *context, const float (&colour)[4], float shade, const rangecast::Roi &part);
  /** Deletes everything that OpenGL holds for us. */
  void stop ();

private:
  GstGLContext *context_ = nullptr;
  GstGLShader *shader_ = nullptr;
  guint array_ = 0;
  bool failed_ = false; /* to make the shader: not to be tried for each picture */
};
