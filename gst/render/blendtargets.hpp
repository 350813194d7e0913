/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gl/gl.h>

/** Render targets in which views of one surface are blended, and the pass that divides: first the
 *  depth of the nearest surface, then sums of colour times weight, of weights, and the largest
 *  coverage of each pixel. Their memory does not depend on the number of views: 14 bytes a pixel.
 *  OpenGL 3.3, or OpenGL ES 3.0 with half-float render targets. All functions in the GL thread. */
class BlendTargets {
public:
  /** Compiles the shader. @return false if OpenGL cannot render to half-float textures, or with
   *  `error` set if the shader does not compile */
  bool start (GstGLContext *context, GError **error);
  /** Deletes everything that OpenGL holds for us. */
  void stop ();

  /** Binds and clears the targets, made anew if their size changes, to draw depth only. Scissors
   *  stay in force.
   *  @return false if OpenGL has no such framebuffer; what was bound is bound again */
  bool begin_depth (int width, int height);
  /** From here on what is drawn adds up: output 0 is colour times weight and coverage, output 1 the
   *  weight. Depth is compared, not written. */
  void begin_sum ();
  /** Divides, into the framebuffer that was bound before begin_depth(), and writes depth, too. What
   *  is drawn later stands among the surfaces.
   *  @param background  R, G, B, A, straight
   *  @param behind      first and second coefficient of u_behind that begin_depth's pictures were
   *                     drawn with */
  void resolve (const float (&background)[4]);

private:
  bool make (int width, int height);
  void delete_targets ();

  GstGLContext *context_ = nullptr;
  GstGLShader *shader_ = nullptr;
  guint framebuffer_ = 0, array_ = 0;
  guint textures_[3] = {}; /* colour and coverage, weight, depth */
  int width_ = 0, height_ = 0;
  gint before_ = 0;
};
