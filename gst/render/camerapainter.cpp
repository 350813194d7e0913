/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "camerapainter.hpp"

#include <cstddef>

using rangecast::LineVertex;

namespace {

const char *const kVertexShader = R"(
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
const char *const kFragmentShader = R"(
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

} // namespace

guint64
CameraPainter::draw (GstGLContext *context, std::span<const LineVertex> lines, guint64 serial,
    const rangecast::Mat4 &clip_from_world)
{
  const GstGLFuncs *gl = context->gl_vtable;
  if (!shader_.make (context, kVertexShader, kFragmentShader, "show-cameras"))
    return 0;
  const bool is_new = !vertices_;
  if (is_new)
    gl->GenBuffers (1, &vertices_);
  gst_gl_shader_use (shader_.shader ());
  gst_gl_shader_set_uniform_matrix_4fv (
      shader_.shader (), "u_clip_from_world", 1, FALSE, clip_from_world.data ());
  gl->BindVertexArray (shader_.array ());
  gl->BindBuffer (GL_ARRAY_BUFFER, vertices_);
  const auto attribute = [&] (const char *name, guint type, gboolean normalised, gsize offset) {
    const gint at = gst_gl_shader_get_attribute_location (shader_.shader (), name);
    gl->EnableVertexAttribArray (guint (at));
    gl->VertexAttribPointer (guint (at), 3, type, normalised, sizeof (LineVertex),
        reinterpret_cast<const void *> (offset)); /* NOLINT: an offset, as OpenGL wants it */
  };
  if (is_new) {
    attribute ("a_position", GL_FLOAT, FALSE, offsetof (LineVertex, x));
    attribute ("a_colour", GL_UNSIGNED_BYTE, TRUE, offsetof (LineVertex, red));
  }
  const bool changed = uploaded_ != serial;
  if (changed)
    upload_vertices (gl, capacity_, lines.data (), lines.size_bytes ());
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
  if (GstGLContext *context = shader_.stop ())
    context->gl_vtable->DeleteBuffers (1, &vertices_);
  *this = {};
}
