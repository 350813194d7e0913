/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "glhelpers.hpp"

/** Antialiasing by multisampling: between begin() and end() OpenGL draws into a framebuffer with
 *  several samples a pixel, whose means then go into the framebuffer that was bound. OpenGL 3.3 or
 *  OpenGL ES 3.0. All functions on the OpenGL thread.
 *
 *  The mean of an opaque and a transparent sample of straight alpha has half of its colour from the
 *  transparent one. For a background that is not opaque, samples therefore have to be opaque, or
 *  (0, 0, 0, 0) where the background shows; the means are then laid over the background. */
class Multisampler {
public:
  /** Binds the framebuffer, which is replaced if size or samples change.
   *  @param samples  at most; OpenGL may have fewer
   *  @return false if nothing was bound: samples below 2, or OpenGL cannot (which is logged once)
   */
  bool begin (GstGLContext *context, int width, int height, int samples);
  /** After begin() was true: resolves, and binds what was bound before.
   *  @param background  R, G, B, A, straight; if not opaque it is put behind the samples */
  void end (const float (&background)[4]);
  /** Deletes everything that OpenGL has of it. */
  void stop ();

private:
  bool make (int width, int height, int samples);
  bool make_resolved (int width, int height);

  GstGLContext *context_ = nullptr;
  guint framebuffer_ = 0, buffers_[2] = {}; /* colour, depth */
  guint resolved_ = 0, texture_ = 0;        /* one sample a pixel, to be laid over a background */
  LazyShader over_background_;
  gint output_ = 0; /* framebuffer that was bound */
  int width_ = 0, height_ = 0, samples_ = 0;
  bool failed_ = false; /* with these numbers */
};
