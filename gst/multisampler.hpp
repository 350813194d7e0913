/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gl/gl.h>

/** Antialiasing: between begin() and end() OpenGL draws into a framebuffer of several samples a
 *  pixel, whose means then go into the framebuffer that was bound. OpenGL 3.3 or OpenGL ES 3.0. All
 *  functions in the GL thread. */
class Multisampler {
public:
  /** Binds the framebuffer. Makes it anew if size or samples differ from the last ones.
   *  @param samples  wanted; less where OpenGL has no more
   *  @return false if nothing was bound: samples below 2, or OpenGL cannot (which is logged once)
   */
  bool begin (GstGLContext *context, int width, int height, int samples);
  /** After begin() was true: resolves, and binds what was bound before. */
  void end ();
  /** Deletes everything that OpenGL holds for us. */
  void stop ();

private:
  bool make (int width, int height, int samples);

  GstGLContext *context_ = nullptr;
  guint framebuffer_ = 0, buffers_[2] = {}; /* colour, depth */
  gint before_ = 0;
  int width_ = 0, height_ = 0, samples_ = 0;
  bool failed_ = false; /* with these numbers */
};
