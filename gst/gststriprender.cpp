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
 * gst-launch-1.0 avatartestsrc is-live=true ! cylinderfilter ! striprender auto-orbit=30 !
 * glimagesink
 * ]|
 *
 * Without a display: `GST_GL_PLATFORM=egl GST_GL_WINDOW=egl-device`, and gldownload behind it.
 *
 * Since: 0.1
 */
#include "gststriprender.h"

#include <gst/video/navigation.h>
#include <gst/video/video.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <gstrange/gstrangeframe.hpp>
#include <gstrange/gstrangeinfo.hpp>
#include <gstrange/gstrangestatus.hpp>
#include <mutex>
#include <opencv2/core/utility.hpp>
#include <vector>

#include "strippainter.hpp"

using rangecast::Orbit;
using rangecast::RangeImage;
using rangecast::Status;
using rangecast::StatusCode;
using rangecast::StripMode;
using rangecast::StripVertex;

GST_DEBUG_CATEGORY_STATIC (gst_strip_render_debug);
#define GST_CAT_DEFAULT gst_strip_render_debug

enum {
  PROP_0,
  PROP_MODE,
  PROP_AZIMUTH,
  PROP_ELEVATION,
  PROP_DISTANCE,
  PROP_FIELD_OF_VIEW,
  PROP_PAN_X,
  PROP_PAN_Y,
  PROP_PAN_Z,
  PROP_AUTO_ORBIT,
  PROP_BACKGROUND,
  PROP_DEPTH_STEP,
  PROP_MAX_GAP,
  PROP_POINT_SIZE,
  PROP_STATS
};

static constexpr guint kDefaultBackground = 0xff20242a;
static constexpr rangecast::StripSettings kDefaults;
static constexpr double kZoomStep = 1.1;

struct RenderSettings {
  Orbit orbit;
  double auto_orbit = 0; /* degrees a second */
  guint background = kDefaultBackground;
  double point_size = 1;
  rangecast::StripSettings strips;
};

struct RenderStats {
  guint64 frames = 0, points = 0, vertices = 0, triangles = 0, strips = 0, isolated = 0,
          uploaded_bytes = 0;
};

/* The mouse, between its events. */
struct Drag {
  int button = 0; /* 0: none is down */
  double x = 0, y = 0;
};

struct GstStripRenderPrivate {
  std::mutex lock; /* guards what follows; never held across a push, event or message */
  RenderSettings settings;
  RenderStats stats;
  Drag drag;
  double distance_m = 1;                 /* in force, for zooming */
  int out_width = 640, out_height = 480; /* for dragging */

  /* streaming thread only, or the GL thread while the streaming thread waits for it */
  gstrange::RangeInfo info;
  rangecast::SceneFrame scene;
  GstVideoInfo out;
  GstClockTime first_running = GST_CLOCK_TIME_NONE; /* of the first frame: where auto-orbit began */
  GstGLFramebuffer *framebuffer = nullptr;
  StripPainter painter;
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

#define GST_TYPE_STRIP_RENDER_MODE (gst_strip_render_mode_get_type ())
static GType
gst_strip_render_mode_get_type (void)
{
  static const GType type = [] {
    static const GEnumValue values[] = {
        {int (StripMode::kStrips), "Bands of triangles along the rows", "strips"},
        {int (StripMode::kRectangles), "One rectangle a pixel", "rectangles"},
        {int (StripMode::kPoints), "One point a pixel", "points"}, {}};
    return g_enum_register_static ("GstStripRenderMode", values);
  }();
  return type;
}

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
  {
    std::lock_guard guard (priv->lock);
    priv->out_width = GST_VIDEO_INFO_WIDTH (&priv->out);
    priv->out_height = GST_VIDEO_INFO_HEIGHT (&priv->out);
  }
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

/* Buffers downstream are OpenGL's, of our context. */
static gboolean
gst_strip_render_decide_allocation (GstBaseTransform *base, GstQuery *query)
{
  if (!gst_gl_base_filter_find_gl_context (GST_GL_BASE_FILTER (base)))
    return FALSE;
  GstGLContext *context = GST_GL_BASE_FILTER (base)->context;
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
    pool = gst_gl_buffer_pool_new (context);
  size = guint (GST_VIDEO_INFO_SIZE (&GST_STRIP_RENDER (base)->priv->out));

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
  return configured &&
         GST_BASE_TRANSFORM_CLASS (gst_strip_render_parent_class)->decide_allocation (base, query);
}

/* ---- OpenGL's life ---- */

static gboolean
gst_strip_render_gl_start (GstGLBaseFilter *filter)
{
  auto self = GST_STRIP_RENDER (filter);
  GError *error = nullptr;
  if (!self->priv->painter.start (filter->context, &error)) {
    GST_ELEMENT_ERROR (self, RESOURCE, NOT_FOUND,
        ("OpenGL cannot be used: %s", error ? error->message : "no shader"), (nullptr));
    g_clear_error (&error);
    return FALSE;
  }
  return TRUE;
}

static void
gst_strip_render_gl_stop (GstGLBaseFilter *filter)
{
  GstStripRenderPrivate *priv = GST_STRIP_RENDER (filter)->priv;
  priv->painter.stop ();
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
  GstGLMemory *target;
  guint64 uploaded = 0;
  gboolean drawn = FALSE;
};

static gboolean
draw_bound (gpointer user_data)
{
  auto job = static_cast<DrawJob *> (user_data);
  job->uploaded = job->self->priv->painter.draw (job->picture, job->layers);
  return TRUE;
}

static void
draw_in_gl_thread (GstGLContext *, gpointer user_data)
{
  auto job = static_cast<DrawJob *> (user_data);
  job->drawn = gst_gl_framebuffer_draw_to_texture (
      job->self->priv->framebuffer, job->target, draw_bound, job);
}

static StripPainter::Picture
make_picture (GstStripRenderPrivate *priv, const RenderSettings &settings, GstClockTime running)
{
  const int width = GST_VIDEO_INFO_WIDTH (&priv->out), height = GST_VIDEO_INFO_HEIGHT (&priv->out);
  const double aspect = double (width) * GST_VIDEO_INFO_PAR_N (&priv->out) /
                        (double (height) * GST_VIDEO_INFO_PAR_D (&priv->out));
  Orbit orbit = settings.orbit;
  if (GST_CLOCK_TIME_IS_VALID (running)) {
    if (!GST_CLOCK_TIME_IS_VALID (priv->first_running) || running < priv->first_running)
      priv->first_running = running;
    running -= priv->first_running;
    orbit.azimuth_deg += std::fmod (settings.auto_orbit * double (running) / GST_SECOND, 360.0);
  }
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
  picture.width = width;
  picture.height = height;
  std::lock_guard guard (priv->lock);
  priv->distance_m = matrices.distance_m;
  return picture;
}

static void
build_all (GstStripRenderPrivate *priv, std::span<const RangeImage> images,
    const rangecast::StripSettings &settings, RenderStats &stats)
{
  std::array<rangecast::StripResult, rangecast::kMaxViews> results{};
  cv::parallel_for_ (cv::Range (0, int (images.size ())), [&] (const cv::Range &range) {
    for (int i = range.start; i < range.end; i++)
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

static GstFlowReturn
draw_frame (GstStripRender *self, const gstrange::RangeFrameMap &frame, GstBuffer *out,
    GstClockTime running)
{
  GstStripRenderPrivate *priv = self->priv;
  RenderSettings settings;
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

  GstMemory *memory = gst_buffer_peek_memory (out, 0);
  if (!gst_is_gl_memory (memory)) {
    GST_ELEMENT_ERROR (
        self, CORE, NEGOTIATION, (nullptr), ("the output buffer is not OpenGL memory"));
    return GST_FLOW_ERROR;
  }
  DrawJob job = {self, make_picture (priv, settings, running), {layers.data (), count},
      GST_GL_MEMORY_CAST (memory)};
  GstMapInfo map; /* tells whoever reads it on the CPU that the texture has changed */
  const auto flags = GstMapFlags (GST_MAP_WRITE | GST_MAP_GL);
  if (gst_memory_map (memory, &map, flags)) {
    gst_gl_context_thread_add (GST_GL_BASE_FILTER (self)->context, draw_in_gl_thread, &job);
    gst_memory_unmap (memory, &map);
  }
  if (!job.drawn) {
    GST_ELEMENT_ERROR (self, RESOURCE, WRITE, ("OpenGL could not draw into the output"), (nullptr));
    return GST_FLOW_ERROR;
  }
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
  if (GST_CLOCK_TIME_IS_VALID (pts))
    gst_object_sync_values (
        GST_OBJECT (self), gst_segment_to_stream_time (&base->segment, GST_FORMAT_TIME, pts));
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

/* Turns half a circle over the width of the picture; moves as far as the hand does. */
static void
drag_to (GstStripRenderPrivate *priv, double x, double y)
{
  const double dx = (x - priv->drag.x) / priv->out_width,
               dy = (y - priv->drag.y) / priv->out_height;
  Orbit &orbit = priv->settings.orbit;
  if (priv->drag.button == 1) {
    orbit.azimuth_deg = std::fmod (orbit.azimuth_deg - 180 * dx, 360.0);
    orbit.elevation_deg = std::clamp (orbit.elevation_deg + 90 * dy, -89.0, 89.0);
  } else {
    const double a = orbit.azimuth_deg * M_PI / 180;
    orbit.pan.x -= std::cos (a) * dx * priv->distance_m;
    orbit.pan.z += std::sin (a) * dx * priv->distance_m;
    orbit.pan.y += dy * priv->distance_m;
  }
  priv->drag.x = x;
  priv->drag.y = y;
}

static void
zoom (GstStripRenderPrivate *priv, double factor)
{
  priv->settings.orbit.distance_m = std::clamp (priv->distance_m * factor, 0.01, 1000.0);
  priv->distance_m = priv->settings.orbit.distance_m;
}

static void
reset_view (GstStripRenderPrivate *priv)
{
  priv->settings.orbit = {};
}

static bool
handle_key (GstStripRenderPrivate *priv, const gchar *key)
{
  Orbit &orbit = priv->settings.orbit;
  if (g_str_equal (key, "r"))
    reset_view (priv);
  else if (g_str_equal (key, "Left"))
    orbit.azimuth_deg -= 5;
  else if (g_str_equal (key, "Right"))
    orbit.azimuth_deg += 5;
  else if (g_str_equal (key, "Up"))
    orbit.elevation_deg = std::min (89.0, orbit.elevation_deg + 5);
  else if (g_str_equal (key, "Down"))
    orbit.elevation_deg = std::max (-89.0, orbit.elevation_deg - 5);
  else if (g_str_equal (key, "plus"))
    zoom (priv, 1 / kZoomStep);
  else if (g_str_equal (key, "minus"))
    zoom (priv, kZoomStep);
  else
    return false;
  return true;
}

/* @return whether the event meant something to us */
static bool
handle_navigation (GstStripRender *self, GstEvent *event)
{
  GstStripRenderPrivate *priv = self->priv;
  double x = 0, y = 0, delta_x = 0, delta_y = 0;
  gint button = 0;
  const gchar *key = nullptr;
  std::lock_guard guard (priv->lock);
  switch (gst_navigation_event_get_type (event)) {
    case GST_NAVIGATION_EVENT_MOUSE_BUTTON_PRESS:
      gst_navigation_event_parse_mouse_button_event (event, &button, &x, &y);
      if (button == 4 || button == 5)
        zoom (priv, button == 4 ? 1 / kZoomStep : kZoomStep);
      else
        priv->drag = {button, x, y};
      return true;
    case GST_NAVIGATION_EVENT_MOUSE_BUTTON_RELEASE:
      priv->drag.button = 0;
      return true;
    case GST_NAVIGATION_EVENT_MOUSE_MOVE:
      if (priv->drag.button == 0)
        return false;
      gst_navigation_event_parse_mouse_move_event (event, &x, &y);
      drag_to (priv, x, y);
      return true;
    case GST_NAVIGATION_EVENT_MOUSE_SCROLL:
      gst_navigation_event_parse_mouse_scroll_event (event, &x, &y, &delta_x, &delta_y);
      if (delta_y != 0)
        zoom (priv, delta_y > 0 ? 1 / kZoomStep : kZoomStep);
      return true;
    case GST_NAVIGATION_EVENT_KEY_PRESS:
      return gst_navigation_event_parse_key_event (event, &key) && key && handle_key (priv, key);
    default:
      return false;
  }
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
  {
    std::lock_guard guard (priv->lock);
    priv->stats = {};
    priv->drag = {};
  }
  return GST_BASE_TRANSFORM_CLASS (gst_strip_render_parent_class)->start (base);
}

static void
gst_strip_render_set_property (GObject *object, guint id, const GValue *value, GParamSpec *pspec)
{
  GstStripRenderPrivate *priv = GST_STRIP_RENDER (object)->priv;
  std::lock_guard guard (priv->lock);
  RenderSettings &settings = priv->settings;
  switch (id) {
    case PROP_MODE:
      settings.strips.mode = StripMode (g_value_get_enum (value));
      break;
    case PROP_AZIMUTH:
      settings.orbit.azimuth_deg = g_value_get_double (value);
      break;
    case PROP_ELEVATION:
      settings.orbit.elevation_deg = g_value_get_double (value);
      break;
    case PROP_DISTANCE:
      settings.orbit.distance_m = g_value_get_double (value);
      break;
    case PROP_FIELD_OF_VIEW:
      settings.orbit.fov_deg = g_value_get_double (value);
      break;
    case PROP_PAN_X:
      settings.orbit.pan.x = g_value_get_double (value);
      break;
    case PROP_PAN_Y:
      settings.orbit.pan.y = g_value_get_double (value);
      break;
    case PROP_PAN_Z:
      settings.orbit.pan.z = g_value_get_double (value);
      break;
    case PROP_AUTO_ORBIT:
      settings.auto_orbit = g_value_get_double (value);
      break;
    case PROP_BACKGROUND:
      settings.background = g_value_get_uint (value);
      break;
    case PROP_DEPTH_STEP:
      settings.strips.depth_step = g_value_get_double (value);
      break;
    case PROP_MAX_GAP:
      settings.strips.max_gap = g_value_get_int (value);
      break;
    case PROP_POINT_SIZE:
      settings.point_size = g_value_get_double (value);
      break;
    default:
      G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
  }
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
  const RenderSettings &settings = priv->settings;
  switch (id) {
    case PROP_MODE:
      g_value_set_enum (value, int (settings.strips.mode));
      break;
    case PROP_AZIMUTH:
      g_value_set_double (value, settings.orbit.azimuth_deg);
      break;
    case PROP_ELEVATION:
      g_value_set_double (value, settings.orbit.elevation_deg);
      break;
    case PROP_DISTANCE:
      g_value_set_double (value, settings.orbit.distance_m);
      break;
    case PROP_FIELD_OF_VIEW:
      g_value_set_double (value, settings.orbit.fov_deg);
      break;
    case PROP_PAN_X:
      g_value_set_double (value, settings.orbit.pan.x);
      break;
    case PROP_PAN_Y:
      g_value_set_double (value, settings.orbit.pan.y);
      break;
    case PROP_PAN_Z:
      g_value_set_double (value, settings.orbit.pan.z);
      break;
    case PROP_AUTO_ORBIT:
      g_value_set_double (value, settings.auto_orbit);
      break;
    case PROP_BACKGROUND:
      g_value_set_uint (value, settings.background);
      break;
    case PROP_DEPTH_STEP:
      g_value_set_double (value, settings.strips.depth_step);
      break;
    case PROP_MAX_GAP:
      g_value_set_int (value, settings.strips.max_gap);
      break;
    case PROP_POINT_SIZE:
      g_value_set_double (value, settings.point_size);
      break;
    case PROP_STATS:
      g_value_take_boxed (value, make_stats (priv->stats));
      break;
    default:
      G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
  }
}

static void
gst_strip_render_finalize (GObject *object)
{
  delete GST_STRIP_RENDER (object)->priv;
  G_OBJECT_CLASS (gst_strip_render_parent_class)->finalize (object);
}

static void
gst_strip_render_init (GstStripRender *self)
{
  self->priv = new GstStripRenderPrivate;
  gst_base_transform_set_qos_enabled (GST_BASE_TRANSFORM (self), TRUE);
}

static void
install_double (GObjectClass *object_class, guint id, const char *name, const char *nick,
    const char *blurb, double minimum, double maximum, double fallback)
{
  g_object_class_install_property (object_class, id,
      g_param_spec_double (name, nick, blurb, minimum, maximum, fallback,
          GParamFlags (G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_PLAYING |
                       GST_PARAM_CONTROLLABLE)));
}

static void
install_camera_properties (GObjectClass *c)
{
  install_double (c, PROP_AZIMUTH, "azimuth", "Azimuth",
      "Degrees round the scene from the first view, to the right (-360 to 360, default 0)", -360,
      360, 0);
  install_double (c, PROP_ELEVATION, "elevation", "Elevation",
      "Degrees above the first view's height (-89 to 89, default 0)", -89, 89, 0);
  install_double (c, PROP_DISTANCE, "distance", "Distance",
      "Metres from what is looked at (0 to 1000, default 0: the first view's distance)", 0, 1000,
      0);
  install_double (c, PROP_FIELD_OF_VIEW, "field-of-view", "Field of view",
      "Vertical angle in degrees (0 to 170, default 0: the first view's)", 0, 170, 0);
  install_double (c, PROP_PAN_X, "pan-x", "Pan x",
      "Metres by which what is looked at moves to the first view's right (default 0)", -1000, 1000,
      0);
  install_double (c, PROP_PAN_Y, "pan-y", "Pan y",
      "Metres by which what is looked at moves up (default 0)", -1000, 1000, 0);
  install_double (c, PROP_PAN_Z, "pan-z", "Pan z",
      "Metres by which what is looked at moves towards the first view (default 0)", -1000, 1000, 0);
  install_double (c, PROP_AUTO_ORBIT, "auto-orbit", "Auto orbit",
      "Degrees a second by which the azimuth grows by itself from the first frame on (-3600 to "
      "3600, "
      "default 0)",
      -3600, 3600, 0);
}

static void
install_drawing_properties (GObjectClass *c)
{
  const auto live = GParamFlags (G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS |
                                 GST_PARAM_MUTABLE_PLAYING | GST_PARAM_CONTROLLABLE);
  g_object_class_install_property (c, PROP_MODE,
      g_param_spec_enum ("mode", "Mode", "What is drawn for the points (default: strips)",
          GST_TYPE_STRIP_RENDER_MODE, int (StripMode::kStrips), live));
  g_object_class_install_property (c, PROP_BACKGROUND,
      g_param_spec_uint ("background", "Background",
          "Colour behind the scene, ARGB (default 0xff20242a)", 0, G_MAXUINT32, kDefaultBackground,
          live));
  install_double (c, PROP_DEPTH_STEP, "depth-step", "Depth step",
      "Neighbours that differ by more than this share of their depth are not joined (0 to 1, "
      "default 0.02)",
      0, 1, kDefaults.depth_step);
  g_object_class_install_property (c, PROP_MAX_GAP,
      g_param_spec_int ("max-gap", "Maximum gap",
          "Invalid pixels of a row that a strip bridges (0 to 1000, default 3)", 0, 1000,
          kDefaults.max_gap, live));
  install_double (c, PROP_POINT_SIZE, "point-size", "Point size",
      "Of mode points, in footprints of a pixel (0.1 to 100, default 1)", 0.1, 100, 1);
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
  install_camera_properties (object_class);
  install_drawing_properties (object_class);
  g_object_class_install_property (object_class, PROP_STATS,
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
