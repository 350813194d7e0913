/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <span>
#include <vector>

#include "glhelpers.hpp"

/** Draws frame sets in mode blend: decides which views a pixel shows, and how much of each.
 *
 *  1. Each view into a cell of an atlas (lib/rangecast/surface/painting.hpp): colour and weight of
 *     its nearest surface, and depth. A view's weight falls with the angle between its ray and the
 *     viewer's; its slant and distance to a depth edge are in its vertices
 *     (lib/rangecast/surface/blend_planes.hpp).
 *  2. Sum: colour times weight of the cells that are within the blend range of the nearest one,
 *     divided by the sum of weights.
 *  3. The picture, with smooth outlines.
 *  4. Small gaps are filled, only where pass 3 has found one.
 *
 *  After C. Buehler et al., "Unstructured lumigraph rendering", SIGGRAPH 2001. The targets take 8
 *  bytes a pixel, and as many for each cell. OpenGL 3.3 or OpenGL ES 3.0. All functions on the
 *  OpenGL thread. */
class BlendPainter {
public:
  /** Compiles the shaders. @return false, with `error` set, if one does not compile */
  bool start (GstGLContext *context, GError **error);
  /** Deletes everything that OpenGL has of it. */
  void stop ();

  /** Uploads the vertices of a frame set. @return their bytes */
  guint64 upload (std::span<const RenderLayer> layers);
  /** Draws one picture of what was uploaded last into the bound framebuffer, whose depth has been
   *  cleared if the picture keeps depth. If the picture does not fill the framebuffer, scissors
   *  keep to its part afterwards.
   *  @return why OpenGL cannot draw it, and nothing is drawn; nullptr if it is drawn */
  const char *draw (const RenderPicture &picture, std::span<const RenderLayer> layers);

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
  const char *start_picture (const RenderPicture &picture, std::span<const RenderLayer> layers);
  bool prepare (Target &target, int width, int height) const;
  void delete_target (Target &target) const;
  void bind_textures (GstGLShader *shader, const Target &target, const char *colours) const;
  void unbind_textures () const;
  void draw_cells (const RenderPicture &picture, std::span<const RenderLayer> layers) const;
  void draw_layer (const RenderPicture &picture, const RenderLayer &layer) const;
  void add_up (const RenderPicture &picture) const;
  void finish (const RenderPicture &picture) const;
  void cover_from_sums (GstGLShader *shader, const RenderPicture &picture) const;

  GstGLContext *context_ = nullptr;
  gint largest_ = 0; /* side of a texture, pixels */
  GstGLShader *cell_shader_ = nullptr, *fill_shader_ = nullptr, *finish_shader_ = nullptr;
  std::array<LazyShader, rangecast::kMaxBlendCells> sum_shaders_; /* by number of cells - 1 */
  guint array_ = 0;                                               /* of draw_covering() */
  /* In turns: OpenGL may still read those of one frame set while the next one is uploaded. */
  std::array<std::array<ViewObjects, rangecast::kMaxViews>, 2> objects_{};
  std::size_t turn_ = 0;

  Target cells_, sums_;
  std::vector<double> alignments_;
  rangecast::BlendAtlas atlas_;
  gint output_ = 0; /* framebuffer that the picture goes to */
};
