/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-striprender
 * @title: striprender
 *
 * Renders range images with OpenGL without building a mesh. The virtual camera orbits the point
 * that the rig's cameras look at, controlled by properties and by navigation events: left-drag
 * orbits, other buttons pan, the wheel, + and - zoom, arrows orbit, r and Home reset. With
 * #GstStripRender:fit it is centred on the content.
 *
 * If downstream requests a frame rate, the element generates it by repeating and dropping frame
 * sets, and in a live pipeline repeats the last one while the stream stalls.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 avatartestsrc ! rangealign ! striprender auto-orbit=30 ! glimagesink
 * gst-launch-1.0 avatartestsrc range-person-only=true ! striprender fit=true background-shade=0.5 !
 * glimagesink
 * ]|
 *
 * Without a display: `GST_GL_PLATFORM=egl GST_GL_WINDOW=egl-device`, and gldownload behind it.
 *
 * Since: 0.1
 */

#include "gststriprender.h"

#include <algorithm>
#include <exception>
#include <gstrange/gstrangestatus.hpp>
#include <rangecast/base/guarded.hpp>
#include <utility>

#include "caps.hpp"
#include "striprenderprivate.hpp"

using rangecast::Status;

static GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE (
    "sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS (GST_RANGE_CAPS));
static GstStaticPadTemplate src_template =
    GST_STATIC_PAD_TEMPLATE ("src", GST_PAD_SRC, GST_PAD_ALWAYS,
        GST_STATIC_CAPS (GST_VIDEO_CAPS_MAKE_WITH_FEATURES (GST_CAPS_FEATURE_MEMORY_GL_MEMORY,
            "RGBA") ", texture-target = (string) 2D, multiview-mode = "
                    "(string) " STRIP_MULTIVIEW_MODES));

G_DEFINE_TYPE (GstStripRender, gst_strip_render, GST_TYPE_GL_BASE_FILTER)
GST_ELEMENT_REGISTER_DEFINE (striprender, "striprender", GST_RANK_NONE, GST_TYPE_STRIP_RENDER)

enum : guint { PROP_STATS = 1, PROP_STATS_INTERVAL, PROP_CAMERA };

/* ---- input caps and output pool ---- */

namespace {

/* Whether both rigs have the same cameras, in other poses perhaps. */
bool
has_same_cameras (const rangecast::Rig &a, const rangecast::Rig &b)
{
  return std::ranges::equal (
      a.views, b.views, [] (const rangecast::View &v, const rangecast::View &w) {
        return v.id == w.id && v.width == w.width && v.height == w.height;
      });
}

/* Downstream may renegotiate, or rangealign correct poses, at any time: a fit outlasts both. */
bool
handle_input_caps (GstStripRender *self, GstCaps *caps)
{
  GstStripRenderPrivate *priv = self->priv;
  if (priv->input && gst_caps_is_equal (caps, priv->input)) {
    return true;
  }
  const Status status = rangecast::guarded ("striprender", [&] {
    gstrange::RangeInfo info;
    Status parsed = gstrange::parse_caps (caps, info);
    if (!parsed.ok ())
      return parsed;
    if (!has_same_cameras (info.rig, priv->info.rig))
      priv->fit.reset ();
    gst_clear_caps (&priv->input); /* what follows may throw */
    priv->info = std::move (info);
    priv->scene.set_rig (priv->info.rig);
    priv->reporter.set_views (priv->info.rig);
    gst_caps_replace (&priv->input, caps);
    return parsed;
  });
  return gst_range_flow_return (GST_ELEMENT (self), status) == GST_FLOW_OK;
}

struct PoolSizes {
  guint size = 0, min = 0, max = 0; /* bytes of a buffer; numbers of buffers */
};

/* Configures a pool for OpenGL buffers of the query's caps. A pool that wants more than it is asked
 * for refuses, and has in its configuration what it would accept. @return whether it is configured
 */
bool
configure_pool (GstBufferPool *pool, GstQuery *query, PoolSizes &sizes)
{
  GstCaps *caps;
  gst_query_parse_allocation (query, &caps, nullptr);
  GstStructure *config = gst_buffer_pool_get_config (pool);
  gst_buffer_pool_config_set_params (config, caps, sizes.size, sizes.min, sizes.max);
  gst_buffer_pool_config_add_option (config, GST_BUFFER_POOL_OPTION_VIDEO_META);
  if (gst_query_find_allocation_meta (query, GST_GL_SYNC_META_API_TYPE, nullptr))
    gst_buffer_pool_config_add_option (config, GST_BUFFER_POOL_OPTION_GL_SYNC_META);
  const bool accepted = gst_buffer_pool_set_config (pool, config);
  config = gst_buffer_pool_get_config (pool);
  const bool enough =
      gst_buffer_pool_config_validate_params (config, caps, sizes.size, sizes.min, sizes.max);
  gst_buffer_pool_config_get_params (config, nullptr, &sizes.size, &sizes.min, &sizes.max);
  if (accepted || !enough) {
    gst_structure_free (config);
    return accepted;
  }
  return gst_buffer_pool_set_config (pool, config);
}

/* Answers the query with downstream's pool of OpenGL buffers if that shares our context, else with
 * a new one. */
bool
choose_pool (GstStripRender *self, GstQuery *query)
{
  GstGLContext *context = GST_GL_BASE_FILTER (self)->context;
  const guint min_size = guint (GST_VIDEO_INFO_SIZE (&self->priv->out));
  GstBufferPool *pool = nullptr;
  PoolSizes offer;
  const bool offered = gst_query_get_n_allocation_pools (query) > 0;
  if (offered)
    gst_query_parse_nth_allocation_pool (query, 0, &pool, &offer.size, &offer.min, &offer.max);
  offer.size = std::max (offer.size, min_size);
  PoolSizes sizes = offer;
  const bool is_usable = pool && GST_IS_GL_BUFFER_POOL (pool) &&
                         gst_gl_context_can_share (GST_GL_BUFFER_POOL (pool)->context, context);
  if (!is_usable || !configure_pool (pool, query, sizes)) {
    if (pool)
      GST_INFO_OBJECT (self, "%" GST_PTR_FORMAT " cannot be used; creating a pool", pool);
    gst_clear_object (&pool);
    pool = gst_gl_buffer_pool_new (context);
    sizes = {min_size, offer.min, 0};
    if (!configure_pool (pool, query, sizes)) {
      GST_DEBUG_OBJECT (self, "no pool of OpenGL buffers for these caps");
      gst_object_unref (pool);
      return false;
    }
  }
  if (offered)
    gst_query_set_nth_allocation_pool (query, 0, pool, sizes.size, sizes.min, sizes.max);
  else
    gst_query_add_allocation_pool (query, pool, sizes.size, sizes.min, sizes.max);
  gst_object_unref (pool);
  return true;
}

} // namespace

/* ---- caps ---- */

static GstCaps *
gst_strip_render_transform_caps (
    GstBaseTransform *, GstPadDirection direction, GstCaps *caps, GstCaps *filter)
{
  const bool forward = direction == GST_PAD_SINK;
  GstCaps *other = gst_static_pad_template_get_caps (forward ? &src_template : &sink_template);
  GstCaps *transformed =
      forward ? strip_output_caps (caps, other, filter) : strip_input_caps (caps, other, filter);
  gst_caps_unref (other);
  return transformed;
}

static GstCaps *
gst_strip_render_fixate_caps (
    GstBaseTransform *, GstPadDirection direction, GstCaps *caps, GstCaps *other)
{
  return direction == GST_PAD_SINK ? strip_fixate_output (other, caps) : gst_caps_fixate (other);
}

static gboolean
gst_strip_render_set_caps (GstBaseTransform *base, GstCaps *in, GstCaps *out)
{
  auto self = GST_STRIP_RENDER (base);
  GstStripRenderPrivate *priv = self->priv;
  GST_INFO_OBJECT (self, "from %" GST_PTR_FORMAT " to %" GST_PTR_FORMAT, in, out);
  if (strip_has_flags_as_text (out)) {
    GST_ELEMENT_ERROR (self, STREAM, FORMAT,
        ("The caps' multiview-flags are a string, expected (GstVideoMultiviewFlagsSet)"),
        (nullptr));
    return FALSE;
  }
  if (!handle_input_caps (self, in) || !gst_video_info_from_caps (&priv->out, out))
    return FALSE;
  {
    std::lock_guard guard (priv->lock);
    priv->rate = strip_output_rate (in, out);
  }
  strip_select_mode (self);
  return GST_BASE_TRANSFORM_CLASS (gst_strip_render_parent_class)->set_caps (base, in, out);
}

static gboolean
gst_strip_render_get_unit_size (GstBaseTransform *, GstCaps *, gsize *size)
{
  *size = 1; /* both sides have buffers of their own; sizes do not follow from one another */
  return TRUE;
}

/* ---- allocation ---- */

/* Frame sets are read on the CPU: upstream has no use for a pool of OpenGL memory. */
static gboolean
gst_strip_render_propose_allocation (GstBaseTransform *, GstQuery *, GstQuery *)
{
  return TRUE;
}

static gboolean
gst_strip_render_decide_allocation (GstBaseTransform *base, GstQuery *query)
{
  auto self = GST_STRIP_RENDER (base);
  GstStripRenderPrivate *priv = self->priv;
  if (!priv->no_context) /* else the base class has posted why */
    priv->no_context = !gst_gl_base_filter_find_gl_context (GST_GL_BASE_FILTER (base));
  if (priv->no_context)
    GST_DEBUG_OBJECT (self, "no OpenGL context");
  if (priv->no_context || !choose_pool (self, query) ||
      !GST_BASE_TRANSFORM_CLASS (gst_strip_render_parent_class)->decide_allocation (base, query))
    return FALSE;
  const GError *error = priv->gl_error ? priv->gl_error : priv->output_error;
  if (error && !priv->gl_error_posted)
    GST_ELEMENT_ERROR (
        self, RESOURCE, NOT_FOUND, ("OpenGL cannot be used: %s", error->message), (nullptr));
  priv->gl_error_posted = error != nullptr;
  return error == nullptr;
}

/* ---- OpenGL, on its thread ---- */

/* TRUE even after a failure: the base class would post an error that does not say why;
 * decide_allocation() posts one that does. */
static gboolean
gst_strip_render_gl_start (GstGLBaseFilter *filter)
{
  GstStripRenderPrivate *priv = GST_STRIP_RENDER (filter)->priv;
  g_clear_error (&priv->gl_error);
  try {
    priv->renderer.start (filter->context, &priv->gl_error);
  } catch (const std::exception &error) {
    g_set_error_literal (
        &priv->gl_error, GST_GL_CONTEXT_ERROR, GST_GL_CONTEXT_ERROR_FAILED, error.what ());
  }
  return TRUE;
}

static void
gst_strip_render_gl_stop (GstGLBaseFilter *filter)
{
  GST_STRIP_RENDER (filter)->priv->renderer.stop ();
}

static gboolean
gst_strip_render_gl_set_caps (GstGLBaseFilter *filter, GstCaps *, GstCaps *)
{
  GstStripRenderPrivate *priv = GST_STRIP_RENDER (filter)->priv;
  g_clear_error (&priv->output_error);
  priv->renderer.set_output (filter->context, priv->out, &priv->output_error);
  return TRUE;
}

/* ---- drawing: when and of which frame set, see scheduling.cpp ---- */

static GstFlowReturn
gst_strip_render_transform (GstBaseTransform *base, GstBuffer *in, GstBuffer *out)
{
  return strip_draw_frame (GST_STRIP_RENDER (base), in, out, false);
}

static gboolean
gst_strip_render_transform_meta (GstBaseTransform *, GstBuffer *, GstMeta *meta, GstBuffer *)
{
  return meta->info->api == GST_REFERENCE_TIMESTAMP_META_API_TYPE;
}

/* ---- events from downstream ---- */

namespace {

bool
handle_navigation (GstStripRender *self, GstEvent *event)
{
  GstStripRenderPrivate *priv = self->priv;
  OrbitControl before, after;
  bool handled;
  {
    std::lock_guard guard (priv->lock);
    before = priv->settings.camera;
    handled = priv->settings.camera.handle (event);
    after = priv->settings.camera;
  }
  camera_properties ().notify_changes (G_OBJECT (self), before, after);
  return handled;
}

std::vector<StatsRow>
collect_stats (GstElement *element)
{
  GstStripRenderPrivate *priv = GST_STRIP_RENDER (element)->priv;
  std::lock_guard guard (priv->lock);
  const RenderStats &stats = priv->stats;
  return {{.counters = {.frames = stats.frames,
               .points = stats.points_total,
               .bytes = stats.uploaded_total,
               .late = stats.dropped}}};
}

} // namespace

static gboolean
gst_strip_render_src_event (GstBaseTransform *base, GstEvent *event)
{
  auto self = GST_STRIP_RENDER (base);
  if (GST_EVENT_TYPE (event) == GST_EVENT_NAVIGATION && handle_navigation (self, event)) {
    gst_event_unref (event);
    return TRUE;
  }
  if (GST_EVENT_TYPE (event) == GST_EVENT_QOS || GST_EVENT_TYPE (event) == GST_EVENT_LATENCY)
    strip_handle_timing_event (self, event);
  return GST_BASE_TRANSFORM_CLASS (gst_strip_render_parent_class)->src_event (base, event);
}

/* ---- states ---- */

static gboolean
gst_strip_render_start (GstBaseTransform *base)
{
  auto self = GST_STRIP_RENDER (base);
  GstStripRenderPrivate *priv = self->priv;
  priv->first_running = GST_CLOCK_TIME_NONE;
  priv->gl_error_posted = priv->no_context = false;
  priv->live = false;
  priv->stats_text = {};
  priv->fit.reset ();
  gst_clear_caps (&priv->input);
  strip_reset_stream (self);
  priv->reporter.start (GST_ELEMENT (self), collect_stats);
  {
    std::lock_guard guard (priv->lock);
    priv->stats = {};
    priv->settings.camera.release ();
  }
  return GST_BASE_TRANSFORM_CLASS (gst_strip_render_parent_class)->start (base);
}

static gboolean
gst_strip_render_stop (GstBaseTransform *base)
{
  auto self = GST_STRIP_RENDER (base);
  self->priv->reporter.stop ();
  self->priv->task.stop ();
  strip_reset_stream (self);
  return GST_BASE_TRANSFORM_CLASS (gst_strip_render_parent_class)->stop (base);
}

static GstStateChangeReturn
gst_strip_render_change_state (GstElement *element, GstStateChange transition)
{
  OutputTask &task = GST_STRIP_RENDER (element)->priv->task;
  if (transition == GST_STATE_CHANGE_PLAYING_TO_PAUSED)
    task.set_playing (false);
  const GstStateChangeReturn result =
      GST_ELEMENT_CLASS (gst_strip_render_parent_class)->change_state (element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_PLAYING && result != GST_STATE_CHANGE_FAILURE)
    task.set_playing (true);
  return result;
}

/* ---- properties ---- */

static void
gst_strip_render_set_property (GObject *object, guint id, const GValue *value, GParamSpec *pspec)
{
  GstStripRenderPrivate *priv = GST_STRIP_RENDER (object)->priv;
  if (id == PROP_STATS_INTERVAL) {
    priv->reporter.set_interval (g_value_get_uint (value));
    return;
  }
  bool hold_changed, keep_changed;
  {
    std::lock_guard guard (priv->lock);
    const StripRenderSettings before = priv->settings;
    if (strip_properties ().set (priv->settings, id, value))
      priv->settings.strips_serial++;
    else if (!camera_properties ().set (priv->settings.camera, id, value))
      G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
    hold_changed = priv->settings.hold_time != before.hold_time;
    keep_changed = priv->settings.keep_rate != before.keep_rate;
    priv->schedule.set_hold (priv->settings.hold_time);
  }
  if (hold_changed || keep_changed) /* without a task they apply to the next frame set */
    priv->task.wake ();
}

static void
gst_strip_render_get_property (GObject *object, guint id, GValue *value, GParamSpec *pspec)
{
  GstStripRenderPrivate *priv = GST_STRIP_RENDER (object)->priv;
  std::lock_guard guard (priv->lock);
  if (id == PROP_STATS)
    g_value_take_boxed (value, priv->stats.to_structure ());
  else if (id == PROP_STATS_INTERVAL)
    g_value_set_uint (value, priv->reporter.interval ());
  else if (!camera_properties ().get (priv->settings.camera, id, value) &&
           !strip_properties ().get (priv->settings, id, value))
    G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
}

static void
gst_strip_render_finalize (GObject *object)
{
  GstStripRenderPrivate *priv = GST_STRIP_RENDER (object)->priv;
  g_clear_error (&priv->gl_error);
  g_clear_error (&priv->output_error);
  gst_clear_caps (&priv->input);
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

  strip_render_category (); /* exists from here on, for GST_DEBUG */

  object_class->set_property = gst_strip_render_set_property;
  object_class->get_property = gst_strip_render_get_property;
  object_class->finalize = gst_strip_render_finalize;
  strip_properties ().install (
      object_class, camera_properties ().install (object_class, PROP_CAMERA));
  install_stats (object_class, PROP_STATS,
      "Counters since the element was started: frames, frame-sets, repeated, dropped, "
      "uploaded-total; of the last frame: points, vertices, triangles, strips, isolated, "
      "uploaded-bytes");
  StatsReporter::install (object_class, PROP_STATS_INTERVAL);

  gst_element_class_add_static_pad_template (element_class, &sink_template);
  gst_element_class_add_static_pad_template (element_class, &src_template);
  gst_element_class_set_static_metadata (element_class, "Strip renderer", "Filter/Converter/Video",
      "Renders range images with OpenGL without building a mesh", "gst-rangecast");
  element_class->change_state = GST_DEBUG_FUNCPTR (gst_strip_render_change_state);

  transform_class->transform_caps = GST_DEBUG_FUNCPTR (gst_strip_render_transform_caps);
  transform_class->fixate_caps = GST_DEBUG_FUNCPTR (gst_strip_render_fixate_caps);
  transform_class->set_caps = GST_DEBUG_FUNCPTR (gst_strip_render_set_caps);
  transform_class->get_unit_size = GST_DEBUG_FUNCPTR (gst_strip_render_get_unit_size);
  transform_class->propose_allocation = GST_DEBUG_FUNCPTR (gst_strip_render_propose_allocation);
  transform_class->decide_allocation = GST_DEBUG_FUNCPTR (gst_strip_render_decide_allocation);

  filter_class->supported_gl_api =
      GstGLAPI (GST_GL_API_OPENGL | GST_GL_API_OPENGL3 | GST_GL_API_GLES2);
  filter_class->gl_start = GST_DEBUG_FUNCPTR (gst_strip_render_gl_start);
  filter_class->gl_stop = GST_DEBUG_FUNCPTR (gst_strip_render_gl_stop);
  filter_class->gl_set_caps = GST_DEBUG_FUNCPTR (gst_strip_render_gl_set_caps);

  transform_class->submit_input_buffer = GST_DEBUG_FUNCPTR (gst_strip_render_submit_input_buffer);
  transform_class->generate_output = GST_DEBUG_FUNCPTR (gst_strip_render_generate_output);
  transform_class->transform = GST_DEBUG_FUNCPTR (gst_strip_render_transform);
  transform_class->transform_meta = GST_DEBUG_FUNCPTR (gst_strip_render_transform_meta);
  transform_class->sink_event = GST_DEBUG_FUNCPTR (gst_strip_render_sink_event);
  transform_class->src_event = GST_DEBUG_FUNCPTR (gst_strip_render_src_event);
  transform_class->query = GST_DEBUG_FUNCPTR (gst_strip_render_query);
  transform_class->start = GST_DEBUG_FUNCPTR (gst_strip_render_start);
  transform_class->stop = GST_DEBUG_FUNCPTR (gst_strip_render_stop);
}
