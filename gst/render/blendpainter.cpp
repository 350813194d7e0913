/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "blendpainter.hpp"

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <string>

#include "backgroundpainter.hpp"

#ifndef GL_RGBA16F
#define GL_RGBA16F 0x881A
#endif
#ifndef GL_RGBA32F
#define GL_RGBA32F 0x8814
#endif
#ifndef GL_HALF_FLOAT
#define GL_HALF_FLOAT 0x140B
#endif

using rangecast::BlendVertex;
using rangecast::Mat3;
using rangecast::Vec3;

namespace {

/* Up to so many views half floats keep 8 bits of colour: each addition is rounded to 11 bits. */
constexpr std::size_t kMaxHalfFloatViews = 16;

/* Views that look against the viewer show the inside of surfaces, which fills holes, but must not
 * hide an outside less than so many metres behind it. */
constexpr double kInsideGap_m = 0.015;

/* ---- passes 1 and 2 ---- */

const char *const kVertexShader = R"(
layout (location = 0) in vec2 a_place; /* quarters of a pixel */
layout (location = 1) in float a_depth;
invariant gl_Position; /* in both passes */
#if SUM
uniform float u_unit;
uniform vec4 u_lens; /* principal point in the ROI, 1 / focal lengths; pixels */
uniform vec3 u_viewer; /* in the view's camera coordinates, metres */
layout (location = 2) in vec4 a_colour; /* and the square root of the weight */
out vec4 v_colour;
const float kMinAngle = 0.03; /* square root of the minimum weight; the cosine's power is 6 */
#endif
void main ()
{
  vec2 at = 0.25 * a_place;
  gl_Position = clip_position (at, a_depth);
#if SUM
  vec3 ray = vec3 ((at - u_lens.xy) * u_lens.zw, 1.0);
  float along = dot (normalize (ray), normalize (ray * a_depth * u_unit - u_viewer));
  v_colour = vec4 (a_colour.rgb, a_colour.a * max (along * along * along, kMinAngle));
#endif
}
)";

const char *const kFragmentShader = R"(
precision highp float;
#if SUM
in vec4 v_colour;
uniform vec3 u_weights; /* maximum, minimum, inside */
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

/* The largest weight: half floats (up to 65504) hold the sum of four surfaces of each view. The
 * smallest weight is a share of it. The inside of a surface weighs so little that the sum tells a
 * pixel in which all views show an inside from one in which a view shows an outside. */
constexpr float kMaxWeight = 1000, kMaxSum = 64000, kMinShare = 2e-6f;

struct Weights {
  float max, min, inside;
};

Weights
weights_for (std::size_t views, bool precise)
{
  const auto n = static_cast<float> (std::max<std::size_t> (views, 1));
  const float max = precise ? kMaxWeight : std::min (kMaxWeight, kMaxSum / (4 * n)),
              min = kMinShare * max;
  return {max, min, min / (2.5f * n)};
}

/* The angle between the view's ray and the viewer's. */
void
set_angle_uniforms (GstGLShader *shader, const RenderPicture &picture, const RenderLayer &layer)
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

void
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

/* ---- pass 3 ---- */

/* Outlines are smoothed over the four neighbours, which also closes cracks of one pixel between
 * what two views draw. Where no camera saw the outside of a surface, so that the inside of one
 * behind shows through (beside a nose, round glasses), small gaps take the colours around them,
 * from the farther surfaces: what a nearer one hides is theirs. */
const char *const kDivideShader = R"(
precision highp int;
precision highp sampler2D;
uniform sampler2D u_sum; /* R, G, B times weight; weight */
uniform sampler2D u_depth;
uniform vec3 u_shift; /* a, b, g of DepthShift */
uniform ivec4 u_part; /* first and last pixel */
uniform float u_outside; /* minimum weight of an outside, less rounding */
uniform int u_reach; /* pixels: wider gaps are not filled */
out vec4 fragment;
float distance_at (ivec2 at)
{
  return u_shift.y / (2.0 * texelFetch (u_depth, at, 0).r - 1.0 - u_shift.x) - u_shift.z;
}
/* The first outside in a direction, and how many steps away; 0: none within reach. */
int trace (ivec2 at, ivec2 step, out vec4 outside)
{
  outside = vec4 (0.0);
  int last = 0;
  for (int r = 1; r <= u_reach; r += 1 + r / 4) {
    outside = texelFetch (u_sum, clamp (at + r * step, u_part.xy, u_part.zw), 0);
    if (outside.a >= u_outside) {
      for (int back = r - 1; back > last; back--) { /* the strides grow */
        vec4 nearer = texelFetch (u_sum, clamp (at + back * step, u_part.xy, u_part.zw), 0);
        if (nearer.a < u_outside)
          break;
        outside = nearer;
        r = back;
      }
      return r;
    }
    last = r;
  }
  return 0;
}
ivec2 direction (int k) /* 0 to 7; k and 7 - k are opposite */
{
  int q = k < 4 ? k : k + 1; /* of 3 x 3, without the centre */
  return ivec2 (q % 3 - 1, q / 3 - 1);
}
/* Weighted mean of the farthest outsides in eight directions, and its share: all of it in gaps up to
 * half the reach wide, less in wider ones; nothing where a direction ends in none. */
vec4 fill (ivec2 at)
{
  const float kSameSurface = 0.02; /* metres */
  vec4 outside;
  float farthest = 0.0;
  int widest = 0;
  for (int k = 0; k < 4; k++) {
    int there = trace (at, direction (k), outside), opposite = trace (at, direction (7 - k), outside);
    if (there == 0 || opposite == 0)
      return vec4 (0.0);
    widest = max (widest, there + opposite);
    farthest = max (farthest, max (distance_at (at + there * direction (k)),
                                  distance_at (at + opposite * direction (7 - k))));
  }
  float share = clamp (2.0 - 2.0 * float (widest) / float (u_reach), 0.0, 1.0);
  if (share <= 0.0)
    return vec4 (0.0);
  vec4 sum = vec4 (0.0);
  for (int k = 0; k < 8; k++) {
    ivec2 way = trace (at, direction (k), outside) * direction (k);
    if (distance_at (at + way) > farthest - kSameSurface)
      sum += vec4 (outside.rgb / outside.a, 1.0) / float (way.x * way.x + way.y * way.y);
  }
  return vec4 (sum.rgb / sum.a, share);
}
void main ()
{
  vec4 ground = background (gl_FragCoord.xy);
  ivec2 at = ivec2 (gl_FragCoord.xy), first = u_part.xy, last = u_part.zw;
  vec4 sum = texelFetch (u_sum, at, 0);
  vec4 west = texelFetch (u_sum, ivec2 (max (at.x - 1, first.x), at.y), 0);
  vec4 east = texelFetch (u_sum, ivec2 (min (at.x + 1, last.x), at.y), 0);
  vec4 north = texelFetch (u_sum, ivec2 (at.x, max (at.y - 1, first.y)), 0);
  vec4 south = texelFetch (u_sum, ivec2 (at.x, min (at.y + 1, last.y)), 0);
  vec4 weights = vec4 (west.a, east.a, north.a, south.a);
  float covered = dot (vec4 (greaterThan (weights, vec4 (0.0))), vec4 (1.0));
  /* a pixel that is drawn: from 1/2 where none beside it is; one that is not: up to 1/2, or a crack */
  float coverage = sum.a > 0.0 ? 0.5 + 0.125 * covered : covered > 2.0 ? 1.0 : 0.125 * covered;
  float heaviest = sum.a;
  if (sum.a <= 0.0) {
    sum = west + east + north + south;
    heaviest = max (max (west.a, east.a), max (north.a, south.a));
  }
  if (heaviest > 0.0 && heaviest < u_outside) {
    vec4 filled = fill (at);
    sum = vec4 (mix (sum.rgb / sum.a, filled.rgb, filled.a), 1.0);
  }
#if WITH_DEPTH
  float depth = texelFetch (u_depth, at, 0).r, distance = distance_at (at);
  gl_FragDepth = depth < 1.0 ? 0.5 + 0.5 * (u_shift.x + u_shift.y / distance) : 1.0;
#endif
  float behind = (1.0 - coverage) * ground.a;
  float alpha = coverage + behind;
  vec3 colour = coverage * sum.rgb / max (sum.a, 1e-7) + behind * ground.rgb;
  fragment = alpha > 0.0 ? vec4 (colour / alpha, alpha) : ground;
}
)";

} // namespace

bool
BlendPainter::is_supported (GstGLContext *context)
{
  return !is_gles (context) ||
         gst_gl_context_check_feature (context, "GL_EXT_color_buffer_float") ||
         gst_gl_context_check_feature (context, "GL_EXT_color_buffer_half_float");
}

bool
BlendPainter::start (GstGLContext *context, GError **error)
{
  context_ = context;
  const auto renderer =
      reinterpret_cast<const char *> (context->gl_vtable->GetString (GL_RENDERER));
  in_software_ = renderer && std::strstr (renderer, "llvmpipe");
  for (std::size_t i = 0; i < shaders_.size (); i++) {
    const std::string variant = "#define SUM " + std::to_string (i);
    const std::string vertex = variant + kPositionFunction + kVertexShader,
                      fragment = variant + kFragmentShader;
    shaders_[i] = make_shader (context, vertex.c_str (), fragment.c_str (), error);
    if (!shaders_[i])
      return false;
  }
  for (std::size_t i = 0; i < divide_shaders_.size (); i++) {
    const std::string fragment =
        "#define WITH_DEPTH " + std::to_string (i) + kBackgroundFunction + kDivideShader;
    divide_shaders_[i] = make_shader (context, kCoveringVertexShader, fragment.c_str (), error);
    if (!divide_shaders_[i])
      return false;
  }
  context->gl_vtable->GenVertexArrays (1, &array_);
  return true;
}

void
BlendPainter::stop ()
{
  if (!context_)
    return;
  const GstGLFuncs *gl = context_->gl_vtable;
  for (auto &turn : objects_)
    for (ViewObjects &objects : turn)
      if (objects.array) {
        gl->DeleteBuffers (1, &objects.vertices);
        gl->DeleteVertexArrays (1, &objects.array);
      }
  for (GstGLShader *&shader : shaders_)
    gst_clear_object (&shader);
  for (GstGLShader *&shader : divide_shaders_)
    gst_clear_object (&shader);
  gl->DeleteVertexArrays (1, &array_);
  delete_targets ();
  *this = {};
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
    upload_vertices (gl, objects.capacity, layer.blend_vertices.data (), size);
    uploaded += size;
  }
  gl->BindVertexArray (0);
  gl->BindBuffer (GL_ARRAY_BUFFER, 0);
  return uploaded;
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
    set_position_uniforms (
        shader, matrix, rangecast::depth_shift (matrix, picture.clip_from_world, gap_m));
    if (pass == kSum)
      set_angle_uniforms (shader, picture, layer);
    gl->BindVertexArray (objects_[turn_][std::size_t (layer.image.view_id)].array);
    gl->DrawArrays (GL_TRIANGLE_STRIP, 0, GLsizei (layer.blend_vertices.size ()));
  }
}

bool
BlendPainter::draw (const RenderPicture &picture, std::span<const RenderLayer> layers)
{
  const GstGLFuncs *gl = context_->gl_vtable;
  const rangecast::Roi &covered = picture.covered;
  const bool precise =
      !is_gles (context_) && (in_software_ || picture.rig_views > kMaxHalfFloatViews);
  if (!bind_targets (picture.width, picture.height, precise))
    return false;

  gl->Viewport (0, 0, picture.width, picture.height);
  gl->Enable (GL_SCISSOR_TEST); /* to clear float targets is a good part of a picture's cost */
  gl->Scissor (covered.x, covered.y, covered.width, covered.height);
  gl->ClearColor (0, 0, 0, 0);
  gl->Clear (GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
  gl->Enable (GL_DEPTH_TEST);
  gl->ColorMask (FALSE, FALSE, FALSE, FALSE);
  draw_layers (layers, picture, kDepth);

  gl->ColorMask (TRUE, TRUE, TRUE, TRUE);
  gl->DepthMask (FALSE);
  gl->DepthFunc (GL_LEQUAL);
  gl->Enable (GL_BLEND);
  gl->BlendFunc (GL_ONE, GL_ONE);
  gl->FrontFace (rangecast::mirrors (picture.clip_from_world) ? GL_CW : GL_CCW);
  const Weights weights = weights_for (picture.rig_views, precise);
  gst_gl_shader_use (shaders_[kSum]);
  gst_gl_shader_set_uniform_3f (
      shaders_[kSum], "u_weights", weights.max, weights.min, weights.inside);
  draw_layers (layers, picture, kSum);
  gl->Disable (GL_BLEND);
  gl->BlendFunc (GL_ONE, GL_ZERO);
  gl->DepthMask (TRUE);

  divide (picture, 0.9f * weights.min);
  gl->DepthFunc (GL_LESS);
  gl->FrontFace (GL_CCW);
  gl->Disable (GL_DEPTH_TEST);
  gst_gl_context_clear_shader (context_);
  return true;
}

/* Pass 3, into the framebuffer that was bound before. Pixels outside of picture.covered become
 * background.
 * @param outside  pixels of less weight show only the inside of surfaces: in gaps up to a 30th of
 *                 the picture's height they take the colours around them, in gaps up to a 15th a
 *                 share of those */
void
BlendPainter::divide (const RenderPicture &picture, float outside) const
{
  const GstGLFuncs *gl = context_->gl_vtable;
  const rangecast::Roi &part = picture.part, &covered = picture.covered;
  const float *background = picture.background;
  gl->DepthFunc (GL_ALWAYS);
  gl->BindFramebuffer (GL_FRAMEBUFFER, guint (output_));
  gl->Scissor (part.x, part.y, part.width, part.height);
  gl->ClearColor (background[0], background[1], background[2], background[3]);
  if (picture.background_shade <= 0) /* else it has been drawn */
    gl->Clear (GL_COLOR_BUFFER_BIT);
  gl->Scissor (covered.x, covered.y, covered.width, covered.height);
  GstGLShader *shader = divide_shaders_[picture.keeps_depth ? 1 : 0];
  gst_gl_shader_use (shader);
  static const char *const kNames[] = {"u_sum", "u_depth"};
  for (std::size_t i = 0; i < targets_.size (); i++) {
    gl->ActiveTexture (guint (GL_TEXTURE0 + i));
    gl->BindTexture (GL_TEXTURE_2D, targets_[i]);
    gst_gl_shader_set_uniform_1i (shader, kNames[i], gint (i));
  }
  gst_gl_shader_set_uniform_4i (shader, "u_part", covered.x, covered.y,
      covered.x + covered.width - 1, covered.y + covered.height - 1);
  const auto shift = rangecast::depth_shift (
      picture.clip_from_world, picture.clip_from_world, picture.blend_range_m);
  gst_gl_shader_set_uniform_3f (shader, "u_shift", shift.a, shift.b, shift.g);
  gst_gl_shader_set_uniform_1f (shader, "u_outside", outside);
  gst_gl_shader_set_uniform_1i (shader, "u_reach", std::max (part.height / 15, 2));
  set_background_uniforms (shader, picture.background, picture.background_shade, part);
  draw_covering (gl, array_);
  for (std::size_t i = targets_.size (); i-- > 0;) { /* they are targets again next time */
    gl->ActiveTexture (guint (GL_TEXTURE0 + i));
    gl->BindTexture (GL_TEXTURE_2D, 0);
  }
  if (part.width == width_ && part.height == height_)
    gl->Disable (GL_SCISSOR_TEST);
  else
    gl->Scissor (part.x, part.y, part.width, part.height);
}

/* Replaces the targets if size or precision change. @return false if OpenGL cannot have them:
 * what was bound is bound again */
bool
BlendPainter::bind_targets (int width, int height, bool precise)
{
  const GstGLFuncs *gl = context_->gl_vtable;
  const bool same = width == width_ && height == height_ && precise == precise_;
  if (same && failed_)
    return false;
  gl->GetIntegerv (GL_DRAW_FRAMEBUFFER_BINDING, &output_);
  if (same) {
    gl->BindFramebuffer (GL_FRAMEBUFFER, framebuffer_);
    return true;
  }
  failed_ = !make_targets (width, height, precise);
  width_ = width;
  height_ = height;
  precise_ = precise;
  if (failed_)
    gl->BindFramebuffer (GL_FRAMEBUFFER, guint (output_));
  return !failed_;
}

bool
BlendPainter::make_targets (int width, int height, bool precise)
{
  const GstGLFuncs *gl = context_->gl_vtable;
  delete_targets ();
  const struct {
    guint internal, format, type, attachment;
  } formats[] = {
      {guint (precise ? GL_RGBA32F : GL_RGBA16F), GL_RGBA,
          guint (precise ? GL_FLOAT : GL_HALF_FLOAT), GL_COLOR_ATTACHMENT0},
      {GL_DEPTH_COMPONENT24, GL_DEPTH_COMPONENT, GL_UNSIGNED_INT, GL_DEPTH_ATTACHMENT},
  };
  gl->GenFramebuffers (1, &framebuffer_);
  gl->BindFramebuffer (GL_FRAMEBUFFER, framebuffer_);
  gl->GenTextures (GLsizei (targets_.size ()), targets_.data ());
  for (std::size_t i = 0; i < targets_.size (); i++) {
    gl->BindTexture (GL_TEXTURE_2D, targets_[i]);
    define_texture (gl, formats[i].internal, width, height, formats[i].format, formats[i].type);
    gl->FramebufferTexture2D (GL_FRAMEBUFFER, formats[i].attachment, GL_TEXTURE_2D, targets_[i], 0);
  }
  gl->BindTexture (GL_TEXTURE_2D, 0);
  return gl->CheckFramebufferStatus (GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
}

void
BlendPainter::delete_targets ()
{
  const GstGLFuncs *gl = context_->gl_vtable;
  gl->DeleteFramebuffers (1, &framebuffer_);
  gl->DeleteTextures (GLsizei (targets_.size ()), targets_.data ());
  framebuffer_ = 0;
  targets_ = {};
}
