/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "camerapainter.hpp"

#include <gst/gl/gstglfuncs.h>

#include <cstddef>

#include "glshader.hpp"

using rangecast::LineVertex;

static const char *const kVertexShader = R"(
precision highp float;
uniform mat4 u_clip_from_world;
in vec3 a_position;
in vec3 a_colour;
out vec3 v_colour;
out vec2 v_depth;
void main ()
{
  gl_Position = u_clip_from_world * vec4 (a_position, 1.0);
  v_depth = gl_Position.zw;
  gl_Position.z = 0.0;
  v_colour = a_colour;
}
)";

/* Near and far plane are those of the points. Lines go on beyond them: they keep their depth beside
 * the points, but nothing clips them. */
static const char *const kFragmentShader = R"(
precision highp float;
in vec3 v_colour;
in vec2 v_depth;
out vec4 fragment;
void main ()
{
  fragment = vec4 (v_colour, 1.0);
  gl_FragDepth = clamp (0.5 + 0.5 * v_depth.x / v_depth.y, 0.0, 1.0);
}
)";

bool
CameraPainter::start (GstGLContext *context)
{
  if (shader_ || failed_)
    return shader_ != nullptr;
  GError *error = nullptr;
  shader_ = make_shader (context, kVertexShader, kFragmentShader, &error);
  if (!shader_) {
    failed_ = true;
    GST_WARNING ("cannot draw the cameras: %s", error ? error->message : "no shader");
    g_clear_error (&error);
    return false;
  }
  context_ = context;
  const GstGLFuncs *gl = context->gl_vtable;
  gl->GenBuffers (1, &vertices_);
  gl->GenVertexArrays (1, &array_);
  gl->BindVertexArray (array_);
  gl->BindBuffer (GL_ARRAY_BUFFER, vertices_);
  const auto attribute = [&] (const char *name, guint type, gboolean normalised, gsize offset) {
    const gint at = gst_gl_shader_get_attribute_location (shader_, name);
    gl->EnableVertexAttribArray (guint (at));
    gl->VertexAttribPointer (guint (at), 3, type, normalised, sizeof (LineVertex),
        reinterpret_cast<const void *> (offset)); /* NOLINT: an offset, as OpenGL wants it */
  };
  attribute ("a_position", GL_FLOAT, FALSE, offsetof (LineVertex, x));
  attribute ("a_colour", GL_UNSIGNED_BYTE, TRUE, offsetof (LineVertex, red));
  return true;
}

guint64
CameraPainter::draw (GstGLContext *context, std::span<const LineVertex> lines, guint64 serial,
    const rangecast::Mat4 &clip_from_world)
{
  if (!start (context))
    return 0;
  const GstGLFuncs *gl = context->gl_vtable;
  gst_gl_shader_use (shader_);
  gst_gl_shader_set_uniform_matrix_4fv (
      shader_, "u_clip_from_world", 1, FALSE, clip_from_world.data ());
  gl->BindVertexArray (array_);
  gl->BindBuffer (GL_ARRAY_BUFFER, vertices_);
  const bool changed = uploaded_ != serial;
  if (changed)
    gl->BufferData (GL_ARRAY_BUFFER, gssize (lines.size_bytes ()), lines.data (), GL_STREAM_DRAW);
  uploaded_ = serial;
  gl->Enable (GL_DEPTH_TEST);
  gl->DrawArrays (GL_LINES, 0, GLsizei (lines.size ()));
  gl->Disable (GL_DEPTH_TEST);
  gl->BindVertexArray (0);
  gl->BindBuffer (GL_ARRAY_BUFFER, 0);
  gst_gl_context_clear_shader (context);
  return changed ? lines.size_bytes () : 0;
}

void
CameraPainter::stop ()
{
  failed_ = false;
  uploaded_ = 0;
  if (!context_)
    return;
  const GstGLFuncs *gl = context_->gl_vtable;
  gl->DeleteBuffers (1, &vertices_);
  gl->DeleteVertexArrays (1, &array_);
  gst_clear_object (&shader_);
  context_ = nullptr;
}
