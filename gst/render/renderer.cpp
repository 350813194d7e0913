/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "renderer.hpp"

#include <algorithm>
#include <cstring>
#include <exception>
#include <utility>

namespace {

constexpr GLenum kContextLost = 0x0507; /* of OpenGL 4.5 and OpenGL ES 3.2 */

/* An error that no further call can mend. @return why, or nullptr */
const char *
fatal_error (const GstGLFuncs *gl)
{
  constexpr int kMaxErrors = 8; /* several may be queued; a lost context may report indefinitely */
  for (int i = 0; i < kMaxErrors; i++)
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

struct Colour {
  float rgba[4];

  explicit Colour (guint argb)
  {
    for (int i = 0; i < 4; i++)
      rgba[i] = float (argb >> (i == 3 ? 24 : 16 - 8 * i) & 0xff) / 255.f;
  }
};

} // namespace

MultiviewLayout::MultiviewLayout (const GstVideoInfo &info)
{
  const int width = GST_VIDEO_INFO_WIDTH (&info), height = GST_VIDEO_INFO_HEIGHT (&info);
  guint flags; /* copied: caps may have bits that are not in the enumeration */
  static_assert (sizeof flags == sizeof GST_VIDEO_INFO_MULTIVIEW_FLAGS (&info));
  std::memcpy (&flags, &GST_VIDEO_INFO_MULTIVIEW_FLAGS (&info), sizeof flags);
  const bool half = (flags & GST_VIDEO_MULTIVIEW_FLAGS_HALF_ASPECT) != 0;
  EyeViewport &first = eyes_[0], &second = eyes_[1];
  first = {0, 0, 0, 0, width, height, 1};
  first.aspect = double (width) * GST_VIDEO_INFO_PAR_N (&info) /
                 (double (height) * GST_VIDEO_INFO_PAR_D (&info));
  count_ = 2;
  switch (GST_VIDEO_INFO_MULTIVIEW_MODE (&info)) {
    case GST_VIDEO_MULTIVIEW_MODE_SIDE_BY_SIDE:
      first.aspect *= half ? 1 : 0.5;
      first.width = width / 2;
      second = first;
      second.x = width - second.width;
      break;
    case GST_VIDEO_MULTIVIEW_MODE_TOP_BOTTOM:
      first.aspect *= half ? 1 : 2;
      first.height = height / 2;
      second = first;
      second.y = height - second.height;
      break;
    case GST_VIDEO_MULTIVIEW_MODE_SEPARATED:
      second = first;
      second.memory = 1;
      break;
    case GST_VIDEO_MULTIVIEW_MODE_LEFT:
    case GST_VIDEO_MULTIVIEW_MODE_RIGHT:
      first.side = GST_VIDEO_INFO_MULTIVIEW_MODE (&info) == GST_VIDEO_MULTIVIEW_MODE_LEFT ? -1 : 1;
      [[fallthrough]];
    default:
      count_ = 1;
      return;
  }
  first.side = -1;
  second.side = 1;
  if (flags & GST_VIDEO_MULTIVIEW_FLAGS_RIGHT_VIEW_FIRST)
    std::swap (first.side, second.side);
}

bool
Renderer::start (GstGLContext *context, GError **error)
{
  context_ = context;
  GST_DEBUG_OBJECT (context, "drawing with %s",
      reinterpret_cast<const char *> (context->gl_vtable->GetString (GL_RENDERER)));
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
  panel_painter_.stop ();
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
        "%dx%d is too large; set caps of at most %dx%d", width_, height_, largest, largest);
  return framebuffer_ != nullptr;
}

struct Renderer::Call {
  Renderer *self;
  const RenderJob *job;
  GstBuffer *out;
  bool panel_changed;
  guint memory = 0;              /* that is drawn into now */
  const char *failure = nullptr; /* of a painter */
  Result result = {};
  std::exception_ptr exception = {}; /* must not pass through C, nor end the OpenGL thread */

  /* Keeps an exception for draw(). */
  template <typename Work> void guard (const Work &work)
  {
    try {
      work ();
    } catch (...) {
      exception = std::current_exception ();
    }
  }
};

Renderer::Result
Renderer::draw (GstGLContext *context, const RenderJob &job, GstBuffer *out)
{
  Call call = {.self = this, .job = &job, .out = out, .panel_changed = job.panel_changed};
  const guint memories = layout_.eyes ().back ().memory + 1;
  std::array<GstMapInfo, 2> maps; /* mark the memories as changed for readers on the CPU */
  guint mapped = 0;
  while (mapped < memories && mapped < gst_buffer_n_memory (out)) {
    GstMemory *memory = gst_buffer_peek_memory (out, mapped);
    const auto flags = GstMapFlags (GST_MAP_WRITE | GST_MAP_GL);
    if (!gst_is_gl_memory (memory) || !gst_memory_map (memory, &maps[mapped], flags))
      break;
    mapped++;
  }
  const auto draw_call = [] (GstGLContext *, gpointer user_data) {
    auto call = static_cast<Call *> (user_data);
    call->guard ([&] { call->self->draw_buffer (*call); });
  };
  if (mapped == memories)
    gst_gl_context_thread_add (context, draw_call, &call);
  for (guint i = 0; i < mapped; i++)
    gst_memory_unmap (gst_buffer_peek_memory (out, i), &maps[i]);
  if (call.exception)
    std::rethrow_exception (call.exception);
  return call.result;
}

/* ---- on the OpenGL thread ---- */

void
Renderer::draw_buffer (Call &call)
{
  const guint memories = layout_.eyes ().back ().memory + 1;
  bool drawn = true;
  if (!upload (call)) {
    call.result.reason = "a view is larger than its textures can be";
    return;
  }
  const auto draw_bound = [] (gpointer user_data) -> gboolean {
    auto bound = static_cast<Call *> (user_data);
    bound->guard ([&] { bound->self->draw_memory (*bound); });
    return !bound->exception;
  };
  for (guint i = 0; i < memories && drawn; i++) {
    call.memory = i;
    drawn = gst_gl_framebuffer_draw_to_texture (
        framebuffer_, GST_GL_MEMORY_CAST (gst_buffer_peek_memory (call.out, i)), draw_bound, &call);
  }
  call.result.reason = drawn ? fatal_error (context_->gl_vtable) : "there is no framebuffer for it";
  if (!call.result.reason)
    call.result.reason = call.failure;
  call.result.drawn = drawn && !call.result.reason;
  GstGLSyncMeta *sync = gst_buffer_get_gl_sync_meta (call.out);
  if (call.result.drawn && sync) /* other contexts wait there for our commands */
    gst_gl_sync_meta_set_sync_point (sync, context_);
}

/* Once for all pictures of a scene: for both eyes, and for as long as it is held. */
bool
Renderer::upload (Call &call)
{
  const rangecast::SurfaceScene &scene = *call.job->scene;
  if (uploaded_ == scene.serial ())
    return true;
  if (!painter_.fits (scene.layers ()))
    return false;
  call.result.uploaded += painter_.upload (scene.layers ());
  uploaded_ = scene.serial ();
  return true;
}

/* Draws what one memory of the buffer shows. */
void
Renderer::draw_memory (Call &call)
{
  for (const EyeViewport &viewport : layout_.eyes ())
    if (viewport.memory == call.memory)
      draw_eye (call, viewport);
}

/* Scissors keep the painter, which clears and draws whole pictures, to this eye's part. */
void
Renderer::draw_eye (Call &call, const EyeViewport &viewport)
{
  const RenderJob &job = *call.job;
  const GstGLFuncs *gl = context_->gl_vtable;
  const RenderPicture picture = make_picture (job, viewport, call.result);
  const bool whole = viewport.width == width_ && viewport.height == height_;
  if (!whole) {
    gl->Enable (GL_SCISSOR_TEST);
    gl->Scissor (viewport.x, viewport.y, viewport.width, viewport.height);
  }
  const bool blends = picture.mode == rangecast::StripMode::kBlend;
  const auto draw_shade = [&] {
    if (picture.background_shade > 0)
      background_painter_.draw (
          context_, picture.background, picture.background_shade, picture.part);
  };
  if (blends && picture.background_shade > 0)
    gl->Clear (GL_DEPTH_BUFFER_BIT);
  if (blends) /* is drawn over the background; other modes leave the background's depth */
    draw_shade ();
  if (const char *failure = painter_.draw (picture, job.scene->layers ()))
    call.failure = failure;
  if (!blends)
    draw_shade ();
  if (!job.panel.empty ())
    call.result.uploaded +=
        panel_painter_.draw (context_, job.panel, std::exchange (call.panel_changed, false),
            viewport.x, viewport.y, std::max (1, (viewport.height + 240) / 480));
  if (!whole)
    gl->Disable (GL_SCISSOR_TEST);
}

RenderPicture
Renderer::make_picture (const RenderJob &job, const EyeViewport &viewport, Result &result) const
{
  const StripRenderSettings &settings = *job.settings;
  const rangecast::SceneFrame &frame = *job.frame;
  const rangecast::Eye eye = {viewport.side * settings.eye_distance_m / 2, settings.convergence_m};
  const auto matrices =
      rangecast::orbit_matrices (frame, job.orbit, viewport.aspect, true, eye, job.scene->hull (),
          std::max (
              2 * rangecast::kViewGap_m, settings.blend_range_m) /* by which surfaces move back */);
  if (result.width == 0) {
    result.matrices = matrices;
    result.width = viewport.width;
    result.height = viewport.height;
  }
  rangecast::PicturePart part{double (viewport.width) / width_, double (viewport.height) / height_};
  part.x = double (2 * viewport.x + viewport.width) / width_ - 1;
  part.y = double (2 * viewport.y + viewport.height) / height_ - 1;
  RenderPicture picture = {};
  picture.clip_from_world = rangecast::in_part (matrices.clip_from_world, part);
  std::ranges::copy (Colour (settings.background).rgba, picture.background);
  if (picture.background[3] >= 1)
    picture.background_shade = float (settings.background_shade);
  picture.point_size = float (settings.point_size);
  picture.pixels_per_unit = float (rangecast::pixels_per_unit (frame, job.orbit, viewport.height));
  picture.mode = settings.strips.mode;
  picture.depth_step = settings.strips.depth_step;
  /* What one camera sees is open at the back, where there is nothing else to see. */
  picture.back_faces = job.scene->rig_views () == 1;
  picture.blend_range_m = settings.blend_range_m;
  picture.width = width_;
  picture.height = height_;
  picture.part = {viewport.x, viewport.y, viewport.width, viewport.height};
  picture.covered = rangecast::covered_part (
      picture.clip_from_world, job.scene->hull (), width_, height_, picture.part);
  return picture;
}
