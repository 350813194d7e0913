/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gl/gl.h>
#include <gst/gl/gstglfuncs.h>

#include <array>
#include <span>

#include "blendpainter.hpp"

/** Draws range images with OpenGL (core 3.3 or GLES 3.0), in mode blend through BlendPainter. All
 * functions in the GL thread. */
class StripPainter {
public:
  /** Compiles the shader. Errors come with the shader's log. */
  bool start (GstGLContext *context, GError **error);
  /** Deletes everything that OpenGL holds for us. */
  void stop ();

  using Picture = RenderPicture;
  using Layer = RenderLayer;
  /** Whether OpenGL's textures can be as large as the layers' ROIs. */
  [[nodiscard]] bool fits (std::span<const Layer> layers) const;
  /** Hands a frame set to OpenGL: depth, colour and vertices of its layers, which must fit.
   *  @return their bytes */
  guint64 upload (std::span<const Layer> layers);
  /** Draws one picture of what was uploaded last into the bound framebuffer. May be called as often
   *  as there are pictures of it: of two eyes, or of a camera that moves.
   *  @param layers  those that were uploaded; of images only the ROI's place and size are read
   *  @return false if OpenGL has no float framebuffer of that size, for mode blend */
  bool draw (const Picture &picture, std::span<const Layer> layers);

private:
  struct ViewObjects { /* OpenGL names of one view */
    guint depth = 0, colour = 0, vertices = 0, array = 0;
    int width = 0, height = 0; /* of the textures, pixels */
  };
  void prepare (ViewObjects &objects, int width, int height);
  guint64 upload_layer (ViewObjects &objects, const Layer &layer);
  void begin (const Picture &picture, GstGLShader *shader);
  void end ();
  enum class Side { kFront, kBack };
  void draw_layer (const ViewObjects &objects, const Layer &layer, const Picture &picture,
      GstGLShader *shader, Side side);
  void draw_layers (std::span<const Layer> layers, const Picture &picture, GstGLShader *shader);

  /* glVertexAttribIPointer, which GStreamer's table of functions lacks */
  using AttributePointer = void (GSTGLAPI *) (
      guint index, gint size, guint type, gint stride, const void *pointer);

  AttributePointer attribute_pointer_ = nullptr;
  GstGLContext *context_ = nullptr;
  gint largest_ = 0;                       /* side of a texture, pixels */
  std::array<GstGLShader *, 3> shaders_{}; /* of strips, rectangles and points */
  BlendPainter blend_painter_;
  /* In turns: what pictures of one frame set read may be in use while the next one is written. */
  std::array<std::array<ViewObjects, rangecast::kMaxViews>, 2> objects_{};
  std::size_t turn_ = 0;
};
