/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "backgroundpainter.hpp"

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
