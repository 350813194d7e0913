/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "media.hpp"

#include <gst/video/video.h>

#include "common/dump-graph.hpp"
#include "glue.hpp"
#include "join.hpp"
#include "tcp-viewer.hpp"

namespace {

const char kCodedType[] = "video/x-neighbour-code";
/* Object data of a media: it has its first frame set; it is live. */
const char kPreparedKey[] = "rangecast-prepared", kLiveKey[] = "rangecast-live";
/* Maximum time for which EOS waits for the time of the last frame set and for its packets. */
constexpr gint64 kMaxEosWait_us = 2 * G_USEC_PER_SEC;
constexpr GstClockTime kSendTime = 100 * GST_MSECOND;

/* ---- the launch string ---- */

/* test-launch of gst-rtsp-server needs parentheses, so users write them. */
std::string
without_parentheses (const std::string &launch)
{
  if (launch.size () < 2 || launch.front () != '(' || launch.back () != ')')
    return launch;
  return launch.substr (1, launch.size () - 2);
}

bool
may_give (GstPad *pad, const char *media_type)
{
  GstCaps *caps = gst_pad_query_caps (pad, nullptr);
  bool may = false;
  for (guint i = 0; i < gst_caps_get_size (caps) && !may; i++)
    may = gst_structure_has_name (gst_caps_get_structure (caps, i), media_type);
  gst_caps_unref (caps);
  return may;
}

void
set_error (GError **error, const std::string &text)
{
  g_set_error_literal (error, GST_PARSE_ERROR, GST_PARSE_ERROR_LINK, text.c_str ());
}

bool
add_payloader (GstBin *bin, GError **error)
{
  GstPad *end = gst_bin_find_unlinked_pad (bin, GST_PAD_SRC);
  if (!end) {
    set_error (
        error, "expected a payloader named pay0, or an unlinked source pad with coded frame sets");
    return false;
  }
  bool added = false;
  GstElement *payloader = nullptr;
  if (!may_give (end, kCodedType)) {
    gchar *name = gst_pad_get_name (end);
    GstElement *owner = gst_pad_get_parent_element (end);
    set_error (error, std::string ("expected coded frame sets at the end (neighbourcodeenc), or a "
                                   "payloader named pay0; the end is pad ") +
                          name + " of " + GST_OBJECT_NAME (owner));
    gst_object_unref (owner);
    g_free (name);
  } else if (!(payloader = gst_element_factory_make ("rtpneighbourcodepay", "pay0"))) {
    set_error (error, "no element rtpneighbourcodepay: expected GST_PLUGIN_PATH to lead "
                      "to the plugins of gst-rangecast, as pipelines/env.sh does");
  } else {
    gst_bin_add (bin, payloader);
    GstPad *sink = gst_element_get_static_pad (payloader, "sink");
    added = gst_pad_link (end, sink) == GST_PAD_LINK_OK;
    gst_object_unref (sink);
    if (!added)
      set_error (error, "the end of the launch string cannot be linked to rtpneighbourcodepay");
  }
  gst_object_unref (end);
  return added;
}

} // namespace

GstElement *
make_stream_bin (const std::string &launch, GError **error)
{
  GstElement *bin = gst_parse_bin_from_description_full (
      without_parentheses (launch).c_str (), FALSE, nullptr, GST_PARSE_FLAG_FATAL_ERRORS, error);
  if (!bin)
    return nullptr;
  if (GstElement *payloader = gst_bin_get_by_name (GST_BIN (bin), "pay0")) {
    gst_object_unref (payloader);
    return bin;
  }
  if (add_payloader (GST_BIN (bin), error))
    return bin;
  gst_object_unref (gst_object_ref_sink (bin));
  return nullptr;
}

namespace {

/* ---- the media ---- */

struct Stage {
  StreamCounts *counts;
  StreamEnd on_end;
};

/* Reports the end of a media, whose elements may outlive it. */
struct Listener {
  Listener (GstRTSPMedia *media, const StreamEnd &on_end) : on_end_ (on_end)
  {
    g_weak_ref_init (&media_, media);
  }
  ~Listener () { g_weak_ref_clear (&media_); }
  void report (bool is_over, const std::string &why)
  {
    auto media = static_cast<GstRTSPMedia *> (g_weak_ref_get (&media_));
    if (!media)
      return;
    on_end_ (media, is_over, why);
    g_object_unref (media);
  }

  /* Once the media has its first frame set. */
  bool is_live ()
  {
    auto media = static_cast<GstRTSPMedia *> (g_weak_ref_get (&media_));
    const bool live = media && g_object_get_data (G_OBJECT (media), kLiveKey);
    g_clear_object (&media);
    return live;
  }

private:
  GWeakRef media_;
  StreamEnd on_end_;
};

void
on_bus_message (GstBus *, GstMessage *message, gpointer user_data)
{
  auto &listener = *static_cast<Listener *> (user_data);
  GError *error = nullptr;
  gchar *details = nullptr;
  dump_graph (message, "rtsp-server");
  if (GST_MESSAGE_TYPE (message) == GST_MESSAGE_STATE_CHANGED)
    return;
  if (GST_MESSAGE_TYPE (message) == GST_MESSAGE_EOS) {
    if (GST_IS_PIPELINE (message->src))
      listener.report (true, "");
    return;
  }
  const bool is_error = GST_MESSAGE_TYPE (message) == GST_MESSAGE_ERROR;
  if (is_error)
    gst_message_parse_error (message, &error, &details);
  else
    gst_message_parse_warning (message, &error, nullptr);
  const std::string text = std::string (GST_OBJECT_NAME (message->src)) + ": " + error->message;
  if (is_error)
    listener.report (true, details ? text + "\n" + details : text);
  else
    g_printerr ("rtsp-server: warning: %s\n", text.c_str ());
  g_free (details);
  g_error_free (error);
}

void
count_packet (StreamCounts &counts, GstBuffer *packet)
{
  counts.bytes += gst_buffer_get_size (packet);
  if (GST_BUFFER_FLAG_IS_SET (packet, GST_BUFFER_FLAG_MARKER))
    counts.frame_sets++;
}

GstPadProbeReturn
on_payload (GstPad *, GstPadProbeInfo *info, gpointer user_data)
{
  StreamCounts &counts = *static_cast<StreamCounts *> (user_data);
  if (GST_PAD_PROBE_INFO_TYPE (info) & GST_PAD_PROBE_TYPE_BUFFER_LIST) {
    GstBufferList *list = GST_PAD_PROBE_INFO_BUFFER_LIST (info);
    for (guint i = 0; i < gst_buffer_list_length (list); i++)
      count_packet (counts, gst_buffer_list_get (list, i));
  } else if (GST_PAD_PROBE_INFO_TYPE (info) & GST_PAD_PROBE_TYPE_BUFFER) {
    count_packet (counts, GST_PAD_PROBE_INFO_BUFFER (info));
  } else if (gst_video_event_is_force_key_unit (GST_PAD_PROBE_INFO_EVENT (info))) {
    counts.key_requests++;
  }
  return GST_PAD_PROBE_OK;
}

/* The one pay0, or the first of several. */
GstPad *
payload_pad (GstRTSPMedia *media)
{
  GstElement *bin = gst_rtsp_media_get_element (media);
  GstElement *payloader = gst_bin_get_by_name (GST_BIN (bin), "pay0");
  GstPad *pad = payloader ? gst_element_get_static_pad (payloader, "src") : nullptr;
  gst_clear_object (&payloader);
  gst_object_unref (bin);
  return pad;
}

bool
is_live (GstRTSPMedia *media)
{
  GstQuery *query = gst_query_new_latency ();
  gboolean live = FALSE;
  if (GstPad *pad = payload_pad (media)) {
    if (gst_pad_query (pad, query))
      gst_query_parse_latency (query, &live, nullptr, nullptr);
    gst_object_unref (pad);
  }
  gst_query_unref (query);
  return live;
}

void
on_prepared (GstRTSPMedia *media, gpointer)
{
  g_object_set_data (G_OBJECT (media), kPreparedKey, media);
  g_object_set_data (G_OBJECT (media), kLiveKey, is_live (media) ? media : nullptr);
  disable_live_sync (media);
}

/* gst_rtsp_media_set_rate_control() of 1.22 leaves multiudpsink out. */
void
disable_udp_sync (GstRTSPMedia *media)
{
  GstElement *pipeline = pipeline_of (media);
  if (!pipeline)
    return;
  GstIterator *elements =
      gst_bin_iterate_elements (GST_BIN (pipeline)); /* not of the launch string */
  const auto disable = [] (const GValue *value, gpointer) {
    auto element = GST_ELEMENT (g_value_get_object (value));
    GstElementFactory *factory = gst_element_get_factory (element);
    if (factory && g_str_equal (GST_OBJECT_NAME (factory), "multiudpsink"))
      g_object_set (element, "sync", FALSE, nullptr);
  };
  while (gst_iterator_foreach (elements, disable, nullptr) == GST_ITERATOR_RESYNC)
    gst_iterator_resync (elements);
  gst_iterator_free (elements);
  gst_object_unref (pipeline);
}

} // namespace

void
disable_live_sync (GstRTSPMedia *media)
{
  if (!g_object_get_data (G_OBJECT (media), kLiveKey))
    return;
  gst_rtsp_media_set_rate_control (media, FALSE);
  disable_udp_sync (media);
  for (guint i = 0; i < gst_rtsp_media_n_streams (media); i++) {
    GObject *session = gst_rtsp_stream_get_rtpsession (gst_rtsp_media_get_stream (media, i));
    if (!session)
      continue;
    /* gst_rtsp_media_set_rate_control() has set it. */
    g_object_set (session, "disable-sr-timestamp", FALSE, nullptr);
    g_object_unref (session);
  }
}

namespace {

/* GstRTSPClientClass::adjust_play_mode, which is unset in 1.22. */
GstRTSPStatusCode
adjust_play_mode (GstRTSPClient *, GstRTSPContext *context, GstRTSPTimeRange **, GstSeekFlags *,
    gdouble *, GstClockTime *, gboolean *enable_rate_control)
{
  if (context->media && g_object_get_data (G_OBJECT (context->media), kLiveKey))
    *enable_rate_control = FALSE;
  return GST_RTSP_STS_OK;
}

} // namespace

void
disable_live_sync_at_play ()
{
  auto klass = static_cast<GstRTSPClientClass *> (g_type_class_ref (GST_TYPE_RTSP_CLIENT));
  if (!klass->adjust_play_mode)
    klass->adjust_play_mode = adjust_play_mode;
}

void
request_key_frame_set (GstRTSPMedia *media)
{
  if (GstPad *pad = payload_pad (media)) {
    gst_pad_send_event (
        pad, gst_video_event_new_upstream_force_key_unit (GST_CLOCK_TIME_NONE, TRUE, 0));
    gst_object_unref (pad);
  }
}

namespace {

/* ---- the end of the stream ---- */

struct EndWatch {
  Listener listener;
  GstClockTime last_pts = GST_CLOCK_TIME_NONE; /* streaming thread */
};

/* The clock time of a PTS at a pad; NONE without a segment. */
GstClockTime
clock_time_of (GstPad *pad, GstElement *element, GstClockTime pts)
{
  GstClockTime running_time = GST_CLOCK_TIME_NONE;
  if (GstEvent *event = gst_pad_get_sticky_event (pad, GST_EVENT_SEGMENT, 0)) {
    const GstSegment *segment = nullptr;
    gst_event_parse_segment (event, &segment);
    running_time = gst_segment_to_running_time (segment, GST_FORMAT_TIME, pts);
    gst_event_unref (event);
  }
  if (!GST_CLOCK_TIME_IS_VALID (running_time))
    return GST_CLOCK_TIME_NONE;
  return gst_element_get_base_time (element) + running_time;
}

/* rtpbin sends RTCP BYE as soon as it gets EOS, while the last frame sets still wait in the sinks
 * for the clock, and players stop at BYE. So EOS waits for the sinks. */
void
wait_for_sinks (GstPad *pad, GstClockTime last_pts)
{
  GstElement *element = gst_pad_get_parent_element (pad);
  GstClock *clock = element ? gst_element_get_clock (element) : nullptr;
  if (clock && GST_CLOCK_TIME_IS_VALID (last_pts)) {
    const GstClockTime due = clock_time_of (pad, element, last_pts);
    const gint64 until_us = g_get_monotonic_time () + kMaxEosWait_us;
    while (GST_CLOCK_TIME_IS_VALID (due) && gst_clock_get_time (clock) < due + kSendTime &&
           !GST_PAD_IS_FLUSHING (pad) && g_get_monotonic_time () < until_us)
      g_usleep (10000);
  }
  gst_clear_object (&clock);
  gst_clear_object (&element);
}

/* EOS is on the bus only when the last frame set has had its duration, but viewers get BYE now. */
GstPadProbeReturn
on_payload_end (GstPad *pad, GstPadProbeInfo *info, gpointer user_data)
{
  auto &watch = *static_cast<EndWatch *> (user_data);
  const GstPadProbeType type = GST_PAD_PROBE_INFO_TYPE (info);
  if (type & GST_PAD_PROBE_TYPE_BUFFER) {
    watch.last_pts = GST_BUFFER_PTS (GST_PAD_PROBE_INFO_BUFFER (info));
  } else if (type & GST_PAD_PROBE_TYPE_BUFFER_LIST) {
    GstBufferList *list = GST_PAD_PROBE_INFO_BUFFER_LIST (info);
    if (gst_buffer_list_length (list) > 0)
      watch.last_pts = GST_BUFFER_PTS (gst_buffer_list_get (list, 0));
  } else if (GST_EVENT_TYPE (GST_PAD_PROBE_INFO_EVENT (info)) == GST_EVENT_EOS) {
    watch.listener.report (false, "");
    if (!watch.listener.is_live ())
      wait_for_sinks (pad, watch.last_pts);
  }
  return GST_PAD_PROBE_OK;
}

} // namespace

/* ---- the factory ---- */

G_BEGIN_DECLS
struct LaunchFactory {
  GstRTSPMediaFactory parent;
  gint run;        /* atomic */
  gint is_ending;  /* atomic; the server */
  GWeakRef latest; /* media */
};
struct LaunchFactoryClass {
  GstRTSPMediaFactoryClass parent_class;
};
G_END_DECLS
G_DEFINE_TYPE (LaunchFactory, launch_factory, GST_TYPE_RTSP_MEDIA_FACTORY)

static GstElement *
launch_factory_create_element (GstRTSPMediaFactory *factory, const GstRTSPUrl *)
{
  gchar *launch = gst_rtsp_media_factory_get_launch (factory);
  GError *error = nullptr;
  GstElement *bin = make_stream_bin (launch, &error);
  if (!bin)
    g_printerr ("rtsp-server: launch string: %s\n", error->message);
  g_clear_error (&error);
  g_free (launch);
  return bin;
}

/* All viewers share a run, whatever port or query their URL has. */
static gchar *
launch_factory_gen_key (GstRTSPMediaFactory *factory, const GstRTSPUrl *)
{
  return g_strdup_printf (
      "%d", g_atomic_int_get (&reinterpret_cast<LaunchFactory *> (factory)->run));
}

void
begin_new_run (GstRTSPMediaFactory *factory)
{
  g_atomic_int_inc (&reinterpret_cast<LaunchFactory *> (factory)->run);
}

static void
launch_factory_init (LaunchFactory *factory)
{
  g_weak_ref_init (&factory->latest, nullptr);
}

static void
launch_factory_finalize (GObject *object)
{
  g_weak_ref_clear (&reinterpret_cast<LaunchFactory *> (object)->latest);
  G_OBJECT_CLASS (launch_factory_parent_class)->finalize (object);
}

static void
launch_factory_class_init (LaunchFactoryClass *klass)
{
  G_OBJECT_CLASS (klass)->finalize = launch_factory_finalize;
  GST_RTSP_MEDIA_FACTORY_CLASS (klass)->create_element = launch_factory_create_element;
  GST_RTSP_MEDIA_FACTORY_CLASS (klass)->gen_key = launch_factory_gen_key;
}

namespace {

/* gst_rtsp_media_prepare() cannot be cancelled, but returns on an error. */
void
post_error (GstRTSPMedia *media)
{
  if (GstElement *pipeline = pipeline_of (media)) {
    GError *error =
        g_error_new_literal (GST_CORE_ERROR, GST_CORE_ERROR_FAILED, "the server is shutting down");
    gst_element_post_message (
        pipeline, gst_message_new_error (GST_OBJECT (pipeline), error, nullptr));
    g_error_free (error);
    gst_object_unref (pipeline);
  }
}

} // namespace

void
end_waiting (GstRTSPMediaFactory *factory)
{
  auto launch_factory = reinterpret_cast<LaunchFactory *> (factory);
  g_atomic_int_set (&launch_factory->is_ending, 1);
  auto media = static_cast<GstRTSPMedia *> (g_weak_ref_get (&launch_factory->latest));
  if (!media)
    return;
  if (!g_object_get_data (G_OBJECT (media), kPreparedKey))
    post_error (media);
  g_object_unref (media);
}

namespace {

void
on_media_configure (GstRTSPMediaFactory *factory, GstRTSPMedia *media, gpointer user_data)
{
  auto stage = static_cast<Stage *> (user_data);
  auto launch_factory = reinterpret_cast<LaunchFactory *> (factory);
  const bool has_one_stream = gst_rtsp_media_n_streams (media) == 1;
  prepare_tcp_queues (media);
  if (GstElement *pipeline = pipeline_of (media)) {
    GstBus *bus = gst_element_get_bus (pipeline);
    gst_bus_enable_sync_message_emission (bus);
    for (const char *signal : {"sync-message::error", "sync-message::warning", "sync-message::eos",
             "sync-message::state-changed"})
      g_signal_connect_data (bus, signal, G_CALLBACK (on_bus_message),
          new Listener (media, stage->on_end), delete_closure_data<Listener>, GConnectFlags (0));
    gst_object_unref (bus);
    GstElement *payloader = gst_bin_get_by_name (GST_BIN (pipeline), "pay0");
    if (payloader && has_one_stream)
      JoinGate::install (media, pipeline, payloader);
    gst_clear_object (&payloader);
    gst_object_unref (pipeline);
  }
  if (GstPad *pad = payload_pad (media)) {
    gst_pad_add_probe (pad,
        GstPadProbeType (GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_BUFFER_LIST |
                         GST_PAD_PROBE_TYPE_EVENT_UPSTREAM),
        on_payload, stage->counts, nullptr);
    if (has_one_stream) /* of several streams, others may go on */
      gst_pad_add_probe (pad, GST_PAD_PROBE_TYPE_DATA_DOWNSTREAM, on_payload_end,
          new EndWatch{{media, stage->on_end}}, delete_data<EndWatch>);
    gst_object_unref (pad);
  }
  g_signal_connect (media, "prepared", G_CALLBACK (on_prepared), nullptr);
  g_weak_ref_set (&launch_factory->latest, media);
  if (g_atomic_int_get (&launch_factory->is_ending))
    post_error (media);
}

void
set_multicast (GstRTSPMediaFactory *factory, const MulticastRange &range)
{
  GstRTSPAddressPool *pool = gst_rtsp_address_pool_new ();
  gst_rtsp_address_pool_add_range (pool, range.first.c_str (), range.last.c_str (),
      guint16 (range.first_port), guint16 (range.last_port), guint8 (range.ttl));
  gst_rtsp_media_factory_set_address_pool (factory, pool);
  gst_rtsp_media_factory_set_max_mcast_ttl (factory, guint (range.ttl));
  g_object_unref (pool);
}

} // namespace

GstRTSPMediaFactory *
make_factory (const RtspOptions &options, StreamCounts &counts, StreamEnd on_end)
{
  auto factory = GST_RTSP_MEDIA_FACTORY (g_object_new (launch_factory_get_type (), nullptr));
  gst_rtsp_media_factory_set_launch (factory, options.launch.c_str ());
  gst_rtsp_media_factory_set_shared (factory, TRUE);
  gst_rtsp_media_factory_set_suspend_mode (factory, GST_RTSP_SUSPEND_MODE_NONE);
  /* AVPF, for immediate PLI and NACK. With AVP beside it the SDP would have two streams, and
   * players set up both. */
  const bool is_clear = options.tcp && !options.udp && options.multicast.first.empty ();
  gst_rtsp_media_factory_set_profiles (factory, options.certificate_file.empty () || is_clear
                                                    ? GST_RTSP_PROFILE_AVPF
                                                    : GST_RTSP_PROFILE_SAVPF);
  int protocols = GST_RTSP_LOWER_TRANS_TCP; /* always, for MediaKeepAlive */
  if (options.udp)
    protocols |= GST_RTSP_LOWER_TRANS_UDP;
  if (!options.multicast.first.empty ()) {
    protocols |= GST_RTSP_LOWER_TRANS_UDP_MCAST;
    set_multicast (factory, options.multicast);
  }
  gst_rtsp_media_factory_set_protocols (factory, GstRTSPLowerTrans (protocols));
  if (options.retransmission_ms > 0) {
    gst_rtsp_media_factory_set_do_retransmission (factory, TRUE);
    gst_rtsp_media_factory_set_retransmission_time (
        factory, guint64 (options.retransmission_ms) * GST_MSECOND);
  }
  /* One role for all users: it must be a GstStructure name, which a user name need not be. */
  gst_rtsp_media_factory_add_role (factory, kViewerRole, "media.factory.access", G_TYPE_BOOLEAN,
      TRUE, "media.factory.construct", G_TYPE_BOOLEAN, TRUE, nullptr);
  g_signal_connect_data (factory, "media-configure", G_CALLBACK (on_media_configure),
      new Stage{&counts, std::move (on_end)}, delete_closure_data<Stage>, GConnectFlags (0));
  return factory;
}
