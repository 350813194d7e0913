/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "backgroundpainter.hpp"

#include <string>

/* A gradient in 8 bits shows bands; noise of one level hides them: interleaved gradient noise
 * (J. Jimenez, "Next generation post processing in Call of Duty", SIGGRAPH 2014). */
const char *const kBackgroundFunction = R"(
precision highp float;
uniform vec4 u_background;
uniform vec3 u_shade; /* first row, rows, share by which the first is lighter */
vec4 background (vec2 at)
{
  if (u_shade.z == 0.0)
    return u_background;
  float down = (at.y - u_shade.x) / u_shade.y;
  float noise = fract (52.9829189 * fract (dot (at, vec2 (0.06711056, 0.00583715)))) - 0.5;
  return vec4 (u_background.rgb * (1.0 + u_shade.z * (1.0 - 2.0 * down)) + noise / 255.0, u_background.a);
}
)";

void
set_background_uniforms (
    GstGLShader *shader, const float (&colour)[4], float shade, const rangecast::Roi &part)
{
  gst_gl_shader_set_uniform_4f (shader, "u_background", colour[0], colour[1], colour[2], colour[3]);
  gst_gl_shader_set_uniform_3f (shader, "u_shade", gfloat (part.y), gfloat (part.height), shade);
}

namespace {

const char *const kFragmentShader = R"(
out vec4 fragment;
void main ()
{
  fragment = background (gl_FragCoord.xy);
}
)";

} // namespace

void
BackgroundPainter::draw (
    GstGLContext *context, const float (&colour)[4], float shade, const rangecast::Roi &part)
{
  const GstGLFuncs *gl = context->gl_vtable;
  if (!shader_.make (context, kCoveringVertexShader,
          (std::string (kBackgroundFunction) + kFragmentShader).c_str (), "background-shade"))
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
