/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <span>

#include "glhelpers.hpp"
#include "picture.hpp"

/** Draws frame sets in mode blend: decides which views a pixel shows, and how much of each.
 *
 *  1. Depth: the nearest surface of each pixel, moved back by the blend range.
 *  2. Sum: colour times weight, and weight, of all views in front of that. A view's weight falls
 *     with the angle between its ray and the viewer's; its slant and distance to a depth edge are
 *     in its vertices (lib/rangecast/surface/blend_planes.hpp).
 *  3. Division, with smooth outlines, and small gaps filled.
 *
 *  After C. Buehler et al., "Unstructured lumigraph rendering", SIGGRAPH 2001, and M. Zwicker et
 *  al., "Surface splatting", SIGGRAPH 2001. The targets take 12 bytes a pixel (20 if precise),
 *  whatever the number of views. OpenGL 3.3, or OpenGL ES 3.0 with half-float render targets. All
 *  functions on the OpenGL thread. */
class BlendPainter {
public:
  /** Whether OpenGL can render to half-float textures. */
  static bool is_supported (GstGLContext *context);
  /** Compiles the shaders. @return false, with `error` set, if one does not compile */
  bool start (GstGLContext *context, GError **error);
  /** Deletes everything that OpenGL has of it. */
  void stop ();

  /** Uploads the vertices of a frame set. @return their bytes */
  guint64 upload (std::span<const RenderLayer> layers);
  /** Draws one picture of what was uploaded last into the bound framebuffer, whose depth has been
   *  cleared if the picture keeps depth. If the picture does not fill the framebuffer, scissors
   *  keep to its part afterwards.
   *  @return false if OpenGL has no float framebuffer of the picture's size; nothing is drawn */
  bool draw (const RenderPicture &picture, std::span<const RenderLayer> layers);

private:
  struct ViewObjects { /* OpenGL names of one view */
    guint vertices = 0, array = 0;
    std::size_t capacity = 0; /* of the buffer, bytes */
  };
  enum Pass { kDepth, kSum, kPasses };
  bool bind_targets (int width, int height, bool precise);
  bool make_targets (int width, int height, bool precise);
  void delete_targets ();
  void draw_layers (
      std::span<const RenderLayer> layers, const RenderPicture &picture, Pass pass) const;
  void divide (const RenderPicture &picture, float outside) const;

  GstGLContext *context_ = nullptr;
  bool in_software_ = false; /* llvmpipe: converting half floats costs it a fifth of the time */
  std::array<GstGLShader *, kPasses> shaders_{};
  std::array<GstGLShader *, 2> divide_shaders_{}; /* without depth, with it */
  guint array_ = 0;                               /* of draw_covering() */
  /* In turns: OpenGL may still read those of one frame set while the next one is uploaded. */
  std::array<std::array<ViewObjects, rangecast::kMaxViews>, 2> objects_{};
  std::size_t turn_ = 0;

  guint framebuffer_ = 0;
  std::array<guint, 2> targets_{}; /* textures: sums, depth */
  int width_ = 0, height_ = 0;
  bool precise_ = false, failed_ = false; /* with that size */
  gint output_ = 0;                       /* framebuffer that the picture goes to */
};
