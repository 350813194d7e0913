/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "strippainter.hpp"

#include <cstring>

#include "glshader.hpp"

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

/* A vertex names its pixel; depth and colour are fetched here, and the pixel's ray unprojected.
 * Vertices that lie beside their pixel follow the plane through it and its neighbours. */
static const char *const kVertexShader = R"(
precision highp float;
precision highp int;
precision highp usampler2D;
uniform usampler2D u_depth;
uniform sampler2D u_colour;
uniform ivec2 u_size; /* of the ROI; beyond it the textures hold older frames */
uniform mat4 u_clip_from_world;
uniform mat4 u_world_from_view;
uniform vec4 u_intrinsics; /* fx, fy, cx, cy of the ROI */
uniform float u_unit;
uniform float u_step;
uniform float u_point_size;
in uint a_vertex;
out vec3 v_colour;

float depth_at (ivec2 p)
{
  bool inside = all (greaterThanEqual (p, ivec2 (0))) && all (lessThan (p, u_size));
  return inside ? float (texelFetch (u_depth, p, 0).r) : 0.0;
}
/* Edges of a surface go on no steeper than 45 degrees: where it is seen at a grazing angle, depth
 * rises too fast there to be trusted, and spikes would stand out from it. */
const float kSteepest = 1.0;
float slope (ivec2 p, ivec2 way, float depth)
{
  float before = depth_at (p - way), after = depth_at (p + way), limit = u_step * depth;
  bool has_before = before > 0.0 && abs (before - depth) <= limit;
  bool has_after = after > 0.0 && abs (after - depth) <= limit;
  if (has_before && has_after)
    return (after - before) * 0.5;
  float edge = has_after ? after - depth : has_before ? depth - before : 0.0;
  float most = kSteepest * depth / u_intrinsics.x;
  return clamp (edge, -most, most);
}
float place (uint n)
{
  return n == 0u ? 0.0 : n == 1u ? -0.5 : n == 2u ? 0.5 : n == 3u ? -0.75 : n == 4u ? 0.75 : 1.0;
}
void main ()
{
  ivec2 pixel = ivec2 (int (a_vertex & 8191u), int (a_vertex >> 13u & 8191u));
  vec2 offset = vec2 (place (a_vertex >> 26u & 7u), place (a_vertex >> 29u));
  float depth = depth_at (pixel);
  if (offset != vec2 (0.0))
    depth += offset.x * slope (pixel, ivec2 (1, 0), depth) + offset.y * slope (pixel, ivec2 (0, 1), depth);
  float z = depth * u_unit;
  vec2 ray = (vec2 (pixel) + offset - u_intrinsics.zw) / u_intrinsics.xy;
  gl_Position = u_clip_from_world * (u_world_from_view * vec4 (ray * z, z, 1.0));
  gl_PointSize = max (1.0, u_point_size * z / (u_intrinsics.x * gl_Position.w));
  v_colour = texelFetch (u_colour, pixel, 0).rgb;
}
)";

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
  shader_ = make_shader (context, kVertexShader, kColourFragmentShader, error);
  return shader_ != nullptr;
}

void
StripPainter::stop ()
{
  if (!context_)
    return;
  const GstGLFuncs *gl = context_->gl_vtable;
  for (ViewObjects &objects : objects_) {
    if (objects.depth) {
      const guint textures[] = {objects.depth, objects.colour};
      gl->DeleteTextures (2, textures);
      gl->DeleteBuffers (1, &objects.vertices);
      gl->DeleteVertexArrays (1, &objects.array);
    }
    objects = {};
  }
  gst_clear_object (&shader_);
  context_ = nullptr;
}

/* Makes the objects of a view, or larger textures. */
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
    const gint attribute = gst_gl_shader_get_attribute_location (shader_, "a_vertex");
    gl->EnableVertexAttribArray (guint (attribute));
    attribute_pointer_ (guint (attribute), 1, GL_UNSIGNED_INT, sizeof (StripVertex), nullptr);
  }
  if (objects.width == width && objects.height == height)
    return;
  objects.width = width;
  objects.height = height;
  const auto allocate = [&] (guint texture, guint internal, guint format, guint type) {
    gl->BindTexture (GL_TEXTURE_2D, texture);
    gl->TexParameteri (GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    gl->TexParameteri (GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    gl->TexParameteri (GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    gl->TexParameteri (GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    gl->TexImage2D (GL_TEXTURE_2D, 0, gint (internal), width, height, 0, format, type, nullptr);
  };
  allocate (objects.depth, GL_R16UI, GL_RED_INTEGER, GL_UNSIGNED_SHORT);
  allocate (objects.colour, GL_RGBA8, GL_RGBA, GL_UNSIGNED_BYTE);
}

guint64
StripPainter::upload (ViewObjects &objects, const Layer &layer)
{
  const GstGLFuncs *gl = context_->gl_vtable;
  const auto &depth = layer.image.depth;
  const auto &colour = layer.image.colour;
  prepare (objects, layer.view->width, layer.view->height);
  gl->PixelStorei (GL_UNPACK_ALIGNMENT, 2);
  gl->PixelStorei (GL_UNPACK_ROW_LENGTH, gint (depth.stride / 2));
  gl->BindTexture (GL_TEXTURE_2D, objects.depth);
  gl->TexSubImage2D (GL_TEXTURE_2D, 0, 0, 0, depth.width, depth.height, GL_RED_INTEGER,
      GL_UNSIGNED_SHORT, depth.data);
  gl->PixelStorei (GL_UNPACK_ALIGNMENT, 4);
  gl->PixelStorei (GL_UNPACK_ROW_LENGTH, gint (colour.stride / 4));
  gl->BindTexture (GL_TEXTURE_2D, objects.colour);
  gl->TexSubImage2D (
      GL_TEXTURE_2D, 0, 0, 0, colour.width, colour.height, GL_RGBA, GL_UNSIGNED_BYTE, colour.data);
  gl->PixelStorei (GL_UNPACK_ROW_LENGTH, 0);
  gl->BindBuffer (GL_ARRAY_BUFFER, objects.vertices);
  gl->BufferData (
      GL_ARRAY_BUFFER, layer.vertices.size_bytes (), layer.vertices.data (), GL_STREAM_DRAW);
  return guint64 (depth.width) * guint64 (depth.height) * 6 + layer.vertices.size_bytes ();
}

void
StripPainter::draw_layer (const ViewObjects &objects, const Layer &layer, const Picture &picture)
{
  const GstGLFuncs *gl = context_->gl_vtable;
  const rangecast::View &view = *layer.view;
  const rangecast::Mat3 &r = view.world_from_view.rotation;
  const rangecast::Vec3 &t = view.world_from_view.translation;
  gfloat world_from_view[16] = {};
  for (int row = 0; row < 3; row++)
    for (int column = 0; column < 3; column++)
      world_from_view[4 * column + row] = gfloat (r[3 * row + column]);
  world_from_view[12] = gfloat (t.x);
  world_from_view[13] = gfloat (t.y);
  world_from_view[14] = gfloat (t.z);
  world_from_view[15] = 1;
  gst_gl_shader_set_uniform_matrix_4fv (shader_, "u_world_from_view", 1, FALSE, world_from_view);
  gst_gl_shader_set_uniform_4f (shader_, "u_intrinsics", gfloat (view.intrinsics.fx),
      gfloat (view.intrinsics.fy), gfloat (view.intrinsics.cx - layer.image.roi.x),
      gfloat (view.intrinsics.cy - layer.image.roi.y));
  gst_gl_shader_set_uniform_1f (shader_, "u_unit", gfloat (view.depth_unit_m));
  gst_gl_shader_set_uniform_2i (
      shader_, "u_size", layer.image.depth.width, layer.image.depth.height);
  gl->ActiveTexture (GL_TEXTURE1);
  gl->BindTexture (GL_TEXTURE_2D, objects.colour);
  gl->ActiveTexture (GL_TEXTURE0);
  gl->BindTexture (GL_TEXTURE_2D, objects.depth);
  gl->BindVertexArray (objects.array);
  gl->DrawArrays (picture.mode == StripMode::kPoints ? GL_POINTS : GL_TRIANGLE_STRIP, 0,
      GLsizei (layer.vertices.size ()));
}

guint64
StripPainter::draw (const Picture &picture, std::span<const Layer> layers)
{
  const GstGLFuncs *gl = context_->gl_vtable;
  const float *c = picture.background;
  guint64 uploaded = 0;
  gl->Viewport (0, 0, picture.width, picture.height);
  gl->ClearColor (c[0], c[1], c[2], c[3]);
  gl->Clear (GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
  gl->Enable (GL_DEPTH_TEST);
  const bool switched_point_size = gst_gl_context_get_gl_api (context_) != GST_GL_API_GLES2;
  if (switched_point_size) /* OpenGL ES always takes it from the shader */
    gl->Enable (GL_PROGRAM_POINT_SIZE);
  gst_gl_shader_use (shader_);
  gst_gl_shader_set_uniform_matrix_4fv (
      shader_, "u_clip_from_world", 1, FALSE, picture.clip_from_world.data ());
  gst_gl_shader_set_uniform_1i (shader_, "u_depth", 0);
  gst_gl_shader_set_uniform_1i (shader_, "u_colour", 1);
  gst_gl_shader_set_uniform_1f (shader_, "u_step", gfloat (picture.depth_step));
  gst_gl_shader_set_uniform_1f (
      shader_, "u_point_size", picture.point_size * picture.pixels_per_unit);
  for (const Layer &layer : layers) {
    if (layer.vertices.empty ())
      continue;
    ViewObjects &objects = objects_[layer.image.view_id];
    gl->ActiveTexture (GL_TEXTURE0);
    uploaded += upload (objects, layer);
    draw_layer (objects, layer, picture);
  }
  gl->BindVertexArray (0);
  gl->BindBuffer (GL_ARRAY_BUFFER, 0);
  gl->Disable (GL_DEPTH_TEST);
  if (switched_point_size)
    gl->Disable (GL_PROGRAM_POINT_SIZE);
  gst_gl_context_clear_shader (context_);
  return uploaded;
}
