/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-avatartestsrc
 * @title: avatartestsrc
 *
 * A rig without cameras: a moving head and shoulders in a textured room, seen by stereo cameras
 * that stand round it. Request pads: `left`, `right` and `third` give the cameras of one view,
 * `src` gives exact range images. All pads are fed by one thread; where several are used, put a
 * queue behind each.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 avatartestsrc ! rangesplit name=s s.depth ! videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
#include "gstavatartestsrc.h"

#include <gst/base/gstflowcombiner.h>
#include <gst/video/gstvideopool.h>
#include <gst/video/video.h>

#include <array>
#include <condition_variable>
#include <gstrange/gstrange.h>
#include <gstrange/gstrangebufferpool.h>
#include <gstrange/gstrangeframe.hpp>
#include <gstrange/gstrangeinfo.hpp>
#include <gstrange/gstrangestatus.hpp>
#include <memory>
#include <mutex>
#include <rangecast/scene/scene.hpp>
#include <vector>

using rangecast::PixelFormat;
using rangecast::Rgbx;
using rangecast::Roi;
using rangecast::Scene;
using rangecast::SceneCamera;
using rangecast::SceneSettings;
using rangecast::Status;
using rangecast::StatusCode;

GST_DEBUG_CATEGORY_STATIC (gst_avatar_test_src_debug);
#define GST_CAT_DEFAULT gst_avatar_test_src_debug

enum {
  PROP_0,
  PROP_VIEWS,
  PROP_VIEW_ID,
  PROP_ARC,
  PROP_DISTANCE,
  PROP_BASELINE,
  PROP_SEED,
  PROP_NOISE,
  PROP_MOTION,
  PROP_EMPTY_FRAMES,
  PROP_NUM_BUFFERS,
  PROP_IS_LIVE,
  PROP_LOCATION,
  PROP_TEXTURE,
  PROP_RIG_EXPORT,
  PROP_RANGE_PERSON_ONLY,
  PROP_N_THREADS,
  PROP_STATS,
};

static constexpr int kAllViews = -1;

enum class PadKind { kLeft, kRight, kThird, kRange };

/* One request pad and its stream; all but `pad` and `kind` belong to the streaming thread. */
struct SourcePad {
  GstPad *pad;
  PadKind kind;

  bool needs_start = true, needs_segment = true, negotiated = false;
  GstVideoInfo video{};
  GstBufferPool *pool = nullptr;

  SourcePad (GstPad *p, PadKind k) : pad (GST_PAD (gst_object_ref (p))), kind (k) {}
  ~SourcePad ()
  {
    drop_pool ();
    gst_object_unref (pad);
  }
  SourcePad (const SourcePad &) = delete;
  SourcePad &operator= (const SourcePad &) = delete;
  void drop_pool ()
  {
    if (pool)
      gst_buffer_pool_set_active (pool, FALSE);
    gst_clear_object (&pool);
  }
};

using SourcePads = std::vector<std::shared_ptr<SourcePad>>;

struct Settings {
  SceneSettings scene;
  int view_id = kAllViews;
  guint empty_frames = 0;
  int num_buffers = -1;
  bool is_live = false;
  std::string rig_export;
  bool person_only = false;
  int n_threads = 0;
};

struct Counters {
  guint64 frames = 0, skipped = 0;
};

struct GstAvatarTestSrcPrivate {
  /* Guards settings, pads, combiner, counters and the four below; never held while pushing,
   * querying, posting or waiting for the clock. */
  std::mutex lock;
  std::condition_variable wake;
  Settings settings;
  SourcePads pads;
  GstFlowCombiner *combiner = gst_flow_combiner_new ();
  Counters counters;
  bool playing = false, stopping = false, eos_wanted = false;
  GstClockID clock_id = nullptr;

  /* Streaming thread only, and whoever starts it. */
  GstTask *task = nullptr;
  GRecMutex task_lock;
  Settings current; /* settings of this run */
  std::unique_ptr<Scene> scene;
  int fps_n = 0, fps_d = 1;
  guint group_id = 0;
  guint64 frame = 0;          /* pictures so far */
  guint64 rate_frame = 0;     /* since the frame rate changed */
  GstClockTime rate_base = 0; /* PTS where it changed */
  guint64 last_tick = G_MAXUINT64;
  std::vector<Rgbx> scratch;

  GstAvatarTestSrcPrivate () { g_rec_mutex_init (&task_lock); }
  ~GstAvatarTestSrcPrivate ()
  {
    gst_flow_combiner_free (combiner);
    g_rec_mutex_clear (&task_lock);
  }
};

struct _GstAvatarTestSrc {
  GstElement parent;
  GstAvatarTestSrcPrivate *priv;
};

#define RAW_CAPS GST_VIDEO_CAPS_MAKE ("{ RGBx, BGRx, RGB, BGR, GRAY8 }")

static GstStaticPadTemplate left_template =
    GST_STATIC_PAD_TEMPLATE ("left", GST_PAD_SRC, GST_PAD_REQUEST, GST_STATIC_CAPS (RAW_CAPS));
static GstStaticPadTemplate right_template =
    GST_STATIC_PAD_TEMPLATE ("right", GST_PAD_SRC, GST_PAD_REQUEST, GST_STATIC_CAPS (RAW_CAPS));
static GstStaticPadTemplate third_template =
    GST_STATIC_PAD_TEMPLATE ("third", GST_PAD_SRC, GST_PAD_REQUEST, GST_STATIC_CAPS (RAW_CAPS));
static GstStaticPadTemplate src_template =
    GST_STATIC_PAD_TEMPLATE ("src", GST_PAD_SRC, GST_PAD_REQUEST, GST_STATIC_CAPS (GST_RANGE_CAPS));

G_DEFINE_TYPE (GstAvatarTestSrc, gst_avatar_test_src, GST_TYPE_ELEMENT)
GST_ELEMENT_REGISTER_DEFINE (
    avatartestsrc, "avatartestsrc", GST_RANK_NONE, GST_TYPE_AVATAR_TEST_SRC)

static SourcePads
current_pads (GstAvatarTestSrc *self)
{
  std::lock_guard guard (self->priv->lock);
  return self->priv->pads;
}

/* ---- the scene ---- */

static Status
make_scene (GstAvatarTestSrc *self, int width, int height)
{
  auto priv = self->priv;
  const Settings &s = priv->current;
  if (s.view_id >= s.scene.views)
    return {StatusCode::kBadValue, "view-id " + std::to_string (s.view_id) +
                                       ": expected less than views, " +
                                       std::to_string (s.scene.views)};
  if (priv->scene && priv->current.scene.width == width && priv->current.scene.height == height)
    return {};
  priv->current.scene.width = width;
  priv->current.scene.height = height;
  if (Status status = Scene::create (priv->current.scene, priv->scene); !status.ok ())
    return status;
  priv->scratch.resize (static_cast<std::size_t> (width) * static_cast<std::size_t> (height));
  return s.rig_export.empty () ? Status ()
                               : rangecast::save_rig (s.rig_export, priv->scene->rig ());
}

/* ---- negotiation: one size and frame rate for all pads ---- */

static GstCaps *
sizes_of (GstCaps *caps)
{
  GstCaps *sizes = gst_caps_new_empty ();
  for (guint i = 0; i < gst_caps_get_size (caps); i++) {
    const GstStructure *from = gst_caps_get_structure (caps, i);
    GstStructure *to = gst_structure_new_empty ("size");
    for (const char *field : {"width", "height", "framerate"})
      if (const GValue *value = gst_structure_get_value (from, field))
        gst_structure_set_value (to, field, value);
    gst_caps_append_structure (sizes, to);
  }
  return sizes;
}

static GstCaps *
peer_caps_of (const SourcePad &pad)
{
  GstCaps *own = gst_pad_get_pad_template_caps (pad.pad);
  GstCaps *peer = gst_pad_peer_query_caps (pad.pad, own);
  gst_caps_unref (own);
  return peer;
}

/* The size and rate that all peers take, nearest to 320 x 240 at 30/s. */
static bool
choose_size (const SourcePads &pads, int &width, int &height, int &fps_n, int &fps_d)
{
  GstCaps *common = gst_caps_from_string ("size, width=(int)[16,4096], height=(int)[16,4096], "
                                          "framerate=(fraction)[1/1000,1000/1]");
  for (const auto &pad : pads) {
    GstCaps *peer = peer_caps_of (*pad), *sizes = sizes_of (peer);
    GstCaps *both = gst_caps_intersect_full (common, sizes, GST_CAPS_INTERSECT_FIRST);
    gst_caps_unref (peer);
    gst_caps_unref (sizes);
    gst_caps_replace (&common, both);
    gst_caps_unref (both);
  }
  const bool found = !gst_caps_is_empty (common);
  if (found) {
    common = gst_caps_make_writable (gst_caps_truncate (common));
    GstStructure *size = gst_caps_get_structure (common, 0);
    gst_structure_fixate_field_nearest_int (size, "width", 320);
    gst_structure_fixate_field_nearest_int (size, "height", 240);
    gst_structure_fixate_field_nearest_fraction (size, "framerate", 30, 1);
    gst_structure_get_int (size, "width", &width);
    gst_structure_get_int (size, "height", &height);
    gst_structure_get_fraction (size, "framerate", &fps_n, &fps_d);
  }
  gst_caps_unref (common);
  return found;
}

static GstCaps *
caps_for (GstAvatarTestSrc *self, const SourcePad &pad)
{
  auto priv = self->priv;
  GstCaps *wanted;
  if (pad.kind == PadKind::kRange) {
    rangecast::Rig rig = priv->scene->range_rig ();
    if (priv->current.view_id != kAllViews)
      rig.views = {*rig.find (priv->current.view_id)};
    wanted = gstrange::make_range_caps (gstrange::make_info (rig, priv->fps_n, priv->fps_d));
  } else {
    wanted = gst_caps_new_simple ("video/x-raw", "width", G_TYPE_INT, priv->current.scene.width,
        "height", G_TYPE_INT, priv->current.scene.height, "framerate", GST_TYPE_FRACTION,
        priv->fps_n, priv->fps_d, "pixel-aspect-ratio", GST_TYPE_FRACTION, 1, 1, "interlace-mode",
        G_TYPE_STRING, "progressive", nullptr);
  }
  GstCaps *peer = peer_caps_of (pad);
  GstCaps *both = gst_caps_intersect_full (peer, wanted, GST_CAPS_INTERSECT_FIRST);
  gst_caps_unref (peer);
  gst_caps_unref (wanted);
  return gst_caps_is_empty (both) ? both : gst_caps_fixate (both);
}

static bool
set_up_raw_pool (SourcePad &pad, GstCaps *caps)
{
  if (!gst_video_info_from_caps (&pad.video, caps))
    return false;
  guint size = static_cast<guint> (GST_VIDEO_INFO_SIZE (&pad.video)), min = 0, max = 0;
  GstQuery *query = gst_query_new_allocation (caps, TRUE);
  gst_pad_peer_query (pad.pad, query);
  if (gst_query_get_n_allocation_pools (query) > 0)
    gst_query_parse_nth_allocation_pool (query, 0, &pad.pool, &size, &min, &max);
  const bool video_meta = gst_query_find_allocation_meta (query, GST_VIDEO_META_API_TYPE, nullptr);
  gst_query_unref (query);
  if (!pad.pool)
    pad.pool = gst_video_buffer_pool_new ();
  GstStructure *config = gst_buffer_pool_get_config (pad.pool);
  gst_buffer_pool_config_set_params (
      config, caps, MAX (size, static_cast<guint> (GST_VIDEO_INFO_SIZE (&pad.video))), min, max);
  if (video_meta)
    gst_buffer_pool_config_add_option (config, GST_BUFFER_POOL_OPTION_VIDEO_META);
  return gst_buffer_pool_set_config (pad.pool, config);
}

static bool
push_caps (GstAvatarTestSrc *self, SourcePad &pad)
{
  GstCaps *caps = caps_for (self, pad);
  bool good = !gst_caps_is_empty (caps);
  if (good) {
    GstCaps *old = gst_pad_get_current_caps (pad.pad);
    if (!old || !gst_caps_is_equal (old, caps))
      good = gst_pad_push_event (pad.pad, gst_event_new_caps (caps));
    gst_clear_caps (&old);
  }
  if (good) {
    pad.drop_pool ();
    if (pad.kind == PadKind::kRange) {
      pad.pool = gst_range_buffer_pool_new ();
      good = gst_range_buffer_pool_configure (pad.pool, caps, 0, 0);
    } else {
      good = set_up_raw_pool (pad, caps);
    }
    good = good && gst_buffer_pool_set_active (pad.pool, TRUE);
  }
  gst_caps_unref (caps);
  return good;
}

static void
push_stream_start (GstAvatarTestSrc *self, SourcePad &pad)
{
  gchar *id = gst_pad_create_stream_id (pad.pad, GST_ELEMENT (self), GST_PAD_NAME (pad.pad));
  GstEvent *event = gst_event_new_stream_start (id);
  gst_event_set_group_id (event, self->priv->group_id);
  gst_pad_push_event (pad.pad, event);
  g_free (id);
  pad.needs_start = false;
}

static bool
set_rate (GstAvatarTestSrc *self, int fps_n, int fps_d)
{
  auto priv = self->priv;
  if (priv->fps_n == fps_n && priv->fps_d == fps_d)
    return false;
  if (priv->fps_n > 0)
    priv->rate_base += gst_util_uint64_scale (
        priv->rate_frame, GST_SECOND * static_cast<guint64> (priv->fps_d), guint64 (priv->fps_n));
  priv->rate_frame = 0;
  priv->last_tick = G_MAXUINT64;
  std::lock_guard guard (priv->lock); /* the latency query reads them */
  priv->fps_n = fps_n;
  priv->fps_d = fps_d;
  return true;
}

static GstFlowReturn
negotiate (GstAvatarTestSrc *self, const SourcePads &pads)
{
  auto priv = self->priv;
  int width = 0, height = 0, fps_n = 0, fps_d = 1;
  for (const auto &pad : pads)
    if (pad->needs_start)
      push_stream_start (self, *pad);
  const bool found = choose_size (pads, width, height, fps_n, fps_d);
  if (!found) {
    std::unique_lock guard (priv->lock);
    if (priv->stopping)
      return GST_FLOW_FLUSHING;
    guard.unlock ();
    GST_ELEMENT_ERROR (self, CORE, NEGOTIATION,
        ("the peers of the pads agree on no size and frame rate (16 to 4096 pixels, 1/1000 to "
         "1000 frames a second)"),
        (nullptr));
    return GST_FLOW_ERROR;
  }
  const GstFlowReturn flow =
      gst_range_flow_return (GST_ELEMENT (self), make_scene (self, width, height));
  if (flow != GST_FLOW_OK)
    return flow;
  const bool new_rate = set_rate (self, fps_n, fps_d);
  for (const auto &pad : pads) {
    if (gst_pad_is_linked (pad->pad) && !push_caps (self, *pad)) {
      if (GST_PAD_IS_FLUSHING (pad->pad))
        return GST_FLOW_FLUSHING;
      GST_ELEMENT_ERROR (self, CORE, NEGOTIATION,
          ("pad %s: its peer takes none of our formats", GST_PAD_NAME (pad->pad)), (nullptr));
      return GST_FLOW_ERROR;
    }
    pad->negotiated = gst_pad_is_linked (pad->pad);
    if (pad->needs_segment) {
      GstSegment segment;
      gst_segment_init (&segment, GST_FORMAT_TIME);
      gst_pad_push_event (pad->pad, gst_event_new_segment (&segment));
      pad->needs_segment = false;
    }
  }
  if (new_rate && priv->current.is_live)
    gst_element_post_message (GST_ELEMENT (self), gst_message_new_latency (GST_OBJECT (self)));
  return GST_FLOW_OK;
}

/* ---- time ---- */

struct Moment {
  GstClockTime pts, duration, capture_time;
  bool discont;
};

static GstClockTime
tick_time (GstAvatarTestSrc *self, guint64 tick)
{
  return gst_util_uint64_scale (
      tick, GST_SECOND * static_cast<guint64> (self->priv->fps_d), guint64 (self->priv->fps_n));
}

/* Waits for the clock's next multiple of the frame period. FALSE: woken, look again. */
static bool
wait_for_tick (GstAvatarTestSrc *self, Moment &moment)
{
  auto priv = self->priv;
  std::unique_lock guard (priv->lock);
  priv->wake.wait (guard, [&] { return priv->playing || priv->stopping || priv->eos_wanted; });
  if (priv->stopping || priv->eos_wanted)
    return false;
  guard.unlock ();
  GstClock *clock = gst_element_get_clock (GST_ELEMENT (self));
  const GstClockTime base = gst_element_get_base_time (GST_ELEMENT (self));
  const GstClockTime now = MAX (gst_clock_get_time (clock), base);
  guint64 tick = gst_util_uint64_scale (
      now, guint64 (priv->fps_n), GST_SECOND * static_cast<guint64> (priv->fps_d));
  while (
      tick_time (self, tick) < now || (priv->last_tick != G_MAXUINT64 && tick == priv->last_tick))
    tick++;
  const GstClockTime time = tick_time (self, tick);
  GstClockID id = gst_clock_new_single_shot_id (clock, time);
  gst_object_unref (clock);
  guard.lock ();
  const bool go_on = priv->playing && !priv->stopping && !priv->eos_wanted;
  priv->clock_id = go_on ? id : nullptr;
  guard.unlock ();
  const GstClockReturn result = go_on ? gst_clock_id_wait (id, nullptr) : GST_CLOCK_UNSCHEDULED;
  guard.lock ();
  priv->clock_id = nullptr;
  gst_clock_id_unref (id);
  if (result == GST_CLOCK_UNSCHEDULED)
    return false;
  moment.discont = priv->last_tick != G_MAXUINT64 && tick != priv->last_tick + 1;
  if (moment.discont && tick > priv->last_tick)
    priv->counters.skipped += tick - priv->last_tick - 1;
  priv->last_tick = tick;
  moment.capture_time = time;
  moment.pts = time - base;
  moment.duration = tick_time (self, tick + 1) - time;
  return true;
}

static void
next_moment (GstAvatarTestSrc *self, Moment &moment)
{
  auto priv = self->priv;
  moment.pts = priv->rate_base + tick_time (self, priv->rate_frame);
  moment.duration = priv->rate_base + tick_time (self, priv->rate_frame + 1) - moment.pts;
  moment.capture_time = moment.pts;
  moment.discont = false;
}

/* ---- pictures ---- */

static PixelFormat
pixel_format (const GstVideoInfo &info)
{
  switch (GST_VIDEO_INFO_FORMAT (&info)) {
    case GST_VIDEO_FORMAT_BGRx:
      return PixelFormat::kBgrx;
    case GST_VIDEO_FORMAT_RGB:
      return PixelFormat::kRgb;
    case GST_VIDEO_FORMAT_BGR:
      return PixelFormat::kBgr;
    case GST_VIDEO_FORMAT_GRAY8:
      return PixelFormat::kGray;
    default:
      return PixelFormat::kRgbx;
  }
}

static Status
draw_raw (GstAvatarTestSrc *self, SourcePad &pad, GstBuffer *buffer, double time_s, bool empty)
{
  auto priv = self->priv;
  const int width = priv->current.scene.width, height = priv->current.scene.height;
  GstVideoFrame frame;
  if (!gst_video_frame_map (&frame, &pad.video, buffer, GST_MAP_WRITE))
    return {StatusCode::kNoSpace, "cannot map an output buffer"};
  auto pixels = static_cast<std::uint8_t *> (GST_VIDEO_FRAME_PLANE_DATA (&frame, 0));
  const int stride = GST_VIDEO_FRAME_PLANE_STRIDE (&frame, 0);
  const PixelFormat format = pixel_format (pad.video);
  const bool direct = format == PixelFormat::kRgbx;
  const rangecast::ImageView<Rgbx> picture{
      direct ? reinterpret_cast<Rgbx *> (pixels) : priv->scratch.data (), width, height,
      direct ? stride : static_cast<std::ptrdiff_t> (sizeof (Rgbx)) * width};
  const Status status = priv->scene->render (MAX (priv->current.view_id, 0),
      static_cast<SceneCamera> (pad.kind), time_s, empty, picture, {}, {});
  if (status.ok () && !direct)
    rangecast::convert_pixels (picture, format, pixels, stride);
  gst_video_frame_unmap (&frame);
  return status;
}

static Status
draw_range (
    GstAvatarTestSrc *self, GstBuffer *buffer, const Moment &moment, double time_s, bool empty)
{
  auto priv = self->priv;
  const Settings &s = priv->current;
  for (const auto &view : priv->scene->range_rig ().views)
    if (s.view_id == kAllViews || s.view_id == view.id)
      gst_range_buffer_add_view (buffer, guint (view.id), 0, 0, guint (view.width),
          guint (view.height), moment.capture_time);
  gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
  if (!frame.status ().ok ())
    return frame.status ();
  std::array<Roi, rangecast::kMaxViews> boxes;
  const std::size_t count = frame.views ().size ();
  const Status status = priv->scene->render_range (
      frame.views (), time_s, empty, {boxes.data (), count}, s.n_threads);
  for (std::size_t i = 0; status.ok () && s.person_only && i < count; i++)
    frame.crop (i, boxes[i]);
  return status;
}

static GstFlowReturn
push_picture (GstAvatarTestSrc *self, SourcePad &pad, const Moment &moment)
{
  auto priv = self->priv;
  if (!gst_pad_is_linked (pad.pad) || !pad.negotiated)
    return GST_FLOW_NOT_LINKED;
  GstBuffer *buffer = nullptr;
  GstFlowReturn flow = gst_buffer_pool_acquire_buffer (pad.pool, &buffer, nullptr);
  if (flow != GST_FLOW_OK)
    return flow;
  const double time_s = static_cast<double> (moment.capture_time) / GST_SECOND;
  const bool empty = priv->frame < priv->current.empty_frames;
  flow = gst_range_flow_return (GST_ELEMENT (self),
      pad.kind == PadKind::kRange ? draw_range (self, buffer, moment, time_s, empty)
                                  : draw_raw (self, pad, buffer, time_s, empty));
  if (flow != GST_FLOW_OK) {
    gst_buffer_unref (buffer);
    return flow;
  }
  GST_BUFFER_PTS (buffer) = moment.pts;
  GST_BUFFER_DURATION (buffer) = moment.duration;
  GST_BUFFER_OFFSET (buffer) = priv->frame;
  GST_BUFFER_OFFSET_END (buffer) = priv->frame + 1;
  if (moment.discont || priv->frame == 0)
    GST_BUFFER_FLAG_SET (buffer, GST_BUFFER_FLAG_DISCONT);
  gst_range_buffer_set_capture_time (buffer, moment.capture_time);
  return gst_pad_push (pad.pad, buffer);
}

/* ---- the streaming thread ---- */

static void
end_stream (GstAvatarTestSrc *self, const SourcePads &pads, GstFlowReturn flow)
{
  GST_INFO_OBJECT (self, "pausing: %s", gst_flow_get_name (flow));
  {
    std::lock_guard guard (self->priv->lock);
    if (!self->priv
             ->stopping) /* a task told to stop must not be told to pause: it would never end */
      gst_task_pause (self->priv->task);
  }
  if (flow == GST_FLOW_FLUSHING)
    return;
  if (flow == GST_FLOW_NOT_LINKED || flow == GST_FLOW_NOT_NEGOTIATED)
    GST_ELEMENT_FLOW_ERROR (self, flow);
  for (const auto &pad : pads) {
    if (pad->needs_start)
      push_stream_start (self, *pad);
    gst_pad_push_event (pad->pad, gst_event_new_eos ());
  }
}

static GstFlowReturn
one_frame (GstAvatarTestSrc *self, const SourcePads &pads)
{
  auto priv = self->priv;
  bool stale = false;
  for (const auto &pad : pads)
    stale |= gst_pad_check_reconfigure (pad->pad) || pad->needs_start ||
             (!pad->negotiated && gst_pad_is_linked (pad->pad));
  GstFlowReturn flow = stale ? negotiate (self, pads) : GST_FLOW_OK;
  if (flow != GST_FLOW_OK)
    return flow;
  Moment moment{};
  if (!priv->current.is_live)
    next_moment (self, moment);
  else if (!wait_for_tick (self, moment))
    return GST_FLOW_OK; /* the loop looks why */
  for (const auto &pad : pads) {
    const GstFlowReturn pushed = push_picture (self, *pad, moment);
    if (pushed == GST_FLOW_ERROR)
      return pushed;
    std::lock_guard guard (priv->lock);
    flow = gst_flow_combiner_update_pad_flow (priv->combiner, pad->pad, pushed);
    if (flow != GST_FLOW_OK)
      return flow;
  }
  priv->frame++;
  priv->rate_frame++;
  std::lock_guard guard (priv->lock);
  priv->counters.frames++;
  return flow;
}

static void
gst_avatar_test_src_loop (gpointer user_data)
{
  auto self = GST_AVATAR_TEST_SRC (user_data);
  auto priv = self->priv;
  const SourcePads pads = current_pads (self);
  bool eos, stopping;
  {
    std::lock_guard guard (priv->lock);
    eos = priv->eos_wanted;
    stopping = priv->stopping;
  }
  const int count = priv->current.num_buffers;
  GstFlowReturn flow = GST_FLOW_EOS;
  if (stopping)
    flow = GST_FLOW_FLUSHING;
  else if (pads.empty ())
    flow = GST_FLOW_NOT_LINKED;
  else if (!eos && (count < 0 || priv->frame < static_cast<guint64> (count)))
    flow = one_frame (self, pads);
  if (flow != GST_FLOW_OK)
    end_stream (self, pads, flow);
}

/* ---- queries and events ---- */

static gboolean
gst_avatar_test_src_query (GstPad *pad, GstObject *parent, GstQuery *query)
{
  auto self = GST_AVATAR_TEST_SRC (parent);
  switch (GST_QUERY_TYPE (query)) {
    case GST_QUERY_LATENCY: {
      std::lock_guard guard (self->priv->lock);
      const bool live = self->priv->settings.is_live;
      const guint64 frame = live && self->priv->fps_n > 0
                                ? gst_util_uint64_scale (GST_SECOND, guint64 (self->priv->fps_d),
                                      guint64 (self->priv->fps_n))
                                : 0;
      gst_query_set_latency (query, live, frame, GST_CLOCK_TIME_NONE);
      return TRUE;
    }
    case GST_QUERY_SEEKING: {
      GstFormat format;
      gst_query_parse_seeking (query, &format, nullptr, nullptr, nullptr);
      gst_query_set_seeking (query, format, FALSE, 0, -1);
      return TRUE;
    }
    default:
      return gst_pad_query_default (pad, parent, query);
  }
}

static gboolean
gst_avatar_test_src_event (GstPad *, GstObject *, GstEvent *event)
{
  /* RECONFIGURE has marked the pad already; QOS and LATENCY ask for nothing that we could do. */
  const bool handled = GST_EVENT_TYPE (event) == GST_EVENT_RECONFIGURE ||
                       GST_EVENT_TYPE (event) == GST_EVENT_QOS ||
                       GST_EVENT_TYPE (event) == GST_EVENT_LATENCY;
  gst_event_unref (event);
  return handled;
}

/* Wakes the streaming thread, wherever it waits. Call with the lock. */
static void
wake_up (GstAvatarTestSrcPrivate *priv)
{
  priv->wake.notify_all ();
  if (priv->clock_id)
    gst_clock_id_unschedule (priv->clock_id);
}

static gboolean
gst_avatar_test_src_send_event (GstElement *element, GstEvent *event)
{
  auto priv = GST_AVATAR_TEST_SRC (element)->priv;
  if (GST_EVENT_TYPE (event) != GST_EVENT_EOS)
    return GST_ELEMENT_CLASS (gst_avatar_test_src_parent_class)->send_event (element, event);
  gst_event_unref (event);
  std::lock_guard guard (priv->lock);
  priv->eos_wanted = true;
  wake_up (priv);
  return TRUE;
}

/* ---- request pads ---- */

static GstPad *
gst_avatar_test_src_request_new_pad (
    GstElement *element, GstPadTemplate *pad_template, const gchar *, const GstCaps *)
{
  auto self = GST_AVATAR_TEST_SRC (element);
  const gchar *name = GST_PAD_TEMPLATE_NAME_TEMPLATE (pad_template);
  const PadKind kind = g_str_equal (name, "left")    ? PadKind::kLeft
                       : g_str_equal (name, "right") ? PadKind::kRight
                       : g_str_equal (name, "third") ? PadKind::kThird
                                                     : PadKind::kRange;
  GstPad *pad = gst_pad_new_from_template (pad_template, name);
  gst_pad_set_query_function (pad, gst_avatar_test_src_query);
  gst_pad_set_event_function (pad, gst_avatar_test_src_event);
  if (!gst_element_add_pad (element, pad)) /* the name is taken; says so itself */
    return nullptr;
  std::lock_guard guard (self->priv->lock);
  self->priv->pads.push_back (std::make_shared<SourcePad> (pad, kind));
  gst_flow_combiner_add_pad (self->priv->combiner, pad);
  return pad;
}

static void
gst_avatar_test_src_release_pad (GstElement *element, GstPad *pad)
{
  auto self = GST_AVATAR_TEST_SRC (element);
  gst_pad_set_active (pad, FALSE);
  {
    std::lock_guard guard (self->priv->lock);
    std::erase_if (self->priv->pads, [&] (const auto &entry) { return entry->pad == pad; });
    gst_flow_combiner_remove_pad (self->priv->combiner, pad);
  }
  gst_element_remove_pad (element, pad);
}

/* ---- life ---- */

/* With no pad there is nothing to stream, but the rig file is written all the same. */
static bool
start (GstAvatarTestSrc *self)
{
  auto priv = self->priv;
  bool idle;
  {
    std::lock_guard guard (priv->lock);
    priv->current = priv->settings;
    priv->counters = {};
    priv->stopping = priv->eos_wanted = false;
    gst_flow_combiner_reset (priv->combiner);
    idle = priv->pads.empty ();
    priv->fps_n = 0;
  }
  priv->frame = priv->rate_frame = 0;
  priv->rate_base = 0;
  priv->last_tick = G_MAXUINT64;
  priv->group_id = gst_util_group_id_next ();
  if (idle && !priv->current.rig_export.empty ())
    return gst_range_flow_return (GST_ELEMENT (self), make_scene (self, 320, 240)) == GST_FLOW_OK;
  return true;
}

static void
start_task (GstAvatarTestSrc *self)
{
  if (current_pads (self).empty ())
    return;
  self->priv->task = gst_task_new (gst_avatar_test_src_loop, self, nullptr);
  gst_task_set_lock (self->priv->task, &self->priv->task_lock);
  gst_task_start (self->priv->task);
}

static void
ask_to_stop (GstAvatarTestSrc *self)
{
  std::lock_guard guard (self->priv->lock);
  self->priv->stopping = true;
  if (self->priv->task)
    gst_task_stop (self->priv->task);
  wake_up (self->priv);
}

/* The pads are inactive by now, so no push holds the thread. */
static void
stop (GstAvatarTestSrc *self)
{
  auto priv = self->priv;
  if (priv->task)
    gst_task_join (priv->task);
  gst_clear_object (&priv->task);
  priv->scene.reset ();
  for (const auto &pad : current_pads (self)) {
    pad->drop_pool ();
    pad->needs_start = pad->needs_segment = true;
    pad->negotiated = false;
  }
}

static void
set_playing (GstAvatarTestSrc *self, bool playing)
{
  std::lock_guard guard (self->priv->lock);
  self->priv->playing = playing;
  wake_up (self->priv);
}

static GstStateChangeReturn
gst_avatar_test_src_change_state (GstElement *element, GstStateChange transition)
{
  auto self = GST_AVATAR_TEST_SRC (element);
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED && !start (self))
    return GST_STATE_CHANGE_FAILURE;
  if (transition == GST_STATE_CHANGE_PLAYING_TO_PAUSED)
    set_playing (self, false);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY)
    ask_to_stop (self);
  GstStateChangeReturn result =
      GST_ELEMENT_CLASS (gst_avatar_test_src_parent_class)->change_state (element, transition);
  const bool no_preroll = self->priv->current.is_live && result == GST_STATE_CHANGE_SUCCESS;
  switch (transition) {
    case GST_STATE_CHANGE_READY_TO_PAUSED:
      if (result != GST_STATE_CHANGE_FAILURE)
        start_task (self);
      return no_preroll ? GST_STATE_CHANGE_NO_PREROLL : result;
    case GST_STATE_CHANGE_PLAYING_TO_PAUSED:
      return no_preroll ? GST_STATE_CHANGE_NO_PREROLL : result;
    case GST_STATE_CHANGE_PAUSED_TO_PLAYING:
      set_playing (self, true);
      return result;
    case GST_STATE_CHANGE_PAUSED_TO_READY:
      stop (self);
      return result;
    default:
      return result;
  }
}

static std::string
string_of (const GValue *value)
{
  const gchar *text = g_value_get_string (value);
  return text ? text : "";
}

static void
gst_avatar_test_src_set_property (GObject *object, guint id, const GValue *value, GParamSpec *pspec)
{
  auto priv = GST_AVATAR_TEST_SRC (object)->priv;
  std::lock_guard guard (priv->lock);
  Settings &s = priv->settings;
  switch (id) {
    case PROP_VIEWS:
      s.scene.views = g_value_get_int (value);
      break;
    case PROP_VIEW_ID:
      s.view_id = g_value_get_int (value);
      break;
    case PROP_ARC:
      s.scene.arc_deg = g_value_get_double (value);
      break;
    case PROP_DISTANCE:
      s.scene.distance_m = g_value_get_double (value);
      break;
    case PROP_BASELINE:
      s.scene.baseline_m = g_value_get_double (value);
      break;
    case PROP_SEED:
      s.scene.seed = g_value_get_uint (value);
      break;
    case PROP_NOISE:
      s.scene.noise_sigma = g_value_get_double (value);
      break;
    case PROP_MOTION:
      s.scene.motion = g_value_get_double (value);
      break;
    case PROP_EMPTY_FRAMES:
      s.empty_frames = g_value_get_uint (value);
      break;
    case PROP_NUM_BUFFERS:
      s.num_buffers = g_value_get_int (value);
      break;
    case PROP_IS_LIVE:
      s.is_live = g_value_get_boolean (value);
      break;
    case PROP_LOCATION:
      s.scene.model = string_of (value);
      break;
    case PROP_TEXTURE:
      s.scene.texture = string_of (value);
      break;
    case PROP_RIG_EXPORT:
      s.rig_export = string_of (value);
      break;
    case PROP_RANGE_PERSON_ONLY:
      s.person_only = g_value_get_boolean (value);
      break;
    case PROP_N_THREADS:
      s.n_threads = g_value_get_int (value);
      break;
    default:
      G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
  }
}

static void
gst_avatar_test_src_get_property (GObject *object, guint id, GValue *value, GParamSpec *pspec)
{
  auto priv = GST_AVATAR_TEST_SRC (object)->priv;
  std::lock_guard guard (priv->lock);
  const Settings &s = priv->settings;
  switch (id) {
    case PROP_VIEWS:
      g_value_set_int (value, s.scene.views);
      break;
    case PROP_VIEW_ID:
      g_value_set_int (value, s.view_id);
      break;
    case PROP_ARC:
      g_value_set_double (value, s.scene.arc_deg);
      break;
    case PROP_DISTANCE:
      g_value_set_double (value, s.scene.distance_m);
      break;
    case PROP_BASELINE:
      g_value_set_double (value, s.scene.baseline_m);
      break;
    case PROP_SEED:
      g_value_set_uint (value, s.scene.seed);
      break;
    case PROP_NOISE:
      g_value_set_double (value, s.scene.noise_sigma);
      break;
    case PROP_MOTION:
      g_value_set_double (value, s.scene.motion);
      break;
    case PROP_EMPTY_FRAMES:
      g_value_set_uint (value, s.empty_frames);
      break;
    case PROP_NUM_BUFFERS:
      g_value_set_int (value, s.num_buffers);
      break;
    case PROP_IS_LIVE:
      g_value_set_boolean (value, s.is_live);
      break;
    case PROP_LOCATION:
      g_value_set_string (value, s.scene.model.c_str ());
      break;
    case PROP_TEXTURE:
      g_value_set_string (value, s.scene.texture.c_str ());
      break;
    case PROP_RIG_EXPORT:
      g_value_set_string (value, s.rig_export.c_str ());
      break;
    case PROP_RANGE_PERSON_ONLY:
      g_value_set_boolean (value, s.person_only);
      break;
    case PROP_N_THREADS:
      g_value_set_int (value, s.n_threads);
      break;
    case PROP_STATS:
      g_value_take_boxed (value,
          gst_structure_new ("avatartestsrc-stats", "frames", G_TYPE_UINT64, priv->counters.frames,
              "skipped", G_TYPE_UINT64, priv->counters.skipped, nullptr));
      break;
    default:
      G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
  }
}

static void
gst_avatar_test_src_finalize (GObject *object)
{
  delete GST_AVATAR_TEST_SRC (object)->priv;
  G_OBJECT_CLASS (gst_avatar_test_src_parent_class)->finalize (object);
}

static void
gst_avatar_test_src_init (GstAvatarTestSrc *self)
{
  self->priv = new GstAvatarTestSrcPrivate;
  GST_OBJECT_FLAG_SET (self, GST_ELEMENT_FLAG_SOURCE);
}

static void
install_properties (GObjectClass *klass)
{
  const auto ready =
      GParamFlags (G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_READY);
  const auto add_int = [&] (guint id, const char *name, const char *blurb, int low, int high,
                           int value) {
    g_object_class_install_property (
        klass, id, g_param_spec_int (name, name, blurb, low, high, value, ready));
  };
  const auto add_uint = [&] (guint id, const char *name, const char *blurb, guint value) {
    g_object_class_install_property (
        klass, id, g_param_spec_uint (name, name, blurb, 0, G_MAXUINT, value, ready));
  };
  const auto add_double = [&] (guint id, const char *name, const char *blurb, double low,
                              double high, double value) {
    g_object_class_install_property (
        klass, id, g_param_spec_double (name, name, blurb, low, high, value, ready));
  };
  const auto add_bool = [&] (guint id, const char *name, const char *blurb) {
    g_object_class_install_property (
        klass, id, g_param_spec_boolean (name, name, blurb, FALSE, ready));
  };
  const auto add_string = [&] (guint id, const char *name, const char *blurb) {
    g_object_class_install_property (
        klass, id, g_param_spec_string (name, name, blurb, nullptr, ready));
  };
  add_int (PROP_VIEWS, "views", "Stereo cameras in the rig (1 to 64, default: 4)", 1, 64, 4);
  add_int (PROP_VIEW_ID, "view-id",
      "Which view to give (0 to 63; -1, the default: all on src, view 0 on left, right and third)",
      kAllViews, 63, kAllViews);
  add_double (PROP_ARC, "arc",
      "Arc on which the views stand, degrees (1 to 360; 360, the default: a ring, view 0 in front; "
      "less: the figure's front in the middle)",
      1, 360, 360);
  add_double (PROP_DISTANCE, "distance",
      "From the left cameras to the figure's axis, metres (0.5 to 1.2, default: 0.8)", 0.5, 1.2,
      0.8);
  add_double (PROP_BASELINE, "baseline",
      "From left to right and to third camera, metres (0.01 to 0.3, default: 0.1)", 0.01, 0.3, 0.1);
  add_uint (PROP_SEED, "seed", "Of all patterns and the noise (default: 1)", 1);
  add_double (PROP_NOISE, "noise",
      "Sensor noise, standard deviation in grey levels (0 to 20, default: 1)", 0, 20, 1);
  add_double (
      PROP_MOTION, "motion", "How much the figure moves (0 = still, to 2; default: 1)", 0, 2, 1);
  add_uint (PROP_EMPTY_FRAMES, "empty-frames",
      "So many frames at first show the room without the figure (default: 0)", 0);
  add_int (
      PROP_NUM_BUFFERS, "num-buffers", "Frames before EOS (default: -1, no end)", -1, G_MAXINT, -1);
  add_bool (PROP_IS_LIVE, "is-live",
      "Take pictures at multiples of the frame period of the pipeline's clock (default: false)");
  add_string (
      PROP_LOCATION, "location", "Model of the figure, glTF or OBJ (default: the built-in one)");
  add_string (PROP_TEXTURE, "texture",
      "Picture for the model (default: what the model names, or a colour map beside it)");
  add_string (PROP_RIG_EXPORT, "rig-export",
      "Write the calibration of all cameras to this file, YAML or JSON (default: none)");
  add_bool (PROP_RANGE_PERSON_ONLY, "range-person-only",
      "Crop range images to the person's bounding box (default: false)");
  add_int (PROP_N_THREADS, "n-threads",
      "Threads that draw range images (0, the default: one a core)", 0, 64, 0);
  g_object_class_install_property (klass, PROP_STATS,
      g_param_spec_boxed ("stats", "stats", "Counters since the element was last started",
          GST_TYPE_STRUCTURE, GParamFlags (G_PARAM_READABLE | G_PARAM_STATIC_STRINGS)));
}

static void
gst_avatar_test_src_class_init (GstAvatarTestSrcClass *klass)
{
  auto object_class = G_OBJECT_CLASS (klass);
  auto element_class = GST_ELEMENT_CLASS (klass);
  object_class->set_property = gst_avatar_test_src_set_property;
  object_class->get_property = gst_avatar_test_src_get_property;
  object_class->finalize = gst_avatar_test_src_finalize;
  install_properties (object_class);

  for (GstStaticPadTemplate *pad_template :
      {&src_template, &left_template, &right_template, &third_template})
    gst_element_class_add_static_pad_template (element_class, pad_template);
  gst_element_class_set_static_metadata (element_class, "Avatar test source", "Source/Video",
      "A head and shoulders seen by a rig of stereo cameras, with exact depth", "gst-rangecast");

  element_class->request_new_pad = gst_avatar_test_src_request_new_pad;
  element_class->release_pad = gst_avatar_test_src_release_pad;
  element_class->send_event = gst_avatar_test_src_send_event;
  element_class->change_state = gst_avatar_test_src_change_state;

  GST_DEBUG_CATEGORY_INIT (gst_avatar_test_src_debug, "avatartestsrc", 0, "Avatar test source");
}
