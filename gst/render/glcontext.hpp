/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gl/gl.h>

#include <mutex>

/** An element's OpenGL display and context, found and shared as GstGLBaseFilter does:
 * GstGLBaseMixer is public only since GStreamer 1.24. */
class GlContext {
public:
  static constexpr auto kApis =
      GstGLAPI (GST_GL_API_OPENGL | GST_GL_API_OPENGL3 | GST_GL_API_GLES2);

  /** NULL to READY: requests a display from neighbours and the application.
   *  @return false if there is none */
  bool open (GstElement *element);
  /** READY to NULL. */
  void close ();
  /** For GstElement's set_context(). Any thread. */
  void set (GstElement *element, GstContext *context);
  /** Answers a CONTEXT query. Any thread. */
  bool answer (GstElement *element, GstQuery *query);
  /** The context of a neighbour, or a new one. Streaming thread.
   *  Returns: (transfer full): nullptr, with `error` set, if there is none */
  GstGLContext *get (GstElement *element, GError **error);

private:
  std::recursive_mutex lock_; /* open() may call set() through the application */
  GstGLDisplay *display_ = nullptr;
  GstGLContext *context_ = nullptr, *other_ = nullptr; /* other_: of the application */
};

/** Calls a function on the context's thread and waits for it. */
template <typename Function>
void
on_gl_thread (GstGLContext *context, const Function &function)
{
  const auto call = [] (GstGLContext *, gpointer data) {
    (*static_cast<const Function *> (data)) ();
  };
  gst_gl_context_thread_add (context, call, const_cast<Function *> (&function));
}
