/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-stereocamsrc
 * @title: stereocamsrc
 *
 * Captures synchronised images from two or three machine-vision cameras (GigE Vision, USB3 Vision).
 * Pads `left` and `right` always exist, `third` if a third camera is named. Images of one trigger
 * have one PTS and one capture time; an image whose partner was lost is dropped and counted,
 * without affecting later pairs.
 *
 * With trigger=software or action the cameras are triggered at multiples of the frame period on the
 * pipeline clock, so hosts that share a clock (#GstStereoCamSrc:clock-server) capture
 * simultaneously. Images are not copied: buffers return to their camera when released.
 *
 * ## Element messages
 * - `stereocamsrc-stats`, every 5 s: the fields of #GstStereoCamSrc:stats.
 * - `stereocamsrc-lost` (`reason`: string) and `stereocamsrc-back` (`left`: string): with
 *   #GstStereoCamSrc:reconnect, a camera went away, or all are there again.
 * - `stereocamsrc-clock` (`server`: string): the pipeline clock is synchronised with clock-server.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 stereocamsrc name=c left=21512345 right=21512346 trigger=software c.left ! queue !
 * d.left c.right ! queue ! d.right stereodepth name=d rig=rig.yaml ! rangesplit name=s s.depth !
 * videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
#include "gststereocamsrc.h"

#include <gstrange/gstrangestatus.hpp>
#include <memory>
#include <mutex>
#include <utility>

#include "clock.hpp"
#include "common/properties.hpp"
#include "common/statsreporter.hpp"
#include "session.hpp"

GST_DEBUG_CATEGORY (gst_stereo_cam_src_debug); /* the other files of this plugin log to it, too */
#define GST_CAT_DEFAULT gst_stereo_cam_src_debug

enum : guint { PROP_STATS = 1, PROP_STATS_INTERVAL, PROP_SETTINGS };

enum { SIGNAL_CAPTURE, N_SIGNALS };
static guint signals[N_SIGNALS];

/* How long going to NULL waits for cameras to be given back. */
static constexpr std::chrono::milliseconds kGiveBack{2000};

struct GstStereoCamSrcPrivate {
  std::mutex lock; /* guards settings and session; taken before the session's */
  StereoCamSettings settings;
  std::shared_ptr<CameraSession> session; ///< the last one; it may have ended

  /* State changes; constant between them. */
  CameraPads pads; ///< left, right, and third while it is there
  NetworkClock clock;
  StatsReporter reporter; /* has locks of its own */

  std::shared_ptr<CameraSession> current ()
  {
    std::lock_guard guard (lock);
    return session;
  }
};

struct _GstStereoCamSrc {
  GstElement parent;
  GstStereoCamSrcPrivate *priv;
};

#define CAMERA_CAPS                                                                                \
  "video/x-raw, format = (string) { GRAY8, RGB, BGR }, width = (int) [ 1, max ], height = (int) "  \
  "[ 1, max ], framerate = (fraction) [ 0/1, 1000/1 ]; "                                           \
  "video/x-bayer, format = (string) { rggb, bggr, gbrg, grbg }, width = (int) [ 1, max ], height " \
  "= (int) [ 1, max ], framerate = (fraction) [ 0/1, 1000/1 ]"

static GstStaticPadTemplate left_template =
    GST_STATIC_PAD_TEMPLATE ("left", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS (CAMERA_CAPS));
static GstStaticPadTemplate right_template =
    GST_STATIC_PAD_TEMPLATE ("right", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS (CAMERA_CAPS));
static GstStaticPadTemplate third_template = GST_STATIC_PAD_TEMPLATE (
    "third", GST_PAD_SRC, GST_PAD_SOMETIMES, GST_STATIC_CAPS (CAMERA_CAPS));

G_DEFINE_TYPE (GstStereoCamSrc, gst_stereo_cam_src, GST_TYPE_ELEMENT)
GST_ELEMENT_REGISTER_DEFINE (stereocamsrc, "stereocamsrc", GST_RANK_NONE, GST_TYPE_STEREO_CAM_SRC)

/* ---- queries and events ---- */

static gboolean
gst_stereo_cam_src_query (GstPad *pad, GstObject *parent, GstQuery *query)
{
  if (GST_QUERY_TYPE (query) != GST_QUERY_LATENCY)
    return gst_pad_query_default (pad, parent, query);
  const auto session = GST_STEREO_CAM_SRC (parent)->priv->current ();
  gst_query_set_latency (query, TRUE, session ? session->latency () : 0, GST_CLOCK_TIME_NONE);
  return TRUE;
}

static gboolean
gst_stereo_cam_src_event (GstPad *pad, GstObject *parent, GstEvent *event)
{
  switch (GST_EVENT_TYPE (event)) {
    case GST_EVENT_RECONFIGURE: /* has marked the pad already */
    case GST_EVENT_QOS:         /* these two ask for nothing that we could do */
    case GST_EVENT_LATENCY:
      gst_event_unref (event);
      return TRUE;
    case GST_EVENT_SEEK:
    case GST_EVENT_NAVIGATION:
      gst_event_unref (event);
      return FALSE;
    default:
      return gst_pad_event_default (pad, parent, event);
  }
}

static bool
end_stream (GstStereoCamSrc *self, GstEvent *event)
{
  const auto session = self->priv->current ();
  if (session)
    session->send_eos (gst_event_get_seqnum (event));
  return session != nullptr;
}

static bool
flush_stream (GstStereoCamSrc *self, GstEvent *event)
{
  const auto session = self->priv->current ();
  if (!session)
    return false;
  const bool start = GST_EVENT_TYPE (event) == GST_EVENT_FLUSH_START;
  if (!start)
    session->flush ();
  for (const auto &pad : self->priv->pads)
    start ? pad->flush_start (event) : pad->flush_stop (event);
  return true;
}

static gboolean
gst_stereo_cam_src_send_event (GstElement *element, GstEvent *event)
{
  auto self = GST_STEREO_CAM_SRC (element);
  bool handled;
  switch (GST_EVENT_TYPE (event)) {
    case GST_EVENT_EOS:
      handled = end_stream (self, event);
      break;
    case GST_EVENT_FLUSH_START:
    case GST_EVENT_FLUSH_STOP:
      handled = flush_stream (self, event);
      break;
    default:
      return GST_ELEMENT_CLASS (gst_stereo_cam_src_parent_class)->send_event (element, event);
  }
  gst_event_unref (event);
  return handled;
}

/* ---- pads ---- */

static gboolean
gst_stereo_cam_src_activate_mode (GstPad *pad, GstObject *, GstPadMode mode, gboolean active)
{
  auto entry = static_cast<CameraPad *> (gst_pad_get_element_private (pad));
  return mode == GST_PAD_MODE_PUSH && entry->activate (active);
}

static void
add_pad (GstStereoCamSrc *self, GstStaticPadTemplate *pad_template)
{
  GstPad *pad = gst_pad_new_from_static_template (pad_template, pad_template->name_template);
  gst_pad_set_query_function (pad, gst_stereo_cam_src_query);
  gst_pad_set_event_function (pad, gst_stereo_cam_src_event);
  gst_pad_set_activatemode_function (pad, gst_stereo_cam_src_activate_mode);
  gst_pad_use_fixed_caps (pad);
  self->priv->pads.push_back (std::make_shared<CameraPad> (
      GST_ELEMENT (self), pad, [self] (CameraPad &pushed, GstFlowReturn flow) {
        if (const auto session = self->priv->current ())
          session->handle_flow (pushed, flow);
      }));
  gst_pad_set_element_private (pad, self->priv->pads.back ().get ());
}

/* The third pad is there while its camera is named. */
static void
add_third_pad (GstStereoCamSrc *self, bool wanted, guint group_id)
{
  if (wanted)
    add_pad (self, &third_template);
  for (const auto &pad : self->priv->pads) {
    pad->prepare (group_id);
    pad->reset_counters ();
  }
  if (wanted) /* becomes active: the element is on its way to PAUSED */
    gst_element_add_pad (GST_ELEMENT (self), self->priv->pads.back ()->pad ());
}

static void
remove_third_pad (GstStereoCamSrc *self)
{
  if (self->priv->pads.size () < 3)
    return;
  GstPad *pad = self->priv->pads.back ()->pad ();
  gst_pad_set_active (pad, FALSE);
  gst_element_remove_pad (GST_ELEMENT (self), pad);
  self->priv->pads.pop_back ();
}

/* ---- life ---- */

/* What the session counts, in the words that all elements have. Latency is the delay of pictures.
 */
static std::vector<StatsRow>
collect_stats (GstElement *element)
{
  GstStereoCamSrcPrivate *priv = GST_STEREO_CAM_SRC (element)->priv;
  std::vector<StatsRow> rows (1);
  {
    std::lock_guard guard (priv->lock);
    rows[0].views = guint64{1} << (priv->settings.view_id & 63);
  }
  const auto session = priv->current ();
  if (!session)
    return rows;
  GstStructure *stats = session->stats ();
  const auto count = [stats] (const std::string &field) {
    guint64 value = 0;
    gst_structure_get_uint64 (stats, field.c_str (), &value);
    return value;
  };
  guint64 lost = 0;
  for (const char *side : {"left", "right", "third"})
    lost += count (std::string ("dropped-") + side) + count (std::string ("incomplete-") + side);
  rows[0].counters = {.frames = count ("sets"), .lost = lost, .late = count ("missed-ticks")};
  gint64 p50, p99;
  if (gst_structure_get_int64 (stats, "delay-p50", &p50) &&
      gst_structure_get_int64 (stats, "delay-p99", &p99)) {
    rows[0].latency_p50 = p50;
    rows[0].latency_p99 = p99;
  }
  gst_structure_free (stats);
  return rows;
}

static bool
check_settings (GstStereoCamSrc *self, StereoCamSettings &settings, CameraNames &names)
{
  {
    std::lock_guard guard (self->priv->lock);
    settings = self->priv->settings;
  }
  rangecast::Status status = settings.check ();
  if (status.ok ())
    status = settings.find_names (names);
  return gst_range_flow_return (GST_ELEMENT (self), status) == GST_FLOW_OK;
}

/* NULL to READY: names and texts, no network. */
static bool
open_clock (GstStereoCamSrc *self)
{
  StereoCamSettings settings;
  CameraNames names;
  if (!check_settings (self, settings, names))
    return false;
  auto element = GST_ELEMENT (self);
  if (gst_range_flow_return (element, self->priv->clock.open (settings.clock_server)) !=
      GST_FLOW_OK)
    return false;
  GST_OBJECT_LOCK (element);
  if (self->priv->clock.clock ())
    GST_OBJECT_FLAG_SET (element, GST_ELEMENT_FLAG_REQUIRE_CLOCK);
  else
    GST_OBJECT_FLAG_UNSET (element, GST_ELEMENT_FLAG_REQUIRE_CLOCK);
  GST_OBJECT_UNLOCK (element);
  if (self->priv->clock.clock ()) /* the pipeline may have asked before there was one */
    gst_element_post_message (element,
        gst_message_new_clock_provide (GST_OBJECT (element), self->priv->clock.clock (), TRUE));
  return true;
}

/* Names and pads of the session that start() begins. */
static bool
prepare (GstStereoCamSrc *self, CameraSession::Setup &setup)
{
  if (!check_settings (self, setup.settings, setup.names))
    return false;
  setup.element = GST_ELEMENT (self);
  setup.clock = self->priv->clock.clock ();
  setup.group_id = gst_util_group_id_next ();
  add_third_pad (self, !setup.names[2].empty (), setup.group_id);
  gst_element_no_more_pads (setup.element);
  setup.pads = self->priv->pads;
  return true;
}

/* The pads are active. */
static bool
start (GstStereoCamSrc *self, CameraSession::Setup setup)
{
  setup.previous = self->priv->current ();
  auto session = CameraSession::begin (std::move (setup));
  if (!session) {
    GST_ELEMENT_ERROR (self, RESOURCE, FAILED, ("Could not start the camera thread"), (nullptr));
    return false;
  }
  std::lock_guard guard (self->priv->lock);
  self->priv->session = std::move (session);
  return true;
}

static void
stop (GstStereoCamSrc *self)
{
  if (const auto session = self->priv->current ())
    session->request_stop ();
}

/* READY to NULL: other programs may have the cameras then. A camera that does not answer is given
 * up later. */
static void
close (GstStereoCamSrc *self)
{
  const auto session = self->priv->current ();
  if (session && !session->wait_until_closed (kGiveBack))
    GST_INFO_OBJECT (self, "a camera does not answer; it is released later");
}

static GstStateChangeReturn
gst_stereo_cam_src_change_state (GstElement *element, GstStateChange transition)
{
  auto self = GST_STEREO_CAM_SRC (element);
  if (transition == GST_STATE_CHANGE_NULL_TO_READY && !open_clock (self))
    return GST_STATE_CHANGE_FAILURE;
  CameraSession::Setup setup;
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED && !prepare (self, setup))
    return GST_STATE_CHANGE_FAILURE;
  if (transition == GST_STATE_CHANGE_PLAYING_TO_PAUSED)
    self->priv->current ()->set_playing (false);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) {
    self->priv->reporter.stop ();
    stop (self);
  }
  const GstStateChangeReturn result =
      GST_ELEMENT_CLASS (gst_stereo_cam_src_parent_class)->change_state (element, transition);
  const bool began = transition == GST_STATE_CHANGE_READY_TO_PAUSED &&
                     result != GST_STATE_CHANGE_FAILURE && start (self, std::move (setup));
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED && !began) { /* back, as far as we are */
    GST_ELEMENT_CLASS (gst_stereo_cam_src_parent_class)
        ->change_state (element, GST_STATE_CHANGE_PAUSED_TO_READY);
    remove_third_pad (self);
    return GST_STATE_CHANGE_FAILURE;
  }
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY)
    remove_third_pad (self);
  if (transition == GST_STATE_CHANGE_READY_TO_NULL)
    close (self);
  if (result == GST_STATE_CHANGE_FAILURE)
    return result;
  if (transition == GST_STATE_CHANGE_PAUSED_TO_PLAYING)
    self->priv->current ()->set_playing (true);
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED)
    self->priv->reporter.start (element, collect_stats);
  const bool to_paused = transition == GST_STATE_CHANGE_READY_TO_PAUSED ||
                         transition == GST_STATE_CHANGE_PLAYING_TO_PAUSED;
  return to_paused ? GST_STATE_CHANGE_NO_PREROLL : result;
}

static GstClock *
gst_stereo_cam_src_provide_clock (GstElement *element)
{
  GstClock *clock = GST_STEREO_CAM_SRC (element)->priv->clock.clock ();
  return clock ? GST_CLOCK (gst_object_ref (clock)) : nullptr;
}

static gboolean
gst_stereo_cam_src_capture (GstStereoCamSrc *self, guint64 time)
{
  const auto session = self->priv->current ();
  return session && session->capture (time);
}

static void
gst_stereo_cam_src_set_property (GObject *object, guint id, const GValue *value, GParamSpec *pspec)
{
  auto priv = GST_STEREO_CAM_SRC (object)->priv;
  if (id == PROP_STATS_INTERVAL) {
    priv->reporter.set_interval (g_value_get_uint (value));
    return;
  }
  std::lock_guard guard (priv->lock);
  if (!camera_properties ().set (priv->settings, id, value))
    G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
}

static void
gst_stereo_cam_src_get_property (GObject *object, guint id, GValue *value, GParamSpec *pspec)
{
  auto priv = GST_STEREO_CAM_SRC (object)->priv;
  if (id == PROP_STATS) {
    const auto session = priv->current ();
    g_value_take_boxed (
        value, session ? session->stats () : gst_structure_new_empty ("stereocamsrc-stats"));
    return;
  }
  if (id == PROP_STATS_INTERVAL) {
    g_value_set_uint (value, priv->reporter.interval ());
    return;
  }
  std::lock_guard guard (priv->lock);
  if (!camera_properties ().get (priv->settings, id, value))
    G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
}

static void
gst_stereo_cam_src_finalize (GObject *object)
{
  delete GST_STEREO_CAM_SRC (object)->priv;
  G_OBJECT_CLASS (gst_stereo_cam_src_parent_class)->finalize (object);
}

static void
gst_stereo_cam_src_init (GstStereoCamSrc *self)
{
  self->priv = new GstStereoCamSrcPrivate;
  GST_OBJECT_FLAG_SET (self, GST_ELEMENT_FLAG_SOURCE);
  GST_OBJECT_FLAG_SET (self, GST_ELEMENT_FLAG_PROVIDE_CLOCK); /* with clock-server; else no clock */
  for (GstStaticPadTemplate *pad_template : {&left_template, &right_template}) {
    add_pad (self, pad_template);
    gst_element_add_pad (GST_ELEMENT (self), self->priv->pads.back ()->pad ());
  }
}

static void
install_capture (GstStereoCamSrcClass *klass)
{
  /**
   * GstStereoCamSrc::capture:
   * @time: when, on the pipeline's clock; GST_CLOCK_TIME_NONE, or what has passed: at once
   *
   * Takes one picture with all cameras: single-shot=true, trigger=software or action. It has the
   * PTS and the capture time of that moment.
   *
   * Returns: %FALSE if the element does not play, or 64 shots wait already
   */
  signals[SIGNAL_CAPTURE] = g_signal_new_class_handler ("capture", G_TYPE_FROM_CLASS (klass),
      GSignalFlags (G_SIGNAL_RUN_LAST | G_SIGNAL_ACTION), G_CALLBACK (gst_stereo_cam_src_capture),
      nullptr, nullptr, nullptr, G_TYPE_BOOLEAN, 1, G_TYPE_UINT64);
}

static void
gst_stereo_cam_src_class_init (GstStereoCamSrcClass *klass)
{
  auto object_class = G_OBJECT_CLASS (klass);
  auto element_class = GST_ELEMENT_CLASS (klass);
  object_class->set_property = gst_stereo_cam_src_set_property;
  object_class->get_property = gst_stereo_cam_src_get_property;
  object_class->finalize = gst_stereo_cam_src_finalize;
  camera_properties ().install (object_class, PROP_SETTINGS);
  install_stats (object_class, PROP_STATS, "Counters since the element was started");
  StatsReporter::install (object_class, PROP_STATS_INTERVAL);
  install_capture (klass);

  for (GstStaticPadTemplate *pad_template : {&left_template, &right_template, &third_template})
    gst_element_class_add_static_pad_template (element_class, pad_template);
  gst_element_class_set_static_metadata (element_class, "Stereo camera source",
      "Source/Video/Hardware",
      "Captures synchronised images from two or three GigE Vision or USB3 Vision cameras",
      "gst-rangecast");

  element_class->send_event = gst_stereo_cam_src_send_event;
  element_class->change_state = gst_stereo_cam_src_change_state;
  element_class->provide_clock = gst_stereo_cam_src_provide_clock;

  GST_DEBUG_CATEGORY_INIT (gst_stereo_cam_src_debug, "stereocamsrc", 0, "Stereo camera source");
}
