/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gl/gl.h>
#include <gst/gl/gstglfuncs.h>

/** Writes the colour that the vertex shader gives as v_colour. */
inline constexpr const char *kColourFragmentShader = R"(
precision highp float;
in vec3 v_colour;
out vec4 fragment;
void main ()
{
  fragment = vec4 (v_colour, 1.0);
}
)";

/** Covers the viewport with one triangle, drawn without vertex buffers, at a depth of
 * u_covering_depth (-1 to 1; 0 unless it is set). */
inline constexpr const char *kCoveringVertexShader = R"(
uniform float u_covering_depth;
void main ()
{
  gl_Position = vec4 (gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, u_covering_depth, 1.0);
}
)";

/** Whether the context is one of OpenGL ES 3.0 or later. */
inline bool
is_gles (GstGLContext *context)
{
  return gst_gl_context_check_gl_version (context, GST_GL_API_GLES2, 3, 0);
}

/** Compiles and links sources without a version line, for OpenGL 3.3 or OpenGL ES 3.0. In the GL
 *  thread. Returns: (transfer full): or nullptr, with the compiler's log in `error` */
inline GstGLShader *
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
