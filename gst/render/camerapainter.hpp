/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <rangecast/surface/camera_lines.hpp>
#include <rangecast/surface/orbit.hpp>
#include <span>

#include "glhelpers.hpp"

/** Draws a rig's cameras and their frusta, for show-cameras. All functions on the OpenGL thread. */
class CameraPainter {
public:
  /** Draws lines into the bound framebuffer; nothing if OpenGL has no shader for them.
   *  @param serial  never 0; lines with the same serial as last time are not uploaded again
   *  @return bytes uploaded */
  guint64 draw (GstGLContext *context, std::span<const rangecast::LineVertex> lines, guint64 serial,
      const rangecast::Mat4 &clip_from_world);
  /** Deletes everything that OpenGL has of it. */
  void stop ();

private:
  LazyShader shader_;
  guint vertices_ = 0;
  std::size_t capacity_ = 0; /* of the vertices, bytes */
  guint64 uploaded_ = 0;     /* serial */
};
