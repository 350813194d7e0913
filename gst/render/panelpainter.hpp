/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <rangecast/geometry/image_view.hpp>

#include "glhelpers.hpp"

/** Lays a small opaque picture, as that of show-stats, over the upper left corner of a larger one.
 *  All functions on the OpenGL thread. */
class PanelPainter {
public:
  /** Draws into the bound framebuffer; nothing if OpenGL has no shader for it.
   *  @param panel    R, G, B, unused; at most 4096 pixels wide and high
   *  @param changed  it differs from the last one
   *  @param x, y     pixels: the origin of the picture below
   *  @param scale    output pixels per pixel of the panel, each way
   *  @return bytes uploaded */
  guint64 draw (GstGLContext *context, const rangecast::ImageView<const rangecast::Rgbx> &panel,
      bool changed, int x, int y, int scale);
  /** Deletes everything that OpenGL has of it. */
  void stop ();

private:
  LazyShader shader_;
  guint texture_ = 0;
};
