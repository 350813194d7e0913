/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "glhelpers.hpp"

#include <utility>

void
define_texture (const GstGLFuncs *gl, guint internal, int width, int height, guint format,
    guint type, const void *data)
{
  gl->TexParameteri (GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
  gl->TexParameteri (GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
  gl->TexParameteri (GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  gl->TexParameteri (GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
  gl->TexImage2D (GL_TEXTURE_2D, 0, gint (internal), width, height, 0, format, type, data);
}

void
upload_vertices (const GstGLFuncs *gl, std::size_t &capacity, const void *data, std::size_t size)
{
  if (size > capacity) {
    capacity = size + size / 2;
    gl->BufferData (GL_ARRAY_BUFFER, GLsizeiptr (capacity), nullptr, GL_DYNAMIC_DRAW);
  }
  gl->BufferSubData (GL_ARRAY_BUFFER, 0, GLsizeiptr (size), data);
}

GstGLShader *
make_shader (GstGLContext *context, const char *vertex, const char *fragment, GError **error)
{
  const bool gles = is_gles (context);
  const GstGLSLVersion version = gles ? GST_GLSL_VERSION_300 : GST_GLSL_VERSION_330;
  const GstGLSLProfile profile = gles ? GST_GLSL_PROFILE_ES : GST_GLSL_PROFILE_CORE;
  const char *const header = gles ? "#version 300 es\n" : "#version 330 core\n";
  const auto stage = [&] (guint type, const char *source) {
    const char *parts[] = {header, source};
    return gst_glsl_stage_new_with_strings (context, type, version, profile, 2, parts);
  };
  return gst_gl_shader_new_link_with_stages (context, error, stage (GL_VERTEX_SHADER, vertex),
      stage (GL_FRAGMENT_SHADER, fragment), nullptr);
}

const char *const kCoveringVertexShader = R"(
uniform float u_covering_depth;
void main ()
{
  gl_Position = vec4 (gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, u_covering_depth, 1.0);
}
)";

void
draw_covering (const GstGLFuncs *gl, guint array)
{
  gl->BindVertexArray (array);
  gl->DrawArrays (GL_TRIANGLES, 0, 3);
  gl->BindVertexArray (0);
}

const char *const kColourFragmentShader = R"(
precision highp float;
in vec3 v_colour;
out vec4 fragment;
void main ()
{
  fragment = vec4 (v_colour, 1.0);
}
)";

const char *const kPositionFunction = R"(
precision highp float;
uniform mat4 u_clip_from_pixel; /* column, row and 1, all times depth, and 1 */
uniform vec2 u_behind;
vec4 clip_position (vec2 at, float depth)
{
  vec4 position = u_clip_from_pixel * vec4 (at * depth, depth, 1.0);
  /* the depth of what is u_behind.y metres farther, in the same place of the picture */
  position.z -= u_behind.x / (max (position.w, 0.0) + u_behind.y);
  return position;
}
)";

void
set_position_uniforms (
    GstGLShader *shader, const rangecast::Mat4 &clip_from_pixel, const rangecast::DepthShift &shift)
{
  gst_gl_shader_set_uniform_matrix_4fv (
      shader, "u_clip_from_pixel", 1, FALSE, clip_from_pixel.data ());
  gst_gl_shader_set_uniform_2f (shader, "u_behind", shift.b * shift.g, shift.g);
}

bool
LazyShader::make (
    GstGLContext *context, const char *vertex, const char *fragment, const char *purpose)
{
  if (shader_ || failed_)
    return !failed_;
  GError *error = nullptr;
  context_ = context;
  shader_ = make_shader (context, vertex, fragment, &error);
  failed_ = !shader_;
  if (failed_)
    GST_WARNING_OBJECT (context, "no %s: %s", purpose, error ? error->message : "no shader");
  else
    context->gl_vtable->GenVertexArrays (1, &array_);
  g_clear_error (&error);
  return !failed_;
}

GstGLContext *
LazyShader::stop ()
{
  GstGLContext *context = shader_ ? context_ : nullptr;
  if (context) {
    context->gl_vtable->DeleteVertexArrays (1, &array_);
    gst_object_unref (shader_);
  }
  *this = {};
  return context;
}
