/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "picture.hpp"

/* striprender's OpenGL, which not every build has: without RANGECAST_HAVE_OPENGL nothing of
 * gstreamer-gl is needed. */
#ifdef RANGECAST_HAVE_OPENGL
#include <gst/gl/gl.h>

#include <mutex>

#define STRIP_GL_CAPS                                                                              \
  GST_VIDEO_CAPS_MAKE_WITH_FEATURES (GST_CAPS_FEATURE_MEMORY_GL_MEMORY, "RGBA")                    \
  ", texture-target = (string) 2D, multiview-mode = (string) { " STRIP_MULTIVIEW_MODES             \
  ", separated }"
#define STRIP_CAPS STRIP_GL_CAPS "; " STRIP_SYSTEM_CAPS

/** An element's OpenGL display and context, found and shared as GstGLBaseFilter does
 *  (GstGLBaseMixer is public only since GStreamer 1.24), and what draws with them. No display is
 *  opened before get() or is_fast(). */
class OpenGl {
public:
  /** PAUSED to READY. */
  void close ();
  /** For GstElement's set_context(). Any thread. */
  void set (GstElement *element, GstContext *context);
  /** Answers a CONTEXT query. Any thread. */
  bool answer (GstElement *element, GstQuery *query);
  /** Whether there is a context, and it is not a rasteriser in software. Streaming thread. */
  bool is_fast (GstElement *element);
  /** A backend for buffers of OpenGL memory; `before` where that has the same context. Streaming
   *  thread. @return nullptr, with `error` set, if OpenGL cannot be used */
  std::unique_ptr<RenderBackend> start (GstElement *element, const GstVideoInfo &info,
      std::unique_ptr<RenderBackend> before, GError **error);
  /** Whether a pool's buffers are of our context. */
  bool can_use (GstBufferPool *pool);
  /** Returns: (transfer full): of buffers of OpenGL memory, after start() */
  GstBufferPool *make_pool ();

private:
  bool open (GstElement *element);
  GstGLContext *get (GstElement *element, GError **error);

  std::recursive_mutex lock_; /* open() may call set() through the application */
  GstGLDisplay *display_ = nullptr;
  GstGLContext *context_ = nullptr, *other_ = nullptr; /* other_: of the application */
};

#else
#define STRIP_GL_CAPS "EMPTY"
#define STRIP_CAPS STRIP_SYSTEM_CAPS

class OpenGl {
public:
  void close () {}
  void set (GstElement *, GstContext *) {}
  bool answer (GstElement *, GstQuery *) { return false; }
  bool is_fast (GstElement *) { return false; }
  std::unique_ptr<RenderBackend> start (
      GstElement *, const GstVideoInfo &, std::unique_ptr<RenderBackend>, GError **)
  {
    return nullptr;
  }
  bool can_use (GstBufferPool *) { return false; }
  GstBufferPool *make_pool () { return nullptr; }
};
#endif
