/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "layerpainters.hpp"

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
  if (!shader_.make (context, rangecast::Shader::kBackgroundFragment, "background-shade"))
    return;
  gl->Enable (GL_DEPTH_TEST);
  gl->DepthFunc (GL_LEQUAL);
  gst_gl_shader_use (shader_.shader ());
  gst_gl_shader_set_uniform_1f (shader_.shader (), "u_covering_depth", 1); /* the farthest */
  set_background_uniforms (shader_.shader (), colour, shade, part);
  draw_covering (gl, shader_.array ());
  gl->DepthFunc (GL_LESS);
  gl->Disable (GL_DEPTH_TEST);
  gst_gl_context_clear_shader (context);
}

/* ---- show-stats ---- */

namespace {

const char *const kPanelFragmentShader = R"(
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

constexpr int kBorder = 8; /* pixels between the panel and the picture's edges */

} // namespace

guint64
PanelPainter::draw (GstGLContext *context, const rangecast::ImageView<const rangecast::Rgbx> &panel,
    bool changed, int x, int y, int scale)
{
  const GstGLFuncs *gl = context->gl_vtable;
  if (panel.empty () || !shader_.make (context, kPanelFragmentShader, "show-stats"))
    return 0;
  guint64 uploaded = 0;
  const bool is_new = !texture_;
  if (is_new)
    gl->GenTextures (1, &texture_);
  gl->ActiveTexture (GL_TEXTURE0);
  gl->BindTexture (GL_TEXTURE_2D, texture_);
  if (is_new || changed) {
    gl->PixelStorei (GL_UNPACK_ALIGNMENT, 4);
    gl->PixelStorei (GL_UNPACK_ROW_LENGTH, GLint (panel.stride / sizeof (rangecast::Rgbx)));
    define_texture (gl, GL_RGBA8, panel.width, panel.height, GL_RGBA, GL_UNSIGNED_BYTE, panel.data);
    gl->PixelStorei (GL_UNPACK_ROW_LENGTH, 0);
    uploaded = guint64 (panel.width) * guint64 (panel.height) * sizeof (rangecast::Rgbx);
  }
  const int left = x + kBorder * scale, top = y + kBorder * scale;
  gl->Viewport (left, top, panel.width * scale, panel.height * scale);
  gst_gl_shader_use (shader_.shader ());
  gst_gl_shader_set_uniform_1i (shader_.shader (), "u_panel", 0);
  gst_gl_shader_set_uniform_2f (shader_.shader (), "u_begin", gfloat (left), gfloat (top));
  gst_gl_shader_set_uniform_1f (shader_.shader (), "u_scale", gfloat (scale));
  draw_covering (gl, shader_.array ());
  gst_gl_context_clear_shader (context);
  return uploaded;
}

void
PanelPainter::stop ()
{
  if (GstGLContext *context = shader_.stop ())
    context->gl_vtable->DeleteTextures (1, &texture_);
  *this = {};
}
