/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "panelpainter.hpp"

#include <gst/gl/gstglfuncs.h>

#include "glshader.hpp"

static const char *const kFragmentShader = R"(
precision highp float;
precision highp int;
uniform sampler2D u_panel;
uniform vec2 u_begin;
uniform float u_scale;
out vec4 fragment;
void main ()
{
  fragment = vec4 (texelFetch (u_panel, ivec2 ((gl_FragCoord.xy - u_begin) / u_scale), 0).rgb, 1.0);
}
)";

static constexpr int kBorder = 8; /* pixels between the panel and the picture's edges */

bool
PanelPainter::start (GstGLContext *context)
{
  if (shader_ || failed_)
    return shader_ != nullptr;
  GError *error = nullptr;
  shader_ = make_shader (context, kCoveringVertexShader, kFragmentShader, &error);
  if (!shader_) {
    failed_ = true;
    GST_WARNING ("cannot draw the statistics: %s", error ? error->message : "no shader");
    g_clear_error (&error);
    return false;
  }
  context_ = context;
  const GstGLFuncs *gl = context->gl_vtable;
  gl->GenVertexArrays (1, &array_); /* OpenGL's core profile draws nothing without */
  gl->GenTextures (1, &texture_);
  gl->BindTexture (GL_TEXTURE_2D, texture_);
  gl->TexParameteri (GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
  gl->TexParameteri (GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
  return true;
}

guint64
PanelPainter::upload (const rangecast::ImageView<const rangecast::Rgbx> &panel)
{
  context_->gl_vtable->PixelStorei (GL_UNPACK_ALIGNMENT, 4);
  context_->gl_vtable->TexImage2D (GL_TEXTURE_2D, 0, GL_RGBA8, panel.width, panel.height, 0,
      GL_RGBA, GL_UNSIGNED_BYTE, panel.data);
  uploaded_ = true;
  return guint64 (panel.width) * guint64 (panel.height) * sizeof (rangecast::Rgbx);
}

guint64
PanelPainter::draw (GstGLContext *context, const rangecast::ImageView<const rangecast::Rgbx> &panel,
    bool changed, int x, int y, int scale)
{
  if (panel.empty () || !start (context))
    return 0;
  const GstGLFuncs *gl = context->gl_vtable;
  gl->ActiveTexture (GL_TEXTURE0);
  gl->BindTexture (GL_TEXTURE_2D, texture_);
  const guint64 uploaded = changed || !uploaded_ ? upload (panel) : 0;
  const int left = x + kBorder * scale, top = y + kBorder * scale;
  gl->Viewport (left, top, panel.width * scale, panel.height * scale);
  gst_gl_shader_use (shader_);
  gst_gl_shader_set_uniform_1i (shader_, "u_panel", 0);
  gst_gl_shader_set_uniform_2f (shader_, "u_begin", gfloat (left), gfloat (top));
  gst_gl_shader_set_uniform_1f (shader_, "u_scale", gfloat (scale));
  gl->BindVertexArray (array_);
  gl->DrawArrays (GL_TRIANGLES, 0, 3);
  gl->BindVertexArray (0);
  gst_gl_context_clear_shader (context);
  return uploaded;
}

void
PanelPainter::stop ()
{
  failed_ = uploaded_ = false;
  if (!context_)
    return;
  context_->gl_vtable->DeleteTextures (1, &texture_);
  context_->gl_vtable->DeleteVertexArrays (1, &array_);
  gst_clear_object (&shader_);
  context_ = nullptr;
}
