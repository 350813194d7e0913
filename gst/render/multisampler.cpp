/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "multisampler.hpp"

#include <algorithm>

#ifndef GL_MAX_SAMPLES
#define GL_MAX_SAMPLES 0x8D57
#endif
#ifndef GL_READ_FRAMEBUFFER
#define GL_READ_FRAMEBUFFER 0x8CA8
#define GL_DRAW_FRAMEBUFFER 0x8CA9
#endif
namespace {

/* Means of opaque samples and (0, 0, 0, 0) are premultiplied by the pixel's coverage. The result is
 * divided by its alpha: straight again. */
const char *const kOverBackground = R"(
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

} // namespace

bool
Multisampler::make_resolved (int width, int height)
{
  const GstGLFuncs *gl = context_->gl_vtable;
  if (!over_background_.make (context_, kOverBackground, "antialiasing"))
    return false;
  gl->GenTextures (1, &texture_);
  gl->BindTexture (GL_TEXTURE_2D, texture_);
  define_texture (gl, GL_RGBA8, width, height, GL_RGBA, GL_UNSIGNED_BYTE);
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
  gint max = 0;
  gl->GetIntegerv (GL_MAX_SAMPLES, &max);
  if (!storage || max < 2 || !make_resolved (width, height))
    return false;
  gl->GenFramebuffers (1, &framebuffer_);
  gl->GenRenderbuffers (2, buffers_);
  gl->BindFramebuffer (GL_FRAMEBUFFER, framebuffer_);
  const guint formats[] = {GL_RGBA8, GL_DEPTH_COMPONENT24};
  const guint attachments[] = {GL_COLOR_ATTACHMENT0, GL_DEPTH_ATTACHMENT};
  for (int i = 0; i < 2; i++) {
    gl->BindRenderbuffer (GL_RENDERBUFFER, buffers_[i]);
    storage (GL_RENDERBUFFER, std::min (samples, max), formats[i], width, height);
    gl->FramebufferRenderbuffer (GL_FRAMEBUFFER, attachments[i], GL_RENDERBUFFER, buffers_[i]);
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
  gl->GetIntegerv (GL_DRAW_FRAMEBUFFER_BINDING, &output_);
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
    GST_WARNING_OBJECT (context,
        "no antialiasing: OpenGL has no framebuffer of %dx%d pixels with %d samples", width, height,
        samples);
    gl->BindFramebuffer (GL_FRAMEBUFFER, guint (output_));
  }
  return !failed_;
}

void
Multisampler::end (const float (&background)[4])
{
  const GstGLFuncs *gl = context_->gl_vtable;
  const bool opaque = background[3] >= 1;
  gl->BindFramebuffer (GL_READ_FRAMEBUFFER, framebuffer_);
  gl->BindFramebuffer (GL_DRAW_FRAMEBUFFER, opaque ? guint (output_) : resolved_);
  gl->BlitFramebuffer (
      0, 0, width_, height_, 0, 0, width_, height_, GL_COLOR_BUFFER_BIT, GL_NEAREST);
  gl->BindFramebuffer (GL_FRAMEBUFFER, guint (output_));
  if (opaque)
    return;
  gl->Viewport (0, 0, width_, height_);
  GstGLShader *shader = over_background_.shader ();
  gst_gl_shader_use (shader);
  gl->ActiveTexture (GL_TEXTURE0);
  gl->BindTexture (GL_TEXTURE_2D, texture_);
  gst_gl_shader_set_uniform_1i (shader, "u_picture", 0);
  gst_gl_shader_set_uniform_4f (
      shader, "u_background", background[0], background[1], background[2], background[3]);
  draw_covering (gl, over_background_.array ());
  gl->BindTexture (GL_TEXTURE_2D, 0);
  gst_gl_context_clear_shader (context_);
}

/* OpenGL ignores the names of objects that were not made. */
void
Multisampler::stop ()
{
  if (context_) {
    const GstGLFuncs *gl = context_->gl_vtable;
    gl->DeleteFramebuffers (1, &framebuffer_);
    gl->DeleteFramebuffers (1, &resolved_);
    gl->DeleteRenderbuffers (2, buffers_);
    gl->DeleteTextures (1, &texture_);
    over_background_.stop ();
  }
  *this = {};
}
