/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

/* What the painters share. All functions are called on the OpenGL thread. */

#include <gst/gl/gl.h>
#include <gst/gl/gstglfuncs.h>

#include <rangecast/geometry/rig.hpp>
#include <rangecast/surface/orbit.hpp>
#include <rangecast/surface/painting.hpp>
#include <rangecast/surface/shaders.hpp>

#include "category.hpp"

/* Of OpenGL 3.3 and OpenGL ES 3.0, but not in every header. */
#ifndef GL_DRAW_FRAMEBUFFER_BINDING
#define GL_DRAW_FRAMEBUFFER_BINDING 0x8CA6
#endif
#ifndef GL_RGBA8
#define GL_RGBA8 0x8058
#endif
#ifndef GL_DEPTH_COMPONENT24
#define GL_DEPTH_COMPONENT24 0x81A6
#endif

/** Whether the context is one of OpenGL ES 3.0 or later. */
inline bool
is_gles (GstGLContext *context)
{
  return gst_gl_context_check_gl_version (context, GST_GL_API_GLES2, 3, 0);
}

/** Allocates or replaces the image of the texture that is bound to GL_TEXTURE_2D; fetches get its
 *  nearest texel. @param data  nullptr: undefined content */
void define_texture (const GstGLFuncs *gl, guint internal, int width, int height, guint format,
    guint type, const void *data = nullptr);

/** Writes `size` bytes into the buffer bound to GL_ARRAY_BUFFER. Reallocates its storage only if it
 *  is too small, with 50 % headroom.
 *  @param[in,out] capacity  bytes of the storage; 0 before the first call */
void upload_vertices (
    const GstGLFuncs *gl, std::size_t &capacity, const void *data, std::size_t size);

/** @name Shaders @{ */

/** Compiles and links sources without a version line, for OpenGL 3.3 or OpenGL ES 3.0.
 *  Returns: (transfer full): or nullptr, with the compiler's log in `error` */
GstGLShader *make_shader (
    GstGLContext *context, const char *vertex, const char *fragment, GError **error);

/** The same of shaders that the library has. */
GstGLShader *make_shader (
    GstGLContext *context, rangecast::Shader vertex, rangecast::Shader fragment, GError **error);

/** Covers the viewport with one triangle by Shader::kCoveringVertex, at a depth of u_covering_depth
 *  (-1 to 1; 0 unless it is set).
 *  @param array  without attributes: the core profile draws nothing without a vertex array */
void draw_covering (const GstGLFuncs *gl, guint array);

/** Uniforms of the library's vertex shaders: where a layer is drawn. */
void set_position_uniforms (GstGLShader *shader, const rangecast::LayerPlace &place);

/** The shader of a painter that is used now and then: compiled by the first picture that needs it.
 */
class LazyShader {
public:
  /** Compiles it with Shader::kCoveringVertex unless that has been done, with a vertex array.
   *  @return false after a failure, which is logged once */
  bool make (GstGLContext *context, const char *fragment, const char *purpose);
  bool make (GstGLContext *context, rangecast::Shader fragment, const char *purpose);
  /** After make(). */
  [[nodiscard]] GstGLShader *shader () const { return shader_; }
  [[nodiscard]] guint array () const { return array_; }
  /** Deletes what OpenGL has of it. @return the context; nullptr if there was nothing */
  GstGLContext *stop ();

private:
  GstGLContext *context_ = nullptr;
  GstGLShader *shader_ = nullptr;
  guint array_ = 0;
  bool failed_ = false;
};
/** @} */

/** What StripPainter and BlendPainter draw: one picture of a frame set. */
struct RenderPicture {
  rangecast::Mat4 clip_from_world;
  float background[4];        ///< R, G, B, A
  float background_shade = 0; ///< see set_background_uniforms()
  float point_size;           ///< in footprints of a pixel
  float pixels_per_unit;      ///< pixels that a length of 1 at a distance of 1 covers
  rangecast::StripMode mode;
  double depth_step;
  bool back_faces = false;     ///< mode strips: draws both sides; mode blend always does
  rangecast::Roi covered = {}; ///< mode blend: all pixels that may show something, and a margin of
                               ///< one pixel

  /** Mode blend: metres behind the nearest surface within which views are blended. */
  double blend_range_m = rangecast::kBlendRange_m;
  int width, height;   ///< of the framebuffer, pixels
  rangecast::Roi part; ///< of it that the picture fills
};

using RenderLayer = rangecast::SurfaceLayer;
