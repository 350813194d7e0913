/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "datachannel.hpp"

#include <gst/sdp/sdp.h>

#include <sys/resource.h>

#include <atomic>
#include <mutex>

#include "category.hpp"
#include "protocol.hpp"

namespace web {

struct DataChannel::Link {
  DataChannel *channel; /* server's thread only; null when it is gone */
  std::mutex lock;      /* held while the pipeline's state changes */
  bool closed = false;  /* with the lock */

  Link (DataChannel *of, GMainContext *server) : channel (of), context_ (server) {}

  /* For signals and threads: a reference of their own. */
  static gpointer hold (const std::shared_ptr<Link> &link) { return new std::shared_ptr (link); }
  static const std::shared_ptr<Link> &held (gpointer data)
  {
    return *static_cast<std::shared_ptr<Link> *> (data);
  }
  static void release (gpointer data) { delete static_cast<std::shared_ptr<Link> *> (data); }
  static void release_closure (gpointer data, GClosure *) { release (data); }

  /* On the server's thread. Nothing is posted to its main context from here on, so that what is
   * posted to it goes with it. */
  void detach ()
  {
    std::lock_guard guard (context_lock_);
    channel = nullptr;
    context_ = nullptr;
  }

  /* Calls on the server's thread, unless the owner is gone by then. */
  template <class Call> static void post (const std::shared_ptr<Link> &link, Call call)
  {
    struct Posted {
      std::shared_ptr<Link> link;
      Call call;
    };
    const auto run = [] (gpointer data) -> gboolean {
      const auto posted = static_cast<Posted *> (data);
      if (posted->link->channel)
        posted->call (*posted->link->channel);
      return G_SOURCE_REMOVE;
    };
    const auto free = [] (gpointer data) { delete static_cast<Posted *> (data); };
    std::lock_guard guard (link->context_lock_);
    if (!link->context_)
      return;
    GSource *source = g_idle_source_new ();
    g_source_set_priority (source, G_PRIORITY_DEFAULT); /* in the order of posting */
    g_source_set_callback (source, run, new Posted{link, std::move (call)}, free);
    g_source_attach (source, link->context_);
    g_source_unref (source);
  }

private:
  std::mutex context_lock_;
  GMainContext *context_; /* with its lock; null when the channel is gone */
};

namespace {

/** File descriptors of a webrtcbin: 24 were counted, more with more network interfaces. */
constexpr rlim_t kDescriptors = 32;
/** Channels of this process, until their pipelines have stopped. */
std::atomic<int> channels = 0;

/* Asks no router for ports. */
void
switch_upnp_off (GstElement *webrtc)
{
  GObject *ice = nullptr, *agent = nullptr;
  g_object_get (webrtc, "ice-agent", &ice, nullptr);
  if (ice && g_object_class_find_property (G_OBJECT_GET_CLASS (ice), "agent"))
    g_object_get (ice, "agent", &agent, nullptr);
  if (agent)
    g_object_set (agent, "upnp", FALSE, nullptr);
  g_clear_object (&agent);
  g_clear_object (&ice);
}

/* What the page of this protocol version answers: one data section with the keys of a transport.
 * webrtcbin is not asked about other descriptions. */
bool
is_answer (const GstSDPMessage *sdp)
{
  if (gst_sdp_message_medias_len (sdp) != 1)
    return false;
  const GstSDPMedia *media = gst_sdp_message_get_media (sdp, 0);
  const auto has = [&] (const char *name) {
    return gst_sdp_media_get_attribute_val (media, name) ||
           gst_sdp_message_get_attribute_val (sdp, name);
  };
  return g_strcmp0 (gst_sdp_media_get_media (media), "application") == 0 &&
         g_strcmp0 (gst_sdp_media_get_proto (media), "UDP/DTLS/SCTP") == 0 &&
         gst_sdp_media_get_attribute_val (media, "mid") && has ("ice-ufrag") && has ("ice-pwd") &&
         has ("fingerprint") && has ("setup");
}

} // namespace

bool
DataChannel::is_supported (std::string &missing)
{
  for (const char *name : {"webrtcbin", "nicesink", "dtlssrtpenc", "sctpenc", "sctpdec"}) {
    GstElementFactory *factory = gst_element_factory_find (name);
    if (!factory) {
      missing = name;
      return false;
    }
    gst_object_unref (factory);
  }
  return true;
}

bool
DataChannel::has_room ()
{
  rlimit limit = {};
  getrlimit (RLIMIT_NOFILE, &limit);
  const rlim_t others = limit.rlim_cur / 4; /* for WebSockets and the rest of the process */
  return limit.rlim_cur == RLIM_INFINITY ||
         rlim_t (channels + 1) * kDescriptors <= limit.rlim_cur - others;
}

/* ---- on webrtcbin's threads ---- */

void
DataChannel::offer (GstElement *webrtc, const std::shared_ptr<Link> &link)
{
  struct Offer {
    std::shared_ptr<Link> link;
    GstElement *webrtc;
  };
  const GstPromiseChangeFunc created = [] (GstPromise *promise, gpointer data) {
    const auto offer = static_cast<Offer *> (data);
    GstWebRTCSessionDescription *description = nullptr;
    if (gst_promise_wait (promise) == GST_PROMISE_RESULT_REPLIED)
      gst_structure_get (gst_promise_get_reply (promise), "offer",
          GST_TYPE_WEBRTC_SESSION_DESCRIPTION, &description, nullptr);
    gst_promise_unref (promise);
    if (!description)
      return;
    g_autofree gchar *sdp = gst_sdp_message_as_text (description->sdp);
    Link::post (offer->link, [message = R"({"type":"offer","sdp":)" + json_string (sdp) + "}"] (
                                 DataChannel &self) { self.owner_.signal (message); });
    /* candidates follow */
    g_signal_emit_by_name (offer->webrtc, "set-local-description", description, nullptr);
    gst_webrtc_session_description_free (description);
  };
  const auto free = [] (gpointer data) {
    const auto offer = static_cast<Offer *> (data);
    gst_object_unref (offer->webrtc);
    delete offer;
  };
  GstPromise *promise = gst_promise_new_with_change_func (
      created, new Offer{link, static_cast<GstElement *> (gst_object_ref (webrtc))}, free);
  g_signal_emit_by_name (webrtc, "create-offer", nullptr, promise);
}

void
DataChannel::on_candidate (GstElement *, guint line, gchar *candidate, gpointer link)
{
  Link::post (Link::held (link),
      [message = R"({"type":"candidate","candidate":)" + json_string (candidate) +
                 ",\"sdpMLineIndex\":" + std::to_string (line) +
                 "}"] (DataChannel &self) { self.owner_.signal (message); });
}

void
DataChannel::on_connection_state (GstElement *webrtc, GParamSpec *, gpointer link)
{
  GstWebRTCPeerConnectionState state = GST_WEBRTC_PEER_CONNECTION_STATE_NEW;
  g_object_get (webrtc, "connection-state", &state, nullptr);
  if (state == GST_WEBRTC_PEER_CONNECTION_STATE_FAILED)
    Link::post (Link::held (link),
        [] (DataChannel &self) { self.change (false, "no connection to the client"); });
}

/* On a thread of GStreamer's pool, because webrtcbin makes a key, which takes 100 ms. */
void
DataChannel::open (GstElement *pipeline, const std::shared_ptr<Link> &link)
{
  std::lock_guard guard (link->lock);
  if (link->closed)
    return;
  GstElement *webrtc = gst_bin_get_by_name (GST_BIN (pipeline), "webrtc");
  gst_element_set_state (pipeline, GST_STATE_READY);
  GstStructure *options = gst_structure_new (
      "options", "ordered", G_TYPE_BOOLEAN, FALSE, "max-retransmits", G_TYPE_INT, 0, nullptr);
  GstWebRTCDataChannel *channel = nullptr;
  g_signal_emit_by_name (webrtc, "create-data-channel", "rangecast", options, &channel);
  gst_structure_free (options);
  if (channel) {
    const auto connect = [&] (const char *signal, GCallback call) {
      g_signal_connect_data (
          channel, signal, call, Link::hold (link), Link::release_closure, GConnectFlags (0));
    };
    const auto opened = [] (GstWebRTCDataChannel *channel, gpointer data) {
      const auto release = [] (GstWebRTCDataChannel *one) { g_object_unref (one); };
      std::shared_ptr<GstWebRTCDataChannel> held (
          static_cast<GstWebRTCDataChannel *> (g_object_ref (channel)), release);
      Link::post (Link::held (data), [held] (DataChannel &self) {
        self.channel_ = held;
        self.change (true, "");
      });
    };
    const auto closed = [] (GstWebRTCDataChannel *, gpointer data) {
      Link::post (Link::held (data),
          [] (DataChannel &self) { self.change (false, "closed by the client"); });
    };
    connect ("on-open", GCallback (+opened));
    connect ("on-close", GCallback (+closed));
    g_object_unref (channel);
  }
  if (channel && gst_element_set_state (pipeline, GST_STATE_PLAYING) != GST_STATE_CHANGE_FAILURE)
    offer (webrtc, link);
  else
    Link::post (link, [] (DataChannel &self) { self.change (false, "webrtcbin does not start"); });
  gst_object_unref (webrtc);
}

/* ---- on the server's thread ---- */

DataChannel::DataChannel (GMainContext *context, Owner &owner, const Settings &settings)
    : link_ (std::make_shared<Link> (this, context)), owner_ (owner),
      pipeline_ (gst_pipeline_new (nullptr)),
      webrtc_ (gst_element_factory_make ("webrtcbin", "webrtc")),
      created_us_ (g_get_monotonic_time ())
{
  gst_object_ref_sink (pipeline_);
  channels++;
  switch_upnp_off (webrtc_);
  g_object_set (webrtc_, "bundle-policy", GST_WEBRTC_BUNDLE_POLICY_MAX_BUNDLE, nullptr);
  if (!settings.stun_server.empty ())
    g_object_set (webrtc_, "stun-server", settings.stun_server.c_str (), nullptr);
  if (!settings.turn_server.empty ())
    g_object_set (webrtc_, "turn-server", settings.turn_server.c_str (), nullptr);
  const auto connect = [&] (const char *signal, GCallback call) {
    g_signal_connect_data (
        webrtc_, signal, call, Link::hold (link_), Link::release_closure, GConnectFlags (0));
  };
  connect ("on-ice-candidate", G_CALLBACK (on_candidate));
  connect ("notify::connection-state", G_CALLBACK (on_connection_state));
  gst_bin_add (GST_BIN (pipeline_), webrtc_);
  const GstElementCallAsyncFunc start = [] (GstElement *pipeline, gpointer link) {
    open (pipeline, Link::held (link));
  };
  gst_element_call_async (pipeline_, start, Link::hold (link_), Link::release);
}

DataChannel::~DataChannel ()
{
  link_->detach ();
  channel_.reset ();
  const GstElementCallAsyncFunc stop = [] (GstElement *pipeline, gpointer data) {
    const auto &link = Link::held (data);
    std::lock_guard guard (link->lock);
    link->closed = true;
    gst_element_set_state (pipeline, GST_STATE_NULL);
    /* Once more for elements that webrtcbin's thread started meanwhile, which has ended by now. */
    gst_element_set_state (pipeline, GST_STATE_NULL);
    channels--;
  };
  gst_element_call_async (pipeline_, stop, Link::hold (link_), Link::release);
  gst_object_unref (pipeline_);
}

void
DataChannel::change (bool open, const std::string &error)
{
  if (closed_ || (open && open_))
    return;
  open_ = open;
  closed_ = !open;
  owner_.channel_changed (error); /* may delete this */
}

bool
DataChannel::answer (const std::string &sdp)
{
  GstSDPMessage *message = nullptr;
  if (answered_ || sdp.empty ())
    return false;
  if (gst_sdp_message_new_from_text (sdp.c_str (), &message) != GST_SDP_OK ||
      !is_answer (message)) {
    g_clear_pointer (&message, gst_sdp_message_free);
    return false;
  }
  answered_ = true;
  GstWebRTCSessionDescription *description =
      gst_webrtc_session_description_new (GST_WEBRTC_SDP_TYPE_ANSWER, message);
  g_signal_emit_by_name (webrtc_, "set-remote-description", description, nullptr);
  gst_webrtc_session_description_free (description);
  return true;
}

void
DataChannel::add_candidate (const std::string &candidate)
{
  g_signal_emit_by_name (webrtc_, "add-ice-candidate", 0u, candidate.c_str ());
}

guint64
DataChannel::buffered () const
{
  guint64 bytes = 0;
  g_object_get (channel_.get (), "buffered-amount", &bytes, nullptr);
  return bytes;
}

void
DataChannel::send (GBytes *message)
{
  gst_webrtc_data_channel_send_data_full (channel_.get (), message, nullptr);
}

} // namespace web
