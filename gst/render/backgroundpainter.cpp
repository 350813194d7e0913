/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "backgroundpainter.hpp"

#include <gst/gl/gstglfuncs.h>

#include <string>

#include "glshader.hpp"

const char *const kBackgroundFunction = R"(
precision highp float;
uniform vec4 u_background;
uniform vec3 u_shade; /* first row, rows, share by which the first is lighter */
vec4 background (vec2 at)
{
  if (u_shade.z == 0.0)
    return u_background;
  float down = (at.y - u_shade.x) / u_shade.y;
  /* interleaved gradient noise (Jimenez 2014), of one level, so that no bands are to be seen */
  float noise = fract (52.9829189 * fract (dot (at, vec2 (0.06711056, 0.00583715)))) - 0.5;
  return vec4 (u_background.rgb * (1.0 + u_shade.z * (1.0 - 2.0 * down)) + noise / 255.0, u_background.a);
}
)";

static const char *const kFragmentShader = R"(
out vec4 fragment;
void main ()
{
  fragment = background (gl_FragCoord.xy);
}
)";

void
set_background_uniforms (
    GstGLShader *shader, const float (&colour)[4], float shade, const rangecast::Roi &part)
{
  gst_gl_shader_set_uniform_4f (shader, "u_background", colour[0], colour[1], colour[2], colour[3]);
  gst_gl_shader_set_uniform_3f (shader, "u_shade", gfloat (part.y), gfloat (part.height), shade);
}

void
BackgroundPainter::draw (
    GstGLContext *context, const float (&colour)[4], float shade, const rangecast::Roi &part)
{
  const GstGLFuncs *gl = context->gl_vtable;
  if (!shader_ && !failed_) {
    GError *error = nullptr;
    shader_ = make_shader (context, kCoveringVertexShader,
        (std::string (kBackgroundFunction) + kFragmentShader).c_str (), &error);
    failed_ = !shader_;
    if (failed_)
      GST_WARNING ("no background-shade: %s", error ? error->message : "no shader");
    g_clear_error (&error);
    if (!failed_)
      gl->GenVertexArrays (1, &array_); /* OpenGL's core profile draws nothing without */
    context_ = context;
  }
  if (failed_)
    return;
  gl->Enable (GL_DEPTH_TEST);
  gl->DepthFunc (GL_LEQUAL);
  gst_gl_shader_use (shader_);
  gst_gl_shader_set_uniform_1f (shader_, "u_covering_depth", 1); /* as far away as depths reach */
  set_background_uniforms (shader_, colour, shade, part);
  gl->BindVertexArray (array_);
  gl->DrawArrays (GL_TRIANGLES, 0, 3);
  gl->BindVertexArray (0);
  gl->DepthFunc (GL_LESS);
  gl->Disable (GL_DEPTH_TEST);
  gst_gl_context_clear_shader (context);
}

void
BackgroundPainter::stop ()
{
  if (context_ && shader_) {
    context_->gl_vtable->DeleteVertexArrays (1, &array_);
    gst_clear_object (&shader_);
  }
  *this = {};
}
