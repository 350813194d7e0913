/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "blendtargets.hpp"

#include <gst/gl/gstglfuncs.h>

#include <algorithm>
#include <iterator>
#include <string>

#include "backgroundpainter.hpp"
#include "glshader.hpp"

#ifndef GL_DRAW_FRAMEBUFFER_BINDING
#define GL_DRAW_FRAMEBUFFER_BINDING 0x8CA6
#endif
#ifndef GL_RGBA16F
#define GL_RGBA16F 0x881A
#endif
#ifndef GL_RGBA32F
#define GL_RGBA32F 0x8814
#endif
#ifndef GL_HALF_FLOAT
#define GL_HALF_FLOAT 0x140B
#endif
#ifndef GL_DEPTH_COMPONENT24
#define GL_DEPTH_COMPONENT24 0x81A6
#endif

/* Outlines are smoothed over the four neighbours, which also closes cracks of one pixel between
 * what two views draw. Where no camera saw the outside of a surface, so that the inside of one
 * behind shows through (beside a nose, round glasses), small gaps take the colours around them,
 * from the farther surfaces: what a nearer one hides is theirs. */
static const char *const kResolveShader = R"(
precision highp int;
precision highp sampler2D;
uniform sampler2D u_sum; /* R, G, B times weight; weight */
uniform sampler2D u_depth;
uniform vec3 u_shift; /* a, b, g of DepthShift */
uniform ivec4 u_part; /* first and last pixel */
uniform float u_outside; /* weight of the least outside, less rounding */
uniform int u_reach; /* gaps so wide are left, pixels */
out vec4 fragment;
float distance_at (ivec2 at)
{
  return u_shift.y / (2.0 * texelFetch (u_depth, at, 0).r - 1.0 - u_shift.x) - u_shift.z;
}
/* The first outside in a direction, and how many steps away; 0: none within reach. */
int trace (ivec2 at, ivec2 step, out vec4 outside)
{
  outside = vec4 (0.0);
  int last = 0;
  for (int r = 1; r <= u_reach; r += 1 + r / 4) {
    outside = texelFetch (u_sum, clamp (at + r * step, u_part.xy, u_part.zw), 0);
    if (outside.a >= u_outside) {
      for (int back = r - 1; back > last; back--) { /* the strides grow */
        vec4 nearer = texelFetch (u_sum, clamp (at + back * step, u_part.xy, u_part.zw), 0);
        if (nearer.a < u_outside)
          break;
        outside = nearer;
        r = back;
      }
      return r;
    }
    last = r;
  }
  return 0;
}
ivec2 direction (int k) /* 0 to 7; k and 7 - k are opposite */
{
  int q = k < 4 ? k : k + 1; /* of 3 x 3, without the centre */
  return ivec2 (q % 3 - 1, q / 3 - 1);
}
/* Weighted mean of the farthest outsides in eight directions, and its share: all of it in gaps up to
 * half the reach wide, less in wider ones; nothing where a direction ends in none. */
vec4 fill (ivec2 at)
{
  const float kSameSurface = 0.02; /* metres */
  vec4 outside;
  float farthest = 0.0;
  int widest = 0;
  for (int k = 0; k < 4; k++) {
    int there = trace (at, direction (k), outside), opposite = trace (at, direction (7 - k), outside);
    if (there == 0 || opposite == 0)
      return vec4 (0.0);
    widest = max (widest, there + opposite);
    farthest = max (farthest, max (distance_at (at + there * direction (k)),
                                  distance_at (at + opposite * direction (7 - k))));
  }
  float share = clamp (2.0 - 2.0 * float (widest) / float (u_reach), 0.0, 1.0);
  if (share <= 0.0)
    return vec4 (0.0);
  vec4 sum = vec4 (0.0);
  for (int k = 0; k < 8; k++) {
    ivec2 way = trace (at, direction (k), outside) * direction (k);
    if (distance_at (at + way) > farthest - kSameSurface)
      sum += vec4 (outside.rgb / outside.a, 1.0) / float (way.x * way.x + way.y * way.y);
  }
  return vec4 (sum.rgb / sum.a, share);
}
void main ()
{
  vec4 ground = background (gl_FragCoord.xy);
  ivec2 at = ivec2 (gl_FragCoord.xy), first = u_part.xy, last = u_part.zw;
  vec4 sum = texelFetch (u_sum, at, 0);
  vec4 west = texelFetch (u_sum, ivec2 (max (at.x - 1, first.x), at.y), 0);
  vec4 east = texelFetch (u_sum, ivec2 (min (at.x + 1, last.x), at.y), 0);
  vec4 north = texelFetch (u_sum, ivec2 (at.x, max (at.y - 1, first.y)), 0);
  vec4 south = texelFetch (u_sum, ivec2 (at.x, min (at.y + 1, last.y)), 0);
  vec4 weights = vec4 (west.a, east.a, north.a, south.a);
  float covered = dot (vec4 (greaterThan (weights, vec4 (0.0))), vec4 (1.0));
  /* a pixel that is drawn: from 1/2 where none beside it is; one that is not: up to 1/2, or a crack */
  float coverage = sum.a > 0.0 ? 0.5 + 0.125 * covered : covered > 2.0 ? 1.0 : 0.125 * covered;
  float heaviest = sum.a;
  if (sum.a <= 0.0) {
    sum = west + east + north + south;
    heaviest = max (max (west.a, east.a), max (north.a, south.a));
  }
  if (heaviest > 0.0 && heaviest < u_outside) {
    vec4 filled = fill (at);
    sum = vec4 (mix (sum.rgb / sum.a, filled.rgb, filled.a), 1.0);
  }
#if WITH_DEPTH
  float depth = texelFetch (u_depth, at, 0).r, distance = distance_at (at);
  gl_FragDepth = depth < 1.0 ? 0.5 + 0.5 * (u_shift.x + u_shift.y / distance) : 1.0;
#endif
  float behind = (1.0 - coverage) * ground.a;
  float alpha = coverage + behind;
  vec3 colour = coverage * sum.rgb / max (sum.a, 1e-7) + behind * ground.rgb;
  fragment = alpha > 0.0 ? vec4 (colour / alpha, alpha) : ground;
}
)";

bool
BlendTargets::is_supported (GstGLContext *context)
{
  return !is_gles (context) ||
         gst_gl_context_check_feature (context, "GL_EXT_color_buffer_float") ||
         gst_gl_context_check_feature (context, "GL_EXT_color_buffer_half_float");
}

bool
BlendTargets::start (GstGLContext *context, GError **error)
{
  context_ = context;
  for (std::size_t i = 0; i < std::size (shaders_); i++) {
    const std::string source =
        "#define WITH_DEPTH " + std::to_string (i) + kBackgroundFunction + kResolveShader;
    shaders_[i] = make_shader (context, kCoveringVertexShader, source.c_str (), error);
    if (!shaders_[i])
      return false;
  }
  context->gl_vtable->GenVertexArrays (1, &array_);
  return true;
}

void
BlendTargets::delete_targets ()
{
  const GstGLFuncs *gl = context_->gl_vtable;
  gl->DeleteFramebuffers (1, &framebuffer_);
  gl->DeleteTextures (std::size (textures_), textures_);
  framebuffer_ = textures_[0] = textures_[1] = 0;
  width_ = height_ = 0;
}

void
BlendTargets::stop ()
{
  if (context_) {
    delete_targets ();
    context_->gl_vtable->DeleteVertexArrays (1, &array_);
    for (GstGLShader *&shader : shaders_)
      gst_clear_object (&shader);
  }
  *this = {};
}

bool
BlendTargets::make (int width, int height, bool precise)
{
  const GstGLFuncs *gl = context_->gl_vtable;
  delete_targets ();
  const struct {
    gint internal;
    guint format, type, attachment;
  } formats[] = {
      {precise ? GL_RGBA32F : GL_RGBA16F, GL_RGBA, guint (precise ? GL_FLOAT : GL_HALF_FLOAT),
          GL_COLOR_ATTACHMENT0},
      {GL_DEPTH_COMPONENT24, GL_DEPTH_COMPONENT, GL_UNSIGNED_INT, GL_DEPTH_ATTACHMENT},
  };
  gl->GenFramebuffers (1, &framebuffer_);
  gl->BindFramebuffer (GL_FRAMEBUFFER, framebuffer_);
  gl->GenTextures (std::size (textures_), textures_);
  for (std::size_t i = 0; i < std::size (textures_); i++) {
    gl->BindTexture (GL_TEXTURE_2D, textures_[i]);
    gl->TexParameteri (GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    gl->TexParameteri (GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    gl->TexParameteri (GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    gl->TexParameteri (GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    gl->TexImage2D (GL_TEXTURE_2D, 0, formats[i].internal, width, height, 0, formats[i].format,
        formats[i].type, nullptr);
    gl->FramebufferTexture2D (
        GL_FRAMEBUFFER, formats[i].attachment, GL_TEXTURE_2D, textures_[i], 0);
  }
  gl->BindTexture (GL_TEXTURE_2D, 0);
  if (gl->CheckFramebufferStatus (GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
    return false;
  return true;
}

bool
BlendTargets::begin_depth (int width, int height, bool precise, const rangecast::Roi &covered)
{
  const GstGLFuncs *gl = context_->gl_vtable;
  gl->GetIntegerv (GL_DRAW_FRAMEBUFFER_BINDING, &before_);
  if (width == width_ && height == height_ && precise == precise_) {
    if (failed_)
      return false;
    gl->BindFramebuffer (GL_FRAMEBUFFER, framebuffer_);
  } else {
    failed_ = !make (width, height, precise);
    width_ = width;
    height_ = height;
    precise_ = precise;
    if (failed_) {
      gl->BindFramebuffer (GL_FRAMEBUFFER, guint (before_));
      return false;
    }
  }
  gl->Viewport (0, 0, width, height);
  gl->Enable (GL_SCISSOR_TEST); /* to clear float targets is a good part of what a picture costs */
  gl->Scissor (covered.x, covered.y, covered.width, covered.height);
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
}

void
BlendTargets::resolve (const rangecast::Roi &part, const rangecast::Roi &covered,
    const float (&background)[4], float shade, const rangecast::DepthShift &shift, float outside,
    bool keeps_depth)
{
  const GstGLFuncs *gl = context_->gl_vtable;
  GstGLShader *shader = shaders_[keeps_depth ? 1 : 0];
  gl->Disable (GL_BLEND);
  gl->BlendFunc (GL_ONE, GL_ZERO);
  gl->DepthMask (TRUE);
  gl->DepthFunc (GL_ALWAYS);
  gl->BindFramebuffer (GL_FRAMEBUFFER, guint (before_));
  gl->Scissor (part.x, part.y, part.width, part.height);
  gl->ClearColor (background[0], background[1], background[2], background[3]);
  if (shade <= 0)
    gl->Clear (GL_COLOR_BUFFER_BIT);
  gl->Scissor (covered.x, covered.y, covered.width, covered.height);
  gst_gl_shader_use (shader);
  static const char *const kNames[] = {"u_sum", "u_depth"};
  for (std::size_t i = 0; i < std::size (kNames); i++) {
    gl->ActiveTexture (guint (GL_TEXTURE0 + i));
    gl->BindTexture (GL_TEXTURE_2D, textures_[i]);
    gst_gl_shader_set_uniform_1i (shader, kNames[i], gint (i));
  }
  gst_gl_shader_set_uniform_4i (shader, "u_part", covered.x, covered.y,
      covered.x + covered.width - 1, covered.y + covered.height - 1);
  gst_gl_shader_set_uniform_3f (shader, "u_shift", shift.a, shift.b, shift.g);
  gst_gl_shader_set_uniform_1f (shader, "u_outside", outside);
  gst_gl_shader_set_uniform_1i (shader, "u_reach", std::max (part.height / 15, 2));
  set_background_uniforms (shader, background, shade, part);
  gl->BindVertexArray (array_);
  gl->DrawArrays (GL_TRIANGLES, 0, 3);
  gl->BindVertexArray (0);
  for (guint i = std::size (textures_); i-- > 0;) { /* they are targets again next time */
    gl->ActiveTexture (GL_TEXTURE0 + i);
    gl->BindTexture (GL_TEXTURE_2D, 0);
  }
  gl->DepthFunc (GL_LESS);
  if (part.width == width_ && part.height == height_)
    gl->Disable (GL_SCISSOR_TEST);
  else
    gl->Scissor (part.x, part.y, part.width, part.height);
}
