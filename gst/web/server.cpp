/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "server.hpp"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <future>
#include <string_view>

#include "category.hpp"

using rangecast::Status;
using rangecast::StatusCode;

namespace web {

namespace {

constexpr guint kTick_ms = 1000, kStats_ms = 250;
/** A client that reads nothing for so long is disconnected. */
constexpr gint kMaxUnread_ms = 30000;
/** Time for clients to take the message that closes their connection. */
constexpr gint64 kFarewell_us = 300 * 1000;

/* HOST and PORT of udp://HOST:PORT; [HOST] for IPv6. Returns: (transfer full) (nullable) */
GSocketAddress *
parse_udp (const std::string &address)
{
  g_autofree gchar *host = nullptr;
  gint port = -1;
  if (!g_uri_split_network (address.c_str (), G_URI_FLAGS_NONE, nullptr, &host, &port, nullptr) ||
      !address.starts_with ("udp://") || port < 0 || port > 65535)
    return nullptr;
  return g_inet_socket_address_new_from_string (host && *host ? host : "0.0.0.0", guint (port));
}

/* What the client's RTCPeerConnection takes for stun://HOST:PORT and
 * turn://USER:PASSWORD@HOST:PORT. */
std::string
ice_servers (const Settings &settings)
{
  std::string json;
  for (const std::string &address : {settings.stun_server, settings.turn_server}) {
    g_autofree gchar *scheme = nullptr, *user = nullptr, *password = nullptr, *host = nullptr;
    gint port = -1;
    if (address.empty () ||
        !g_uri_split_with_user (address.c_str (), G_URI_FLAGS_HAS_PASSWORD, &scheme, &user,
            &password, nullptr, &host, &port, nullptr, nullptr, nullptr, nullptr))
      continue;
    json += json.empty () ? "{" : ",{";
    const bool is_ipv6 = std::strchr (host, ':');
    const std::string name = is_ipv6 ? std::string ("[") + host + "]" : host;
    json += "\"urls\":" + json_string (std::string (scheme) + ":" + name +
                                       (port < 0 ? "" : ":" + std::to_string (port)));
    if (user && password)
      json += ",\"username\":" + json_string (user) + ",\"credential\":" + json_string (password);
    json += "}";
  }
  return "[" + json + "]";
}

/* GIO does not compare the certificate with its key; clients would find out. So one connects here,
 * over a pair of sockets.
 * @param context  default of this thread
 * @return what is wrong; else empty */
std::string
try_handshake (GMainContext *context, GTlsCertificate *certificate)
{
  struct Outcome {
    GCancellable *failed;
    guint sides; /* that are done */
    std::string error;
  };
  g_autoptr (GCancellable) failed = g_cancellable_new ();
  Outcome outcome{failed, 0, {}};
  const GAsyncReadyCallback done = [] (GObject *side, GAsyncResult *result, gpointer data) {
    auto outcome = static_cast<Outcome *> (data);
    g_autoptr (GError) error = nullptr;
    outcome->sides++;
    if (g_tls_connection_handshake_finish (G_TLS_CONNECTION (side), result, &error))
      return;
    if (outcome->error.empty ())
      outcome->error = error->message;
    g_cancellable_cancel (outcome->failed);
  };
  int descriptors[2];
  if (socketpair (AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, descriptors) != 0)
    return g_strerror (errno);
  for (const bool is_server : {true, false}) {
    g_autoptr (GError) error = nullptr;
    g_autoptr (GSocket) socket = g_socket_new_from_fd (descriptors[is_server], &error);
    if (!socket)
      close (descriptors[is_server]);
    g_autoptr (GSocketConnection) stream =
        socket ? g_socket_connection_factory_create_connection (socket) : nullptr;
    g_autoptr (GIOStream) side = nullptr;
    if (stream)
      side = is_server ? g_tls_server_connection_new (G_IO_STREAM (stream), certificate, &error)
                       : g_tls_client_connection_new (G_IO_STREAM (stream), nullptr, &error);
    if (!side) {
      outcome.error = error->message;
      outcome.sides++;
      g_cancellable_cancel (failed);
      continue;
    }
    /* Whoever signed it: clients decide whom they trust. */
    const auto accept = [] (GTlsConnection *, GTlsCertificate *, GTlsCertificateFlags,
                            gpointer) -> gboolean { return TRUE; };
    g_signal_connect (side, "accept-certificate", GCallback (+accept), nullptr);
    g_tls_connection_handshake_async (
        G_TLS_CONNECTION (side), G_PRIORITY_DEFAULT, outcome.failed, done, &outcome);
  }
  while (outcome.sides < 2)
    g_main_context_iteration (context, TRUE);
  return outcome.error;
}

GSource *
add_timer (GMainContext *context, guint interval_ms, GSourceFunc call, gpointer data)
{
  GSource *source = g_timeout_source_new (interval_ms);
  g_source_set_callback (source, call, data, nullptr);
  g_source_attach (source, context);
  return source;
}

} // namespace

Server::Server (GstObject *element, Settings settings, RequestKey request_key)
    : element_ (element), settings_ (std::move (settings)), request_key_ (request_key),
      context_ (g_main_context_new ()), loop_ (g_main_loop_new (context_, FALSE)),
      page_ (settings_.root), key_requested_us_ (g_get_monotonic_time () - G_MAXINT32),
      stream_ (element, context_, [this] (const StreamItem &item) { deliver (item); })
{
}

Server::~Server ()
{
  stop ();
  if (thread_.joinable ())
    thread_.join ();
  g_main_context_push_thread_default (context_);
  stop_listening (); /* if start() failed */
  clients_.clear ();
  g_clear_object (&soup_);
  g_clear_object (&stats_socket_);
  g_main_context_pop_thread_default (context_);
  for (GstStructure *structure : client_stats_)
    gst_structure_free (structure);
  g_main_loop_unref (loop_);
  g_main_context_unref (context_);
}

/* ---- starting ---- */

Status
Server::load_certificate ()
{
  if (settings_.certificate.empty ())
    return {};
  const std::string &key =
      settings_.private_key.empty () ? settings_.certificate : settings_.private_key;
  g_autoptr (GError) error = nullptr;
  g_autoptr (GTlsCertificate) certificate =
      g_tls_certificate_new_from_files (settings_.certificate.c_str (), key.c_str (), &error);
  if (!certificate)
    return {StatusCode::kNotFound, "certificate and private-key: expected PEM files; '" +
                                       settings_.certificate + "' and '" + key +
                                       "': " + error->message};
  if (const std::string wrong = try_handshake (context_, certificate); !wrong.empty ())
    return {StatusCode::kBadValue, "private-key: expected the key of the certificate '" +
                                       settings_.certificate + "', got '" + key +
                                       "': TLS does not work with them: " + wrong};
  soup_server_set_tls_certificate (soup_, certificate);
  return {};
}

Status
Server::listen ()
{
  g_autoptr (GSocketAddress) address = g_inet_socket_address_new_from_string (
      settings_.address == "localhost" ? "127.0.0.1" : settings_.address.c_str (), settings_.port);
  if (!address)
    return {StatusCode::kBadValue,
        "address: expected an IP address of this machine, got '" + settings_.address + "'"};
  GInetAddress *host = g_inet_socket_address_get_address (G_INET_SOCKET_ADDRESS (address));
  if (!g_inet_address_get_is_loopback (host) && !settings_.has_token () && !settings_.anonymous)
    return {StatusCode::kBadValue, "address=" + settings_.address +
                                       " can be reached from other machines; expected token, "
                                       "token-file, or anonymous=true for a stream that anybody "
                                       "may see"};
  g_autoptr (GError) error = nullptr;
  const bool tls = !settings_.certificate.empty ();
  if (!soup_server_listen (
          soup_, address, tls ? SOUP_SERVER_LISTEN_HTTPS : SoupServerListenOptions (0), &error))
    return {StatusCode::kNotFound, "address=" + settings_.address +
                                       " port=" + std::to_string (settings_.port) +
                                       ": cannot listen there: " + error->message};
  GSList *uris = soup_server_get_uris (soup_);
  g_autofree gchar *url = g_uri_to_string (static_cast<GUri *> (uris->data));
  url_ = url;
  g_slist_free_full (uris, reinterpret_cast<GDestroyNotify> (g_uri_unref));
  return {};
}

Status
Server::open_stats ()
{
  if (settings_.stats_address.empty ())
    return {};
  g_autoptr (GSocketAddress) address = parse_udp (settings_.stats_address);
  if (!address)
    return {StatusCode::kBadValue,
        "stats-address: expected udp://ADDRESS:PORT, got '" + settings_.stats_address + "'"};
  g_autoptr (GError) error = nullptr;
  stats_socket_ = g_socket_new (
      g_socket_address_get_family (address), G_SOCKET_TYPE_DATAGRAM, G_SOCKET_PROTOCOL_UDP, &error);
  if (!stats_socket_ || !g_socket_bind (stats_socket_, address, FALSE, &error))
    return {StatusCode::kNotFound,
        "stats-address=" + settings_.stats_address + ": cannot listen there: " + error->message};
  g_socket_set_blocking (stats_socket_, FALSE);
  GSource *source = g_socket_create_source (stats_socket_, G_IO_IN, nullptr);
  const GSocketSourceFunc read = [] (GSocket *, GIOCondition, gpointer self) -> gboolean {
    static_cast<Server *> (self)->read_stats ();
    return G_SOURCE_CONTINUE;
  };
  g_source_set_callback (source, G_SOURCE_FUNC (read), this, nullptr);
  g_source_attach (source, context_);
  timers_.push_back (source);
  return {};
}

/* What browsers send as Origin: scheme, host, and the port if it is not the scheme's own. */
static bool
is_origin (const char *text)
{
  g_autofree gchar *scheme = nullptr, *user = nullptr, *host = nullptr, *path = nullptr,
                   *query = nullptr, *fragment = nullptr;
  gint port = -1;
  return g_uri_split (text, G_URI_FLAGS_NONE, &scheme, &user, &host, &port, &path, &query,
             &fragment, nullptr) &&
         scheme && (g_str_equal (scheme, "http") || g_str_equal (scheme, "https")) && host &&
         *host && !user && !*path && !query && !fragment &&
         port != (g_str_equal (scheme, "http") ? 80 : 443);
}

Status
Server::start ()
{
  if (!settings_.token_file.empty () &&
      !g_file_test (settings_.token_file.c_str (), G_FILE_TEST_IS_REGULAR))
    return {StatusCode::kNotFound,
        "token-file: expected a file, but there is no '" + settings_.token_file + "'"};
  if (!settings_.private_key.empty () && settings_.certificate.empty ())
    return {StatusCode::kBadValue, "private-key: expected certificate, too"};
  if (settings_.anonymous && settings_.has_token ())
    return {StatusCode::kBadValue, "anonymous: expected without token and token-file"};
  g_auto (GStrv) origins = g_strsplit (settings_.origins.c_str (), " ", -1);
  for (gchar **origin = origins; *origin; origin++)
    if (**origin && !is_origin (*origin))
      return {StatusCode::kBadValue,
          "origins: expected https://HOST[:PORT] or http://HOST[:PORT], without the port 443 or 80 "
          "that it has anyway, got '" +
              std::string (*origin) + "'"};
  const std::string index = settings_.root + "/index.html";
  if (!g_file_test (index.c_str (), G_FILE_TEST_IS_REGULAR))
    return {StatusCode::kNotFound,
        "root: expected the folder of the page, but there is no '" + index + "'"};
  for (const auto &[name, address, scheme] :
      {std::tuple ("stun-server", settings_.stun_server, "stun://HOST:PORT"),
          std::tuple ("turn-server", settings_.turn_server, "turn://USER:PASSWORD@HOST:PORT")}) {
    if (address.empty ())
      continue;
    if (!address.starts_with (std::string_view (scheme).substr (0, 7)) ||
        (*name == 't' && address.find ('@') == address.npos) ||
        !g_uri_is_valid (address.c_str (), G_URI_FLAGS_HAS_PASSWORD, nullptr))
      return {StatusCode::kBadValue, std::string (name) + ": expected " + scheme};
    if (!settings_.webrtc)
      return {StatusCode::kBadValue, std::string (name) + ": expected webrtc=true, too"};
  }
  g_main_context_push_thread_default (context_);
  soup_ = soup_server_new ("server-header", "rangewebsink", nullptr);
  Status status = load_certificate ();
  if (status.ok ())
    status = listen ();
  if (status.ok ())
    status = open_stats ();
  g_main_context_pop_thread_default (context_);
  if (!status.ok ())
    return status;
  if (std::string missing; settings_.webrtc && !(rtc_ = DataChannel::is_supported (missing)))
    GST_INFO_OBJECT (element_, "offering no WebRTC: there is no element %s", missing.c_str ());
  add_handlers ();
  const auto tick = [] (gpointer self) -> gboolean {
    static_cast<Server *> (self)->tick ();
    return G_SOURCE_CONTINUE;
  };
  const auto stats = [] (gpointer self) -> gboolean {
    static_cast<Server *> (self)->send_stats ();
    return G_SOURCE_CONTINUE;
  };
  timers_.push_back (add_timer (context_, kTick_ms, tick, this));
  timers_.push_back (add_timer (context_, kStats_ms, stats, this));
  try {
    thread_ = std::thread ([this] { run (); });
  } catch (const std::system_error &error) {
    return {
        StatusCode::kInternal, std::string ("cannot start the server's thread: ") + error.what ()};
  }
  return {};
}

void
Server::run ()
{
  g_main_context_push_thread_default (context_);
  g_main_loop_run (loop_);
  g_main_context_pop_thread_default (context_);
  stopped_ = true;
}

/* Until something has happened, but no longer. */
void
Server::run_for (gint64 time_us, const std::function<bool ()> &happened)
{
  const gint64 end = g_get_monotonic_time () + time_us;
  GSource *timer = add_timer (
      context_, guint (time_us / 1000), [] (gpointer) -> gboolean { return G_SOURCE_REMOVE; },
      nullptr);
  while (!happened () && g_get_monotonic_time () < end)
    g_main_context_iteration (context_, TRUE);
  g_source_destroy (timer);
  g_source_unref (timer);
}

/* ---- stopping ---- */

/* Waits for what the server's thread does at the moment, and for no client. */
void
Server::stop ()
{
  struct Stop {
    Server *server;
    std::promise<void> listening_ended;
  };
  if (!thread_.joinable () || std::exchange (stopping_, true))
    return;
  const auto call = [] (gpointer data) -> gboolean {
    auto stop = static_cast<Stop *> (data);
    stop->server->stop_listening ();
    stop->listening_ended.set_value ();
    stop->server->close_all ();
    return G_SOURCE_REMOVE;
  };
  const auto free = [] (gpointer data) { delete static_cast<Stop *> (data); };
  auto stop = new Stop{this, {}};
  const auto listening_ended = stop->listening_ended.get_future ();
  GSource *source = g_idle_source_new ();
  g_source_set_priority (source, G_PRIORITY_HIGH);
  g_source_set_callback (source, call, stop, free);
  g_source_attach (source, context_);
  g_source_unref (source);
  listening_ended.wait ();
}

void
Server::stop_listening ()
{
  for (GSource *timer : timers_) {
    g_source_destroy (timer);
    g_source_unref (timer);
  }
  timers_.clear ();
  if (soup_)
    soup_server_disconnect (soup_); /* no new ones; open WebSockets stay */
  if (stats_socket_)
    g_socket_close (stats_socket_, nullptr);
}

void
Server::close_all ()
{
  for (const auto &client : clients_)
    client->close (kCloseGoingAway, "the server stops");
  run_for (kFarewell_us, [this] { return clients_.empty (); });
  clients_.clear (); /* those that did not answer; their connections close asynchronously, too */
  run_for (kFarewell_us, [this] { return *connections_ == 0; });
  g_main_loop_quit (loop_);
}

/* ---- HTTP ---- */

void
Server::add_handlers ()
{
  const SoupServerCallback early = [] (SoupServer *, SoupServerMessage *message, const char *,
                                       GHashTable *, gpointer self) {
    auto server = static_cast<Server *> (self);
    if (server->is_own_origin (message))
      return;
    GST_WARNING_OBJECT (server->element_, "refusing %s: it comes from a page of '%s'",
        soup_server_message_get_remote_host (message),
        soup_message_headers_get_one (soup_server_message_get_request_headers (message), "Origin"));
    soup_server_message_set_status (message, SOUP_STATUS_FORBIDDEN, nullptr);
  };
  const SoupServerCallback upgrade = [] (SoupServer *, SoupServerMessage *message, const char *path,
                                         GHashTable *, gpointer self) {
    static_cast<Server *> (self)->upgrade (message, path);
  };
  const SoupServerCallback file = [] (SoupServer *, SoupServerMessage *message, const char *path,
                                      GHashTable *, gpointer self) {
    static_cast<Server *> (self)->answer (message, path);
  };
  /* libsoup before 3.4 never closes its side of a connection that a client closed between two
   * requests, so each has one. An upgrade replaces this header. */
  const auto once = [] (SoupServer *, SoupServerMessage *message, gpointer) {
    soup_message_headers_replace (
        soup_server_message_get_response_headers (message), "Connection", "close");
  };
  /* No request has a body of use; libsoup would keep it in memory. */
  const auto without_body = [] (SoupServer *, SoupServerMessage *message, gpointer) {
    soup_message_body_set_accumulate (soup_server_message_get_request_body (message), FALSE);
  };
  const SoupServerCallback check_host = [] (SoupServer *, SoupServerMessage *message, const char *,
                                            GHashTable *, gpointer self) {
    auto server = static_cast<Server *> (self);
    if (server->is_own_host (message))
      return;
    GST_WARNING_OBJECT (server->element_, "refusing %s: it asks for another host, '%s'",
        soup_server_message_get_remote_host (message),
        soup_message_headers_get_one (soup_server_message_get_request_headers (message), "Host"));
    soup_server_message_set_status (message, SOUP_STATUS_MISDIRECTED_REQUEST, nullptr);
  };
  g_signal_connect (soup_, "request-started", GCallback (+once), nullptr);
  g_signal_connect (soup_, "request-started", GCallback (+without_body), nullptr);
  soup_server_add_early_handler (soup_, "/", check_host, this, nullptr);
  soup_server_add_early_handler (soup_, "/stream", early, this, nullptr);
  soup_server_add_handler (soup_, "/stream", upgrade, this, nullptr);
  soup_server_add_handler (soup_, "/", file, this, nullptr);
}

/* Without token and TLS, whoever makes a name of their own point here could let a browser of this
 * network read the stream for their page (DNS rebinding). Addresses, names without a dot and
 * .local are no such names; origins lists others. */
bool
Server::is_own_host (SoupServerMessage *message) const
{
  if (settings_.has_token () || !settings_.certificate.empty ())
    return true;
  const char *value =
      soup_message_headers_get_one (soup_server_message_get_request_headers (message), "Host");
  g_autofree gchar *host = nullptr;
  if (!value || !g_uri_split_network ((std::string ("http://") + value).c_str (), G_URI_FLAGS_NONE,
                    nullptr, &host, nullptr, nullptr))
    return false;
  if (g_hostname_is_ip_address (host) || !std::strchr (host, '.') ||
      std::string_view (host).ends_with (".local"))
    return true;
  g_auto (GStrv) origins = g_strsplit (settings_.origins.c_str (), " ", -1);
  return g_strv_contains (origins, (std::string ("http://") + value).c_str ());
}

bool
Server::is_own_origin (SoupServerMessage *message) const
{
  SoupMessageHeaders *headers = soup_server_message_get_request_headers (message);
  const char *origin = soup_message_headers_get_one (headers, "Origin");
  const char *host = soup_message_headers_get_one (headers, "Host");
  if (!origin)
    return true;
  const std::string_view text = origin;
  const auto slashes = text.find ("://");
  if (host && slashes != text.npos && text.substr (slashes + 3) == host)
    return true;
  g_auto (GStrv) allowed = g_strsplit (settings_.origins.c_str (), " ", -1);
  return g_strv_contains (allowed, origin);
}

void
Server::answer (SoupServerMessage *message, const char *path)
{
  SoupMessageHeaders *headers = soup_server_message_get_response_headers (message);
  soup_message_headers_append (headers, "Cache-Control", "no-cache");
  soup_message_headers_append (headers, "X-Content-Type-Options", "nosniff");
  soup_message_headers_append (headers, "Referrer-Policy", "no-referrer");
  soup_message_headers_append (headers, "Content-Security-Policy",
      "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self' 'unsafe-inline'; "
      "img-src 'self' data: blob:; media-src blob:; connect-src *; object-src 'none'; base-uri "
      "'none'; "
      "frame-ancestors 'none'");
  const char *method = soup_server_message_get_method (message);
  if (method != SOUP_METHOD_GET && method != SOUP_METHOD_HEAD)
    return soup_server_message_set_status (message, SOUP_STATUS_METHOD_NOT_ALLOWED, nullptr);
  if (std::strcmp (path, "/server.json") == 0) {
    std::string json = "{\"version\":" + std::to_string (kProtocolVersion) +
                       ",\"token\":" + (settings_.has_token () ? "true" : "false") +
                       ",\"title\":" + json_string (settings_.title) + "}";
    soup_server_message_set_response (
        message, "application/json", SOUP_MEMORY_COPY, json.data (), json.size ());
    return soup_server_message_set_status (message, SOUP_STATUS_OK, nullptr);
  }
  const PageFiles::File *file = page_.find (path);
  if (!file)
    return soup_server_message_set_status (message, SOUP_STATUS_NOT_FOUND, nullptr);
  SoupMessageHeaders *request = soup_server_message_get_request_headers (message);
  soup_message_headers_append (headers, "ETag", file->etag.c_str ());
  soup_message_headers_append (headers, "Vary", "Accept-Encoding");
  if (g_strcmp0 (soup_message_headers_get_list (request, "If-None-Match"), file->etag.c_str ()) ==
      0)
    return soup_server_message_set_status (message, SOUP_STATUS_NOT_MODIFIED, nullptr);
  const char *encodings = soup_message_headers_get_list (request, "Accept-Encoding");
  const bool gzip = encodings && soup_header_contains (encodings, "gzip");
  if (gzip)
    soup_message_headers_append (headers, "Content-Encoding", "gzip");
  soup_message_headers_set_content_type (headers, file->type, nullptr);
  soup_message_body_append_bytes (
      soup_server_message_get_response_body (message), (gzip ? file->gzip : file->plain).get ());
  soup_server_message_set_status (message, SOUP_STATUS_OK, nullptr);
}

/* ---- clients ---- */

/* What soup_server_add_websocket_handler() does, but with an input whose size is limited. */
void
Server::upgrade (SoupServerMessage *message, const char *path)
{
  const char *protocols[] = {kSubprotocol, nullptr};
  const auto names = const_cast<char **> (protocols);
  if (std::strcmp (path, "/stream") != 0)
    return answer (message, path);
  /* libsoup upgrades also without any */
  const char *offered = soup_message_headers_get_list (
      soup_server_message_get_request_headers (message), "Sec-WebSocket-Protocol");
  if (!offered || !soup_header_contains (offered, kSubprotocol)) {
    GST_INFO_OBJECT (element_, "%s does not offer %s",
        soup_server_message_get_remote_host (message), kSubprotocol);
    return soup_server_message_set_status (message, SOUP_STATUS_BAD_REQUEST, nullptr);
  }
  if (!soup_websocket_server_process_handshake (message, nullptr, names, nullptr, nullptr)) {
    GST_INFO_OBJECT (element_, "%s: no WebSocket of this protocol",
        soup_server_message_get_remote_host (message));
    return; /* it has set the status */
  }
  const auto complete = [] (SoupServerMessage *upgraded, gpointer self) {
    static_cast<Server *> (self)->accept (upgraded);
  };
  g_signal_connect (message, "wrote-informational", GCallback (+complete), this);
}

/* Clients that were not let in do not keep others out. */
void
Server::drop_waiting_client ()
{
  const auto waiting =
      std::ranges::find_if (clients_, [] (const auto &one) { return !one->was_let_in (); });
  if (waiting == clients_.end ())
    return;
  GST_INFO_OBJECT (element_, "%s makes room for others", (*waiting)->label ().c_str ());
  (*waiting)->close (kCloseLimit, "too many connections without hello");
  closed (**waiting);
}

void
Server::accept (SoupServerMessage *message)
{
  g_autofree gchar *host = g_strdup (soup_server_message_get_remote_host (message));
  g_autoptr (GUri) uri = g_uri_ref (soup_server_message_get_uri (message));
  /* Who acknowledges but reads nothing must not let libsoup's queue grow. */
  g_socket_set_option (soup_server_message_get_socket (message), IPPROTO_TCP, TCP_USER_TIMEOUT,
      kMaxUnread_ms, nullptr);
  g_autoptr (GIOStream) connection = soup_server_message_steal_connection (message);
  const auto gone = [] (gpointer count, GObject *) {
    const std::unique_ptr<ConnectionCount> connections (static_cast<ConnectionCount *> (count));
    --**connections;
  };
  ++*connections_;
  g_object_weak_ref (G_OBJECT (connection), gone, new ConnectionCount (connections_));
  g_autoptr (WebLimitedInput) input =
      web_limited_input_new (g_io_stream_get_input_stream (connection), kMaxUnfinished);
  g_autoptr (GIOStream) stream =
      g_simple_io_stream_new (G_INPUT_STREAM (input), g_io_stream_get_output_stream (connection));
  /* Closing this stream does not close the connection. */
  const auto close = [] (gpointer connection) {
    g_io_stream_close_async (
        G_IO_STREAM (connection), G_PRIORITY_DEFAULT, nullptr, nullptr, nullptr);
    g_object_unref (connection);
  };
  g_object_set_data_full (G_OBJECT (stream), "connection", g_object_ref (connection), close);
  g_autoptr (SoupWebsocketConnection) socket = soup_websocket_connection_new (
      stream, uri, SOUP_WEBSOCKET_CONNECTION_SERVER, nullptr, kSubprotocol, nullptr);
  if (clients_.size () >= settings_.max_clients)
    drop_waiting_client ();
  const bool full = clients_.size () >= settings_.max_clients;
  {
    std::lock_guard guard (lock_);
    counters_.connections++;
    counters_.refused += full;
  }
  if (full) {
    GST_WARNING_OBJECT (element_, "refusing %s: max-clients=%u", host, settings_.max_clients);
    return soup_websocket_connection_close (socket, kCloseLimit,
        ("at most " + std::to_string (settings_.max_clients) + " viewers").c_str ());
  }
  GST_DEBUG_OBJECT (element_, "%s connected", host);
  Client::Host &self = *this;
  clients_.push_back (std::make_unique<Client> (
      element_, self, settings_, socket, input, host ? host : "unknown address"));
  std::lock_guard guard (lock_);
  counters_.clients = guint (clients_.size ());
}

void
Server::closed (Client &client)
{
  gone_bytes_ += client.bytes ();
  std::erase_if (clients_, [&] (const auto &one) { return one.get () == &client; });
  std::lock_guard guard (lock_);
  counters_.clients = guint (clients_.size ());
}

Client::Host::Admission
Server::admit (const std::string &address, const std::string &token, std::string &name)
{
  const gint64 now = g_get_monotonic_time ();
  if (settings_.has_token () && !guesses_.allows (address, now)) {
    std::lock_guard guard (lock_);
    counters_.refused++;
    return Admission::kTooManyWrongTokens;
  }
  bool admitted = !settings_.has_token ();
  if (!settings_.token.empty ())
    admitted = equal_tokens (token, settings_.token);
  if (!admitted && !settings_.token_file.empty ()) {
    std::string error;
    const auto found = find_token (settings_.token_file, token, error);
    if (!error.empty ())
      GST_WARNING_OBJECT (element_, "token-file: %s", error.c_str ());
    admitted = found.has_value ();
    name = found.value_or ("");
  }
  if (admitted)
    return Admission::kAdmitted;
  if (!token.empty ())
    guesses_.add_failure (address, now);
  std::lock_guard guard (lock_);
  counters_.refused++;
  return Admission::kWrongToken;
}

std::string
Server::welcome ()
{
  std::string json = "{\"type\":\"welcome\",\"version\":" + std::to_string (kProtocolVersion) +
                     ",\"window\":" + std::to_string (settings_.window) +
                     ",\"audio\":" + (stream_.has_audio () ? "true" : "false") +
                     ",\"rtc\":" + (rtc_ ? "true" : "false");
  if (rtc_)
    json += ",\"iceServers\":" + ice_servers (settings_);
  return json + "}";
}

bool
Server::offers_rtc ()
{
  if (rtc_ && !DataChannel::has_room ())
    GST_WARNING_OBJECT (element_, "no file descriptors for another data channel");
  return rtc_ && DataChannel::has_room ();
}

void
Server::entered (Client &client)
{
  send_stats_to (client);
}

void
Server::request_key (Client &client)
{
  const gint64 now = g_get_monotonic_time ();
  if (now - key_requested_us_ < gint64 (settings_.key_unit_interval_ms) * 1000 ||
      !request_key_ (element_))
    return;
  key_requested_us_ = now;
  GST_DEBUG_OBJECT (element_, "requesting a key frame set for %s", client.label ().c_str ());
  std::lock_guard guard (lock_);
  counters_.key_requests++;
}

/* Frees what was published a second ago. */
void
Server::tick ()
{
  /* A client that is closed at once leaves the list. */
  for (auto at = clients_.begin (); at != clients_.end ();)
    (*at++)->check_silence ();
  std::vector<GstStructure *> made;
  guint64 bytes = gone_bytes_;
  for (const auto &client : clients_) {
    made.push_back (client->stats ());
    bytes += client->bytes ();
  }
  {
    std::lock_guard guard (lock_);
    made.swap (client_stats_);
    counters_.bytes = bytes;
  }
  for (GstStructure *structure : made)
    gst_structure_free (structure);
}

/* ---- the stream ---- */

void
Server::deliver (const StreamItem &item)
{
  for (auto at = clients_.begin (); at != clients_.end ();) {
    Client &client = **at++; /* it may leave */
    if (const auto frame_set = std::get_if<FrameSet> (&item))
      client.send (*frame_set);
    else if (const auto packet = std::get_if<AudioPacket> (&item))
      client.send (*packet);
    else if (const auto speech = std::get_if<SpeechChange> (&item))
      client.set_audio (speech->available);
    else
      client.end ();
  }
}

/* ---- statistics ---- */

void
Server::read_stats ()
{
  std::array<gchar, StatsBoard::kMaxDatagram + 1> datagram;
  for (int i = 0; i < 100; i++) { /* others want to be served, too */
    const gssize size =
        g_socket_receive (stats_socket_, datagram.data (), datagram.size (), nullptr, nullptr);
    if (size < 0)
      return;
    if (!board_.add ({datagram.data (), gsize (size)}))
      GST_LOG_OBJECT (element_, "ignoring a datagram of %d bytes: no statistics", int (size));
  }
}

void
Server::send_stats_to (Client &client)
{
  const std::string message = client.wants_stats () ? board_.message (client.stats_sent) : "";
  if (!message.empty ())
    client.send_text (message);
}

void
Server::send_stats ()
{
  for (auto at = clients_.begin (); at != clients_.end ();)
    send_stats_to (**at++);
}

Server::Counters
Server::counters ()
{
  std::lock_guard guard (lock_);
  Counters counters = counters_;
  counters.frame_sets = stream_.frame_sets ();
  return counters;
}

void
Server::take_client_stats (GValue *array)
{
  std::lock_guard guard (lock_);
  for (const GstStructure *structure : client_stats_) {
    GValue value = G_VALUE_INIT;
    g_value_init (&value, GST_TYPE_STRUCTURE);
    gst_value_set_structure (&value, structure);
    gst_value_array_append_and_take_value (array, &value);
  }
}

} // namespace web
