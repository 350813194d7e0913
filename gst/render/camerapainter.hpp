/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gl/gl.h>

#include <rangecast/surface/camera_lines.hpp>
#include <rangecast/surface/orbit.hpp>
#include <span>

/** Draws where a rig's cameras stand and what they see, with OpenGL (core 3.3 or GLES 3.0). All
 *  functions in the GL thread. */
class CameraPainter {
public:
  /** Draws lines into the bound framebuffer; makes what it needs when first called. Without a
   *  shader it draws nothing; the reason has been logged.
   *  @param serial  never 0; the lines are those of the last call if it is that one's
   *  @return bytes uploaded */
  guint64 draw (GstGLContext *context, std::span<const rangecast::LineVertex> lines, guint64 serial,
      const rangecast::Mat4 &clip_from_world);
  /** Deletes everything that OpenGL holds for us. */
  void stop ();

private:
  bool start (GstGLContext *context);

  GstGLContext *context_ = nullptr;
  GstGLShader *shader_ = nullptr;
  bool failed_ = false; /* to make the shader: not to be tried for each picture */
  guint vertices_ = 0, array_ = 0;
  guint64 uploaded_ = 0; /* serial */
};
