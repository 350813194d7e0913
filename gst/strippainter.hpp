/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gl/gl.h>
#include <gst/gl/gstglfuncs.h>

#include <array>
#include <rangecast/geometry/rig.hpp>
#include <rangecast/strips/orbit.hpp>
#include <rangecast/strips/strips.hpp>
#include <span>

/** Draws range images with OpenGL (core 3.3 or GLES 3.0). All functions in the GL thread. */
class StripPainter {
public:
  /** Compiles the shader. Errors come with the shader's log. */
  bool start (GstGLContext *context, GError **error);
  /** Deletes everything that OpenGL holds for us. */
  void stop ();

  struct Picture {
    rangecast::Mat4 clip_from_world;
    float background[4];   ///< R, G, B, A
    float point_size;      ///< of a pixel's footprint
    float pixels_per_unit; ///< pixels that a length of 1 at a distance of 1 covers
    rangecast::StripMode mode;
    double depth_step;
    bool back_faces = false; ///< of strips, where no front is

    /** Metres by which what a view draws moves away from the viewer, times 1 - cos of the angle
     *  between the two's directions. */
    double view_gap_m = 0.012;
    int width, height;
  };
  struct Layer {
    rangecast::RangeImage image;
    const rangecast::View *view;
    std::span<const rangecast::StripVertex> vertices;
  };
  /** Draws one picture into the bound framebuffer. @return bytes uploaded */
  guint64 draw (const Picture &picture, std::span<const Layer> layers);

private:
  struct ViewObjects { /* OpenGL names of one view */
    guint depth = 0, colour = 0, vertices = 0, array = 0;
    int width = 0, height = 0;
  };
  void prepare (ViewObjects &objects, int width, int height);
  guint64 upload (ViewObjects &objects, const Layer &layer);
  void begin (const Picture &picture);
  void end ();
  enum class Side { kFront, kBack };
  void draw_layer (
      const ViewObjects &objects, const Layer &layer, const Picture &picture, Side side);

  /* glVertexAttribIPointer, which GStreamer's table of functions lacks */
  using AttributePointer = void (GSTGLAPI *) (
      guint index, gint size, guint type, gint stride, const void *pointer);

  AttributePointer attribute_pointer_ = nullptr;
  GstGLContext *context_ = nullptr;
  std::array<GstGLShader *, 3> shaders_{}; /* by mode */
  /* In turns: what the last picture reads may still be in use while this one's is written. */
  std::array<std::array<ViewObjects, rangecast::kMaxViews>, 2> objects_{};
  std::size_t turn_ = 0;
};
