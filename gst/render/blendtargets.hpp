/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gl/gl.h>

#include <rangecast/geometry/range_image.hpp>

/** Render targets in which views of one surface are blended, and the pass that divides: first the
 *  depth of the nearest surface, then sums of colour times weight and of weights. Their memory does
 *  not depend on the number of views: 12 bytes a pixel (20 if precise). OpenGL 3.3, or OpenGL
 * ES 3.0 with half-float render targets. All functions in the GL thread. */
class BlendTargets {
public:
  /** Whether OpenGL can render to half-float textures. */
  static bool is_supported (GstGLContext *context);
  /** Compiles the shader. @return false, with `error` set, if it does not compile */
  bool start (GstGLContext *context, GError **error);
  /** Deletes everything that OpenGL holds for us. */
  void stop ();

  /** Binds and clears the targets, made anew if size or precision change, to draw depth only.
   *  Scissors stay in force.
   *  @param precise  32-bit floats instead of 16-bit ones; not with OpenGL ES
   *  @return false if OpenGL has no such framebuffer (logged once); what was bound is bound again
   */
  bool begin_depth (int width, int height, bool precise);
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
   *  @param part        pixels that this picture fills
   *  @param background  R, G, B, A, straight
   *  @param shade       see BackgroundPainter::draw() */
  void resolve (const rangecast::Roi &part, const float (&background)[4], float shade,
      const DepthShift &shift);

private:
  bool make (int width, int height, bool precise);
  void delete_targets ();

  GstGLContext *context_ = nullptr;
  GstGLShader *shader_ = nullptr;
  guint framebuffer_ = 0, array_ = 0;
  guint textures_[2] = {}; /* sums, depth */
  int width_ = 0, height_ = 0;
  bool precise_ = false, failed_ = false; /* with that size */
  gint before_ = 0;
};
