/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gl/gl.h>

#include <rangecast/geometry/image_view.hpp>

/** Lays a small picture over a larger one with OpenGL (core 3.3 or GLES 3.0), opaque, in its upper
 *  left corner. All functions in the GL thread. */
class PanelPainter {
public:
  /** Draws into the bound framebuffer; makes what it needs when first called.
   *  @param panel    R, G, B, unused; at most 4096 pixels wide and high
   *  @param changed  it is another one than the last time
   *  @param x, y     pixels, where the picture begins that it is laid over
   *  @param scale    pixels a pixel of the panel becomes, each way
   *  @return bytes uploaded */
  guint64 draw (GstGLContext *context, const rangecast::ImageView<const rangecast::Rgbx> &panel,
      bool changed, int x, int y, int scale);
  /** Deletes everything that OpenGL holds for us. */
  void stop ();

private:
  bool start (GstGLContext *context);
  guint64 upload (const rangecast::ImageView<const rangecast::Rgbx> &panel);

  GstGLContext *context_ = nullptr;
  GstGLShader *shader_ = nullptr;
  bool failed_ = false; /* to make the shader: not to be tried for each picture */
  bool uploaded_ = false;
  guint texture_ = 0, array_ = 0;
};
