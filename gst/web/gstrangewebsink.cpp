/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-rangewebsink
 * @title: rangewebsink
 *
 * Serves coded frame sets to browsers: a page that shows the person in 3D, a dashboard of the rig
 * (/rig), and the stream over WebSockets, as docs/formats/web-protocol.md specifies. Clients that
 * cannot keep up are sent fewer frame sets; they never delay the pipeline or other clients.
 *
 * By default only this machine can connect. An @address that others can reach needs a @token, a
 * @token-file, or @anonymous=true; use @certificate there, too.
 *
 * Audio (Opus) that comes to the request pad `audio` is played in sync with the video.
 *
 * When it listens, it posts an element message `rangewebsink-address` with the field `url`
 * (string), the address of the page.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 avatartestsrc is-live=true ! video/x-range,framerate=15/1 ! neighbourcodeenc ! \
 *   rangewebsink port=8080
 * ]|
 *
 * Since: 0.1
 */
#include <gst/base/gstbasesink.h>

#include <gst/video/video.h>

#include <atomic>
#include <gstrange/gstrangeinfo.hpp>
#include <gstrange/gstrangestatus.hpp>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "common/capturetime.hpp"
#include "common/elementproperties.hpp"
#include "server.hpp"

using rangecast::Status;
using web::Settings;

GST_DEBUG_CATEGORY (gst_range_web_sink_debug);

struct GstRangeWebSinkPrivate {
  std::mutex lock; /* guards settings, and which server there is; not held while the server starts,
                      stops or is given frame sets */
  Settings settings;
  std::shared_ptr<web::Server> server; /* from PAUSED on */
  StatsReporter reporter;
  std::atomic<bool> requesting_key = false;

  GstSegment audio_segment{}; /* streaming thread of the audio pad only */

  /* streaming thread only */
  GstClockTime last_pts = GST_CLOCK_TIME_NONE;
  bool new_caps = false; /* since the last frame set */
};

DECLARE_ELEMENT (GstRangeWebSink, gst_range_web_sink, RANGE_WEB_SINK, GstBaseSink)

static GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE (
    "sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS (GST_NEIGHBOUR_CODE_CAPS));

static GstStaticPadTemplate audio_template = GST_STATIC_PAD_TEMPLATE ("audio", GST_PAD_SINK,
    GST_PAD_REQUEST, GST_STATIC_CAPS ("audio/x-opus, channel-mapping-family = (int) 0"));

G_DEFINE_TYPE_WITH_CODE (GstRangeWebSink, gst_range_web_sink, GST_TYPE_BASE_SINK,
    GST_DEBUG_CATEGORY_INIT (gst_range_web_sink_debug, "rangewebsink", 0, "Range web sink"))
GST_ELEMENT_REGISTER_DEFINE (
    rangewebsink, "rangewebsink", GST_RANK_NONE, gst_range_web_sink_get_type ())

static std::shared_ptr<web::Server>
current_server (GstRangeWebSinkPrivate *priv)
{
  std::lock_guard guard (priv->lock);
  return priv->server;
}

/* ---- the stream ---- */

static gboolean
gst_range_web_sink_set_caps (GstBaseSink *base, GstCaps *caps)
{
  GstRangeWebSinkPrivate *priv = GST_RANGE_WEB_SINK (base)->priv;
  gstrange::RangeInfo info;
  if (gst_range_flow_return (GST_ELEMENT (base), gstrange::parse_caps (caps, info)) != GST_FLOW_OK)
    return FALSE;
  GST_INFO_OBJECT (base, "%" GST_PTR_FORMAT, caps);
  priv->reporter.set_views (info.rig);
  priv->new_caps = true;
  return TRUE;
}

/* A capture time on g_get_monotonic_time(); -1: unknown. */
static gint64
monotonic_us (GstElement *element, GstClockTime captured)
{
  GstClock *clock = gst_element_get_clock (element);
  if (!clock || !GST_CLOCK_TIME_IS_VALID (captured)) {
    gst_clear_object (&clock);
    return -1;
  }
  const GstClockTimeDiff age = GST_CLOCK_DIFF (captured, gst_clock_get_time (clock));
  gst_object_unref (clock);
  /* otherwise the time is of another clock */
  return ABS (age) < 10 * GstClockTimeDiff (GST_SECOND) ? g_get_monotonic_time () - age / 1000 : -1;
}

/* Whether decoders should not use earlier frame sets. As in neighbourcodedec, DISCONT alone does
 * not say so: it comes with each lost packet, and slices name the frame sets that they refer to. */
static bool
is_discontinuity (GstRangeWebSinkPrivate *priv, GstBuffer *buffer)
{
  const GstClockTime last = std::exchange (priv->last_pts, GST_BUFFER_PTS (buffer));
  if (std::exchange (priv->new_caps, false))
    return true;
  if (!GST_BUFFER_IS_DISCONT (buffer))
    return false;
  return !GST_BUFFER_PTS_IS_VALID (buffer) || !GST_CLOCK_TIME_IS_VALID (last) ||
         GST_BUFFER_PTS (buffer) < last || GST_BUFFER_PTS (buffer) - last > GST_SECOND;
}

static GstFlowReturn
gst_range_web_sink_render (GstBaseSink *base, GstBuffer *buffer)
{
  GstRangeWebSinkPrivate *priv = GST_RANGE_WEB_SINK (base)->priv;
  gpointer units = nullptr;
  gsize size = 0;
  gst_buffer_extract_dup (buffer, 0, gst_buffer_get_size (buffer), &units, &size);
  GST_LOG_OBJECT (base, "%" G_GSIZE_FORMAT " bytes of %" GST_TIME_FORMAT, size,
      GST_TIME_ARGS (GST_BUFFER_PTS (buffer)));
  current_server (priv)->push (web::BytesPtr (g_bytes_new_take (units, size)),
      !GST_BUFFER_FLAG_IS_SET (buffer, GST_BUFFER_FLAG_DELTA_UNIT), is_discontinuity (priv, buffer),
      monotonic_us (GST_ELEMENT (base), capture_time_of (buffer)));
  priv->reporter.passed (GST_ELEMENT (base), buffer);
  return GST_FLOW_OK;
}

static gboolean
gst_range_web_sink_event (GstBaseSink *base, GstEvent *event)
{
  GstRangeWebSinkPrivate *priv = GST_RANGE_WEB_SINK (base)->priv;
  const bool ended = GST_EVENT_TYPE (event) == GST_EVENT_EOS;
  if (GST_EVENT_TYPE (event) == GST_EVENT_FLUSH_STOP) {
    priv->last_pts = GST_CLOCK_TIME_NONE;
    if (const auto server = current_server (priv))
      server->flush ();
  }
  /* waits until the last frame set was rendered */
  const gboolean handled =
      GST_BASE_SINK_CLASS (gst_range_web_sink_parent_class)->event (base, event);
  if (ended && handled) {
    if (const auto server = current_server (priv))
      server->end ();
    priv->reporter.finish ();
  }
  return handled;
}

/* ---- speech ---- */

static GstFlowReturn
gst_range_web_sink_audio_chain (GstPad *, GstObject *parent, GstBuffer *buffer)
{
  GstRangeWebSinkPrivate *priv = GST_RANGE_WEB_SINK (parent)->priv;
  if (priv->audio_segment.format != GST_FORMAT_TIME) {
    GST_ELEMENT_ERROR (parent, STREAM, FORMAT,
        ("audio needs a segment in time format, got %s",
            gst_format_get_name (priv->audio_segment.format)),
        (nullptr));
    gst_buffer_unref (buffer);
    return GST_FLOW_ERROR;
  }
  gint64 captured_us = monotonic_us (GST_ELEMENT (parent), capture_time_of (buffer));
  const GstClockTime running =
      gst_segment_to_running_time (&priv->audio_segment, GST_FORMAT_TIME, GST_BUFFER_PTS (buffer));
  if (captured_us < 0 && GST_CLOCK_TIME_IS_VALID (running)) /* live, or of another clock */
    captured_us = monotonic_us (
        GST_ELEMENT (parent), gst_element_get_base_time (GST_ELEMENT (parent)) + running);
  gpointer data = nullptr;
  gsize size = 0;
  gst_buffer_extract_dup (buffer, 0, gst_buffer_get_size (buffer), &data, &size);
  gst_buffer_unref (buffer);
  web::BytesPtr packet (g_bytes_new_take (data, size));
  const auto server = current_server (priv);
  if (!server)
    return GST_FLOW_FLUSHING;
  if (captured_us >= 0)
    server->push_audio (std::move (packet), captured_us);
  else
    GST_DEBUG_OBJECT (parent, "dropping a packet of speech: it is not known when it was captured");
  return GST_FLOW_OK;
}

/* Speech may begin, pause and end while frame sets go on. */
static gboolean
gst_range_web_sink_audio_event (GstPad *, GstObject *parent, GstEvent *event)
{
  if (GST_EVENT_TYPE (event) == GST_EVENT_SEGMENT)
    gst_event_copy_segment (event, &GST_RANGE_WEB_SINK (parent)->priv->audio_segment);
  gst_event_unref (event);
  return TRUE;
}

static GstPad *
gst_range_web_sink_request_pad (
    GstElement *element, GstPadTemplate *pad_template, const gchar *, const GstCaps *)
{
  GstRangeWebSinkPrivate *priv = GST_RANGE_WEB_SINK (element)->priv;
  if (GstPad *there = gst_element_get_static_pad (element, "audio")) {
    gst_object_unref (there);
    return nullptr;
  }
  GstPad *pad = gst_pad_new_from_template (pad_template, "audio");
  gst_segment_init (&priv->audio_segment, GST_FORMAT_TIME);
  gst_pad_set_chain_function (pad, GST_DEBUG_FUNCPTR (gst_range_web_sink_audio_chain));
  gst_pad_set_event_function (pad, GST_DEBUG_FUNCPTR (gst_range_web_sink_audio_event));
  gst_pad_set_active (pad, GST_STATE (element) > GST_STATE_READY);
  gst_element_add_pad (element, pad);
  if (const auto server = current_server (priv))
    server->set_audio (true);
  return pad;
}

static void
gst_range_web_sink_release_pad (GstElement *element, GstPad *pad)
{
  gst_pad_set_active (pad, FALSE);
  gst_element_remove_pad (element, pad);
  if (const auto server = current_server (GST_RANGE_WEB_SINK (element)->priv))
    server->set_audio (false);
}

/* On the server's thread, which does not wait for what upstream does with the event. */
static bool
request_key (GstObject *object)
{
  auto self = GST_RANGE_WEB_SINK (object);
  if (self->priv->requesting_key.exchange (true))
    return false;
  const GstElementCallAsyncFunc push = [] (GstElement *element, gpointer) {
    gst_pad_push_event (GST_BASE_SINK_PAD (element),
        gst_video_event_new_upstream_force_key_unit (GST_CLOCK_TIME_NONE, TRUE, 0));
    GST_RANGE_WEB_SINK (element)->priv->requesting_key = false;
  };
  gst_element_call_async (GST_ELEMENT (self), push, nullptr, nullptr);
  return true;
}

/* ---- life ---- */

/* The page of the build folder that this plugin was built in, or else the installed one. */
static std::string
default_root (GstElement *element)
{
  std::string root = RANGECAST_WEB_FOLDER;
  GstPlugin *plugin =
      gst_plugin_feature_get_plugin (GST_PLUGIN_FEATURE (gst_element_get_factory (element)));
  const gchar *file = plugin ? gst_plugin_get_filename (plugin) : nullptr;
  if (file) {
    g_autofree gchar *folder = g_path_get_dirname (file);
    const std::string built = std::string (folder) + "/../../pipelines/web";
    if (g_file_test ((built + "/index.html").c_str (), G_FILE_TEST_IS_REGULAR))
      root = built;
  }
  gst_clear_object (&plugin);
  return root;
}

static bool
gst_range_web_sink_start (GstElement *element)
{
  GstRangeWebSinkPrivate *priv = GST_RANGE_WEB_SINK (element)->priv;
  Settings settings = settings_of (priv);
  if (settings.root.empty ())
    settings.root = default_root (element);
  priv->last_pts = GST_CLOCK_TIME_NONE;
  auto server = std::make_shared<web::Server> (GST_OBJECT (element), settings, request_key);
  if (const Status status = server->start ();
      gst_range_flow_return (element, status) != GST_FLOW_OK)
    return false;
  if (GstPad *audio = gst_element_get_static_pad (element, "audio")) {
    server->set_audio (true);
    gst_object_unref (audio);
  }
  {
    std::lock_guard guard (priv->lock);
    priv->settings.url = server->url ();
    priv->server = server;
  }
  GST_INFO_OBJECT (element, "listening at %s", server->url ().c_str ());
  gst_element_post_message (element, gst_message_new_element (GST_OBJECT (element),
                                         gst_structure_new ("rangewebsink-address", "url",
                                             G_TYPE_STRING, server->url ().c_str (), nullptr)));
  return true;
}

static void
gst_range_web_sink_stop (GstRangeWebSinkPrivate *priv)
{
  std::shared_ptr<web::Server> server; /* ends without the lock */
  std::lock_guard guard (priv->lock);
  server.swap (priv->server);
  priv->settings.url.clear ();
}

static std::vector<StatsRow>
collect_stats (GstElement *element)
{
  const auto server = current_server (GST_RANGE_WEB_SINK (element)->priv);
  if (!server)
    return {{}};
  const auto &counters = server->counters ();
  return {{.counters = {.frames = counters.frame_sets, .bytes = counters.bytes}}};
}

static GstStateChangeReturn
gst_range_web_sink_change_state (GstElement *element, GstStateChange transition)
{
  GstRangeWebSinkPrivate *priv = GST_RANGE_WEB_SINK (element)->priv;
  /* Not the base class's start(), which it calls from NULL to READY and whose failure is another
   * error message. */
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED) {
    if (!gst_range_web_sink_start (element))
      return GST_STATE_CHANGE_FAILURE;
    priv->reporter.start (element, collect_stats);
  }
  const GstStateChangeReturn result =
      GST_ELEMENT_CLASS (gst_range_web_sink_parent_class)->change_state (element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY ||
      (transition == GST_STATE_CHANGE_READY_TO_PAUSED && result == GST_STATE_CHANGE_FAILURE)) {
    priv->reporter.stop ();
    gst_range_web_sink_stop (priv);
  }
  return result;
}

/* With the lock held. */
static GstStructure *
make_stats (GstRangeWebSinkPrivate *priv)
{
  static const web::Server::Counters kNone;
  const auto &counters = priv->server ? priv->server->counters () : kNone;
  return gst_structure_new ("server-stats", "clients", G_TYPE_UINT, counters.clients.load (),
      "connections", G_TYPE_UINT64, counters.connections.load (), "refused", G_TYPE_UINT64,
      counters.refused.load (), "frame-sets", G_TYPE_UINT64, counters.frame_sets.load (),
      "key-requests", G_TYPE_UINT64, counters.key_requests.load (), "bytes", G_TYPE_UINT64,
      counters.bytes.load (), nullptr);
}

static PropertyTable<Settings> &
web_properties ()
{
  using P = PropertyTable<Settings>;
  static P table = {
      P::text<&Settings::address> ("address", "Address",
          "Address or name to listen at; one that other machines can reach needs token, token-file "
          "or anonymous",
          kMutableReady),
      P::number<&Settings::port> (
          "port", "Port", "TCP port (0 = any that is free)", 0, 65535, kMutableReady),
      P::text<&Settings::url> ("url", "URL", "Address of the page; null before PAUSED", kReadOnly),
      P::text<&Settings::root> (
          "root", "Root", "Folder of the page (default: the installed page)", kMutableReady),
      P::text<&Settings::title> ("title", "Title", "Title of the page", kMutableReady),
      P::text<&Settings::certificate> ("certificate", "Certificate",
          "PEM file of the TLS certificate, and of those that signed it; null: no TLS",
          kMutableReady),
      P::text<&Settings::private_key> ("private-key", "Private key",
          "PEM file of the certificate's private key; null: it is in the certificate's file",
          kMutableReady),
      P::text<&Settings::token> ("token", "Token",
          "Shared secret that clients must send; null: none",
          GParamFlags (G_PARAM_WRITABLE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_READY)),
      P::text<&Settings::token_file> ("token-file", "Token file",
          "File of lines `name token`, one for each user; read whenever a client enters",
          kMutableReady),
      P::boolean<&Settings::anonymous> ("anonymous", "Anonymous",
          "Serve without a token also where other machines can connect", kMutableReady),
      P::text<&Settings::origins> ("origins", "Origins",
          "Origins (https://HOST:PORT) of other servers' pages that may connect, separated by "
          "spaces",
          kMutableReady),
      P::text<&Settings::frame_ancestors> ("frame-ancestors", "Frame ancestors",
          "Origins (https://HOST:PORT) whose pages may show this one in a frame, separated by "
          "spaces; *: all; null: none",
          kMutableReady),
      P::number<&Settings::max_clients> (
          "max-clients", "Max clients", "Maximum number of clients", 1, 10000, kMutableReady),
      P::number<&Settings::window> ("window", "Window",
          "Maximum number of frame sets in flight to a client, not acknowledged yet", 1, 1000,
          kMutableReady),
      P::text<&Settings::stats_address> ("stats-address", "Stats address",
          "udp://ADDRESS:PORT where hosts send their statistics for the dashboard; null: none",
          kMutableReady),
  };
  return table;
}

static void
gst_range_web_sink_init (GstRangeWebSink *self)
{
  self->priv = new GstRangeWebSinkPrivate;
}

static void
gst_range_web_sink_class_init (GstRangeWebSinkClass *klass)
{
  auto object_class = G_OBJECT_CLASS (klass);
  auto element_class = GST_ELEMENT_CLASS (klass);
  auto base_class = GST_BASE_SINK_CLASS (klass);

  object_class->finalize = delete_private<GstRangeWebSink>;
  install_properties<GstRangeWebSink, web_properties, make_stats> (object_class,
      "clients (uint), connections, refused, frame-sets, key-requests, bytes (guint64)",
      "server-stats");

  gst_element_class_add_static_pad_template (element_class, &sink_template);
  gst_element_class_add_static_pad_template (element_class, &audio_template);
  gst_element_class_set_static_metadata (element_class, "Range web sink", "Sink/Network",
      "Serves coded frame sets, and a page that shows them, to browsers", "gst-rangecast");
  element_class->change_state = GST_DEBUG_FUNCPTR (gst_range_web_sink_change_state);
  element_class->request_new_pad = GST_DEBUG_FUNCPTR (gst_range_web_sink_request_pad);
  element_class->release_pad = GST_DEBUG_FUNCPTR (gst_range_web_sink_release_pad);

  base_class->set_caps = GST_DEBUG_FUNCPTR (gst_range_web_sink_set_caps);
  base_class->event = GST_DEBUG_FUNCPTR (gst_range_web_sink_event);
  base_class->render = GST_DEBUG_FUNCPTR (gst_range_web_sink_render);
}
