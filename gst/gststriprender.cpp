/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-striprender
 * @title: striprender
 *
 * Draws range images with OpenGL as bands of triangles along their rows, without building a mesh.
 * The camera orbits what the rig's cameras look at: by properties, which are controllable, and by
 * mouse and keys (GstNavigation): drag to turn, drag with another button to move, wheel to zoom,
 * arrows, + and -, and the key r to go back.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 avatartestsrc ! cylinderfilter ! striprender auto-orbit=30 ! glimagesink
 * ]|
 *
 * Without a display: `GST_GL_PLATFORM=egl GST_GL_WINDOW=egl-device`, and gldownload behind it.
 *
 * Since: 0.1
 */
#include "gststriprender.h"

#include <gst/gl/gl.h>
#include <gst/video/video.h>

#include <array>
#include <cmath>
#include <gstrange/gstrangeframe.hpp>
#include <gstrange/gstrangeinfo.hpp>
#include <gstrange/gstrangestatus.hpp>
#include <mutex>
#include <rangecast/parallel.hpp>
#include <vector>

#include "camerapainter.hpp"
#include "controlledvalues.hpp"
#include "multisampler.hpp"
#include "strippainter.hpp"
#include "stripsettings.hpp"

using rangecast::RangeImage;
using rangecast::Status;
using rangecast::StatusCode;
using rangecast::StripVertex;

GST_DEBUG_CATEGORY_STATIC (gst_strip_render_debug);
#define GST_CAT_DEFAULT gst_strip_render_debug

struct RenderStats {
  guint64 frames = 0, points = 0, vertices = 0, triangles = 0, strips = 0, isolated = 0,
          uploaded_bytes = 0;
};

struct GstStripRenderPrivate {
  std::mutex lock; /* guards what follows; never held across a push, event or message */
  StripRenderSettings settings;
  RenderStats stats;

  /* streaming thread only, or the GL thread while the streaming thread waits for it */
  gstrange::RangeInfo info;
  rangecast::SceneFrame scene;
  GstVideoInfo out;
  GstClockTime first_running = GST_CLOCK_TIME_NONE; /* of the first frame: where auto-orbit began */
  GstGLFramebuffer *framebuffer = nullptr;
  GError *gl_error = nullptr;   /* why OpenGL cannot be used */
  bool gl_error_posted = false; /* negotiation is tried again, the error is not */
  StripPainter painter;
  CameraPainter camera_painter;
  Multisampler multisampler;
  std::array<std::vector<StripVertex>, rangecast::kMaxViews> vertices; /* by number in the buffer */
};

struct _GstStripRender {
  GstGLBaseFilter parent;
  GstStripRenderPrivate *priv;
};

static GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE (
    "sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS (GST_RANGE_CAPS));
static GstStaticPadTemplate src_template =
    GST_STATIC_PAD_TEMPLATE ("src", GST_PAD_SRC, GST_PAD_ALWAYS,
        GST_STATIC_CAPS (GST_VIDEO_CAPS_MAKE_WITH_FEATURES (
            GST_CAPS_FEATURE_MEMORY_GL_MEMORY, "RGBA") ", texture-target = (string) 2D"));

G_DEFINE_TYPE (GstStripRender, gst_strip_render, GST_TYPE_GL_BASE_FILTER)
GST_ELEMENT_REGISTER_DEFINE (striprender, "striprender", GST_RANK_NONE, GST_TYPE_STRIP_RENDER)

static guint prop_stats; /* after those of the settings */

/* ---- caps ---- */

static GstCaps *
gst_strip_render_transform_caps (
    GstBaseTransform *, GstPadDirection direction, GstCaps *caps, GstCaps *filter)
{
  GstStaticPadTemplate *other_template = direction == GST_PAD_SINK ? &src_template : &sink_template;
  GstCaps *other = gst_caps_make_writable (gst_static_pad_template_get_caps (other_template));
  const GValue *rate = gst_caps_get_size (caps) == 1
                           ? gst_structure_get_value (gst_caps_get_structure (caps, 0), "framerate")
                           : nullptr;
  if (rate)
    gst_caps_set_value (other, "framerate", rate);
  if (!filter)
    return other;
  GstCaps *filtered = gst_caps_intersect_full (filter, other, GST_CAPS_INTERSECT_FIRST);
  gst_caps_unref (other);
  return filtered;
}

static GstCaps *
gst_strip_render_fixate_caps (
    GstBaseTransform *, GstPadDirection direction, GstCaps *, GstCaps *other)
{
  other = gst_caps_make_writable (gst_caps_truncate (other));
  if (direction == GST_PAD_SINK) {
    GstStructure *s = gst_caps_get_structure (other, 0);
    gst_structure_fixate_field_nearest_int (s, "width", 640);
    gst_structure_fixate_field_nearest_int (s, "height", 480);
    if (gst_structure_has_field (s, "pixel-aspect-ratio"))
      gst_structure_fixate_field_nearest_fraction (s, "pixel-aspect-ratio", 1, 1);
    else
      gst_structure_set (s, "pixel-aspect-ratio", GST_TYPE_FRACTION, 1, 1, nullptr);
  }
  return gst_caps_fixate (other);
}

static gboolean
gst_strip_render_set_caps (GstBaseTransform *base, GstCaps *in, GstCaps *out)
{
  auto self = GST_STRIP_RENDER (base);
  GstStripRenderPrivate *priv = self->priv;
  const Status status = gstrange::parse_caps (in, priv->info);
  if (gst_range_flow_return (GST_ELEMENT (self), status) != GST_FLOW_OK ||
      !gst_video_info_from_caps (&priv->out, out))
    return FALSE;
  priv->scene = rangecast::scene_frame (priv->info.rig);
  return GST_BASE_TRANSFORM_CLASS (gst_strip_render_parent_class)->set_caps (base, in, out);
}

static gboolean
gst_strip_render_get_unit_size (GstBaseTransform *, GstCaps *, gsize *size)
{
  *size = 1; /* both sides have buffers of their own; sizes do not follow from one another */
  return TRUE;
}

/* Our frame sets come from system memory; nobody upstream can use OpenGL's. */
static gboolean
gst_strip_render_propose_allocation (GstBaseTransform *, GstQuery *, GstQuery *)
{
  return TRUE;
}

/* A pool of OpenGL's buffers in our context: downstream's if it offers one. */
static gboolean
choose_pool (GstStripRender *self, GstQuery *query)
{
  GstCaps *caps;
  GstBufferPool *pool = nullptr;
  guint size = 0, min = 0, max = 0;
  gst_query_parse_allocation (query, &caps, nullptr);
  const bool offered = gst_query_get_n_allocation_pools (query) > 0;
  if (offered)
    gst_query_parse_nth_allocation_pool (query, 0, &pool, &size, &min, &max);
  if (pool && !GST_IS_GL_BUFFER_POOL (pool))
    gst_clear_object (&pool);
  if (!pool)
    pool = gst_gl_buffer_pool_new (GST_GL_BASE_FILTER (self)->context);
  size = guint (GST_VIDEO_INFO_SIZE (&self->priv->out));

  GstStructure *config = gst_buffer_pool_get_config (pool);
  gst_buffer_pool_config_set_params (config, caps, size, min, max);
  gst_buffer_pool_config_add_option (config, GST_BUFFER_POOL_OPTION_VIDEO_META);
  if (gst_query_find_allocation_meta (query, GST_GL_SYNC_META_API_TYPE, nullptr))
    gst_buffer_pool_config_add_option (config, GST_BUFFER_POOL_OPTION_GL_SYNC_META);
  const gboolean configured = gst_buffer_pool_set_config (pool, config);
  if (offered)
    gst_query_set_nth_allocation_pool (query, 0, pool, size, min, max);
  else
    gst_query_add_allocation_pool (query, pool, size, min, max);
  gst_object_unref (pool);
  return configured;
}

static gboolean
gst_strip_render_decide_allocation (GstBaseTransform *base, GstQuery *query)
{
  auto self = GST_STRIP_RENDER (base);
  if (!gst_gl_base_filter_find_gl_context (GST_GL_BASE_FILTER (base)) ||
      !choose_pool (self, query) ||
      !GST_BASE_TRANSFORM_CLASS (gst_strip_render_parent_class)->decide_allocation (base, query))
    return FALSE;
  GstStripRenderPrivate *priv = self->priv;
  if (priv->gl_error && !priv->gl_error_posted) {
    priv->gl_error_posted = true;
    GST_ELEMENT_ERROR (self, RESOURCE, NOT_FOUND,
        ("OpenGL cannot be used: %s", priv->gl_error->message), (nullptr));
  }
  return priv->gl_error == nullptr;
}

/* ---- OpenGL's life ---- */

/* TRUE even after a failure: the base class would post an error of its own, which does not say why.
 * decide_allocation posts ours. */
static gboolean
gst_strip_render_gl_start (GstGLBaseFilter *filter)
{
  GstStripRenderPrivate *priv = GST_STRIP_RENDER (filter)->priv;
  g_clear_error (&priv->gl_error);
  if (!priv->painter.start (filter->context, &priv->gl_error) && !priv->gl_error)
    priv->gl_error = g_error_new (GST_GL_CONTEXT_ERROR, GST_GL_CONTEXT_ERROR_FAILED, "no shader");
  return TRUE;
}

static void
gst_strip_render_gl_stop (GstGLBaseFilter *filter)
{
  GstStripRenderPrivate *priv = GST_STRIP_RENDER (filter)->priv;
  priv->painter.stop ();
  priv->camera_painter.stop ();
  priv->multisampler.stop ();
  gst_clear_object (&priv->framebuffer);
}

static gboolean
gst_strip_render_gl_set_caps (GstGLBaseFilter *filter, GstCaps *, GstCaps *)
{
  GstStripRenderPrivate *priv = GST_STRIP_RENDER (filter)->priv;
  gst_clear_object (&priv->framebuffer);
  priv->framebuffer = gst_gl_framebuffer_new_with_default_depth (filter->context,
      guint (GST_VIDEO_INFO_WIDTH (&priv->out)), guint (GST_VIDEO_INFO_HEIGHT (&priv->out)));
  return priv->framebuffer != nullptr;
}

/* ---- drawing ---- */

/* One frame on its way through the GL thread. */
struct DrawJob {
  GstStripRender *self;
  StripPainter::Picture picture;
  std::span<const StripPainter::Layer> layers;
  bool show_cameras;
  int samples;
  GstGLMemory *target;
  GstGLSyncMeta *sync; /* nullptr where downstream wants none */
  guint64 uploaded = 0;
  gboolean drawn = FALSE;
};

static gboolean
draw_bound (gpointer user_data)
{
  auto job = static_cast<DrawJob *> (user_data);
  GstStripRenderPrivate *priv = job->self->priv;
  GstGLContext *context = GST_GL_BASE_FILTER (job->self)->context;
  const bool antialiased =
      priv->multisampler.begin (context, job->picture.width, job->picture.height, job->samples);
  job->uploaded = priv->painter.draw (job->picture, job->layers);
  if (job->show_cameras)
    priv->camera_painter.draw (context, priv->info.rig, job->picture.clip_from_world);
  if (antialiased)
    priv->multisampler.end ();
  return TRUE;
}

static void
draw_in_gl_thread (GstGLContext *context, gpointer user_data)
{
  auto job = static_cast<DrawJob *> (user_data);
  job->drawn = gst_gl_framebuffer_draw_to_texture (
      job->self->priv->framebuffer, job->target, draw_bound, job);
  if (job->drawn && job->sync) /* other contexts wait for our commands there */
    gst_gl_sync_meta_set_sync_point (job->sync, context);
}

/* Time since the first picture, where auto-orbit began; a flush begins it anew. */
static guint64
orbit_time (GstStripRenderPrivate *priv, GstClockTime running)
{
  if (!GST_CLOCK_TIME_IS_VALID (running))
    return 0;
  if (!GST_CLOCK_TIME_IS_VALID (priv->first_running) || running < priv->first_running)
    priv->first_running = running;
  return running - priv->first_running;
}

static StripPainter::Picture
make_picture (
    GstStripRenderPrivate *priv, const StripRenderSettings &settings, GstClockTime running)
{
  const int width = GST_VIDEO_INFO_WIDTH (&priv->out), height = GST_VIDEO_INFO_HEIGHT (&priv->out);
  const double aspect = double (width) * GST_VIDEO_INFO_PAR_N (&priv->out) /
                        (double (height) * GST_VIDEO_INFO_PAR_D (&priv->out));
  const rangecast::Orbit orbit = settings.camera.at (orbit_time (priv, running));
  const auto matrices = rangecast::orbit_matrices (priv->scene, orbit, aspect, true);
  const double fov = orbit.fov_deg > 0 ? orbit.fov_deg : priv->scene.fov_deg;
  StripPainter::Picture picture = {};
  picture.clip_from_world = matrices.clip_from_world;
  for (int i = 0; i < 4; i++) /* ARGB to R, G, B, A */
    picture.background[i] =
        float (settings.background >> (i == 3 ? 24 : 16 - 8 * i) & 0xff) / 255.f;
  picture.point_size = float (settings.point_size);
  picture.pixels_per_unit = float (height / (2 * std::tan (fov * M_PI / 360)));
  picture.mode = settings.strips.mode;
  picture.depth_step = settings.strips.depth_step;
  /* what one camera sees is open at the back: there is nothing else to look at from there */
  picture.back_faces = settings.back_faces || priv->info.rig.views.size () == 1;
  picture.view_gap_m = settings.view_gap_m;
  picture.width = width;
  picture.height = height;
  std::lock_guard guard (priv->lock);
  priv->settings.camera.shown (matrices, width, height);
  return picture;
}

static void
build_all (GstStripRenderPrivate *priv, std::span<const RangeImage> images,
    const rangecast::StripSettings &settings, RenderStats &stats)
{
  std::array<rangecast::StripResult, rangecast::kMaxViews> results{};
  rangecast::in_parallel (images.size (), 0, [&] (std::size_t i) {
    rangecast::build_strips (images[i], settings, priv->vertices[i], results[i]);
  });
  for (std::size_t i = 0; i < images.size (); i++) {
    stats.points += results[i].points;
    stats.strips += results[i].strips;
    stats.isolated += results[i].isolated;
    stats.triangles += results[i].triangles;
    stats.vertices += priv->vertices[i].size ();
  }
}

static bool
draw_into (GstStripRender *self, GstBuffer *out, DrawJob &job)
{
  GstMemory *memory = gst_buffer_peek_memory (out, 0);
  if (!gst_is_gl_memory (memory)) {
    GST_ELEMENT_ERROR (
        self, CORE, NEGOTIATION, (nullptr), ("the output buffer is not OpenGL memory"));
    return false;
  }
  job.target = GST_GL_MEMORY_CAST (memory);
  job.sync = gst_buffer_get_gl_sync_meta (out);
  GstMapInfo map; /* tells whoever reads it on the CPU that the texture has changed */
  const auto flags = GstMapFlags (GST_MAP_WRITE | GST_MAP_GL);
  if (gst_memory_map (memory, &map, flags)) {
    gst_gl_context_thread_add (GST_GL_BASE_FILTER (self)->context, draw_in_gl_thread, &job);
    gst_memory_unmap (memory, &map);
  }
  if (!job.drawn)
    GST_ELEMENT_ERROR (self, RESOURCE, WRITE, ("OpenGL could not draw into the output"), (nullptr));
  return job.drawn;
}

static GstFlowReturn
draw_frame (GstStripRender *self, const gstrange::RangeFrameMap &frame, GstBuffer *out,
    GstClockTime running)
{
  GstStripRenderPrivate *priv = self->priv;
  StripRenderSettings settings;
  {
    std::lock_guard guard (priv->lock);
    settings = priv->settings;
  }
  RenderStats stats;
  build_all (priv, frame.views (), settings.strips, stats);
  std::array<StripPainter::Layer, rangecast::kMaxViews> layers;
  std::size_t count = 0;
  for (std::size_t i = 0; i < frame.views ().size (); i++)
    if (const rangecast::View *view = priv->info.rig.find (frame.views ()[i].view_id))
      layers[count++] = {frame.views ()[i], view, priv->vertices[i]};

  DrawJob job = {};
  job.self = self;
  job.picture = make_picture (priv, settings, running);
  job.layers = {layers.data (), count};
  job.show_cameras = settings.show_cameras;
  job.samples = settings.samples;
  if (!draw_into (self, out, job))
    return GST_FLOW_ERROR;
  stats.uploaded_bytes = job.uploaded;
  std::lock_guard guard (priv->lock);
  stats.frames = priv->stats.frames + 1;
  priv->stats = stats;
  return GST_FLOW_OK;
}

static Status
check_frame (GstStripRenderPrivate *priv, const gstrange::RangeFrameMap &frame)
{
  if (!frame.status ().ok ())
    return frame.status ();
  for (const RangeImage &image : frame.views ()) {
    const rangecast::View *view = priv->info.rig.find (image.view_id);
    if (view && (image.roi.x + image.roi.width > view->width ||
                    image.roi.y + image.roi.height > view->height))
      return {StatusCode::kBadSize, "range buffer: the ROI of view " +
                                        std::to_string (image.view_id) +
                                        " does not lie in the view's image"};
  }
  return {};
}

static GstFlowReturn
gst_strip_render_transform (GstBaseTransform *base, GstBuffer *in, GstBuffer *out)
{
  auto self = GST_STRIP_RENDER (base);
  const GstClockTime pts = GST_BUFFER_PTS (in);
  sync_controlled_values (base, in);
  gstrange::RangeFrameMap frame (in, GST_MAP_READ);
  const GstFlowReturn flow =
      gst_range_flow_return (GST_ELEMENT (self), check_frame (self->priv, frame));
  if (flow != GST_FLOW_OK)
    return flow;
  return draw_frame (
      self, frame, out, gst_segment_to_running_time (&base->segment, GST_FORMAT_TIME, pts));
}

static gboolean
gst_strip_render_transform_meta (GstBaseTransform *, GstBuffer *, GstMeta *meta, GstBuffer *)
{
  return meta->info->api == GST_REFERENCE_TIMESTAMP_META_API_TYPE;
}

/* ---- mouse and keys ---- */

static bool
handle_navigation (GstStripRender *self, GstEvent *event)
{
  GstStripRenderPrivate *priv = self->priv;
  StripRenderSettings before, after;
  bool handled;
  {
    std::lock_guard guard (priv->lock);
    before = priv->settings;
    handled = priv->settings.camera.handle (event);
    after = priv->settings;
  }
  notify_strip_settings (G_OBJECT (self), before, after);
  return handled;
}

static gboolean
gst_strip_render_src_event (GstBaseTransform *base, GstEvent *event)
{
  if (GST_EVENT_TYPE (event) == GST_EVENT_NAVIGATION &&
      handle_navigation (GST_STRIP_RENDER (base), event)) {
    gst_event_unref (event);
    return TRUE;
  }
  return GST_BASE_TRANSFORM_CLASS (gst_strip_render_parent_class)->src_event (base, event);
}

/* ---- life ---- */

static gboolean
gst_strip_render_start (GstBaseTransform *base)
{
  GstStripRenderPrivate *priv = GST_STRIP_RENDER (base)->priv;
  priv->first_running = GST_CLOCK_TIME_NONE;
  priv->gl_error_posted = false;
  {
    std::lock_guard guard (priv->lock);
    priv->stats = {};
    priv->settings.camera.release ();
  }
  return GST_BASE_TRANSFORM_CLASS (gst_strip_render_parent_class)->start (base);
}

static void
gst_strip_render_set_property (GObject *object, guint id, const GValue *value, GParamSpec *pspec)
{
  GstStripRenderPrivate *priv = GST_STRIP_RENDER (object)->priv;
  std::lock_guard guard (priv->lock);
  if (!set_strip_setting (priv->settings, id, value))
    G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
}

static GstStructure *
make_stats (const RenderStats &s)
{
  return gst_structure_new ("application/x-striprender-stats", "frames", G_TYPE_UINT64, s.frames,
      "points", G_TYPE_UINT64, s.points, "vertices", G_TYPE_UINT64, s.vertices, "triangles",
      G_TYPE_UINT64, s.triangles, "strips", G_TYPE_UINT64, s.strips, "isolated", G_TYPE_UINT64,
      s.isolated, "uploaded-bytes", G_TYPE_UINT64, s.uploaded_bytes, nullptr);
}

static void
gst_strip_render_get_property (GObject *object, guint id, GValue *value, GParamSpec *pspec)
{
  GstStripRenderPrivate *priv = GST_STRIP_RENDER (object)->priv;
  std::lock_guard guard (priv->lock);
  if (id == prop_stats)
    g_value_take_boxed (value, make_stats (priv->stats));
  else if (!get_strip_setting (priv->settings, id, value))
    G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
}

static void
gst_strip_render_finalize (GObject *object)
{
  GstStripRenderPrivate *priv = GST_STRIP_RENDER (object)->priv;
  g_clear_error (&priv->gl_error);
  delete priv;
  G_OBJECT_CLASS (gst_strip_render_parent_class)->finalize (object);
}

static void
gst_strip_render_init (GstStripRender *self)
{
  self->priv = new GstStripRenderPrivate;
  gst_base_transform_set_qos_enabled (GST_BASE_TRANSFORM (self), TRUE);
}

static void
gst_strip_render_class_init (GstStripRenderClass *klass)
{
  auto object_class = G_OBJECT_CLASS (klass);
  auto element_class = GST_ELEMENT_CLASS (klass);
  auto transform_class = GST_BASE_TRANSFORM_CLASS (klass);
  auto filter_class = GST_GL_BASE_FILTER_CLASS (klass);

  object_class->set_property = gst_strip_render_set_property;
  object_class->get_property = gst_strip_render_get_property;
  object_class->finalize = gst_strip_render_finalize;
  prop_stats = install_strip_settings (object_class) + 1;
  g_object_class_install_property (object_class, prop_stats,
      g_param_spec_boxed ("stats", "Statistics",
          "frames since start; and of the last one: points, vertices, triangles, strips, isolated, "
          "uploaded-bytes",
          GST_TYPE_STRUCTURE, GParamFlags (G_PARAM_READABLE | G_PARAM_STATIC_STRINGS)));

  gst_element_class_add_static_pad_template (element_class, &sink_template);
  gst_element_class_add_static_pad_template (element_class, &src_template);
  gst_element_class_set_static_metadata (element_class, "Strip renderer", "Filter/Converter/Video",
      "Draws range images as triangle strips with OpenGL", "gst-rangecast");
  gst_type_mark_as_plugin_api (GST_TYPE_STRIP_RENDER_MODE, GstPluginAPIFlags (0));

  transform_class->start = gst_strip_render_start;
  transform_class->transform_caps = gst_strip_render_transform_caps;
  transform_class->fixate_caps = gst_strip_render_fixate_caps;
  transform_class->set_caps = gst_strip_render_set_caps;
  transform_class->get_unit_size = gst_strip_render_get_unit_size;
  transform_class->propose_allocation = gst_strip_render_propose_allocation;
  transform_class->decide_allocation = gst_strip_render_decide_allocation;
  transform_class->transform = gst_strip_render_transform;
  transform_class->transform_meta = gst_strip_render_transform_meta;
  transform_class->src_event = gst_strip_render_src_event;

  filter_class->supported_gl_api =
      GstGLAPI (GST_GL_API_OPENGL | GST_GL_API_OPENGL3 | GST_GL_API_GLES2);
  filter_class->gl_start = gst_strip_render_gl_start;
  filter_class->gl_stop = gst_strip_render_gl_stop;
  filter_class->gl_set_caps = gst_strip_render_gl_set_caps;

  GST_DEBUG_CATEGORY_INIT (gst_strip_render_debug, "striprender", 0, "Strip renderer");
}
