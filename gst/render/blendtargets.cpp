/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "blendtargets.hpp"

#include <gst/gl/gstglfuncs.h>

#include <iterator>

#include "../glshader.hpp"

#ifndef GL_DRAW_FRAMEBUFFER_BINDING
#define GL_DRAW_FRAMEBUFFER_BINDING 0x8CA6
#endif
#ifndef GL_RGBA16F
#define GL_RGBA16F 0x881A
#endif
#ifndef GL_R16F
#define GL_R16F 0x822D
#endif
#ifndef GL_HALF_FLOAT
#define GL_HALF_FLOAT 0x140B
#endif
#ifndef GL_DEPTH_COMPONENT24
#define GL_DEPTH_COMPONENT24 0x81A6
#endif
#ifndef GL_MAX
#define GL_MAX 0x8008
#endif
#ifndef GL_COLOR_ATTACHMENT1
#define GL_COLOR_ATTACHMENT1 0x8CE1
#endif

/* Outlines are smoothed by a binomial filter of 3 x 3 pixels (four samples between pixels), which
 * also closes cracks of one pixel between what two views draw. */
static const char *const kResolveShader = R"(
precision highp float;
precision highp int;
uniform sampler2D u_sum;    /* colour times weight; coverage */
uniform sampler2D u_weight;
uniform sampler2D u_depth;
uniform vec4 u_background;
uniform vec2 u_texel;
out vec4 fragment;
const float kReach = 0.75, kSteepness = 1.5; /* pixels; slope of the smoothed outline */
void main ()
{
  ivec2 at = ivec2 (gl_FragCoord.xy);
  vec2 place = gl_FragCoord.xy * u_texel;
  vec2 ways[4] = vec2[] (vec2 (-kReach, -kReach), vec2 (kReach, -kReach), vec2 (-kReach, kReach), vec2 (kReach, kReach));
  vec4 around = vec4 (0.0);
  for (int i = 0; i < 4; i++)
    around += texture (u_sum, place + ways[i] * u_texel);
  gl_FragDepth = texelFetch (u_depth, at, 0).r;
  float coverage = clamp ((around.a / 4.0 - 0.5) * kSteepness + 0.5, 0.0, 1.0);
  if (coverage <= 0.0) {
    fragment = u_background;
    return;
  }
  float weight = texelFetch (u_weight, at, 0).r;
  vec4 sum = texelFetch (u_sum, at, 0);
  if (sum.a < 0.5) { /* beside the outline, or in a crack */
    weight = 0.0;
    for (int i = 0; i < 4; i++)
      weight += texture (u_weight, place + ways[i] * u_texel).r;
    sum = around;
  }
  vec3 colour = sum.rgb / max (weight, 1e-7);
  float behind = (1.0 - coverage) * u_background.a;
  float alpha = coverage + behind;
  fragment = vec4 ((coverage * colour + behind * u_background.rgb) / alpha, alpha);
}
)";

bool
BlendTargets::start (GstGLContext *context, GError **error)
{
  const bool can_render_half = !is_gles (context) ||
                               gst_gl_context_check_feature (context, "GL_EXT_color_buffer_float") ||
                               gst_gl_context_check_feature (
                                   context, "GL_EXT_color_buffer_half_float");
  if (!can_render_half)
    return false;
  shader_ = make_shader (context, kCoveringVertexShader, kResolveShader, error);
  if (!shader_)
    return false;
  context_ = context;
  context->gl_vtable->GenVertexArrays (1, &array_);
  return true;
}

void
BlendTargets::delete_targets ()
{
  const GstGLFuncs *gl = context_->gl_vtable;
  gl->DeleteFramebuffers (1, &framebuffer_);
  gl->DeleteTextures (std::size (textures_), textures_);
  framebuffer_ = textures_[0] = textures_[1] = textures_[2] = 0;
  width_ = height_ = 0;
}

void
BlendTargets::stop ()
{
  if (context_) {
    delete_targets ();
    context_->gl_vtable->DeleteVertexArrays (1, &array_);
    gst_clear_object (&shader_);
  }
  *this = {};
}

bool
BlendTargets::make (int width, int height)
{
  const GstGLFuncs *gl = context_->gl_vtable;
  delete_targets ();
  static const struct {
    gint internal, filter;
    guint format, type, attachment;
  } kFormats[] = {
      {GL_RGBA16F, GL_LINEAR, GL_RGBA, GL_HALF_FLOAT, GL_COLOR_ATTACHMENT0},
      {GL_R16F, GL_LINEAR, GL_RED, GL_HALF_FLOAT, GL_COLOR_ATTACHMENT1},
      {GL_DEPTH_COMPONENT24, GL_NEAREST, GL_DEPTH_COMPONENT, GL_UNSIGNED_INT, GL_DEPTH_ATTACHMENT},
  };
  gl->GenFramebuffers (1, &framebuffer_);
  gl->BindFramebuffer (GL_FRAMEBUFFER, framebuffer_);
  gl->GenTextures (std::size (textures_), textures_);
  for (std::size_t i = 0; i < std::size (textures_); i++) {
    gl->BindTexture (GL_TEXTURE_2D, textures_[i]);
    gl->TexParameteri (GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, kFormats[i].filter);
    gl->TexParameteri (GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, kFormats[i].filter);
    gl->TexParameteri (GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    gl->TexParameteri (GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    gl->TexImage2D (GL_TEXTURE_2D, 0, kFormats[i].internal, width, height, 0, kFormats[i].format,
        kFormats[i].type, nullptr);
    gl->FramebufferTexture2D (
        GL_FRAMEBUFFER, kFormats[i].attachment, GL_TEXTURE_2D, textures_[i], 0);
  }
  gl->BindTexture (GL_TEXTURE_2D, 0);
  const guint outputs[] = {GL_COLOR_ATTACHMENT0, GL_COLOR_ATTACHMENT1};
  gl->DrawBuffers (2, outputs);
  if (gl->CheckFramebufferStatus (GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
    return false;
  width_ = width;
  height_ = height;
  return true;
}

bool
BlendTargets::begin_depth (int width, int height)
{
  const GstGLFuncs *gl = context_->gl_vtable;
  gl->GetIntegerv (GL_DRAW_FRAMEBUFFER_BINDING, &before_);
  if (width == width_ && height == height_)
    gl->BindFramebuffer (GL_FRAMEBUFFER, framebuffer_);
  else if (!make (width, height)) {
    gl->BindFramebuffer (GL_FRAMEBUFFER, guint (before_));
    return false;
  }
  gl->Viewport (0, 0, width, height);
  gl->ClearColor (0, 0, 0, 0);
  gl->Clear (GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
  gl->Enable (GL_DEPTH_TEST);
  gl->ColorMask (FALSE, FALSE, FALSE, FALSE);
  return true;
}

void
BlendTargets::begin_sum ()
{
  const GstGLFuncs *gl = context_->gl_vtable;
  gl->ColorMask (TRUE, TRUE, TRUE, TRUE);
  gl->DepthMask (FALSE);
  gl->DepthFunc (GL_LEQUAL);
  gl->Enable (GL_BLEND);
  gl->BlendFunc (GL_ONE, GL_ONE);
  gl->BlendEquationSeparate (GL_FUNC_ADD, GL_MAX);
}

void
BlendTargets::resolve (const float (&background)[4])
{
  const GstGLFuncs *gl = context_->gl_vtable;
  gl->Disable (GL_BLEND);
  gl->BlendEquationSeparate (GL_FUNC_ADD, GL_FUNC_ADD);
  gl->BlendFunc (GL_ONE, GL_ZERO);
  gl->DepthMask (TRUE);
  gl->DepthFunc (GL_ALWAYS);
  gl->BindFramebuffer (GL_FRAMEBUFFER, guint (before_));
  gst_gl_shader_use (shader_);
  static const char *const kNames[] = {"u_sum", "u_weight", "u_depth"};
  for (std::size_t i = 0; i < std::size (textures_); i++) {
    gl->ActiveTexture (guint (GL_TEXTURE0 + i));
    gl->BindTexture (GL_TEXTURE_2D, textures_[i]);
    gst_gl_shader_set_uniform_1i (shader_, kNames[i], gint (i));
  }
  gst_gl_shader_set_uniform_2f (
      shader_, "u_texel", 1 / gfloat (width_), 1 / gfloat (height_));
  gst_gl_shader_set_uniform_4f (
      shader_, "u_background", background[0], background[1], background[2], background[3]);
  gl->BindVertexArray (array_);
  gl->DrawArrays (GL_TRIANGLES, 0, 3);
  gl->BindVertexArray (0);
  gl->BindTexture (GL_TEXTURE_2D, 0);
  gl->ActiveTexture (GL_TEXTURE0);
  gl->DepthFunc (GL_LESS);
}
