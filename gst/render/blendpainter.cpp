/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "blendpainter.hpp"

#include <cstddef>
#include <cstring>
#include <rangecast/surface/painting.hpp>

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
using rangecast::Shader;

namespace {

/* The angle between the view's ray and the viewer's. */
void
set_angle_uniforms (GstGLShader *shader, const RenderPicture &picture, const RenderLayer &layer)
{
  const auto angles =
      rangecast::layer_angles (picture.clip_from_world, *layer.view, layer.image.roi);
  const auto &[lens, viewer, unit] = angles;
  gst_gl_shader_set_uniform_4f (shader, "u_lens", lens[0], lens[1], lens[2], lens[3]);
  gst_gl_shader_set_uniform_3f (shader, "u_viewer", viewer[0], viewer[1], viewer[2]);
  gst_gl_shader_set_uniform_1f (shader, "u_unit", unit);
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
  const struct {
    GstGLShader *&shader;
    Shader vertex, fragment;
  } stages[] = {
      {shaders_[kDepth], Shader::kBlendDepthVertex, Shader::kBlendDepthFragment},
      {shaders_[kSum], Shader::kBlendSumVertex, Shader::kBlendSumFragment},
      {divide_shaders_[0], Shader::kCoveringVertex, Shader::kDivideFragment},
      {divide_shaders_[1], Shader::kCoveringVertex, Shader::kDivideDepthFragment},
  };
  for (const auto &[shader, vertex, fragment] : stages)
    if (!(shader = make_shader (context, vertex, fragment, error)))
      return false;
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
    const auto &matrix = picture.clip_from_world;
    const double gap_m =
        pass == kDepth ? rangecast::depth_pass_gap (matrix, *layer.view, picture.blend_range_m)
                       : rangecast::sum_pass_gap (matrix, *layer.view);
    set_position_uniforms (
        shader, rangecast::place_layer (
                    clip_from_pixel (matrix, *layer.view, layer.image.roi), matrix, gap_m));
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
      !is_gles (context_) && (in_software_ || picture.rig_views > rangecast::kMaxHalfFloatViews);
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
  const auto weights = rangecast::blend_weights (picture.rig_views, precise);
  gst_gl_shader_use (shaders_[kSum]);
  gst_gl_shader_set_uniform_3f (
      shaders_[kSum], "u_weights", weights.max, weights.min, weights.inside);
  draw_layers (layers, picture, kSum);
  gl->Disable (GL_BLEND);
  gl->BlendFunc (GL_ONE, GL_ZERO);
  gl->DepthMask (TRUE);

  divide (picture, weights.outside ());
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
  gst_gl_shader_set_uniform_1i (shader, "u_reach", rangecast::fill_reach (part.height));
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
