/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "blendpainter.hpp"

#include <algorithm>
#include <cstddef>
#include <rangecast/surface/painting.hpp>

#include "layerpainters.hpp"

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
set_shift_uniform (GstGLShader *shader, const RenderPicture &picture)
{
  const auto shift = rangecast::depth_shift (
      picture.clip_from_world, picture.clip_from_world, picture.blend_range_m);
  gst_gl_shader_set_uniform_3f (shader, "u_shift", shift.a, shift.b, shift.g);
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
BlendPainter::start (GstGLContext *context, GError **error)
{
  context_ = context;
  const struct {
    GstGLShader *&shader;
    Shader vertex, fragment;
  } stages[] = {
      {cell_shader_, Shader::kBlendVertex, Shader::kBlendFragment},
      {fill_shader_, Shader::kCoveringVertex, Shader::kFillFragment},
      {finish_shader_, Shader::kCoveringVertex, Shader::kFinishFragment},
  };
  for (const auto &[shader, vertex, fragment] : stages)
    if (!(shader = make_shader (context, vertex, fragment, error)))
      return false;
  context->gl_vtable->GenVertexArrays (1, &array_);
  context->gl_vtable->GetIntegerv (GL_MAX_TEXTURE_SIZE, &largest_);
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
  for (GstGLShader **shader : {&cell_shader_, &fill_shader_, &finish_shader_})
    gst_clear_object (shader);
  for (LazyShader &shader : sum_shaders_)
    shader.stop ();
  gl->DeleteVertexArrays (1, &array_);
  delete_target (cells_);
  delete_target (sums_);
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

const char *
BlendPainter::draw (const RenderPicture &picture, std::span<const RenderLayer> layers)
{
  const GstGLFuncs *gl = context_->gl_vtable;
  const rangecast::Roi &part = picture.part, &covered = picture.covered;
  const float *background = picture.background;
  const bool any = !covered.empty () && !layers.empty ();
  if (any) {
    if (const char *reason = start_picture (picture, layers))
      return reason;
    gl->GetIntegerv (GL_DRAW_FRAMEBUFFER_BINDING, &output_);
    gl->Enable (GL_DEPTH_TEST);
    gl->Disable (GL_BLEND);
    draw_cells (picture, layers);
    gl->Viewport (0, 0, picture.width, picture.height);
    gl->DepthFunc (GL_ALWAYS);
    add_up (picture);
    gl->BindFramebuffer (GL_FRAMEBUFFER, guint (output_));
  }
  gl->Enable (GL_SCISSOR_TEST);
  gl->Scissor (part.x, part.y, part.width, part.height);
  gl->ClearColor (background[0], background[1], background[2], background[3]);
  if (picture.background_shade <= 0) /* else it has been drawn */
    gl->Clear (GL_COLOR_BUFFER_BIT);
  if (any)
    finish (picture);
  if (part.width == picture.width && part.height == picture.height)
    gl->Disable (GL_SCISSOR_TEST);
  else
    gl->Scissor (part.x, part.y, part.width, part.height);
  gl->DepthFunc (GL_LESS);
  gl->Disable (GL_DEPTH_TEST);
  gst_gl_context_clear_shader (context_);
  return nullptr;
}

/* Makes all that the passes need. @return why OpenGL cannot have it */
const char *
BlendPainter::start_picture (const RenderPicture &picture, std::span<const RenderLayer> layers)
{
  alignments_.clear ();
  for (const RenderLayer &layer : layers)
    alignments_.push_back (rangecast::view_alignment (picture.clip_from_world, *layer.view));
  rangecast::make_blend_atlas (alignments_, picture.covered, largest_, atlas_);
  if (!prepare (cells_, atlas_.width, atlas_.height) ||
      !prepare (sums_, picture.width, picture.height))
    return "OpenGL has no framebuffer of the size that mode blend takes";
  const bool compiled = sum_shaders_[atlas_.cells - 1].make (
      context_, rangecast::sum_shader (atlas_.cells), "mode blend");
  return compiled ? nullptr : "a shader of mode blend does not compile (see the log)";
}

/* Pass 1. Both sides of all surfaces: weights leave next to nothing of what is seen from behind. */
void
BlendPainter::draw_cells (const RenderPicture &picture, std::span<const RenderLayer> layers) const
{
  const GstGLFuncs *gl = context_->gl_vtable;
  const rangecast::Roi &covered = picture.covered;
  gl->BindFramebuffer (GL_FRAMEBUFFER, cells_.framebuffer);
  gl->Disable (GL_SCISSOR_TEST); /* llvmpipe clears all in a third of the time of a part */
  gl->ClearColor (0, 0, 0, 0);
  gl->Clear (GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
  gl->Enable (GL_SCISSOR_TEST);
  gl->DepthFunc (GL_LESS);
  gl->FrontFace (rangecast::mirrors (picture.clip_from_world) ? GL_CW : GL_CCW);
  gst_gl_shader_use (cell_shader_);
  for (std::size_t i = 0; i < layers.size (); i++) {
    if (layers[i].blend_vertices.empty ())
      continue;
    const auto [right, down] = atlas_.from_picture[atlas_.cell_of[i]];
    gl->Viewport (right, down, picture.width, picture.height);
    gl->Scissor (covered.x + right, covered.y + down, covered.width, covered.height);
    draw_layer (picture, layers[i]);
  }
  gl->FrontFace (GL_CCW);
}

void
BlendPainter::draw_layer (const RenderPicture &picture, const RenderLayer &layer) const
{
  const GstGLFuncs *gl = context_->gl_vtable;
  const auto &matrix = picture.clip_from_world;
  set_position_uniforms (
      cell_shader_, rangecast::place_layer (clip_from_pixel (matrix, *layer.view, layer.image.roi),
                        matrix, rangecast::inside_gap (matrix, *layer.view)));
  set_angle_uniforms (cell_shader_, picture, layer);
  gl->BindVertexArray (objects_[turn_][std::size_t (layer.image.view_id)].array);
  gl->DrawArrays (GL_TRIANGLE_STRIP, 0, GLsizei (layer.blend_vertices.size ()));
}

/* Pass 2. */
void
BlendPainter::add_up (const RenderPicture &picture) const
{
  const GstGLFuncs *gl = context_->gl_vtable;
  const rangecast::Roi &covered = picture.covered;
  gl->BindFramebuffer (GL_FRAMEBUFFER, sums_.framebuffer);
  gl->Scissor (covered.x, covered.y, covered.width, covered.height);
  GstGLShader *shader = sum_shaders_[atlas_.cells - 1].shader ();
  gst_gl_shader_use (shader);
  bind_textures (shader, cells_, "u_colours");
  gst_gl_shader_set_uniform_2iv (
      shader, "u_cells", guint (atlas_.cells), atlas_.from_picture[0].data ());
  set_shift_uniform (shader, picture);
  draw_covering (gl, array_);
  unbind_textures ();
}

/* Passes 3 and 4, into the framebuffer that was bound before. Pixels outside of picture.covered
 * become background. Gaps up to a 30th of the picture's height that show only the inside of
 * surfaces take the colours around them, those up to a 15th a share of those. */
void
BlendPainter::finish (const RenderPicture &picture) const
{
  const GstGLFuncs *gl = context_->gl_vtable;
  const rangecast::Roi &covered = picture.covered;
  gl->Scissor (covered.x, covered.y, covered.width, covered.height);
  cover_from_sums (finish_shader_, picture);
  gl->DepthMask (FALSE);
  gl->DepthFunc (GL_LESS); /* spares all other pixels the shader */
  cover_from_sums (fill_shader_, picture);
  gl->DepthMask (TRUE);
}

void
BlendPainter::cover_from_sums (GstGLShader *shader, const RenderPicture &picture) const
{
  const rangecast::Roi &covered = picture.covered;
  gst_gl_shader_use (shader);
  bind_textures (shader, sums_, "u_sum");
  gst_gl_shader_set_uniform_4i (shader, "u_part", covered.x, covered.y,
      covered.x + covered.width - 1, covered.y + covered.height - 1);
  set_shift_uniform (shader, picture);
  gst_gl_shader_set_uniform_1i (shader, "u_reach", rangecast::fill_reach (picture.part.height));
  set_background_uniforms (shader, picture.background, picture.background_shade, picture.part);
  draw_covering (context_->gl_vtable, array_);
  unbind_textures ();
}

/* Binds colours and depths of a target to two texture units. */
void
BlendPainter::bind_textures (GstGLShader *shader, const Target &target, const char *colours) const
{
  const GstGLFuncs *gl = context_->gl_vtable;
  const char *const names[] = {colours, "u_depths"};
  for (guint i = 0; i < 2; i++) {
    gl->ActiveTexture (GL_TEXTURE0 + i);
    gl->BindTexture (GL_TEXTURE_2D, target.textures[i]);
    gst_gl_shader_set_uniform_1i (shader, names[i], gint (i));
  }
}

/* They are rendered to again next time. */
void
BlendPainter::unbind_textures () const
{
  const GstGLFuncs *gl = context_->gl_vtable;
  for (guint i = 2; i-- > 0;) {
    gl->ActiveTexture (GL_TEXTURE0 + i);
    gl->BindTexture (GL_TEXTURE_2D, 0);
  }
}

/* Enlarges a target, in steps, so that a person who moves does not need new textures in each
 * picture. It keeps the larger of old and new sides unless that doubles its pixels.
 * @return false if OpenGL cannot have it */
bool
BlendPainter::prepare (Target &target, int width, int height) const
{
  if (target.width >= width && target.height >= height)
    return !target.failed;
  const GstGLFuncs *gl = context_->gl_vtable;
  constexpr int kStep = 128;
  const auto side = [&] (int pixels) {
    return std::min ((pixels + kStep - 1) / kStep * kStep, largest_);
  };
  gint bound = 0;
  gl->GetIntegerv (GL_DRAW_FRAMEBUFFER_BINDING, &bound);
  width = side (width);
  height = side (height);
  const int widest = std::max (width, target.width), highest = std::max (height, target.height);
  if (gint64{widest} * highest <= 2 * gint64{width} * height) {
    width = widest;
    height = highest;
  }
  delete_target (target);
  target.width = width;
  target.height = height;
  const struct {
    guint internal, format, type, attachment;
  } formats[] = {
      {GL_RGBA8, GL_RGBA, GL_UNSIGNED_BYTE, GL_COLOR_ATTACHMENT0},
      {GL_DEPTH_COMPONENT24, GL_DEPTH_COMPONENT, GL_UNSIGNED_INT, GL_DEPTH_ATTACHMENT},
  };
  gl->GenFramebuffers (1, &target.framebuffer);
  gl->BindFramebuffer (GL_FRAMEBUFFER, target.framebuffer);
  gl->GenTextures (2, target.textures.data ());
  for (std::size_t i = 0; i < 2; i++) {
    const auto &[internal, format, type, attachment] = formats[i];
    gl->BindTexture (GL_TEXTURE_2D, target.textures[i]);
    define_texture (gl, internal, width, height, format, type);
    gl->FramebufferTexture2D (GL_FRAMEBUFFER, attachment, GL_TEXTURE_2D, target.textures[i], 0);
  }
  gl->BindTexture (GL_TEXTURE_2D, 0);
  target.failed = gl->CheckFramebufferStatus (GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE;
  gl->BindFramebuffer (GL_FRAMEBUFFER, guint (bound));
  return !target.failed;
}

void
BlendPainter::delete_target (Target &target) const
{
  const GstGLFuncs *gl = context_->gl_vtable;
  if (target.framebuffer) {
    gl->DeleteFramebuffers (1, &target.framebuffer);
    gl->DeleteTextures (2, target.textures.data ());
  }
  target = {};
}
