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
 * - `stereocamsrc-lost` (`reason`: string) and `stereocamsrc-back` (`left`: string): with
 *   #GstStereoCamSrc:reconnect, a camera went away, or all are there again.
 * - `stereocamsrc-clock` (`server`: string): the pipeline clock is synchronised with clock-server.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 stereocamsrc name=c left=21512345 right=21512346 trigger=software \
 *   c.left ! queue ! d.left c.right ! queue ! d.right stereodepth name=d rig=rig.yaml ! \
 *   rangesplit name=s s.depth ! videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
#include <gst/gst.h>

#include <gstrange/gstrangestatus.hpp>
#include <memory>
#include <mutex>
#include <utility>

#include "camera/aravis/debug.hpp"
#include "clock.hpp"
#include "common/elementproperties.hpp"
#include "session.hpp"

/* How long READY to NULL waits for cameras to be closed. */
static constexpr std::chrono::milliseconds kMaxClose{2000};

struct GstStereoCamSrcPrivate {
  std::mutex lock; /* guards settings and session; taken before those of the session */
  StereoCamSettings settings;
  std::shared_ptr<CameraSession> session; ///< the last one, which may have ended

  /* State changes; constant between them. */
  CameraPads pads; ///< left, right, and third while it exists
  NetworkClock clock;
  StatsReporter reporter;

  std::shared_ptr<CameraSession> current ()
  {
    std::lock_guard guard (lock);
    return session;
  }
};

DECLARE_ELEMENT (GstStereoCamSrc, gst_stereo_cam_src, STEREO_CAM_SRC, GstElement)

#define CAMERA_CAPS                                                                                \
  "video/x-raw, format = (string) { GRAY8, RGB, BGR }, width = (int) [ 1, max ], height = (int) "  \
  "[ 1, max ], framerate = (fraction) [ 1/1000, 1000/1 ]; "                                        \
  "video/x-bayer, format = (string) { rggb, bggr, gbrg, grbg }, width = (int) [ 1, max ], height " \
  "= (int) [ 1, max ], framerate = (fraction) [ 1/1000, 1000/1 ]"

static GstStaticPadTemplate left_template =
    GST_STATIC_PAD_TEMPLATE ("left", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS (CAMERA_CAPS));
static GstStaticPadTemplate right_template =
    GST_STATIC_PAD_TEMPLATE ("right", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS (CAMERA_CAPS));
static GstStaticPadTemplate third_template = GST_STATIC_PAD_TEMPLATE (
    "third", GST_PAD_SRC, GST_PAD_SOMETIMES, GST_STATIC_CAPS (CAMERA_CAPS));

G_DEFINE_TYPE (GstStereoCamSrc, gst_stereo_cam_src, GST_TYPE_ELEMENT)
GST_ELEMENT_REGISTER_DEFINE (
    stereocamsrc, "stereocamsrc", GST_RANK_NONE, gst_stereo_cam_src_get_type ())

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
    case GST_EVENT_RECONFIGURE: /* GstPad has marked the pad */
    case GST_EVENT_QOS:         /* cameras are not throttled */
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

static gboolean
gst_stereo_cam_src_send_event (GstElement *element, GstEvent *event)
{
  if (GST_EVENT_TYPE (event) != GST_EVENT_EOS)
    return GST_ELEMENT_CLASS (gst_stereo_cam_src_parent_class)->send_event (element, event);
  const auto session = GST_STEREO_CAM_SRC (element)->priv->current ();
  if (session)
    session->send_eos (gst_event_get_seqnum (event));
  gst_event_unref (event);
  return session != nullptr;
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
  gst_pad_set_query_function (pad, GST_DEBUG_FUNCPTR (gst_stereo_cam_src_query));
  gst_pad_set_event_function (pad, GST_DEBUG_FUNCPTR (gst_stereo_cam_src_event));
  gst_pad_set_activatemode_function (pad, GST_DEBUG_FUNCPTR (gst_stereo_cam_src_activate_mode));
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

/* ---- state changes ---- */

static std::vector<StatsRow>
collect_stats (GstElement *element)
{
  GstStereoCamSrcPrivate *priv = GST_STEREO_CAM_SRC (element)->priv;
  std::lock_guard guard (priv->lock);
  StatsRow row = priv->session ? priv->session->stats_row () : StatsRow ();
  row.views = guint64{1} << (priv->settings.view_id & 63);
  return {row};
}

static bool
check_settings (GstStereoCamSrc *self, StereoCamSettings &settings, CameraNames &names)
{
  settings = settings_of (self->priv);
  return gst_range_flow_return (GST_ELEMENT (self), settings.find_names (names)) == GST_FLOW_OK;
}

/* NULL to READY: checks settings and provides the clock; no network. */
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

/* READY to PAUSED, before the pads become active: the names and pads of the next session. */
static bool
prepare_session (GstStereoCamSrc *self, CameraSession::Setup &setup)
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

/* READY to PAUSED, with active pads. */
static bool
begin_session (GstStereoCamSrc *self, CameraSession::Setup setup)
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

static GstStateChangeReturn
gst_stereo_cam_src_change_state (GstElement *element, GstStateChange transition)
{
  auto self = GST_STEREO_CAM_SRC (element);
  if (transition == GST_STATE_CHANGE_NULL_TO_READY && !open_clock (self))
    return GST_STATE_CHANGE_FAILURE;
  CameraSession::Setup setup;
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED && !prepare_session (self, setup))
    return GST_STATE_CHANGE_FAILURE;
  if (transition == GST_STATE_CHANGE_PLAYING_TO_PAUSED)
    self->priv->current ()->set_playing (false);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) {
    self->priv->reporter.stop ();
    if (const auto session = self->priv->current ())
      session->request_stop ();
  }
  const GstStateChangeReturn result =
      GST_ELEMENT_CLASS (gst_stereo_cam_src_parent_class)->change_state (element, transition);
  const bool began = transition == GST_STATE_CHANGE_READY_TO_PAUSED &&
                     result != GST_STATE_CHANGE_FAILURE && begin_session (self, std::move (setup));
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED && !began) { /* undo */
    GST_ELEMENT_CLASS (gst_stereo_cam_src_parent_class)
        ->change_state (element, GST_STATE_CHANGE_PAUSED_TO_READY);
    remove_third_pad (self);
    return GST_STATE_CHANGE_FAILURE;
  }
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY)
    remove_third_pad (self);
  if (transition == GST_STATE_CHANGE_READY_TO_NULL) { /* other programs may use the cameras now */
    const auto session = self->priv->current ();
    if (session && !session->wait_until_ended (kMaxClose))
      GST_INFO_OBJECT (self, "a camera does not answer; it is released later");
  }
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

static GstStructure *
make_stats (const GstStereoCamSrcPrivate *priv)
{
  return priv->session ? priv->session->stats () : gst_structure_new_empty ("stereocamsrc-stats");
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
gst_stereo_cam_src_class_init (GstStereoCamSrcClass *klass)
{
  auto object_class = G_OBJECT_CLASS (klass);
  auto element_class = GST_ELEMENT_CLASS (klass);
  object_class->finalize = delete_private<GstStereoCamSrc>;
  install_properties<GstStereoCamSrc, stereo_cam_properties, make_stats> (
      object_class, "Counters since the element was started");
  for (GstStaticPadTemplate *pad_template : {&left_template, &right_template, &third_template})
    gst_element_class_add_static_pad_template (element_class, pad_template);
  gst_element_class_set_static_metadata (element_class, "Stereo camera source",
      "Source/Video/Hardware",
      "Captures synchronised images from two or three GigE Vision or USB3 Vision cameras",
      "gst-rangecast");

  element_class->send_event = GST_DEBUG_FUNCPTR (gst_stereo_cam_src_send_event);
  element_class->change_state = GST_DEBUG_FUNCPTR (gst_stereo_cam_src_change_state);
  element_class->provide_clock = GST_DEBUG_FUNCPTR (gst_stereo_cam_src_provide_clock);

  (void)camera_debug_category (); /* so that GST_DEBUG_CATEGORIES lists it */
}
