/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "strippainter.hpp"

#include <algorithm>
#include <rangecast/surface/painting.hpp>

using rangecast::Mat4;
using rangecast::Shader;
using rangecast::StripMode;
using rangecast::StripVertex;

#ifndef GL_R16UI
#define GL_R16UI 0x8234
#endif
#ifndef GL_RED_INTEGER
#define GL_RED_INTEGER 0x8D94
#endif
#ifndef GL_UNPACK_ROW_LENGTH
#define GL_UNPACK_ROW_LENGTH 0x0CF2
#endif
#ifndef GL_PROGRAM_POINT_SIZE
#define GL_PROGRAM_POINT_SIZE 0x8642
#endif

namespace {

constexpr Shader kVertexShaders[] = {
    Shader::kStripVertex, Shader::kRectangleVertex, Shader::kPointVertex};
static_assert (int (StripMode::kStrips) == 1 && int (StripMode::kRectangles) == 2 &&
               int (StripMode::kPoints) == 3); /* the order in draw() */

/* Textures grow in steps, so that a ROI that follows a person does not need new ones in each
 * picture. */
int
texture_side (int pixels, int max)
{
  constexpr int kStep = 64;
  return std::min ((pixels + kStep - 1) / kStep * kStep, max);
}

} // namespace

bool
StripPainter::start (GstGLContext *context, GError **error)
{
  context_ = context;
  if (!is_gles (context) && !gst_gl_context_check_gl_version (
                                context, GstGLAPI (GST_GL_API_OPENGL3 | GST_GL_API_OPENGL), 3, 3)) {
    g_set_error (error, GST_GL_CONTEXT_ERROR, GST_GL_CONTEXT_ERROR_OLD_LIBS,
        "expected OpenGL 3.3 or OpenGL ES 3.0");
    return false;
  }
  attribute_pointer_ = reinterpret_cast<AttributePointer> (
      gst_gl_context_get_proc_address (context, "glVertexAttribIPointer"));
  if (!attribute_pointer_) {
    g_set_error (error, GST_GL_CONTEXT_ERROR, GST_GL_CONTEXT_ERROR_OLD_LIBS,
        "OpenGL has no glVertexAttribIPointer");
    return false;
  }
  context->gl_vtable->GetIntegerv (GL_MAX_TEXTURE_SIZE, &largest_);
  if (!blend_painter_.start (context, error))
    return false;
  for (std::size_t i = 0; i < shaders_.size (); i++) {
    shaders_[i] = make_shader (context, kVertexShaders[i], Shader::kColourFragment, error);
    if (!shaders_[i])
      return false;
  }
  return true;
}

void
StripPainter::stop ()
{
  if (!context_)
    return;
  const GstGLFuncs *gl = context_->gl_vtable;
  for (auto &turn : objects_)
    for (ViewObjects &objects : turn) {
      if (objects.depth) {
        const guint textures[] = {objects.depth, objects.colour};
        gl->DeleteTextures (2, textures);
        gl->DeleteBuffers (1, &objects.vertices);
        gl->DeleteVertexArrays (1, &objects.array);
      }
      objects = {};
    }
  for (GstGLShader *&shader : shaders_)
    gst_clear_object (&shader);
  blend_painter_.stop ();
  context_ = nullptr;
}

bool
StripPainter::fits (std::span<const RenderLayer> layers) const
{
  return std::ranges::all_of (
      layers, [&] (const RenderLayer &layer) { /* mode blend has no textures */
        return layer.vertices.empty () ||
               std::max (layer.image.depth.width, layer.image.depth.height) <= largest_;
      });
}

/* Makes the objects of a view, or larger textures, which stay that large. */
void
StripPainter::prepare (ViewObjects &objects, int width, int height)
{
  const GstGLFuncs *gl = context_->gl_vtable;
  if (!objects.depth) {
    gl->GenTextures (1, &objects.depth);
    gl->GenTextures (1, &objects.colour);
    gl->GenBuffers (1, &objects.vertices);
    gl->GenVertexArrays (1, &objects.array);
    gl->BindVertexArray (objects.array);
    gl->BindBuffer (GL_ARRAY_BUFFER, objects.vertices);
    gl->EnableVertexAttribArray (0); /* as the shaders' layout says */
    attribute_pointer_ (0, 1, GL_UNSIGNED_INT, sizeof (StripVertex), nullptr);
  }
  if (objects.width >= width && objects.height >= height)
    return;
  objects.width = width = std::max (objects.width, texture_side (width, largest_));
  objects.height = height = std::max (objects.height, texture_side (height, largest_));
  gl->BindTexture (GL_TEXTURE_2D, objects.depth);
  define_texture (gl, GL_R16UI, width, height, GL_RED_INTEGER, GL_UNSIGNED_SHORT);
  gl->BindTexture (GL_TEXTURE_2D, objects.colour);
  define_texture (gl, GL_RGBA8, width, height, GL_RGBA, GL_UNSIGNED_BYTE);
}

guint64
StripPainter::upload_layer (ViewObjects &objects, const RenderLayer &layer)
{
  const GstGLFuncs *gl = context_->gl_vtable;
  const auto &depth = layer.image.depth;
  const auto &colour = layer.image.colour;
  prepare (objects, depth.width, depth.height);
  const auto copy = [&] (guint texture, int width, int height, guint format, guint type,
                        std::ptrdiff_t row_pixels, const void *data) {
    gl->PixelStorei (GL_UNPACK_ROW_LENGTH, gint (row_pixels));
    gl->BindTexture (GL_TEXTURE_2D, texture);
    gl->TexSubImage2D (GL_TEXTURE_2D, 0, 0, 0, width, height, format, type, data);
  };
  gl->PixelStorei (GL_UNPACK_ALIGNMENT, 1);
  copy (objects.depth, depth.width, depth.height, GL_RED_INTEGER, GL_UNSIGNED_SHORT,
      depth.stride / 2, depth.data);
  copy (objects.colour, colour.width, colour.height, GL_RGBA, GL_UNSIGNED_BYTE, colour.stride / 4,
      colour.data);
  gl->PixelStorei (GL_UNPACK_ROW_LENGTH, 0);
  gl->BindBuffer (GL_ARRAY_BUFFER, objects.vertices);
  upload_vertices (gl, objects.capacity, layer.vertices.data (), layer.vertices.size_bytes ());
  return guint64 (depth.width) * guint64 (depth.height) * 6 + layer.vertices.size_bytes ();
}

guint64
StripPainter::upload (std::span<const RenderLayer> layers)
{
  if (std::ranges::any_of (
          layers, [] (const RenderLayer &l) { return !l.blend_vertices.empty (); }))
    return blend_painter_.upload (layers);
  guint64 uploaded = 0;
  turn_ = (turn_ + 1) % objects_.size ();
  context_->gl_vtable->ActiveTexture (GL_TEXTURE0);
  for (const RenderLayer &layer : layers)
    if (!layer.vertices.empty ())
      uploaded += upload_layer (objects_[turn_][std::size_t (layer.image.view_id)], layer);
  return uploaded;
}

void
StripPainter::draw_layer (
    const ViewObjects &objects, const RenderLayer &layer, const RenderPicture &picture) const
{
  const GstGLFuncs *gl = context_->gl_vtable;
  GstGLShader *shader = shaders_[std::size_t (picture.mode) - 1];
  const Mat4 matrix = clip_from_pixel (picture.clip_from_world, *layer.view, layer.image.roi);
  const double gap_m = rangecast::strip_gap (picture.clip_from_world, *layer.view);
  set_position_uniforms (shader, rangecast::place_layer (matrix, picture.clip_from_world, gap_m));
  gst_gl_shader_set_uniform_1f (shader, "u_focal", gfloat (layer.view->intrinsics.fx));
  gst_gl_shader_set_uniform_1f (shader, "u_unit", gfloat (layer.view->depth_unit_m));
  gst_gl_shader_set_uniform_2i (
      shader, "u_size", layer.image.depth.width, layer.image.depth.height);
  gl->ActiveTexture (GL_TEXTURE1);
  gl->BindTexture (GL_TEXTURE_2D, objects.colour);
  gl->ActiveTexture (GL_TEXTURE0);
  gl->BindTexture (GL_TEXTURE_2D, objects.depth);
  gl->BindVertexArray (objects.array);
  gl->DrawArrays (picture.mode == StripMode::kPoints ? GL_POINTS : GL_TRIANGLE_STRIP, 0,
      GLsizei (layer.vertices.size ()));
}

const char *
StripPainter::draw (const RenderPicture &picture, std::span<const RenderLayer> layers)
{
  if (picture.mode == StripMode::kBlend)
    return blend_painter_.draw (picture, layers);
  const GstGLFuncs *gl = context_->gl_vtable;
  const bool gles = is_gles (context_); /* where the shader always sets the size of points */
  const float *c = picture.background;
  gl->Viewport (0, 0, picture.width, picture.height);
  gl->ClearColor (c[0], c[1], c[2], c[3]);
  gl->Clear (GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
  gl->Enable (GL_DEPTH_TEST);
  if (!gles)
    gl->Enable (GL_PROGRAM_POINT_SIZE);
  GstGLShader *shader = shaders_[std::size_t (picture.mode) - 1];
  gst_gl_shader_use (shader);
  gst_gl_shader_set_uniform_1i (shader, "u_depth", 0);
  gst_gl_shader_set_uniform_1i (shader, "u_colour", 1);
  gst_gl_shader_set_uniform_1f (shader, "u_step", gfloat (picture.depth_step));
  gst_gl_shader_set_uniform_1f (
      shader, "u_point_size", picture.point_size * picture.pixels_per_unit);
  /* Only strips have sides: noise turns many a single rectangle over. */
  if (picture.mode == StripMode::kStrips && !picture.back_faces) {
    gl->Enable (GL_CULL_FACE);
    gl->CullFace (rangecast::mirrors (picture.clip_from_world) ? GL_FRONT : GL_BACK);
  }
  for (const RenderLayer &layer : layers)
    if (!layer.vertices.empty ())
      draw_layer (objects_[turn_][std::size_t (layer.image.view_id)], layer, picture);
  gl->BindVertexArray (0);
  gl->BindBuffer (GL_ARRAY_BUFFER, 0);
  gl->Disable (GL_DEPTH_TEST);
  gl->Disable (GL_CULL_FACE);
  gl->CullFace (GL_BACK);
  if (!gles)
    gl->Disable (GL_PROGRAM_POINT_SIZE);
  gst_gl_context_clear_shader (context_);
  return nullptr;
}
