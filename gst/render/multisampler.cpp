/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "multisampler.hpp"

#include <gst/gl/gstglfuncs.h>

#include <algorithm>

#include "glshader.hpp"

#ifndef GL_DRAW_FRAMEBUFFER_BINDING
#define GL_DRAW_FRAMEBUFFER_BINDING 0x8CA6
#endif
#ifndef GL_MAX_SAMPLES
#define GL_MAX_SAMPLES 0x8D57
#endif
#ifndef GL_READ_FRAMEBUFFER
#define GL_READ_FRAMEBUFFER 0x8CA8
#define GL_DRAW_FRAMEBUFFER 0x8CA9
#endif
#ifndef GL_RGBA8
#define GL_RGBA8 0x8058
#endif
#ifndef GL_DEPTH_COMPONENT24
#define GL_DEPTH_COMPONENT24 0x81A6
#endif

/* Means of opaque samples and of nothing are premultiplied by what they cover of the pixel. Laid
 * over the background they are divided by their alpha: straight again. */
static const char *const kOverBackground = R"(
precision highp float;
precision highp int;
uniform sampler2D u_picture;
uniform vec4 u_background;
out vec4 fragment;
void main ()
{
  vec4 picture = texelFetch (u_picture, ivec2 (gl_FragCoord.xy), 0);
  float behind = (1.0 - picture.a) * u_background.a;
  float alpha = picture.a + behind;
  vec3 colour = picture.rgb + behind * u_background.rgb;
  fragment = alpha > 0.0 ? vec4 (colour / alpha, alpha) : u_background;
}
)";

/* What is laid over the background. */
bool
Multisampler::make_resolved (int width, int height)
{
  const GstGLFuncs *gl = context_->gl_vtable;
  GError *error = nullptr;
  shader_ = make_shader (context_, kCoveringVertexShader, kOverBackground, &error);
  if (!shader_) {
    GST_WARNING ("%s", error ? error->message : "no shader");
    g_clear_error (&error);
    return false;
  }
  gl->GenVertexArrays (1, &array_); /* OpenGL's core profile draws nothing without */
  gl->GenTextures (1, &texture_);
  gl->BindTexture (GL_TEXTURE_2D, texture_);
  gl->TexParameteri (GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
  gl->TexParameteri (GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
  gl->TexImage2D (GL_TEXTURE_2D, 0, GL_RGBA8, width, height, 0, GL_RGBA, GL_UNSIGNED_BYTE, nullptr);
  gl->BindTexture (GL_TEXTURE_2D, 0);
  gl->GenFramebuffers (1, &resolved_);
  gl->BindFramebuffer (GL_FRAMEBUFFER, resolved_);
  gl->FramebufferTexture2D (GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, texture_, 0);
  return gl->CheckFramebufferStatus (GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
}

bool
Multisampler::make (int width, int height, int samples)
{
  const GstGLFuncs *gl = context_->gl_vtable;
  /* GStreamer's table of functions lacks it */
  using Storage =
      void (GSTGLAPI *) (guint target, gint samples, guint format, gint width, gint height);
  const auto storage = reinterpret_cast<Storage> (
      gst_gl_context_get_proc_address (context_, "glRenderbufferStorageMultisample"));
  gint most = 0;
  gl->GetIntegerv (GL_MAX_SAMPLES, &most);
  if (!storage || most < 2 || !make_resolved (width, height))
    return false;
  gl->GenFramebuffers (1, &framebuffer_);
  gl->GenRenderbuffers (2, buffers_);
  gl->BindFramebuffer (GL_FRAMEBUFFER, framebuffer_);
  const guint formats[] = {GL_RGBA8, GL_DEPTH_COMPONENT24};
  const guint places[] = {GL_COLOR_ATTACHMENT0, GL_DEPTH_ATTACHMENT};
  for (int i = 0; i < 2; i++) {
    gl->BindRenderbuffer (GL_RENDERBUFFER, buffers_[i]);
    storage (GL_RENDERBUFFER, std::min (samples, most), formats[i], width, height);
    gl->FramebufferRenderbuffer (GL_FRAMEBUFFER, places[i], GL_RENDERBUFFER, buffers_[i]);
  }
  gl->BindRenderbuffer (GL_RENDERBUFFER, 0);
  return gl->CheckFramebufferStatus (GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
}

bool
Multisampler::begin (GstGLContext *context, int width, int height, int samples)
{
  if (samples < 2) {
    stop ();
    return false;
  }
  const bool same = width == width_ && height == height_ && samples == samples_;
  if (same && failed_)
    return false;
  const GstGLFuncs *gl = context->gl_vtable;
  if (!same)
    stop ();
  gl->GetIntegerv (GL_DRAW_FRAMEBUFFER_BINDING, &before_);
  if (same) {
    gl->BindFramebuffer (GL_FRAMEBUFFER, framebuffer_);
    return true;
  }
  context_ = context;
  width_ = width;
  height_ = height;
  samples_ = samples;
  failed_ = !make (width, height, samples);
  if (failed_) {
    GST_WARNING ("no antialiasing: OpenGL has no framebuffer of %dx%d pixels with %d samples",
        width, height, samples);
    gl->BindFramebuffer (GL_FRAMEBUFFER, guint (before_));
  }
  return !failed_;
}

/* The means of the samples. */
void
Multisampler::blit (guint to)
{
  const GstGLFuncs *gl = context_->gl_vtable;
  gl->BindFramebuffer (GL_READ_FRAMEBUFFER, framebuffer_);
  gl->BindFramebuffer (GL_DRAW_FRAMEBUFFER, to);
  gl->BlitFramebuffer (
      0, 0, width_, height_, 0, 0, width_, height_, GL_COLOR_BUFFER_BIT, GL_NEAREST);
}

void
Multisampler::end (const float (&background)[4])
{
  const GstGLFuncs *gl = context_->gl_vtable;
  const bool opaque = background[3] >= 1;
  blit (opaque ? guint (before_) : resolved_);
  gl->BindFramebuffer (GL_FRAMEBUFFER, guint (before_));
  if (opaque)
    return;
  gl->Viewport (0, 0, width_, height_);
  gst_gl_shader_use (shader_);
  gl->ActiveTexture (GL_TEXTURE0);
  gl->BindTexture (GL_TEXTURE_2D, texture_);
  gst_gl_shader_set_uniform_1i (shader_, "u_picture", 0);
  gst_gl_shader_set_uniform_4f (
      shader_, "u_background", background[0], background[1], background[2], background[3]);
  gl->BindVertexArray (array_);
  gl->DrawArrays (GL_TRIANGLES, 0, 3);
  gl->BindVertexArray (0);
  gl->BindTexture (GL_TEXTURE_2D, 0);
  gst_gl_context_clear_shader (context_);
}

/* OpenGL takes no notice of what was never made. */
void
Multisampler::stop ()
{
  if (context_) {
    const GstGLFuncs *gl = context_->gl_vtable;
    gl->DeleteFramebuffers (1, &framebuffer_);
    gl->DeleteFramebuffers (1, &resolved_);
    gl->DeleteRenderbuffers (2, buffers_);
    gl->DeleteTextures (1, &texture_);
    gl->DeleteVertexArrays (1, &array_);
    gst_clear_object (&shader_);
  }
  *this = {};
}
