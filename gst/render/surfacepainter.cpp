/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "surfacepainter.hpp"

#include <algorithm>
#include <cstddef>

/* Of OpenGL 3.3 and OpenGL ES 3.0, but not in every header. */
#ifndef GL_DRAW_FRAMEBUFFER_BINDING
#define GL_DRAW_FRAMEBUFFER_BINDING 0x8CA6
#endif
#ifndef GL_RGBA8
#define GL_RGBA8 0x8058
#endif
#ifndef GL_DEPTH_COMPONENT24
#define GL_DEPTH_COMPONENT24 0x81A6
#endif
#ifndef GL_PROGRAM_POINT_SIZE
#define GL_PROGRAM_POINT_SIZE 0x8642
#endif

using rangecast::Roi;
using rangecast::Shader;
using rangecast::StripMode;
using rangecast::SurfaceLayer;
using rangecast::SurfaceVertex;

namespace {

void
describe_vertices (const GstGLFuncs *gl)
{
  const auto attribute = [gl] (guint location, gint size, guint type, bool in_one, std::size_t at) {
    gl->EnableVertexAttribArray (location);
    gl->VertexAttribPointer (location, size, type, in_one, sizeof (SurfaceVertex),
        reinterpret_cast<const void *> (at)); /* an offset in the buffer */
  };
  attribute (0, 2, GL_SHORT, false, offsetof (SurfaceVertex, x));
  attribute (1, 1, GL_UNSIGNED_SHORT, false, offsetof (SurfaceVertex, depth));
  attribute (2, 4, GL_UNSIGNED_BYTE, true, offsetof (SurfaceVertex, colour));
}

GstGLShader *
make_library_shader (GstGLContext *context, Shader vertex, Shader fragment, GError **error)
{
  return make_shader (
      context, rangecast::shader_source (vertex), rangecast::shader_source (fragment), error);
}

} // namespace

GstGLShader *
make_shader (
    GstGLContext *context, const std::string &vertex, const std::string &fragment, GError **error)
{
  const bool gles = is_gles (context);
  const auto stage = [&] (guint type, const std::string &source) {
    const char *parts[] = {gles ? "#version 300 es\n" : "#version 330 core\n", source.c_str ()};
    return gst_glsl_stage_new_with_strings (context, type,
        gles ? GST_GLSL_VERSION_300 : GST_GLSL_VERSION_330,
        gles ? GST_GLSL_PROFILE_ES : GST_GLSL_PROFILE_CORE, 2, parts);
  };
  GstGLShader *shader = gst_gl_shader_new_link_with_stages (context, error,
      stage (GL_VERTEX_SHADER, vertex), stage (GL_FRAGMENT_SHADER, fragment), nullptr);
  if (!shader && error && !*error)
    *error = g_error_new (GST_GL_CONTEXT_ERROR, GST_GL_CONTEXT_ERROR_FAILED, "no shader");
  return shader;
}

bool
SurfacePainter::start (GstGLContext *context, GError **error)
{
  context_ = context;
  if (!has_shaders (context)) {
    g_set_error (error, GST_GL_CONTEXT_ERROR, GST_GL_CONTEXT_ERROR_OLD_LIBS,
        "it is older than OpenGL 3.3 or OpenGL ES 3.0");
    return false;
  }
  cell_shader_ = make_library_shader (context, Shader::kVertex, Shader::kFragment, error);
  if (cell_shader_)
    finish_shader_ =
        make_library_shader (context, Shader::kCoveringVertex, Shader::kFinishFragment, error);
  context->gl_vtable->GenVertexArrays (1, &array_);
  context->gl_vtable->GetIntegerv (GL_MAX_TEXTURE_SIZE, &largest_);
  return finish_shader_ != nullptr;
}

void
SurfacePainter::stop ()
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
  gst_clear_object (&cell_shader_);
  gst_clear_object (&finish_shader_);
  for (GstGLShader *&shader : sum_shaders_)
    gst_clear_object (&shader);
  gl->DeleteVertexArrays (1, &array_);
  delete_target (cells_);
  delete_target (sums_);
  *this = {};
}

guint64
SurfacePainter::upload (std::span<const SurfaceLayer> layers)
{
  const GstGLFuncs *gl = context_->gl_vtable;
  guint64 uploaded = 0;
  turn_ = (turn_ + 1) % objects_.size ();
  for (const SurfaceLayer &layer : layers) {
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
    const std::size_t size = layer.vertices.size_bytes ();
    if (size > objects.capacity) {
      objects.capacity = size + size / 2;
      gl->BufferData (GL_ARRAY_BUFFER, GLsizeiptr (objects.capacity), nullptr, GL_DYNAMIC_DRAW);
    }
    gl->BufferSubData (GL_ARRAY_BUFFER, 0, GLsizei (size), layer.vertices.data ());
    uploaded += size;
  }
  gl->BindVertexArray (0);
  gl->BindBuffer (GL_ARRAY_BUFFER, 0);
  return uploaded;
}

const char *
SurfacePainter::draw (
    const rangecast::SurfacePicture &picture, std::span<const SurfaceLayer> layers)
{
  const GstGLFuncs *gl = context_->gl_vtable;
  const Roi &part = picture.part;
  picture_ = picture;
  layers_ = layers;
  if (picture.covered.empty ()) /* one pixel of nothing */
    picture_.covered = {part.x, part.y, 1, 1};
  if (const char *reason = start_picture ())
    return reason;
  gint output = 0;
  gl->GetIntegerv (GL_DRAW_FRAMEBUFFER_BINDING, &output);
  gl->Enable (GL_DEPTH_TEST);
  gl->Disable (GL_BLEND);
  gl->Enable (GL_SCISSOR_TEST);
  draw_cells ();
  gl->Viewport (0, 0, picture.width, picture.height);
  gl->DepthFunc (GL_ALWAYS);
  add_up ();
  gl->DepthFunc (GL_LESS);
  gl->Disable (GL_DEPTH_TEST);
  gl->BindFramebuffer (GL_FRAMEBUFFER, guint (output));
  gl->Scissor (part.x, part.y, part.width, part.height);
  finish ();
  gl->Disable (GL_SCISSOR_TEST);
  gst_gl_context_clear_shader (context_);
  return nullptr;
}

/* Makes all that the passes need. @return why OpenGL cannot have it */
const char *
SurfacePainter::start_picture ()
{
  alignments_.clear ();
  for (const SurfaceLayer &layer : layers_)
    alignments_.push_back (rangecast::view_alignment (picture_.clip_from_world, *layer.view));
  const std::size_t cells = picture_.mode == StripMode::kBlend ? rangecast::kMaxBlendCells : 1;
  rangecast::make_blend_atlas (alignments_, cells, picture_.covered, largest_, atlas_);
  if (!prepare (cells_, atlas_.width, atlas_.height) ||
      !prepare (sums_, picture_.width, picture_.height))
    return "OpenGL has no framebuffer of the size that the picture takes";
  GstGLShader *&shader = sum_shaders_[atlas_.cells - 1];
  if (!shader)
    shader = make_library_shader (
        context_, Shader::kCoveringVertex, rangecast::sum_shader (atlas_.cells), nullptr);
  return shader ? nullptr : "a shader does not compile";
}

/* Pass 1. In mode blend both sides of all surfaces: weights leave next to nothing of what is seen
 * from behind. */
void
SurfacePainter::draw_cells () const
{
  const GstGLFuncs *gl = context_->gl_vtable;
  const Roi &covered = picture_.covered;
  const bool sets_point_size = !is_gles (context_); /* where the shader always does */
  gl->BindFramebuffer (GL_FRAMEBUFFER, cells_.framebuffer);
  gl->Scissor (0, 0, atlas_.width, atlas_.height);
  gl->ClearColor (0, 0, 0, 0);
  gl->Clear (GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
  gl->DepthFunc (GL_LESS);
  gl->FrontFace (rangecast::mirrors (picture_.clip_from_world) ? GL_CW : GL_CCW);
  if (picture_.culls ())
    gl->Enable (GL_CULL_FACE);
  if (sets_point_size)
    gl->Enable (GL_PROGRAM_POINT_SIZE);
  gst_gl_shader_use (cell_shader_);
  for (std::size_t i = 0; i < layers_.size (); i++) {
    if (layers_[i].vertices.empty ())
      continue;
    const auto [right, down] = atlas_.from_picture[atlas_.cell_of[i]];
    gl->Viewport (right, down, picture_.width, picture_.height);
    gl->Scissor (covered.x + right, covered.y + down, covered.width, covered.height);
    draw_layer (layers_[i]);
  }
  gl->BindVertexArray (0);
  gl->FrontFace (GL_CCW);
  gl->Disable (GL_CULL_FACE);
  if (sets_point_size)
    gl->Disable (GL_PROGRAM_POINT_SIZE);
}

void
SurfacePainter::draw_layer (const SurfaceLayer &layer) const
{
  const auto &matrix = picture_.clip_from_world;
  const auto place = rangecast::place_layer (clip_from_pixel (matrix, *layer.view, layer.image.roi),
      matrix, rangecast::layer_gap (picture_.mode, matrix, *layer.view));
  const auto [lens, viewer, unit] = rangecast::layer_angles (matrix, *layer.view, layer.image.roi);
  GstGLShader *shader = cell_shader_;
  gst_gl_shader_set_uniform_matrix_4fv (
      shader, "u_clip_from_pixel", 1, FALSE, place.clip_from_pixel.data ());
  gst_gl_shader_set_uniform_2f (shader, "u_behind", place.behind[0], place.behind[1]);
  gst_gl_shader_set_uniform_4f (shader, "u_lens", lens[0], lens[1], lens[2], lens[3]);
  gst_gl_shader_set_uniform_3f (shader, "u_viewer", viewer[0], viewer[1], viewer[2]);
  gst_gl_shader_set_uniform_1f (shader, "u_unit", unit);
  gst_gl_shader_set_uniform_1f (
      shader, "u_point_size", picture_.point_size * picture_.pixels_per_unit * unit * lens[2]);
  context_->gl_vtable->BindVertexArray (objects_[turn_][std::size_t (layer.image.view_id)].array);
  context_->gl_vtable->DrawArrays (
      picture_.mode == StripMode::kPoints ? GL_POINTS : GL_TRIANGLE_STRIP, 0,
      GLsizei (layer.vertices.size ()));
}

/* Pass 2. */
void
SurfacePainter::add_up () const
{
  const GstGLFuncs *gl = context_->gl_vtable;
  const Roi &covered = picture_.covered;
  GstGLShader *shader = sum_shaders_[atlas_.cells - 1];
  gl->BindFramebuffer (GL_FRAMEBUFFER, sums_.framebuffer);
  gl->Scissor (covered.x, covered.y, covered.width, covered.height);
  gst_gl_shader_use (shader);
  std::array<rangecast::ViewCotangent, rangecast::kMaxBlendCells> cotangents;
  for (std::size_t i = 0; i < layers_.size (); i++)
    cotangents[atlas_.cell_of[i]] = rangecast::view_cotangent (picture_.clip_from_world,
        *layers_[i].view, atlas_.cell_of[i], atlas_.cells, layers_.size ());
  gst_gl_shader_set_uniform_2fv (
      shader, "u_cotangents", guint (atlas_.cells), &cotangents[0].per_w);
  gst_gl_shader_set_uniform_2iv (
      shader, "u_cells", guint (atlas_.cells), atlas_.from_picture[0].data ());
  cover (shader, cells_, "u_colours");
}

/* Pass 3. */
void
SurfacePainter::finish () const
{
  const Roi &covered = picture_.covered, &part = picture_.part;
  const float *colour = picture_.background;
  GstGLShader *shader = finish_shader_;
  gst_gl_shader_use (shader);
  gst_gl_shader_set_uniform_4i (shader, "u_part", covered.x, covered.y,
      covered.x + covered.width - 1, covered.y + covered.height - 1);
  gst_gl_shader_set_uniform_1i (shader, "u_reach", rangecast::fill_reach (part.height));
  gst_gl_shader_set_uniform_1i (shader, "u_smooth", picture_.mode != StripMode::kPoints);
  gst_gl_shader_set_uniform_4f (shader, "u_background", colour[0], colour[1], colour[2], colour[3]);
  gst_gl_shader_set_uniform_3f (
      shader, "u_shade", gfloat (part.y), gfloat (part.height), picture_.background_shade);
  cover (shader, sums_, "u_sum");
}

/* Covers the viewport with what a shader makes of a target, whose textures are rendered to again
 * next time. */
void
SurfacePainter::cover (GstGLShader *shader, const Target &from, const char *colours) const
{
  const GstGLFuncs *gl = context_->gl_vtable;
  const char *const names[] = {colours, "u_depths"};
  const auto shift = rangecast::depth_shift (
      picture_.clip_from_world, picture_.clip_from_world, picture_.blend_range_m);
  gst_gl_shader_set_uniform_3f (shader, "u_shift", shift.a, shift.b, shift.g);
  for (guint i = 0; i < 2; i++) {
    gl->ActiveTexture (GL_TEXTURE0 + i);
    gl->BindTexture (GL_TEXTURE_2D, from.textures[i]);
    gst_gl_shader_set_uniform_1i (shader, names[i], gint (i));
  }
  gl->BindVertexArray (array_);
  gl->DrawArrays (GL_TRIANGLES, 0, 3);
  gl->BindVertexArray (0);
  for (guint i = 2; i-- > 0;) {
    gl->ActiveTexture (GL_TEXTURE0 + i);
    gl->BindTexture (GL_TEXTURE_2D, 0);
  }
}

/* Enlarges a target, in steps, so that a person who moves does not need new textures in each
 * picture. It keeps the larger of old and new sides unless that doubles its pixels.
 * @return false if OpenGL cannot have it */
bool
SurfacePainter::prepare (Target &target, int width, int height) const
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
    for (const guint filter : {GL_TEXTURE_MIN_FILTER, GL_TEXTURE_MAG_FILTER})
      gl->TexParameteri (GL_TEXTURE_2D, filter, GL_NEAREST);
    gl->TexImage2D (GL_TEXTURE_2D, 0, gint (internal), width, height, 0, format, type, nullptr);
    gl->FramebufferTexture2D (GL_FRAMEBUFFER, attachment, GL_TEXTURE_2D, target.textures[i], 0);
  }
  gl->BindTexture (GL_TEXTURE_2D, 0);
  target.failed = gl->CheckFramebufferStatus (GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE;
  gl->BindFramebuffer (GL_FRAMEBUFFER, guint (bound));
  return !target.failed;
}

void
SurfacePainter::delete_target (Target &target) const
{
  const GstGLFuncs *gl = context_->gl_vtable;
  if (target.framebuffer) {
    gl->DeleteFramebuffers (1, &target.framebuffer);
    gl->DeleteTextures (2, target.textures.data ());
  }
  target = {};
}
