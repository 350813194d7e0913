/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gl/gl.h>

#include <array>
#include <span>

#include "blendtargets.hpp"
#include "picture.hpp"

/** Draws frame sets in mode blend: the nearest surface of each pixel, moved back by the blend
 * range; then colour times weight of all views within that range; then their quotient (C. Buehler
 * et al., "Unstructured lumigraph rendering", SIGGRAPH 2001; M. Zwicker et al., "Surface
 * splatting", SIGGRAPH 2001). OpenGL 3.3, or OpenGL ES 3.0 with half-float render targets. All
 * functions in the GL thread. */
class BlendPainter {
public:
  /** Compiles the shaders. @return false, with `error` set, if one does not compile */
  bool start (GstGLContext *context, GError **error);
  /** Deletes everything that OpenGL holds for us. */
  void stop ();

  /** Hands the vertices of a frame set to OpenGL. @return their bytes */
  guint64 upload (std::span<const RenderLayer> layers);
  /** Draws one picture of what was uploaded last into the bound framebuffer.
   *  @return false if OpenGL has no float framebuffer of the picture's size; nothing is drawn */
  bool draw (const RenderPicture &picture, std::span<const RenderLayer> layers);

private:
  struct ViewObjects { /* OpenGL names of one view */
    guint vertices = 0, array = 0;
    std::size_t capacity = 0; /* of the buffer, bytes */
  };
  enum Pass { kDepth, kSum, kPasses };
  void draw_layers (
      std::span<const RenderLayer> layers, const RenderPicture &picture, Pass pass) const;

  GstGLContext *context_ = nullptr;
  std::array<GstGLShader *, kPasses> shaders_{};
  BlendTargets targets_;
  bool in_software_ = false; /* llvmpipe: converting half floats costs it a fifth of the time */
  /* In turns: what pictures of one frame set read may be in use while the next one is written. */
  std::array<std::array<ViewObjects, rangecast::kMaxViews>, 2> objects_{};
  std::size_t turn_ = 0;
};
