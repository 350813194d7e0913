/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gl/gl.h>
#include <gst/gl/gstglfuncs.h>

#include <array>
#include <rangecast/geometry/rig.hpp>
#include <rangecast/strips/orbit.hpp>
#include <rangecast/strips/strips.hpp>
#include <rangecast/surface/blend_planes.hpp>
#include <span>

#include "render/blendtargets.hpp"

/** Draws range images with OpenGL (core 3.3 or GLES 3.0). All functions in the GL thread. */
class StripPainter {
public:
  /** Compiles the shader. Errors come with the shader's log. */
  bool start (GstGLContext *context, GError **error);
  /** Deletes everything that OpenGL holds for us. */
  void stop ();

  struct Picture {
    rangecast::Mat4 clip_from_world;
    float background[4];        ///< R, G, B, A
    float background_shade = 0; ///< mode blend: see BackgroundPainter
    float point_size;           ///< of a pixel's footprint
    float pixels_per_unit;      ///< pixels that a length of 1 at a distance of 1 covers
    rangecast::StripMode mode;
    double depth_step;
    bool back_faces = false; ///< mode strips: where no front is; mode blend shows all

    /** Metres by which what a view draws moves away from the viewer, times 1 - cos of the angle
     *  between the two's directions. */
    double view_gap_m = 0.012;
    /** Mode blend: metres by which what a pixel shows may lie behind the nearest surface. */
    double blend_range_m = 0.02;
    int width, height;   ///< of the framebuffer, pixels
    rangecast::Roi part; ///< of it that the picture fills
  };
  struct Layer {
    rangecast::ConstRangeImage image;
    const rangecast::View *view;
    std::span<const rangecast::StripVertex> vertices;
    const rangecast::BlendPlanes *planes = nullptr; ///< mode blend
  };
  /** Whether OpenGL's textures can be as large as the layers' ROIs. */
  [[nodiscard]] bool fits (std::span<const Layer> layers) const;
  /** Hands a frame set to OpenGL: depth, colour and vertices of its layers, which must fit.
   *  @return their bytes */
  guint64 upload (std::span<const Layer> layers);
  /** Draws one picture of what was uploaded last into the bound framebuffer. May be called as often
   *  as there are pictures of it: of two eyes, or of a camera that moves.
   *  @param layers  those that were uploaded; of images only the ROI's place and size are read */
  void draw (const Picture &picture, std::span<const Layer> layers);
  /** The matrix whose depths are all in the nearer half of the depth buffer, where fronts are with
   *  back_faces, or in the farther one. */
  static rangecast::Mat4 in_half_of_depths (rangecast::Mat4 clip_matrix, bool farther);

private:
  struct ViewObjects { /* OpenGL names of one view */
    guint depth = 0, colour = 0, weight = 0, vertices = 0, array = 0;
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
  void blend (const Picture &picture, std::span<const Layer> layers);

  /* glVertexAttribIPointer, which GStreamer's table of functions lacks */
  using AttributePointer = void (GSTGLAPI *) (
      guint index, gint size, guint type, gint stride, const void *pointer);

  AttributePointer attribute_pointer_ = nullptr;
  GstGLContext *context_ = nullptr;
  gint largest_ = 0; /* side of a texture, pixels */
  /* Of strips, rectangles and points; of blended strips their depth, and their sums. */
  enum ShaderIndex { kStrips, kRectangles, kPoints, kBlendDepth, kBlendSum, kShaders };
  std::array<GstGLShader *, kShaders> shaders_{};
  BlendTargets targets_;
  bool in_software_ =
      false; /* Mesa's llvmpipe: converting half floats costs it a fifth of the time */
  /* In turns: what pictures of one frame set read may be in use while the next one is written. */
  std::array<std::array<ViewObjects, rangecast::kMaxViews>, 2> objects_{};
  std::size_t turn_ = 0;
};
