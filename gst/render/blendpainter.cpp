/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "blendpainter.hpp"

#include <gst/gl/gstglfuncs.h>

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <rangecast/surface/view_matrices.hpp>
#include <string>

#include "glshader.hpp"

using rangecast::BlendVertex;
using rangecast::Mat3;
using rangecast::Vec3;

/* Up to so many views half floats keep 8 bits of colour: each addition is rounded to 11 bits. */
static constexpr std::size_t kMaxHalfFloatViews = 16;

/* Views that look against the viewer show the inside of surfaces, which fills holes, but must not
 * hide an outside that is less than so many metres behind. */
static constexpr double kInsideGap_m = 0.015;

static const char *const kVertexShader = R"(
precision highp float;
uniform mat4 u_clip_from_pixel; /* column, row and 1, all times depth, and 1 */
uniform vec2 u_behind;
layout (location = 0) in vec2 a_place; /* quarters of a pixel */
layout (location = 1) in float a_depth;
invariant gl_Position; /* in both passes */
#if SUM
uniform float u_unit;
uniform vec4 u_lens; /* principal point in the ROI, 1 / focal lengths; pixels */
uniform vec3 u_viewer; /* in the view's camera coordinates, metres */
layout (location = 2) in vec4 a_colour; /* and the square root of the weight */
out vec4 v_colour;
const float kMinAngle = 0.03; /* square root of the least weight; the cosine's power is 6 */
#endif
void main ()
{
  vec2 at = 0.25 * a_place;
  gl_Position = u_clip_from_pixel * vec4 (at * a_depth, a_depth, 1.0);
  /* the depth of what is u_behind.y metres farther, in the same place of the picture */
  gl_Position.z -= u_behind.x / (max (gl_Position.w, 0.0) + u_behind.y);
#if SUM
  vec3 ray = vec3 ((at - u_lens.xy) * u_lens.zw, 1.0);
  float along = dot (normalize (ray), normalize (ray * a_depth * u_unit - u_viewer));
  v_colour = vec4 (a_colour.rgb, a_colour.a * max (along * along * along, kMinAngle));
#endif
}
)";

/* Largest weight, so that half floats (up to 65504) hold the sum of four surfaces of each view, and
 * the least one as a share of it. The inside of a surface weighs so little that a pixel in which
 * all views show one is known by its sum. */
static constexpr float kMaxWeight = 1000, kMaxSum = 64000, kMinShare = 2e-6f;

struct Weights {
  float largest, least, inside;
};

static Weights
weights_for (std::size_t views, bool precise)
{
  const auto n = static_cast<float> (std::max<std::size_t> (views, 1));
  const float largest = precise ? kMaxWeight : std::min (kMaxWeight, kMaxSum / (4 * n)),
              least = kMinShare * largest;
  return {largest, least, least / (2.5f * n)};
}

static const char *const kFragmentShader = R"(
precision highp float;
#if SUM
in vec4 v_colour;
uniform vec3 u_weights; /* largest, least, inside */
out vec4 sum;
#endif
void main ()
{
#if SUM
  float weight = gl_FrontFacing ? max (v_colour.a * v_colour.a * u_weights.x, u_weights.y) : u_weights.z;
  sum = vec4 (v_colour.rgb * weight, weight);
#endif
}
)";

bool
BlendPainter::start (GstGLContext *context, GError **error)
{
  context_ = context;
  const auto renderer =
      reinterpret_cast<const char *> (context->gl_vtable->GetString (GL_RENDERER));
  in_software_ = renderer && std::strstr (renderer, "llvmpipe");
  for (std::size_t i = 0; i < shaders_.size (); i++) {
    const std::string variant = "#define SUM " + std::to_string (i);
    const std::string vertex = variant + kVertexShader, fragment = variant + kFragmentShader;
    shaders_[i] = make_shader (context, vertex.c_str (), fragment.c_str (), error);
    if (!shaders_[i])
      return false;
  }
  return targets_.start (context, error);
}

void
BlendPainter::stop ()
{
  if (!context_)
    return;
  const GstGLFuncs *gl = context_->gl_vtable;
  for (auto &turn : objects_)
    for (ViewObjects &objects : turn) {
      if (objects.array) {
        gl->DeleteBuffers (1, &objects.vertices);
        gl->DeleteVertexArrays (1, &objects.array);
      }
      objects = {};
    }
  for (GstGLShader *&shader : shaders_)
    gst_clear_object (&shader);
  targets_.stop ();
  context_ = nullptr;
}

static void
describe_vertices (const GstGLFuncs *gl)
{
  const auto attribute = [gl] (guint location, gint size, guint type, bool in_one, std::size_t at) {
    gl->EnableVertexAttribArray (location);
    gl->VertexAttribPointer (location, size, type, in_one, sizeof (BlendVertex),
        reinterpret_cast<const void *> (at)); /* an offset in the buffer */
  };
  attribute (0, 2, GL_SHORT, false, offsetof (BlendVertex, x));
  attribute (1, 1, GL_UNSIGNED_SHORT, false, offsetof (BlendVertex, depth));
  attribute (2, 4, GL_UNSIGNED_BYTE, true, offsetof (BlendVertex, colour));
}

guint64
BlendPainter::upload (std::span<const RenderLayer> layers)
{
  const GstGLFuncs *gl = context_->gl_vtable;
  guint64 uploaded = 0;
  turn_ = (turn_ + 1) % objects_.size ();
  for (const RenderLayer &layer : layers) {
    ViewObjects &objects = objects_[turn_][std::size_t (layer.image.view_id)];
    const bool is_new = !objects.array;
    if (is_new) {
      gl->GenBuffers (1, &objects.vertices);
      gl->GenVertexArrays (1, &objects.array);
    }
    gl->BindVertexArray (objects.array);
    gl->BindBuffer (GL_ARRAY_BUFFER, objects.vertices);
    if (is_new)
      describe_vertices (gl);
    const std::size_t size = layer.blend_vertices.size_bytes ();
    if (size > objects.capacity) { /* with room for the next ones: memory is made anew seldom */
      objects.capacity = size + size / 2;
      gl->BufferData (GL_ARRAY_BUFFER, GLsizeiptr (objects.capacity), nullptr, GL_DYNAMIC_DRAW);
    }
    gl->BufferSubData (GL_ARRAY_BUFFER, 0, GLsizeiptr (size), layer.blend_vertices.data ());
    uploaded += size;
  }
  gl->BindVertexArray (0);
  gl->BindBuffer (GL_ARRAY_BUFFER, 0);
  return uploaded;
}

/* How a view weighs its points. */
static void
set_weight_uniforms (GstGLShader *shader, const RenderPicture &picture, const RenderLayer &layer)
{
  const rangecast::View &view = *layer.view;
  const rangecast::Intrinsics &lens = view.intrinsics;
  const Mat3 &r = view.world_from_view.rotation;
  const Vec3 from =
      rangecast::viewer_position (picture.clip_from_world) - view.world_from_view.translation;
  gst_gl_shader_set_uniform_4f (shader, "u_lens", gfloat (lens.cx - layer.image.roi.x),
      gfloat (lens.cy - layer.image.roi.y), gfloat (1 / lens.fx), gfloat (1 / lens.fy));
  gst_gl_shader_set_uniform_3f (shader, "u_viewer", gfloat (dot (from, {r[0], r[3], r[6]})),
      gfloat (dot (from, {r[1], r[4], r[7]})), gfloat (dot (from, {r[2], r[5], r[8]})));
  gst_gl_shader_set_uniform_1f (shader, "u_unit", gfloat (view.depth_unit_m));
}

/* Both sides of all surfaces: weights leave next to nothing of what is seen from behind. */
void
BlendPainter::draw_layers (
    std::span<const RenderLayer> layers, const RenderPicture &picture, Pass pass) const
{
  const GstGLFuncs *gl = context_->gl_vtable;
  GstGLShader *shader = shaders_[pass];
  gst_gl_shader_use (shader);
  for (const RenderLayer &layer : layers) {
    if (layer.blend_vertices.empty ())
      continue;
    const auto matrix = clip_from_pixel (picture.clip_from_world, *layer.view, layer.image.roi);
    const double against = -view_alignment (picture.clip_from_world, *layer.view);
    const double gap_m = (pass == kDepth ? picture.blend_range_m : 0) +
                         kInsideGap_m * std::clamp (2 * against, 0.0, 1.0);
    const auto shift = rangecast::depth_shift (matrix, picture.clip_from_world, gap_m);
    gst_gl_shader_set_uniform_matrix_4fv (shader, "u_clip_from_pixel", 1, FALSE, matrix.data ());
    gst_gl_shader_set_uniform_2f (shader, "u_behind", shift.b * shift.g, shift.g);
    if (pass == kSum)
      set_weight_uniforms (shader, picture, layer);
    gl->BindVertexArray (objects_[turn_][std::size_t (layer.image.view_id)].array);
    gl->DrawArrays (GL_TRIANGLE_STRIP, 0, GLsizei (layer.blend_vertices.size ()));
  }
}

bool
BlendPainter::draw (const RenderPicture &picture, std::span<const RenderLayer> layers)
{
  const bool precise =
      !is_gles (context_) && (in_software_ || picture.rig_views > kMaxHalfFloatViews);
  if (!targets_.begin_depth (picture.width, picture.height, precise, picture.covered))
    return false;
  draw_layers (layers, picture, kDepth);
  targets_.begin_sum ();
  const Weights weights = weights_for (picture.rig_views, precise);
  gst_gl_shader_use (shaders_[kSum]);
  gst_gl_shader_set_uniform_3f (
      shaders_[kSum], "u_weights", weights.largest, weights.least, weights.inside);
  context_->gl_vtable->FrontFace (rangecast::mirrors (picture.clip_from_world) ? GL_CW : GL_CCW);
  draw_layers (layers, picture, kSum);
  const auto shift = rangecast::depth_shift (
      picture.clip_from_world, picture.clip_from_world, picture.blend_range_m);
  targets_.resolve (picture.part, picture.covered, picture.background, picture.background_shade,
      shift, 0.9f * weights.least, picture.keeps_depth);
  context_->gl_vtable->FrontFace (GL_CCW);
  context_->gl_vtable->BindVertexArray (0);
  context_->gl_vtable->Disable (GL_DEPTH_TEST);
  gst_gl_context_clear_shader (context_);
  return true;
}
