/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gl/gl.h>
#include <gst/gl/gstglfuncs.h>

#include <array>
#include <rangecast/surface/painting.hpp>
#include <span>
#include <string>
#include <vector>

/** Whether the context is one of OpenGL ES 3.0 or later. On the OpenGL thread, as all here. */
inline bool
is_gles (GstGLContext *context)
{
  return gst_gl_context_check_gl_version (context, GST_GL_API_GLES2, 3, 0);
}
/** Whether it is that, or OpenGL 3.3 or later. */
inline bool
has_shaders (GstGLContext *context)
{
  constexpr auto kDesktop = GstGLAPI (GST_GL_API_OPENGL3 | GST_GL_API_OPENGL);
  return is_gles (context) || gst_gl_context_check_gl_version (context, kDesktop, 3, 3);
}
/** Compiles and links sources without a version line, for OpenGL 3.3 or OpenGL ES 3.0.
 *  Returns: (transfer full): or nullptr, with the compiler's log in `error` */
GstGLShader *make_shader (
    GstGLContext *context, const std::string &vertex, const std::string &fragment, GError **error);

/** Draws frame sets with OpenGL 3.3 or OpenGL ES 3.0: decides which views a pixel shows, and how
 * much of each.
 *
 *  1. Each view into a cell of an atlas (lib/rangecast/surface/painting.hpp): colour and weight of
 *     its nearest surface, and depth. A view's weight falls with the angle between its ray and the
 *     viewer's; its slant and distance to a depth edge are in its vertices
 *     (lib/rangecast/surface/blend_planes.hpp).
 *  2. Sum: colour times weight of the cells that are within the blend range of the nearest one,
 *     divided by the sum of weights.
 *  3. The picture: background, smooth outlines, small gaps filled.
 *
 *  After C. Buehler et al., "Unstructured lumigraph rendering", SIGGRAPH 2001. The targets take 8
 *  bytes a pixel, and as many for each cell. All functions on the OpenGL thread. */
class SurfacePainter {
public:
  /** Compiles the shaders. @return false, with `error` set, if OpenGL is too old for them */
  bool start (GstGLContext *context, GError **error);
  /** Deletes everything that OpenGL has of it. */
  void stop ();

  /** Uploads the vertices of a frame set. @return their bytes */
  guint64 upload (std::span<const rangecast::SurfaceLayer> layers);
  /** Draws one picture of what was uploaded last into the bound framebuffer. May be called as often
   *  as there are pictures of it: of two eyes, or of a camera that moves.
   *  @return why OpenGL cannot draw it, and nothing is drawn; nullptr if it is drawn */
  const char *draw (
      const rangecast::SurfacePicture &picture, std::span<const rangecast::SurfaceLayer> layers);

private:
  struct ViewObjects { /* OpenGL names of one view */
    guint vertices = 0, array = 0;
    std::size_t capacity = 0; /* of the buffer, bytes */
  };
  /* A framebuffer with textures of colours and depth, which grow. */
  struct Target {
    guint framebuffer = 0;
    std::array<guint, 2> textures{};
    int width = 0, height = 0;
    bool failed = false; /* with that size */
  };
  const char *start_picture ();
  bool prepare (Target &target, int width, int height) const;
  void delete_target (Target &target) const;
  void draw_cells () const;
  void draw_layer (const rangecast::SurfaceLayer &layer) const;
  void add_up () const;
  void finish () const;
  void cover (GstGLShader *shader, const Target &from, const char *colours) const;

  GstGLContext *context_ = nullptr;
  gint largest_ = 0; /* side of a texture, pixels */
  GstGLShader *cell_shader_ = nullptr, *finish_shader_ = nullptr;
  std::array<GstGLShader *, rangecast::kMaxBlendCells> sum_shaders_{}; /* by number of cells - 1 */
  guint array_ = 0;                                                    /* without attributes */
  /* In turns: OpenGL may still read those of one frame set while the next one is uploaded. */
  std::array<std::array<ViewObjects, rangecast::kMaxViews>, 2> objects_{};
  std::size_t turn_ = 0;

  Target cells_, sums_;
  std::vector<double> alignments_;
  rangecast::BlendAtlas atlas_;
  /* Of the picture that is drawn. */
  rangecast::SurfacePicture picture_;
  std::span<const rangecast::SurfaceLayer> layers_;
};
