/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "renderer.hpp"

#include <gst/gl/gstglfuncs.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <utility>

static constexpr GLenum kContextLost = 0x0507; /* of OpenGL 4.5 and ES 3.2 */

bool
Renderer::start (GstGLContext *context, GError **error)
{
  context_ = context;
  can_blend_ = BlendTargets::is_supported (context);
  if (painter_.start (context, error))
    return true;
  if (error && !*error)
    *error = g_error_new (GST_GL_CONTEXT_ERROR, GST_GL_CONTEXT_ERROR_FAILED, "no shader");
  return false;
}

void
Renderer::stop ()
{
  painter_.stop ();
  background_painter_.stop ();
  camera_painter_.stop ();
  panel_painter_.stop ();
  multisampler_.stop ();
  gst_clear_object (&framebuffer_);
  uploaded_ = 0;
  context_ = nullptr;
}

bool
Renderer::set_output (GstGLContext *context, const GstVideoInfo &info, GError **error)
{
  gst_clear_object (&framebuffer_);
  width_ = GST_VIDEO_INFO_WIDTH (&info);
  height_ = GST_VIDEO_INFO_HEIGHT (&info);
  layout_ = MultiviewLayout (info);
  gint largest = 0;
  context->gl_vtable->GetIntegerv (GL_MAX_TEXTURE_SIZE, &largest);
  if (std::max (width_, height_) <= largest)
    framebuffer_ =
        gst_gl_framebuffer_new_with_default_depth (context, guint (width_), guint (height_));
  if (!framebuffer_)
    g_set_error (error, GST_GL_CONTEXT_ERROR, GST_GL_CONTEXT_ERROR_FAILED,
        "pictures of %dx%d pixels, expected no more than %dx%d", width_, height_, largest, largest);
  return framebuffer_ != nullptr;
}

/* R, G, B, A of ARGB */
static float
background_channel (const StripRenderSettings &settings, int i)
{
  return float (settings.background >> (i == 3 ? 24 : 16 - 8 * i) & 0xff) / 255.f;
}

StripPainter::Picture
Renderer::make_picture (const RenderJob &job, const EyeViewport &place, Result &result) const
{
  const StripRenderSettings &settings = *job.settings;
  const rangecast::SceneFrame &frame = *job.frame;
  const rangecast::Eye eye = {place.side * settings.eye_distance_m / 2, settings.convergence_m};
  const auto matrices = rangecast::orbit_matrices (frame, job.orbit, place.aspect, true, eye,
      job.scene->hull (),
      std::max (2 * settings.view_gap_m, settings.blend_range_m) /* by which surfaces move back */);
  if (result.width == 0) {
    result.matrices = matrices;
    result.width = place.width;
    result.height = place.height;
  }
  rangecast::PicturePart part{double (place.width) / width_, double (place.height) / height_};
  part.x = double (2 * place.x + place.width) / width_ - 1;
  part.y = double (2 * place.y + place.height) / height_ - 1;
  const double fov = job.orbit.fov_deg > 0 ? job.orbit.fov_deg : frame.fov_deg;
  StripPainter::Picture picture = {};
  picture.clip_from_world = rangecast::in_part (matrices.clip_from_world, part);
  for (int i = 0; i < 4; i++)
    picture.background[i] = background_channel (settings, i);
  if (picture.background[3] >= 1)
    picture.background_shade = float (settings.background_shade);
  picture.point_size = float (settings.point_size);
  picture.pixels_per_unit = float (place.height / (2 * std::tan (fov * M_PI / 360)));
  picture.mode = settings.strips.mode;
  picture.depth_step = settings.strips.depth_step;
  /* what one camera sees is open at the back: there is nothing else to look at from there */
  picture.back_faces = (settings.back_faces || job.scene->rig_views () == 1) &&
                       picture.mode != rangecast::StripMode::kBlend;
  picture.view_gap_m = settings.view_gap_m;
  picture.blend_range_m = settings.blend_range_m;
  picture.rig_views = job.scene->rig_views ();
  picture.keeps_depth = settings.show_cameras;
  picture.width = width_;
  picture.height = height_;
  picture.part = {place.x, place.y, place.width, place.height};
  picture.covered = rangecast::covered_part (
      picture.clip_from_world, job.scene->hull (), width_, height_, picture.part);
  return picture;
}

struct Renderer::Call {
  Renderer *self;
  const RenderJob *job;
  GstBuffer *out;
  bool panel_changed;
  guint memory = 0; /* that is drawn into now */
  bool has_targets = true;
  Result result = {};
  std::exception_ptr exception = {}; /* which must not go through C, nor end the GL thread */
};

/* Once for all pictures of a scene: for both eyes, and for as long as it is held. */
bool
Renderer::upload (Call &call)
{
  const StripScene &scene = *call.job->scene;
  if (uploaded_ == scene.serial ())
    return true;
  if (!painter_.fits (scene.layers ()))
    return false;
  call.result.uploaded += painter_.upload (scene.layers ());
  uploaded_ = scene.serial ();
  return true;
}

/* Scissors keep the painter, which clears and draws whole pictures, to this eye's part. */
void
Renderer::draw_eye (Call &call, const EyeViewport &place, bool antialiased)
{
  const RenderJob &job = *call.job;
  const GstGLFuncs *gl = context_->gl_vtable;
  StripPainter::Picture picture = make_picture (job, place, call.result);
  if (antialiased && picture.background[3] < 1) /* it comes behind the means of the samples */
    std::ranges::fill (picture.background, 0.f);
  const bool whole = place.width == width_ && place.height == height_;
  if (!whole) {
    gl->Enable (GL_SCISSOR_TEST);
    gl->Scissor (place.x, place.y, place.width, place.height);
  }
  const bool blends = picture.mode == rangecast::StripMode::kBlend;
  const auto shade = [&] {
    if (picture.background_shade > 0)
      background_painter_.draw (
          context_, picture.background, picture.background_shade, picture.part);
  };
  if (blends && (picture.keeps_depth || picture.background_shade > 0))
    gl->Clear (GL_DEPTH_BUFFER_BIT);
  if (blends) /* over what is there; other modes leave the background's depth */
    shade ();
  call.has_targets = painter_.draw (picture, job.scene->layers ()) && call.has_targets;
  if (!blends)
    shade ();
  if (job.settings->show_cameras)
    call.result.uploaded +=
        camera_painter_.draw (context_, job.scene->camera_lines (), job.scene->serial (),
            picture.back_faces ? rangecast::in_half_of_depths (picture.clip_from_world, false)
                               : picture.clip_from_world);
  if (!job.panel.empty ())
    call.result.uploaded +=
        panel_painter_.draw (context_, job.panel, std::exchange (call.panel_changed, false),
            place.x, place.y, std::max (1, (place.height + 240) / 480));
  if (!whole)
    gl->Disable (GL_SCISSOR_TEST);
}

/* All that one memory of the buffer shows. */
void
Renderer::draw_memory (Call &call)
{
  const StripRenderSettings &settings = *call.job->settings;
  /* mode blend has smooth outlines of its own */
  const int samples = settings.strips.mode == rangecast::StripMode::kBlend ? 0 : settings.samples;
  const bool antialiased = multisampler_.begin (context_, width_, height_, samples);
  for (const EyeViewport &place : layout_.eyes ())
    if (place.memory == call.memory)
      draw_eye (call, place, antialiased);
  if (antialiased)
    multisampler_.end ({background_channel (settings, 0), background_channel (settings, 1),
        background_channel (settings, 2), background_channel (settings, 3)});
}

gboolean
Renderer::draw_bound (gpointer user_data)
{
  auto call = static_cast<Call *> (user_data);
  try {
    call->self->draw_memory (*call);
  } catch (...) {
    call->exception = std::current_exception ();
  }
  return !call->exception;
}

/* What no further call can mend. @return why, or nullptr */
static const char *
fatal_error (const GstGLFuncs *gl)
{
  constexpr int kMax = 8; /* more than one may be waiting; a lost context may not stop telling */
  for (int i = 0; i < kMax; i++)
    switch (gl->GetError ()) {
      case GL_NO_ERROR:
        return nullptr;
      case kContextLost:
        return "its context is lost";
      case GL_OUT_OF_MEMORY:
        return "it is out of memory";
      default:
        break;
    }
  return nullptr;
}

void
Renderer::draw_memories (Call &call)
{
  const guint memories = layout_.eyes ().back ().memory + 1;
  bool drawn = true;
  if (!upload (call)) {
    call.result.reason = "a view is larger than its textures can be";
    return;
  }
  for (guint i = 0; i < memories && drawn; i++) {
    call.memory = i;
    drawn = gst_gl_framebuffer_draw_to_texture (
        framebuffer_, GST_GL_MEMORY_CAST (gst_buffer_peek_memory (call.out, i)), draw_bound, &call);
  }
  call.result.reason = drawn ? fatal_error (context_->gl_vtable) : "there is no framebuffer for it";
  if (!call.result.reason && !call.has_targets)
    call.result.reason = "it has no float framebuffer of that size for mode blend";
  call.result.drawn = drawn && !call.result.reason;
  GstGLSyncMeta *sync = gst_buffer_get_gl_sync_meta (call.out);
  if (call.result.drawn && sync) /* other contexts wait for our commands there */
    gst_gl_sync_meta_set_sync_point (sync, context_);
}

void
Renderer::draw_in_gl_thread (GstGLContext *, gpointer user_data)
{
  auto call = static_cast<Call *> (user_data);
  try {
    call->self->draw_memories (*call);
  } catch (...) {
    call->exception = std::current_exception ();
  }
}

Renderer::Result
Renderer::draw (GstGLContext *context, const RenderJob &job, GstBuffer *out)
{
  Call call = {.self = this, .job = &job, .out = out, .panel_changed = job.panel_changed};
  const guint memories = layout_.eyes ().back ().memory + 1;
  std::array<GstMapInfo, 2> maps; /* tell whoever reads it on the CPU that it has changed */
  guint mapped = 0;
  while (mapped < memories && mapped < gst_buffer_n_memory (out)) {
    GstMemory *memory = gst_buffer_peek_memory (out, mapped);
    const auto flags = GstMapFlags (GST_MAP_WRITE | GST_MAP_GL);
    if (!gst_is_gl_memory (memory) || !gst_memory_map (memory, &maps[mapped], flags))
      break;
    mapped++;
  }
  if (mapped == memories)
    gst_gl_context_thread_add (context, draw_in_gl_thread, &call);
  for (guint i = 0; i < mapped; i++)
    gst_memory_unmap (gst_buffer_peek_memory (out, i), &maps[i]);
  if (call.exception)
    std::rethrow_exception (call.exception);
  return call.result;
}
