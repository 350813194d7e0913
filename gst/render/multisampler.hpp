/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gl/gl.h>

/** Antialiasing: between begin() and end() OpenGL draws into a framebuffer of several samples a
 *  pixel, whose means then go into the framebuffer that was bound. OpenGL 3.3 or OpenGL ES 3.0. All
 *  functions in the GL thread.
 *
 *  Means of straight alpha are wrong: of an opaque sample and a transparent one, half of the colour
 *  would be that of what is not there. Over a background that is not opaque the samples therefore
 *  have to be opaque or (0, 0, 0, 0), where the background is to be seen; what they cover of a
 * pixel is then laid over the background. */
class Multisampler {
public:
  /** Binds the framebuffer. Makes it anew if size or samples differ from the last ones.
   *  @param samples  wanted; less where OpenGL has no more
   *  @return false if nothing was bound: samples below 2, or OpenGL cannot (which is logged once)
   */
  bool begin (GstGLContext *context, int width, int height, int samples);
  /** After begin() was true: resolves, and binds what was bound before.
   *  @param background  R, G, B, A, straight; not opaque: what to put behind the samples */
  void end (const float (&background)[4]);
  /** Deletes everything that OpenGL holds for us. */
  void stop ();

private:
  bool make (int width, int height, int samples);
  bool make_resolved (int width, int height);
  void blit (guint to);

  GstGLContext *context_ = nullptr;
  guint framebuffer_ = 0, buffers_[2] = {}; /* colour, depth */
  /* one sample a pixel, to be laid over a background */
  guint resolved_ = 0, texture_ = 0, array_ = 0;
  GstGLShader *shader_ = nullptr;
  gint before_ = 0;
  int width_ = 0, height_ = 0, samples_ = 0;
  bool failed_ = false; /* with these numbers */
};
