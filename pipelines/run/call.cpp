/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "call.hpp"

#include <json-glib/json-glib.h>
#include <libsoup/soup.h>
#define GST_USE_UNSTABLE_API
#include <gst/webrtc/webrtc.h>

#include <cstdlib>
#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

#include "common/for-each.hpp"

namespace {

/** STUN and TURN servers may be slower than the checks of candidates without them. */
constexpr guint kMaxCandidateWait_ms = 15000;
constexpr const char *kWasConnected = "was-connected"; /* data of the webrtcbin */

std::string
json (std::initializer_list<std::pair<const char *, const char *>> fields)
{
  g_autoptr (JsonNode) node = json_node_new (JSON_NODE_OBJECT);
  JsonObject *object = json_object_new ();
  for (const auto &[name, text] : fields)
    json_object_set_string_member (object, name, text);
  json_node_take_object (node, object);
  g_autofree gchar *text = json_to_string (node, FALSE);
  return text;
}

/* Signals and promises of webrtcbin come on its own threads, and go through the bus to the main
 * loop: as application messages "call-send", whose text the other end gets, "call-left" and
 * "call-over", whose text the user gets. */

void
post (GstElement *webrtc, const char *name, const std::string &text)
{
  gst_element_post_message (
      webrtc, gst_message_new_application (GST_OBJECT (webrtc),
                  gst_structure_new (name, "text", G_TYPE_STRING, text.c_str (), nullptr)));
}

void
on_candidate (GstElement *webrtc, guint media, const gchar *candidate, gpointer)
{
  const std::string index = std::to_string (media);
  post (webrtc, "call-send",
      json ({{"type", "call"}, {"media", index.c_str ()}, {"candidate", candidate}}));
}

bool
has_state (gpointer webrtc, GstWebRTCPeerConnectionState wanted)
{
  GstWebRTCPeerConnectionState state = GST_WEBRTC_PEER_CONNECTION_STATE_NEW;
  g_object_get (webrtc, "connection-state", &state, nullptr);
  return state == wanted;
}

void
on_state (GstElement *webrtc, GParamSpec *, gpointer)
{
  const auto give_up = [] (gpointer webrtc) -> gboolean {
    if (has_state (webrtc, GST_WEBRTC_PEER_CONNECTION_STATE_FAILED))
      GST_ELEMENT_ERROR (webrtc, RESOURCE, OPEN_READ_WRITE,
          ("No network path to the other end; try a STUN server, or a TURN server"), (nullptr));
    return G_SOURCE_REMOVE;
  };
  const bool failed = has_state (webrtc, GST_WEBRTC_PEER_CONNECTION_STATE_FAILED);
  if (failed && g_object_get_data (G_OBJECT (webrtc), kWasConnected))
    post (webrtc, "call-left", "the connection to the other end is lost");
  else if (failed) /* with the candidates so far */
    g_timeout_add_full (G_PRIORITY_DEFAULT, kMaxCandidateWait_ms, give_up, gst_object_ref (webrtc),
        gst_object_unref);
  if (!has_state (webrtc, GST_WEBRTC_PEER_CONNECTION_STATE_CONNECTED))
    return;
  g_object_set_data (G_OBJECT (webrtc), kWasConnected, webrtc);
  GstObject *pipeline = gst_object_get_parent (GST_OBJECT (webrtc));
  for_each (gst_bin_iterate_all_by_element_factory_name (GST_BIN (pipeline), "valve"),
      [] (GstElement *valve) { g_object_set (valve, "drop", FALSE, nullptr); });
  gst_object_unref (pipeline);
  g_print ("the other end is connected\n");
}

/* Pads have no caps yet in GStreamer 1.22, and the number of their arrival in later versions. */
void
on_pad (GstElement *webrtc, GstPad *pad, gpointer)
{
  g_autoptr (GObject) transceiver = nullptr;
  GstWebRTCKind kind = GST_WEBRTC_KIND_UNKNOWN;
  if (GST_PAD_IS_SINK (pad))
    return;
  g_object_get (pad, "transceiver", &transceiver, nullptr);
  g_object_get (transceiver, "kind", &kind, nullptr);
  GstObject *pipeline = gst_object_get_parent (GST_OBJECT (webrtc));
  GstElement *receiver = gst_bin_get_by_name (
      GST_BIN (pipeline), kind == GST_WEBRTC_KIND_VIDEO ? "call-video" : "call-audio");
  if (receiver)
    gst_element_link_pads (webrtc, GST_PAD_NAME (pad), receiver, "sink");
  gst_clear_object (&receiver);
  gst_object_unref (pipeline);
}

/* An offer or answer has been made: sets it, and sends it. */
void
on_description (GstPromise *promise, gpointer data)
{
  auto webrtc = GST_ELEMENT (data);
  GstWebRTCSessionDescription *description = nullptr;
  g_autoptr (GError) error = nullptr;
  const GstStructure *reply = gst_promise_get_reply (promise);
  if (!reply) /* the pipeline stops */
    return gst_promise_unref (promise);
  for (const char *type : {"offer", "answer"})
    gst_structure_get (reply, type, GST_TYPE_WEBRTC_SESSION_DESCRIPTION, &description, nullptr);
  if (description) {
    g_signal_emit_by_name (webrtc, "set-local-description", description, nullptr);
    g_autofree gchar *text = gst_sdp_message_as_text (description->sdp);
    post (webrtc, "call-send",
        json ({{"type", "call"}, {gst_webrtc_sdp_type_to_string (description->type), text}}));
    gst_webrtc_session_description_free (description);
  } else {
    gst_structure_get (reply, "error", G_TYPE_ERROR, &error, nullptr);
    GST_ELEMENT_ERROR (webrtc, STREAM, FAILED, ("Cannot negotiate with the other end"),
        ("%s", error ? error->message : ""));
  }
  gst_promise_unref (promise);
}

void
describe (GstElement *webrtc, const char *action)
{
  g_signal_emit_by_name (webrtc, action, nullptr,
      gst_promise_new_with_change_func (on_description, gst_object_ref (webrtc), gst_object_unref));
}

/* No loop runs when it ends. */
struct WebrtcCall : Call {
  ~WebrtcCall () override;
  bool join (GstElement *pipeline) override;
  bool handle (GstMessage *message) override;
  static void on_connected (GObject *session, GAsyncResult *result, gpointer self);
  void connect ();
  void receive (const std::string &text);
  void on_closed ();

  GstElement *webrtc_ = nullptr;
  SoupSession *session_ = nullptr;
  SoupWebsocketConnection *socket_ = nullptr;
  GTlsCertificate *certificate_ = nullptr;
  std::string url_, hello_;
  std::vector<std::string> held_; /* messages for the next webrtcbin */
  bool leaving_ = false;
  bool offers_ = false; /* this end was in the room first */
  bool answered_ = false;
};

WebrtcCall::~WebrtcCall ()
{
  if (socket_)
    g_signal_handlers_disconnect_by_data (socket_, this);
  g_clear_object (&socket_);
  g_clear_object (&session_);
  g_clear_object (&certificate_);
  gst_clear_object (&webrtc_);
}

bool
WebrtcCall::join (GstElement *pipeline)
{
  gst_clear_object (&webrtc_);
  webrtc_ = gst_bin_get_by_name (GST_BIN (pipeline), "webrtc");
  if (!webrtc_ || !g_signal_lookup ("create-offer", G_OBJECT_TYPE (webrtc_))) {
    g_printerr ("rangecast-run: --signal: there is no webrtcbin named webrtc\n");
    return false;
  }
  g_signal_connect (webrtc_, "on-ice-candidate", G_CALLBACK (on_candidate), nullptr);
  g_signal_connect (webrtc_, "notify::connection-state", G_CALLBACK (on_state), nullptr);
  g_signal_connect (webrtc_, "pad-added", G_CALLBACK (on_pad), nullptr);
  GstElement *rtpbin = gst_bin_get_by_name (GST_BIN (webrtc_), "rtpbin");
  /* The first packet of a frame set that comes later than the one before is not lost. */
  const auto set = [] (GstElement *, GObject *jitterbuffer, guint, guint, gpointer) {
    g_object_set (jitterbuffer, "rtx-next-seqnum", FALSE, nullptr);
  };
  g_signal_connect (rtpbin, "new-jitterbuffer", GCallback (+set), nullptr);
  gst_object_unref (rtpbin);
  g_autoptr (GArray) transceivers = nullptr;
  g_signal_emit_by_name (webrtc_, "get-transceivers", &transceivers);
  for (guint i = 0; i < transceivers->len; i++) /* lost packets are requested again */
    g_object_set (g_array_index (transceivers, GObject *, i), "do-nack", TRUE, nullptr);
  leaving_ = answered_ = false;
  if (!session_)
    connect ();
  else if (offers_)
    describe (webrtc_, "create-offer");
  else
    g_print ("waiting for the other end\n");
  for (const std::string &text : std::exchange (held_, {}))
    receive (text);
  return true;
}

/* ---- the server ---- */

void
WebrtcCall::connect ()
{
  session_ = soup_session_new ();
  g_autoptr (SoupMessage) message = soup_message_new ("GET", url_.c_str ());
  const auto accept = [] (SoupMessage *, GTlsCertificate *its, GTlsCertificateFlags,
                          gpointer own) -> gboolean {
    return own && g_tls_certificate_is_same (its, G_TLS_CERTIFICATE (own));
  };
  g_signal_connect (message, "accept-certificate", GCallback (+accept), certificate_);
  const char *protocols[] = {"rangecast.v1", nullptr};
  soup_session_websocket_connect_async (session_, message, nullptr, const_cast<char **> (protocols),
      G_PRIORITY_DEFAULT, nullptr, on_connected, this);
}

void
WebrtcCall::on_connected (GObject *session, GAsyncResult *result, gpointer user_data)
{
  g_autoptr (GError) error = nullptr;
  SoupWebsocketConnection *socket =
      soup_session_websocket_connect_finish (SOUP_SESSION (session), result, &error);
  auto self = static_cast<WebrtcCall *> (user_data);
  if (!socket) {
    GST_ELEMENT_ERROR (self->webrtc_, RESOURCE, OPEN_READ_WRITE,
        ("Cannot connect to the call's server %s: %s%s", self->url_.c_str (), error->message,
            error->domain == G_TLS_ERROR ? "; name the server's in --certificate" : ""),
        (nullptr));
    return;
  }
  self->socket_ = socket;
  soup_websocket_connection_set_keepalive_interval (socket, 20);
  const auto message = [] (SoupWebsocketConnection *, gint type, GBytes *bytes, gpointer data) {
    if (type == SOUP_WEBSOCKET_DATA_TEXT) /* which libsoup terminates */
      static_cast<WebrtcCall *> (data)->receive (
          static_cast<const char *> (g_bytes_get_data (bytes, nullptr)));
  };
  const auto closed = [] (SoupWebsocketConnection *, gpointer data) {
    static_cast<WebrtcCall *> (data)->on_closed ();
  };
  g_signal_connect (socket, "message", GCallback (+message), self);
  g_signal_connect (socket, "closed", GCallback (+closed), self);
  soup_websocket_connection_send_text (socket, self->hello_.c_str ());
}

void
WebrtcCall::on_closed ()
{
  const char *reason = soup_websocket_connection_get_close_data (socket_);
  if (soup_websocket_connection_get_close_code (socket_) == SOUP_WEBSOCKET_CLOSE_GOING_AWAY)
    return post (webrtc_, "call-over", "the call's server has ended");
  GST_ELEMENT_ERROR (webrtc_, RESOURCE, READ,
      ("The call's server %s closed the connection: %s", url_.c_str (),
          reason && *reason ? reason : "no reason given"),
      (nullptr));
}

/* What the server and, through it, the other end have to say. */
void
WebrtcCall::receive (const std::string &text)
{
  if (leaving_)
    return held_.push_back (text);
  g_autoptr (JsonNode) root = json_from_string (text.c_str (), nullptr);
  if (!root || !JSON_NODE_HOLDS_OBJECT (root))
    return;
  JsonObject *message = json_node_get_object (root);
  const auto field = [&] (const char *name) {
    return json_object_get_string_member_with_default (message, name, nullptr);
  };
  const std::string type = field ("type") ? field ("type") : "";
  if (type == "welcome")
    g_print ("waiting for the other end\n");
  offers_ = type == "joined" || (offers_ && type != "left");
  if (type == "joined")
    describe (webrtc_, "create-offer");
  const bool again = type == "call" && field ("offer") && std::exchange (answered_, true);
  if (again)
    held_ = {text};
  if ((leaving_ = again || type == "left"))
    post (webrtc_, "call-left", again ? "the other end connects again" : "the other end left");
  if (type != "call" || again)
    return;
  if (field ("candidate") && field ("media"))
    g_signal_emit_by_name (
        webrtc_, "add-ice-candidate", guint (std::atoi (field ("media"))), field ("candidate"));
  for (const auto kind : {GST_WEBRTC_SDP_TYPE_OFFER, GST_WEBRTC_SDP_TYPE_ANSWER}) {
    const char *description = field (gst_webrtc_sdp_type_to_string (kind));
    GstSDPMessage *sdp = nullptr;
    if (!description || gst_sdp_message_new_from_text (description, &sdp) != GST_SDP_OK)
      continue;
    GstWebRTCSessionDescription *remote = gst_webrtc_session_description_new (kind, sdp);
    g_signal_emit_by_name (webrtc_, "set-remote-description", remote, nullptr);
    gst_webrtc_session_description_free (remote);
    if (kind == GST_WEBRTC_SDP_TYPE_OFFER)
      describe (webrtc_, "create-answer");
  }
}

bool
WebrtcCall::handle (GstMessage *message)
{
  const char *text = gst_structure_get_string (gst_message_get_structure (message), "text");
  const bool sends = gst_message_has_name (message, "call-send");
  if (sends && soup_websocket_connection_get_state (socket_) == SOUP_WEBSOCKET_STATE_OPEN)
    soup_websocket_connection_send_text (socket_, text);
  if (GST_MESSAGE_SRC (message) != GST_OBJECT (webrtc_) || sends)
    return false;
  g_print ("%s\n", text);
  return true;
}

} // namespace

std::unique_ptr<Call>
Call::make (const char *url, const char *certificate)
{
  auto call = std::make_unique<WebrtcCall> ();
  g_autoptr (GError) error = nullptr;
  g_autoptr (GUri) uri = g_uri_parse (url, G_URI_FLAGS_ENCODED_FRAGMENT, &error);
  const std::string scheme = uri ? g_uri_get_scheme (uri) : "";
  const char *host = uri ? g_uri_get_host (uri) : nullptr;
  if ((scheme != "http" && scheme != "https") || !host || !*host) {
    g_printerr ("rangecast-run: --signal: '%s' is not http[s]://HOST:PORT/#token=TOKEN\n", url);
    return nullptr;
  }
  const char *fragment = g_uri_get_fragment (uri);
  g_autoptr (GHashTable) fields =
      g_uri_parse_params (fragment ? fragment : "", -1, "&", G_URI_PARAMS_NONE, nullptr);
  const auto field = [&] (const char *name) {
    auto value = fields ? static_cast<const char *> (g_hash_table_lookup (fields, name)) : nullptr;
    return value ? value : "";
  };
  call->hello_ = json ({{"type", "hello"}, {"token", field ("token")}, {"room", field ("room")}});
  call->hello_.insert (1, "\"version\":1,");
  g_autofree gchar *page = g_uri_to_string_partial (uri, G_URI_HIDE_FRAGMENT);
  g_autofree gchar *stream = g_uri_resolve_relative (page, "stream", G_URI_FLAGS_NONE, nullptr);
  call->url_ = stream;
  if (certificate &&
      !(call->certificate_ = g_tls_certificate_new_from_file (certificate, &error))) {
    g_printerr ("rangecast-run: --certificate: '%s': %s\n", certificate, error->message);
    return nullptr;
  }
  return call;
}
