/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "glcontext.hpp"

bool
GlContext::open (GstElement *element)
{
  std::lock_guard guard (lock_);
  if (!gst_gl_ensure_element_data (element, &display_, &other_))
    return false;
  gst_gl_display_filter_gl_api (display_, kApis);
  return true;
}

void
GlContext::close ()
{
  std::lock_guard guard (lock_);
  gst_clear_object (&context_);
  gst_clear_object (&other_);
  gst_clear_object (&display_);
}

void
GlContext::set (GstElement *element, GstContext *context)
{
  std::lock_guard guard (lock_);
  gst_gl_handle_set_context (element, context, &display_, &other_);
  if (display_)
    gst_gl_display_filter_gl_api (display_, kApis);
}

bool
GlContext::answer (GstElement *element, GstQuery *query)
{
  std::lock_guard guard (lock_);
  return gst_gl_handle_context_query (element, query, display_, context_, other_);
}

GstGLContext *
GlContext::get (GstElement *element, GError **error)
{
  if (!open (element)) {
    g_set_error (
        error, GST_GL_CONTEXT_ERROR, GST_GL_CONTEXT_ERROR_FAILED, "there is no OpenGL display");
    return nullptr;
  }
  /* Without the lock: neighbours may ask back. */
  GstGLContext *shared = nullptr;
  if (!gst_gl_query_local_gl_context (element, GST_PAD_SRC, &shared))
    gst_gl_query_local_gl_context (element, GST_PAD_SINK, &shared);
  std::lock_guard guard (lock_);
  if (context_ && context_->display != display_)
    gst_clear_object (&context_);
  if (!context_ && shared && shared->display == display_)
    context_ = GST_GL_CONTEXT (gst_object_ref (shared));
  gst_clear_object (&shared);
  if (!context_) {
    GST_OBJECT_LOCK (display_);
    do {
      gst_clear_object (&context_);
      context_ = gst_gl_display_get_gl_context_for_thread (display_, nullptr);
      if (!context_ && !gst_gl_display_create_context (display_, other_, &context_, error))
        break;
    } while (!gst_gl_display_add_context (display_, context_));
    GST_OBJECT_UNLOCK (display_);
  }
  return context_ ? GST_GL_CONTEXT (gst_object_ref (context_)) : nullptr;
}
