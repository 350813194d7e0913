/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-striprender
 * @title: striprender
 *
 * Renders range images without building a mesh. The virtual camera orbits the point
 * that the rig's cameras look at, controlled by properties and by navigation events: left-drag
 * orbits, other buttons pan, the wheel, + and - zoom, arrows orbit, r and Home reset. With
 * #GstStripRender:fit it is centred on the content.
 *
 * If downstream requests a frame rate, the element generates it by repeating and dropping frame
 * sets, and in a live pipeline repeats the last one while the stream stalls.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 avatartestsrc ! rangealign ! striprender auto-orbit=30 ! autovideosink
 * gst-launch-1.0 avatartestsrc range-person-only=true ! striprender fit=true \
 *   background-shade=0.5 ! autovideosink
 * ]|
 *
 * It draws into system memory with the CPU, or with OpenGL into OpenGL memory:
 * #GstStripRender:backend.
 *
 * Since: 0.1
 */

#include <algorithm>
#include <gstrange/gstrangestatus.hpp>
#include <utility>

#include "common/elementproperties.hpp"
#include "common/matcher.hpp"
#include "striprenderprivate.hpp"

using rangecast::Status;

GST_DEBUG_CATEGORY (strip_render_debug);

static GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE (
    "sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS (GST_RANGE_CAPS));
static GstStaticPadTemplate src_template =
    GST_STATIC_PAD_TEMPLATE ("src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS (STRIP_CAPS));

G_DEFINE_TYPE (GstStripRender, gst_strip_render, GST_TYPE_AGGREGATOR)
GST_ELEMENT_REGISTER_DEFINE (
    striprender, "striprender", GST_RANK_NONE, gst_strip_render_get_type ())

/* ---- backends ---- */

namespace {

bool
is_gl (const GstCaps *caps)
{
  const GstCapsFeatures *features = gst_caps_get_features (caps, 0);
  return gst_caps_features_contains (features, "memory:GLMemory");
}

/* What the backend may output for downstream's caps. Returns: (transfer full) */
GstCaps *
caps_of_backend (GstStripRender *self, GstCaps *downstream)
{
  static GstStaticCaps gl_caps = GST_STATIC_CAPS (STRIP_GL_CAPS),
                       system_caps = GST_STATIC_CAPS (STRIP_SYSTEM_CAPS);
  GstStripRenderPrivate *priv = self->priv;
  GstCaps *gl = gst_static_caps_get (&gl_caps), *system = gst_static_caps_get (&system_caps);
  const RenderBackendChoice choice = settings_of (priv).backend;
  bool by_gl = choice == RenderBackendChoice::kOpenGl;
  if (choice == RenderBackendChoice::kAuto && gst_caps_can_intersect (downstream, gl))
    by_gl = !gst_caps_can_intersect (downstream, system) ||
            (!priv->lost_opengl && priv->gl.is_fast (GST_ELEMENT (self)));
  gst_caps_unref (by_gl ? system : gl);
  return by_gl ? gl : system;
}

/* Makes what draws pictures of the output's caps. */
bool
start_backend (GstStripRender *self, GError **error)
{
  GstStripRenderPrivate *priv = self->priv;
  if (priv->is_gl)
    priv->backend =
        priv->gl.start (GST_ELEMENT (self), priv->out, std::move (priv->backend), error);
  else
    priv->backend = make_software_backend (priv->out);
  if (!priv->backend)
    return false;
  GST_INFO_OBJECT (self, "drawing with backend %s", priv->backend->name ());
  std::lock_guard guard (priv->lock);
  priv->stats.backend = priv->backend->name ();
  return true;
}

/* @return whether the pool can have such buffers of the query's caps */
bool
configure_pool (GstBufferPool *pool, GstQuery *query, guint size, guint min, guint max)
{
  GstCaps *caps;
  gst_query_parse_allocation (query, &caps, nullptr);
  GstStructure *config = gst_buffer_pool_get_config (pool);
  gst_buffer_pool_config_set_params (config, caps, size, min, max);
  if (is_gl (caps) || gst_query_find_allocation_meta (query, GST_VIDEO_META_API_TYPE, nullptr))
    gst_buffer_pool_config_add_option (config, GST_BUFFER_POOL_OPTION_VIDEO_META);
  if (is_gl (caps)) /* its other contexts wait for our commands */
    gst_buffer_pool_config_add_option (config, "GstBufferPoolOptionGLSyncMeta");
  return gst_buffer_pool_set_config (pool, config);
}

/* Answers the query with downstream's pool if we can draw into its buffers, else with a new one. */
bool
choose_pool (GstStripRender *self, GstQuery *query)
{
  GstStripRenderPrivate *priv = self->priv;
  GstBufferPool *pool = nullptr;
  guint size = 0, min = 0, max = 0;
  const bool offered = gst_query_get_n_allocation_pools (query) > 0;
  if (offered)
    gst_query_parse_nth_allocation_pool (query, 0, &pool, &size, &min, &max);
  size = std::max (size, guint (GST_VIDEO_INFO_SIZE (&priv->out)));
  const bool is_usable = pool && (!priv->is_gl || priv->gl.can_use (pool));
  if (!is_usable || !configure_pool (pool, query, size, min, max)) {
    gst_clear_object (&pool);
    pool = priv->is_gl ? priv->gl.make_pool () : gst_video_buffer_pool_new ();
    max = 0;
    if (!configure_pool (pool, query, size, min, max)) {
      gst_object_unref (pool);
      return false;
    }
  }
  if (offered)
    gst_query_set_nth_allocation_pool (query, 0, pool, size, min, max);
  else
    gst_query_add_allocation_pool (query, pool, size, min, max);
  gst_object_unref (pool);
  return true;
}

} // namespace

static gboolean
gst_strip_render_decide_allocation (GstAggregator *aggregator, GstQuery *query)
{
  auto self = GST_STRIP_RENDER (aggregator);
  for (guint i = 0;
       GstEvent *tags = gst_pad_get_sticky_event (GST_PAD (self->priv->sink), GST_EVENT_TAG, i);
       i++)
    gst_pad_push_event (aggregator->srcpad, tags); /* sends none twice */
  GError *error = nullptr;
  const bool ready = start_backend (self, &error) && choose_pool (self, query);
  if (error)
    GST_ELEMENT_ERROR (
        self, RESOURCE, NOT_FOUND, ("OpenGL cannot be used: %s", error->message), (nullptr));
  g_clear_error (&error);
  return ready;
}

/* ---- caps ---- */

namespace {

constexpr int kMaxFrameRate = 1000; /* above that a period is too short for times in ns */

/* The frame rate that all structures of caps have, else nullptr. */
const GValue *
frame_rate (const GstCaps *caps)
{
  const GValue *rate = nullptr;
  for (guint i = 0; caps && i < gst_caps_get_size (caps); i++) {
    const GValue *own = gst_structure_get_value (gst_caps_get_structure (caps, i), "framerate");
    if (!own || (rate && gst_value_compare (rate, own) != GST_VALUE_EQUAL))
      return nullptr;
    rate = own;
  }
  return rate;
}

GstCaps *
filtered (GstCaps *caps, GstCaps *filter)
{
  if (!filter)
    return caps;
  GstCaps *result = gst_caps_intersect_full (filter, caps, GST_CAPS_INTERSECT_FIRST);
  gst_caps_unref (caps);
  return result;
}

/* Any size, and any frame rate up to kMaxFrameRate. Returns: (transfer full)
 *
 * One structure; fixation prefers the input's rate. Two structures that differ only in their rates
 * would be merged by elements downstream that simplify caps, into caps that are no longer a subset
 * of ours (GStreamer 1.22). */
GstCaps *
output_caps (GstCaps *output_template, GstCaps *filter)
{
  GstCaps *output = gst_caps_copy (output_template);
  gst_caps_set_simple (
      output, "framerate", GST_TYPE_FRACTION_RANGE, 0, 1, kMaxFrameRate, 1, nullptr);
  return filtered (output, filter);
}

/* Input caps for an output: its frame rate first, so that sources prefer it, then any.
 * Returns: (transfer full) */
GstCaps *
input_caps (const GstCaps *output, GstCaps *input_template, GstCaps *filter)
{
  GstCaps *input = gst_caps_copy (input_template);
  if (const GValue *rate = frame_rate (output)) {
    GstCaps *same = gst_caps_copy (input);
    gst_caps_set_value (same, "framerate", rate);
    input = gst_caps_merge (same, input);
  }
  return filtered (input, filter);
}

/* The input's, or near it; 30 if the input has none and downstream requires one. */
void
fixate_rate (GstStructure *s, const GstCaps *input)
{
  int n = 0, d = 1;
  gst_structure_get_fraction (gst_caps_get_structure (input, 0), "framerate", &n, &d);
  GValue none = G_VALUE_INIT;
  g_value_init (&none, GST_TYPE_FRACTION);
  gst_value_set_fraction (&none, 0, 1);
  const GValue *wanted = gst_structure_get_value (s, "framerate");
  if (n == 0 && wanted && !gst_value_intersect (nullptr, wanted, &none))
    n = 30;
  g_value_unset (&none);
  gst_structure_fixate_field_nearest_fraction (s, "framerate", n, d);
}

/* Width and height for both eyes together. */
void
fixate_size (GstStructure *s)
{
  const gchar *mode = gst_structure_get_string (s, "multiview-mode");
  guint flags = 0, mask = 0;
  gst_structure_get_flagset (s, "multiview-flags", &flags, &mask);
  const bool half = (flags & mask & GST_VIDEO_MULTIVIEW_FLAGS_HALF_ASPECT) != 0;
  const bool wide = !half && g_strcmp0 (mode, "side-by-side") == 0;
  const bool high = !half && g_strcmp0 (mode, "top-bottom") == 0;
  gst_structure_fixate_field_nearest_int (s, "width", wide ? 1280 : 640);
  gst_structure_fixate_field_nearest_int (s, "height", high ? 960 : 480);
}

/* One picture of 640x480, or that much for each eye, with the input's rate or near it.
 * @param caps  transfer full. Returns: (transfer full) */
GstCaps *
fixate_output (GstCaps *caps, const GstCaps *input)
{
  caps = gst_caps_make_writable (gst_caps_truncate (caps));
  GstStructure *s = gst_caps_get_structure (caps, 0);
  fixate_rate (s, input);
  gst_structure_fixate_field_string (s, "multiview-mode", "mono");
  if (g_strcmp0 (gst_structure_get_string (s, "multiview-mode"), "separated") == 0)
    gst_structure_set (s, "views", G_TYPE_INT, 2, nullptr);
  fixate_size (s);
  if (gst_structure_has_field (s, "pixel-aspect-ratio"))
    gst_structure_fixate_field_nearest_fraction (s, "pixel-aspect-ratio", 1, 1);
  else
    gst_structure_set (s, "pixel-aspect-ratio", GST_TYPE_FRACTION, 1, 1, nullptr);
  return gst_caps_fixate (caps);
}

/* rangealign may correct poses at any time: a fit outlasts that. */
bool
handle_input_caps (GstStripRender *self, GstCaps *caps)
{
  GstStripRenderPrivate *priv = self->priv;
  if (priv->input && gst_caps_is_equal (caps, priv->input))
    return true;
  strip_drain (self);
  gstrange::RangeInfo info;
  const Status status = gstrange::parse_caps (caps, info);
  if (status.ok ()) {
    /* The output depends on the rate alone: rangealign corrects poses often. */
    if (!priv->input || info.fps_n != priv->info.fps_n || info.fps_d != priv->info.fps_d)
      gst_pad_mark_reconfigure (GST_AGGREGATOR_SRC_PAD (self));
    priv->info = std::move (info);
    if (!priv->scene.set_rig (priv->info.rig))
      priv->fit.reset ();
    priv->reporter.set_views (priv->info.rig);
    gst_caps_replace (&priv->input, caps);
  }
  return gst_range_flow_return (GST_ELEMENT (self), status) == GST_FLOW_OK;
}

/* Sources prefer the frame rate that downstream requests. */
void
answer_caps (GstStripRender *self, GstQuery *query)
{
  GstCaps *filter = nullptr, *input = gst_static_pad_template_get_caps (&sink_template);
  gst_query_parse_caps (query, &filter);
  GstCaps *output = gst_pad_get_allowed_caps (GST_AGGREGATOR_SRC_PAD (self));
  GstCaps *caps = input_caps (output, input, filter);
  gst_query_set_caps_result (query, caps);
  gst_caps_unref (caps);
  gst_clear_caps (&output);
  gst_caps_unref (input);
}

} // namespace

static GstFlowReturn
gst_strip_render_update_src_caps (GstAggregator *aggregator, GstCaps *wanted, GstCaps **caps)
{
  GstStripRenderPrivate *priv = GST_STRIP_RENDER (aggregator)->priv;
  if (!priv->input)
    return GST_AGGREGATOR_FLOW_NEED_DATA;
  auto self = GST_STRIP_RENDER (aggregator);
  GstCaps *output = caps_of_backend (self, wanted);
  const bool built = !gst_caps_is_empty (output), fits = gst_caps_can_intersect (output, wanted);
  *caps = output_caps (output, wanted);
  gst_caps_unref (output);
  if (!gst_caps_is_empty (*caps))
    return GST_FLOW_OK;
  gst_clear_caps (caps);
  const bool by_gl = settings_of (self->priv).backend == RenderBackendChoice::kOpenGl;
  const char *reason =
      !built  ? "striprender was built without OpenGL; use backend=auto"
      : fits  ? "frame rates above 1000/1 are not supported"
      : by_gl ? "backend=opengl outputs OpenGL memory; add gldownload, or use backend=auto"
              : "backend=software outputs system memory; add glupload, or use backend=auto";
  GST_ELEMENT_ERROR (self, CORE, NEGOTIATION, ("Downstream accepts no output: %s", reason),
      ("downstream: %" GST_PTR_FORMAT, wanted));
  return GST_FLOW_NOT_NEGOTIATED;
}

static gboolean
gst_strip_render_negotiated_src_caps (GstAggregator *aggregator, GstCaps *caps)
{
  auto self = GST_STRIP_RENDER (aggregator);
  GstStripRenderPrivate *priv = self->priv;
  GST_INFO_OBJECT (self, "from %" GST_PTR_FORMAT " to %" GST_PTR_FORMAT, priv->input, caps);
  const GstStructure *s = gst_caps_get_structure (caps, 0);
  if (gst_structure_has_field_typed (s, "multiview-flags", G_TYPE_STRING)) {
    GST_ELEMENT_ERROR (self, STREAM, FORMAT,
        ("multiview-flags in the caps is a string; write (GstVideoMultiviewFlagsSet) before its "
         "value"),
        (nullptr));
    return FALSE;
  }
  if (!gst_video_info_from_caps (&priv->out, caps))
    return FALSE;
  priv->is_gl = is_gl (caps);
  const GstVideoInfo &out = priv->out;
  const bool is_inputs =
      gst_util_fraction_compare (out.fps_n, out.fps_d, priv->info.fps_n, priv->info.fps_d) == 0;
  priv->period = out.fps_n > 0 && (!is_inputs || settings_of (priv).keep_rate)
                     ? gst_util_uint64_scale (GST_SECOND, guint64 (out.fps_d), guint64 (out.fps_n))
                     : 0;
  gst_aggregator_set_latency (aggregator, priv->period, priv->period);
  return TRUE;
}

/* ---- events and queries ---- */

static gboolean
gst_strip_render_sink_event (GstAggregator *aggregator, GstAggregatorPad *pad, GstEvent *event)
{
  auto self = GST_STRIP_RENDER (aggregator);
  switch (GST_EVENT_TYPE (event)) {
    case GST_EVENT_CAPS: {
      GstCaps *caps;
      gst_event_parse_caps (event, &caps);
      const bool accepted = handle_input_caps (self, caps);
      gst_event_unref (event);
      return accepted;
    }
    case GST_EVENT_SEGMENT: {
      if (refuse_bytes (pad, event))
        return FALSE;
      const GstSegment *segment;
      gst_event_parse_segment (event, &segment);
      strip_drain (self);
      strip_reset_stream (self);
      gst_aggregator_update_segment (
          aggregator, segment); /* pictures keep the times of the input */
      break;
    }
    case GST_EVENT_SEGMENT_DONE:
      strip_drain (self);
      break;
    case GST_EVENT_TAG: /* GstAggregator forwards none; those before caps follow them */
      if (gst_pad_has_current_caps (GST_AGGREGATOR_SRC_PAD (self)))
        return gst_pad_push_event (GST_AGGREGATOR_SRC_PAD (self), event);
      break;
    default:
      break;
  }
  return GST_AGGREGATOR_CLASS (gst_strip_render_parent_class)->sink_event (aggregator, pad, event);
}

static gboolean
gst_strip_render_sink_query (GstAggregator *aggregator, GstAggregatorPad *pad, GstQuery *query)
{
  auto self = GST_STRIP_RENDER (aggregator);
  switch (GST_QUERY_TYPE (query)) {
    case GST_QUERY_CAPS:
      answer_caps (self, query);
      return TRUE;
    case GST_QUERY_CONTEXT:
      if (self->priv->gl.answer (GST_ELEMENT (self), query))
        return TRUE;
      break;
    default:
      break;
  }
  return GST_AGGREGATOR_CLASS (gst_strip_render_parent_class)->sink_query (aggregator, pad, query);
}

static gboolean
gst_strip_render_src_event (GstAggregator *aggregator, GstEvent *event)
{
  auto self = GST_STRIP_RENDER (aggregator);
  GstStripRenderPrivate *priv = self->priv;
  if (GST_EVENT_TYPE (event) == GST_EVENT_NAVIGATION) { /* GstAggregator forwards none */
    StripRenderSettings before, after;
    bool handled;
    {
      std::lock_guard guard (priv->lock);
      before = priv->settings;
      handled = priv->settings.camera.handle (event);
      after = priv->settings;
    }
    strip_properties ().notify_changes (G_OBJECT (self), before, after);
    if (!handled)
      return gst_pad_push_event (GST_PAD (priv->sink), event);
    gst_event_unref (event);
    return TRUE;
  }
  if (GST_EVENT_TYPE (event) == GST_EVENT_LATENCY) {
    GstClockTime latency;
    gst_event_parse_latency (event, &latency);
    priv->pipeline_latency = GST_CLOCK_TIME_IS_VALID (latency) ? latency : 0;
  } else if (GST_EVENT_TYPE (event) == GST_EVENT_QOS) {
    GstQOSType type;
    GstClockTimeDiff diff;
    GstClockTime time;
    gst_event_parse_qos (event, &type, nullptr, &diff, &time);
    if (diff > 0 && type != GST_QOS_TYPE_THROTTLE)
      diff *= 2; /* to catch up, instead of being just as late again; as GstVideoDecoder */
    if (GST_CLOCK_TIME_IS_VALID (time))
      priv->earliest = diff < 0 && GstClockTime (-diff) > time ? 0 : time + diff;
  }
  return GST_AGGREGATOR_CLASS (gst_strip_render_parent_class)->src_event (aggregator, event);
}

static gboolean
gst_strip_render_src_query (GstAggregator *aggregator, GstQuery *query)
{
  auto self = GST_STRIP_RENDER (aggregator);
  if (GST_QUERY_TYPE (query) == GST_QUERY_CONTEXT &&
      self->priv->gl.answer (GST_ELEMENT (self), query))
    return TRUE;
  if (GST_QUERY_TYPE (query) == GST_QUERY_SEEKING) /* GstAggregator says no */
    return gst_pad_peer_query (GST_PAD (self->priv->sink), query);
  return GST_AGGREGATOR_CLASS (gst_strip_render_parent_class)->src_query (aggregator, query);
}

/* ---- states ---- */

static std::vector<StatsRow>
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

static GstStructure *
make_stats (const GstStripRenderPrivate *priv)
{
  const RenderStats &s = priv->stats;
  return gst_structure_new ("application/x-striprender-stats", "frames", G_TYPE_UINT64, s.frames,
      "frame-sets", G_TYPE_UINT64, s.frame_sets, "repeated", G_TYPE_UINT64, s.repeated, "dropped",
      G_TYPE_UINT64, s.dropped, "points", G_TYPE_UINT64, s.points, "vertices", G_TYPE_UINT64,
      s.vertices, "triangles", G_TYPE_UINT64, s.triangles, "strips", G_TYPE_UINT64, s.strips,
      "isolated", G_TYPE_UINT64, s.isolated, "uploaded-bytes", G_TYPE_UINT64, s.uploaded_bytes,
      "uploaded-total", G_TYPE_UINT64, s.uploaded_total, "backend", G_TYPE_STRING, s.backend,
      nullptr);
}

static gboolean
gst_strip_render_start (GstAggregator *aggregator)
{
  auto self = GST_STRIP_RENDER (aggregator);
  GstStripRenderPrivate *priv = self->priv;
  priv->first_running = GST_CLOCK_TIME_NONE;
  priv->lost_opengl = false;
  priv->fit.reset ();
  priv->reporter.start (GST_ELEMENT (self), collect_stats);
  std::lock_guard guard (priv->lock);
  priv->stats = {};
  priv->pipeline_latency = 0;
  priv->settings.camera.release ();
  return TRUE;
}

static gboolean
gst_strip_render_stop (GstAggregator *aggregator)
{
  auto self = GST_STRIP_RENDER (aggregator);
  self->priv->reporter.stop ();
  strip_reset_stream (self);
  gst_clear_caps (&self->priv->input);
  self->priv->scene.reset ();
  self->priv->backend.reset ();
  self->priv->gl.close ();
  return TRUE;
}

static void
gst_strip_render_init (GstStripRender *self)
{
  self->priv = new GstStripRenderPrivate;
  self->priv->sink = add_sink_pad (GST_ELEMENT (self), "sink");
}

static void
gst_strip_render_class_init (GstStripRenderClass *klass)
{
  auto object_class = G_OBJECT_CLASS (klass);
  auto element_class = GST_ELEMENT_CLASS (klass);
  auto aggregator_class = GST_AGGREGATOR_CLASS (klass);

  GST_DEBUG_CATEGORY_INIT (strip_render_debug, "striprender", 0, "Strip renderer");

  object_class->finalize = delete_private<GstStripRender>;
  install_properties<GstStripRender, strip_properties, make_stats> (object_class,
      "Counters since the element was started: frames, frame-sets, repeated, dropped, "
      "uploaded-total; of the last frame: points, vertices, triangles, strips, isolated, "
      "uploaded-bytes; backend: which one draws");

  for (GstStaticPadTemplate *pad_template : {&sink_template, &src_template})
    gst_element_class_add_static_pad_template_with_gtype (
        element_class, pad_template, GST_TYPE_AGGREGATOR_PAD);
  gst_element_class_set_static_metadata (element_class, "Strip renderer", "Filter/Converter/Video",
      "Renders range images without building a mesh", "gst-rangecast");
  element_class->set_context = [] (GstElement *element, GstContext *context) {
    GST_STRIP_RENDER (element)->priv->gl.set (element, context);
    GST_ELEMENT_CLASS (gst_strip_render_parent_class)->set_context (element, context);
  };

  aggregator_class->update_src_caps = GST_DEBUG_FUNCPTR (gst_strip_render_update_src_caps);
  aggregator_class->fixate_src_caps = [] (GstAggregator *aggregator, GstCaps *caps) {
    return fixate_output (caps, GST_STRIP_RENDER (aggregator)->priv->input);
  };
  aggregator_class->negotiated_src_caps = GST_DEBUG_FUNCPTR (gst_strip_render_negotiated_src_caps);
  aggregator_class->decide_allocation = GST_DEBUG_FUNCPTR (gst_strip_render_decide_allocation);
  aggregator_class->sink_event = GST_DEBUG_FUNCPTR (gst_strip_render_sink_event);
  aggregator_class->sink_query = GST_DEBUG_FUNCPTR (gst_strip_render_sink_query);
  aggregator_class->src_event = GST_DEBUG_FUNCPTR (gst_strip_render_src_event);
  aggregator_class->src_query = GST_DEBUG_FUNCPTR (gst_strip_render_src_query);
  aggregator_class->aggregate = aggregate_to_the_end<gst_strip_render_aggregate>;
  aggregator_class->get_next_time = GST_DEBUG_FUNCPTR (gst_strip_render_get_next_time);
  aggregator_class->flush = [] (GstAggregator *aggregator) {
    strip_reset_stream (GST_STRIP_RENDER (aggregator));
    return GST_FLOW_OK;
  };
  aggregator_class->start = GST_DEBUG_FUNCPTR (gst_strip_render_start);
  aggregator_class->stop = GST_DEBUG_FUNCPTR (gst_strip_render_stop);
}
