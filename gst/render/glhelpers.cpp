/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "glhelpers.hpp"

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

GstGLShader *
make_shader (
    GstGLContext *context, rangecast::Shader vertex, rangecast::Shader fragment, GError **error)
{
  return make_shader (context, rangecast::shader_source (vertex).c_str (),
      rangecast::shader_source (fragment).c_str (), error);
}

void
draw_covering (const GstGLFuncs *gl, guint array)
{
  gl->BindVertexArray (array);
  gl->DrawArrays (GL_TRIANGLES, 0, 3);
  gl->BindVertexArray (0);
}

void
set_position_uniforms (GstGLShader *shader, const rangecast::LayerPlace &place)
{
  gst_gl_shader_set_uniform_matrix_4fv (
      shader, "u_clip_from_pixel", 1, FALSE, place.clip_from_pixel.data ());
  gst_gl_shader_set_uniform_2f (shader, "u_behind", place.behind[0], place.behind[1]);
}

bool
LazyShader::make (GstGLContext *context, rangecast::Shader fragment, const char *purpose)
{
  if (shader_ || failed_)
    return !failed_;
  return make (context, rangecast::shader_source (fragment).c_str (), purpose);
}

bool
LazyShader::make (GstGLContext *context, const char *fragment, const char *purpose)
{
  if (shader_ || failed_)
    return !failed_;
  GError *error = nullptr;
  context_ = context;
  const std::string vertex = rangecast::shader_source (rangecast::Shader::kCoveringVertex);
  shader_ = make_shader (context, vertex.c_str (), fragment, &error);
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
