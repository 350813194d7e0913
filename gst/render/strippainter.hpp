/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <span>

#include "blendpainter.hpp"

/** Draws range images with OpenGL 3.3 or OpenGL ES 3.0: strips, rectangles and points itself, mode
 *  blend through BlendPainter. All functions on the OpenGL thread. */
class StripPainter {
public:
  /** Compiles the shader. Errors come with the shader's log. */
  bool start (GstGLContext *context, GError **error);
  /** Deletes everything that OpenGL has of it. */
  void stop ();

  /** Whether OpenGL's textures can be as large as the layers' ROIs. */
  [[nodiscard]] bool fits (std::span<const RenderLayer> layers) const;
  /** Uploads a frame set: depth, colour and vertices of its layers, which must fit.
   *  @return their bytes */
  guint64 upload (std::span<const RenderLayer> layers);
  /** Draws one picture of what was uploaded last into the bound framebuffer. May be called as often
   *  as there are pictures of it: of two eyes, or of a camera that moves.
   *  @param layers  those that were uploaded; of images only the ROI's place and size are read
   *  @return why OpenGL cannot draw it; nullptr if it is drawn */
  const char *draw (const RenderPicture &picture, std::span<const RenderLayer> layers);

private:
  struct ViewObjects { /* OpenGL names of one view */
    guint depth = 0, colour = 0, vertices = 0, array = 0;
    std::size_t capacity = 0;  /* of the vertices, bytes */
    int width = 0, height = 0; /* of the textures, pixels */
  };
  void prepare (ViewObjects &objects, int width, int height);
  guint64 upload_layer (ViewObjects &objects, const RenderLayer &layer);
  void draw_layer (
      const ViewObjects &objects, const RenderLayer &layer, const RenderPicture &picture) const;

  /* glVertexAttribIPointer, which GStreamer's table of functions lacks */
  using AttributePointer = void (GSTGLAPI *) (
      guint index, gint size, guint type, gint stride, const void *pointer);

  AttributePointer attribute_pointer_ = nullptr;
  GstGLContext *context_ = nullptr;
  gint largest_ = 0;                       /* side of a texture, pixels */
  std::array<GstGLShader *, 3> shaders_{}; /* of strips, rectangles and points */
  BlendPainter blend_painter_;
  /* In turns: OpenGL may still read those of one frame set while the next one is uploaded. */
  std::array<std::array<ViewObjects, rangecast::kMaxViews>, 2> objects_{};
  std::size_t turn_ = 0;
};
