/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gl/gl.h>

#include <rangecast/geometry/range_image.hpp>
#include <rangecast/surface/view_matrices.hpp>

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
   *  @param precise  32-bit floats instead of 16-bit ones; not with OpenGL ES
   *  @param covered  pixels that something may be drawn in, and one more on each side: scissors
   *                  keep to them until resolve()
   *  @return false if OpenGL has no such framebuffer; what was bound is bound again */
  bool begin_depth (int width, int height, bool precise, const rangecast::Roi &covered);
  /** From here on what is drawn adds up: R, G, B times weight, and the weight. Depth is compared,
   *  not written. */
  void begin_sum ();
  /** Divides, into the framebuffer that was bound before begin_depth(), and smooths outlines.
   *  @param part        pixels that this picture fills; if that is not the whole framebuffer,
   *                     scissors keep to it, now and afterwards
   *  @param covered     those of begin_depth(); the rest becomes background
   *  @param background  R, G, B, A, straight
   *  @param shade       see BackgroundPainter::draw(), which has drawn it if it is not 0
   *  @param shift       of the depth pass
   *  @param outside     pixels of less weight show only the inside of surfaces; in gaps up to a
   * 30th of the height of `part` they take the colours around them, and less of those in gaps up to
   * a 15th
   *  @param keeps_depth the surfaces' depth is written, too, into a depth buffer that has been
   *                     cleared: what is drawn later stands among them */
  void resolve (const rangecast::Roi &part, const rangecast::Roi &covered,
      const float (&background)[4], float shade, const rangecast::DepthShift &shift, float outside,
      bool keeps_depth);

private:
  bool make (int width, int height, bool precise);
  void delete_targets ();

  GstGLContext *context_ = nullptr;
  GstGLShader *shaders_[2] = {}; /* of resolve(): without depth, with it */
  guint framebuffer_ = 0, array_ = 0;
  guint textures_[2] = {}; /* sums, depth */
  int width_ = 0, height_ = 0;
  bool precise_ = false, failed_ = false; /* with that size */
  gint before_ = 0;
};
