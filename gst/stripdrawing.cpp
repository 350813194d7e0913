/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "stripdrawing.hpp"

#include <gst/gl/gstglfuncs.h>

#include <algorithm>
#include <cmath>

static constexpr GLenum kContextLost = 0x0507; /* of OpenGL 4.5 and ES 3.2 */

bool
StripDrawing::start (GstGLContext *context, GError **error)
{
  context_ = context;
  if (painter_.start (context, error))
    return true;
  if (error && !*error)
    *error = g_error_new (GST_GL_CONTEXT_ERROR, GST_GL_CONTEXT_ERROR_FAILED, "no shader");
  return false;
}

void
StripDrawing::stop ()
{
  painter_.stop ();
  camera_painter_.stop ();
  panel_painter_.stop ();
  multisampler_.stop ();
  gst_clear_object (&framebuffer_);
  context_ = nullptr;
}

bool
StripDrawing::set_output (GstGLContext *context, const GstVideoInfo &info)
{
  gst_clear_object (&framebuffer_);
  width_ = GST_VIDEO_INFO_WIDTH (&info);
  height_ = GST_VIDEO_INFO_HEIGHT (&info);
  eyes_ = EyePlaces (info);
  framebuffer_ =
      gst_gl_framebuffer_new_with_default_depth (context, guint (width_), guint (height_));
  return framebuffer_ != nullptr;
}

StripPainter::Picture
StripDrawing::make_picture (const StripDrawingJob &job, const EyePlace &place, Result &result) const
{
  const StripRenderSettings &settings = *job.settings;
  const rangecast::SceneFrame &frame = job.scene->frame ();
  const rangecast::Eye eye = {place.side * settings.eye_distance_m / 2, settings.convergence_m};
  const auto matrices =
      rangecast::orbit_matrices (frame, job.orbit, place.aspect, true, eye, job.scene->hull ());
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
  for (int i = 0; i < 4; i++) /* ARGB to R, G, B, A */
    picture.background[i] =
        float (settings.background >> (i == 3 ? 24 : 16 - 8 * i) & 0xff) / 255.f;
  picture.point_size = float (settings.point_size);
  picture.pixels_per_unit = float (place.height / (2 * std::tan (fov * M_PI / 360)));
  picture.mode = settings.strips.mode;
  picture.depth_step = settings.strips.depth_step;
  /* what one camera sees is open at the back: there is nothing else to look at from there */
  picture.back_faces = settings.back_faces || job.scene->rig_views () == 1;
  picture.view_gap_m = settings.view_gap_m;
  picture.width = width_;
  picture.height = height_;
  return picture;
}

/* Scissors keep the painter, which clears and draws whole pictures, to this eye's part. */
guint64
StripDrawing::draw_eye (const StripDrawingJob &job, const EyePlace &place, Result &result)
{
  const GstGLFuncs *gl = context_->gl_vtable;
  const StripPainter::Picture picture = make_picture (job, place, result);
  const bool whole = place.width == width_ && place.height == height_;
  if (!whole) {
    gl->Enable (GL_SCISSOR_TEST);
    gl->Scissor (place.x, place.y, place.width, place.height);
  }
  const guint64 uploaded = painter_.draw (picture, job.scene->layers ());
  if (job.settings->show_cameras)
    camera_painter_.draw (context_, job.scene->camera_lines (), picture.clip_from_world);
  if (!job.panel.empty ())
    panel_painter_.draw (context_, job.panel, job.panel_changed, place.x, place.y,
        std::max (1, (place.height + 240) / 480));
  if (!whole)
    gl->Disable (GL_SCISSOR_TEST);
  return uploaded;
}

struct StripDrawing::Call {
  StripDrawing *self;
  const StripDrawingJob *job;
  GstBuffer *out;
  guint memory; /* that is drawn into now */
  Result result;
};

gboolean
StripDrawing::draw_bound (gpointer user_data)
{
  auto call = static_cast<Call *> (user_data);
  StripDrawing *self = call->self;
  const bool antialiased = self->multisampler_.begin (
      self->context_, self->width_, self->height_, call->job->settings->samples);
  for (const EyePlace &place : self->eyes_.all ())
    if (place.memory == call->memory)
      call->result.uploaded += self->draw_eye (*call->job, place, call->result);
  if (antialiased)
    self->multisampler_.end ();
  return TRUE;
}

/* What no further call can mend. @return why, or nullptr */
static const char *
fatal_error (const GstGLFuncs *gl)
{
  constexpr int kMost = 8; /* more than one may be waiting; a lost context may not stop telling */
  for (int i = 0; i < kMost; i++)
    switch (gl->GetError ()) {
      case GL_NO_ERROR:
        return nullptr;
      case kContextLost:
        return "its context is lost";
      case GL_OUT_OF_MEMORY:
        return "it has no memory left";
      default:
        break;
    }
  return nullptr;
}

void
StripDrawing::draw_in_gl_thread (GstGLContext *context, gpointer user_data)
{
  auto call = static_cast<Call *> (user_data);
  const guint memories = call->self->eyes_.all ().back ().memory + 1;
  bool drawn = true;
  for (guint i = 0; i < memories && drawn; i++) {
    call->memory = i;
    drawn = gst_gl_framebuffer_draw_to_texture (call->self->framebuffer_,
        GST_GL_MEMORY_CAST (gst_buffer_peek_memory (call->out, i)), draw_bound, call);
  }
  call->result.reason = drawn ? fatal_error (context->gl_vtable) : "there is no framebuffer for it";
  drawn = drawn && !call->result.reason;
  call->result.drawn = drawn;
  GstGLSyncMeta *sync = gst_buffer_get_gl_sync_meta (call->out);
  if (drawn && sync) /* other contexts wait for our commands there */
    gst_gl_sync_meta_set_sync_point (sync, context);
}

StripDrawing::Result
StripDrawing::draw (GstGLContext *context, const StripDrawingJob &job, GstBuffer *out)
{
  Call call{this, &job, out, 0, {}};
  const guint memories = eyes_.all ().back ().memory + 1;
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
  return call.result;
}
