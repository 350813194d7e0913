/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "multisampler.hpp"

#include <gst/gl/gstglfuncs.h>

#include <algorithm>

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
  if (!storage || most < 2)
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

void
Multisampler::end ()
{
  const GstGLFuncs *gl = context_->gl_vtable;
  gl->BindFramebuffer (GL_READ_FRAMEBUFFER, framebuffer_);
  gl->BindFramebuffer (GL_DRAW_FRAMEBUFFER, guint (before_));
  gl->BlitFramebuffer (
      0, 0, width_, height_, 0, 0, width_, height_, GL_COLOR_BUFFER_BIT, GL_NEAREST);
  gl->BindFramebuffer (GL_FRAMEBUFFER, guint (before_));
}

void
Multisampler::stop ()
{
  if (context_ && framebuffer_) {
    const GstGLFuncs *gl = context_->gl_vtable;
    gl->DeleteFramebuffers (1, &framebuffer_);
    gl->DeleteRenderbuffers (2, buffers_);
  }
  *this = {};
}
