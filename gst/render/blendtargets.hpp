/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gl/gl.h>

/** Render targets in which views of one surface are blended, and the pass that divides: first the
 *  depth of the nearest surface, then sums of colour times weight and of weights. Their memory does
 *  not depend on the number of views: 12 bytes a pixel. OpenGL 3.3, or OpenGL ES 3.0 with
 * half-float render targets. All functions in the GL thread. */
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
  /** From here on what is drawn adds up: R, G, B times weight, and the weight. Depth is compared,
   *  not written. */
  void begin_sum ();
  /** By what surfaces were moved away from the viewer in the depth pass: their z in normalised
   *  device coordinates, a + b / w, became a + b / (w + g). */
  struct DepthShift {
    float a, b, g;
  };
  /** Divides, into the framebuffer that was bound before begin_depth(), smooths outlines, and
   * writes the surfaces' depth: what is drawn later stands among them.
   *  @param background  R, G, B, A, straight */
  void resolve (const float (&background)[4], const DepthShift &shift);

private:
  bool make (int width, int height);
  void delete_targets ();

  GstGLContext *context_ = nullptr;
  GstGLShader *shader_ = nullptr;
  guint framebuffer_ = 0, array_ = 0;
  guint textures_[2] = {}; /* sums, depth */
  int width_ = 0, height_ = 0;
  gint before_ = 0;
};
