/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "server.hpp"

#include <linux/tcp.h>
#include <netinet/in.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <string_view>

using rangecast::Status;
using rangecast::StatusCode;

namespace web {

namespace {

constexpr guint kTick_ms = 250;
/** A client that reads nothing for so long is disconnected. */
constexpr gint kMaxUnread_ms = 30000;
/** Time for libsoup to close streams whose sockets are closed already. */
constexpr gint64 kMaxClosing_us = G_USEC_PER_SEC / 10;
/** Time between two requests for a key frame set, of all clients together: key frame sets are
 *  larger, so that clients that come and go must not cause one after another. */
constexpr gint64 kKeyInterval_us = G_USEC_PER_SEC;
/** What waits for the server's thread; more would be late. */
constexpr int kMaxWaitingFrameSets = 8, kMaxWaitingAudio = 100;
/** Datagrams of statistics: bytes of one, and number between two ticks. */
constexpr gsize kMaxDatagram = 8192;
constexpr guint kMaxReports = 100;

/* An address, or the first one of a name. Returns: (transfer full) (nullable) */
GSocketAddress *
resolve (const char *host, guint port)
{
  if (std::strcmp (host, "localhost") == 0)
    host = "127.0.0.1";
  g_autoptr (GSocketConnectable) name = g_network_address_new (host, guint16 (port));
  g_autoptr (GSocketAddressEnumerator) addresses = g_socket_connectable_enumerate (name);
  return g_socket_address_enumerator_next (addresses, nullptr, nullptr);
}

/* HOST and PORT of udp://HOST:PORT; [HOST] for IPv6. Returns: (transfer full) (nullable) */
GSocketAddress *
parse_udp (const std::string &address)
{
  g_autofree gchar *host = nullptr;
  gint port = -1;
  if (!g_uri_split_network (address.c_str (), G_URI_FLAGS_NONE, nullptr, &host, &port, nullptr) ||
      !address.starts_with ("udp://") || port < 0 || port > 65535)
    return nullptr;
  return resolve (host && *host ? host : "0.0.0.0", guint (port));
}

/* What browsers send as Origin: scheme, host and port, without a path. */
bool
is_origin (std::string_view text)
{
  const auto slashes = text.find ("://");
  const std::string_view scheme = text.substr (0, slashes);
  return slashes != text.npos && (scheme == "http" || scheme == "https") &&
         slashes + 3 < text.size () &&
         text.find_first_of ("/@?#;,\t\r\n", slashes + 3) == text.npos;
}

/* Whether the list, separated by spaces, has the origin. */
bool
has_origin (const std::string &list, const std::string &origin)
{
  g_auto (GStrv) origins = g_strsplit (list.c_str (), " ", -1);
  return g_strv_contains (origins, origin.c_str ());
}

/* The media type of a file in the page's folder, or nullptr if the name is no such file's. */
const char *
type_of (std::string_view name)
{
  static constexpr std::array<std::pair<const char *, const char *>, 4> kTypes = {
      {{".html", "text/html; charset=utf-8"}, {".js", "text/javascript; charset=utf-8"},
          {".css", "text/css; charset=utf-8"}, {".wasm", "application/wasm"}}};
  const auto allowed = [] (char c) { return g_ascii_isalnum (c) || c == '-' || c == '.'; };
  if (name.empty () || name.front () == '.' || !std::ranges::all_of (name, allowed))
    return nullptr;
  for (const auto &[suffix, type] : kTypes)
    if (name.ends_with (suffix))
      return type;
  return nullptr;
}

const char *
request_header (SoupServerMessage *message, const char *name)
{
  return soup_message_headers_get_list (soup_server_message_get_request_headers (message), name);
}

} // namespace

Server::Server (GstObject *element, Settings settings, RequestKey request_key)
    : element_ (element), settings_ (std::move (settings)), request_key_ (request_key),
      context_ (g_main_context_new ()), loop_ (g_main_loop_new (context_, FALSE)),
      key_requested_us_ (g_get_monotonic_time () - kKeyInterval_us)
{
}

Server::~Server ()
{
  if (thread_.joinable ()) {
    post ([this] { close_all (); });
    thread_.join ();
  }
  g_clear_object (&soup_);
  g_clear_object (&stats_socket_);
  g_main_loop_unref (loop_);
  g_main_context_unref (context_);
}

/* ---- starting ---- */

Status
Server::check_settings () const
{
  if (!settings_.token_file.empty () &&
      !g_file_test (settings_.token_file.c_str (), G_FILE_TEST_IS_REGULAR))
    return {StatusCode::kNotFound, "token-file: there is no file '" + settings_.token_file + "'"};
  if (!settings_.private_key.empty () && settings_.certificate.empty ())
    return {StatusCode::kBadValue, "private-key: set certificate, too"};
  if (settings_.anonymous && settings_.has_token ())
    return {StatusCode::kBadValue, "anonymous: set it without token and token-file"};
  for (const bool frames : {false, true}) {
    const std::string &list = frames ? settings_.frame_ancestors : settings_.origins;
    g_auto (GStrv) origins = g_strsplit (list.c_str (), " ", -1);
    for (gchar **origin = origins; *origin && !(frames && list == "*"); origin++)
      if (**origin && !is_origin (*origin))
        return {StatusCode::kBadValue, std::string (frames ? "frame-ancestors" : "origins") +
                                           ": '" + *origin +
                                           "' is not https://HOST[:PORT] or http://HOST[:PORT]"};
  }
  const std::string index = settings_.root + "/index.html";
  if (!g_file_test (index.c_str (), G_FILE_TEST_IS_REGULAR))
    return {
        StatusCode::kNotFound, "root: name the folder of the page; there is no '" + index + "'"};
  return {};
}

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
    return {StatusCode::kNotFound, "certificate='" + settings_.certificate + "' private-key='" +
                                       key + "': cannot load PEM files: " + error->message};
  soup_server_set_tls_certificate (soup_, certificate);
  return {};
}

Status
Server::listen ()
{
  g_autoptr (GSocketAddress) address = resolve (settings_.address.c_str (), settings_.port);
  if (!address)
    return {StatusCode::kBadValue,
        "address: '" + settings_.address + "' is neither an IP address nor a known name"};
  GInetAddress *host = g_inet_socket_address_get_address (G_INET_SOCKET_ADDRESS (address));
  if (!g_inet_address_get_is_loopback (host) && !settings_.has_token () && !settings_.anonymous)
    return {StatusCode::kBadValue, "address=" + settings_.address +
                                       " can be reached from other machines; set token, "
                                       "token-file, or anonymous=true for a stream that anybody "
                                       "may see"};
  g_autoptr (GError) error = nullptr;
  const bool is_any = g_inet_address_get_is_any (host);
  const auto options =
      settings_.certificate.empty () ? SoupServerListenOptions (0) : SOUP_SERVER_LISTEN_HTTPS;
  if (is_any && g_inet_address_get_family (host) == G_SOCKET_FAMILY_IPV6
          ? !soup_server_listen_all (soup_, settings_.port, options, &error)
          : !soup_server_listen (soup_, address, options, &error))
    return {StatusCode::kNotFound, "address=" + settings_.address +
                                       " port=" + std::to_string (settings_.port) +
                                       ": cannot listen there: " + error->message};
  GSList *uris = soup_server_get_uris (soup_);
  auto uri = static_cast<GUri *> (uris->data);
  g_autofree gchar *url = g_uri_join (G_URI_FLAGS_NONE, g_uri_get_scheme (uri), nullptr,
      is_any ? g_get_host_name () : g_uri_get_host (uri), g_uri_get_port (uri), "/", nullptr,
      nullptr);
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
        "stats-address: '" + settings_.stats_address + "' is not udp://ADDRESS:PORT"};
  g_autoptr (GError) error = nullptr;
  stats_socket_ = g_socket_new (
      g_socket_address_get_family (address), G_SOCKET_TYPE_DATAGRAM, G_SOCKET_PROTOCOL_UDP, &error);
  if (!stats_socket_ || !g_socket_bind (stats_socket_, address, FALSE, &error))
    return {StatusCode::kNotFound,
        "stats-address=" + settings_.stats_address + ": cannot listen there: " + error->message};
  g_socket_set_blocking (stats_socket_, FALSE);
  const GSocketSourceFunc read = [] (GSocket *, GIOCondition, gpointer self) -> gboolean {
    static_cast<Server *> (self)->read_stats ();
    return G_SOURCE_CONTINUE;
  };
  add_source (g_socket_create_source (stats_socket_, G_IO_IN, nullptr), G_SOURCE_FUNC (read));
  return {};
}

/* Takes the source, which ends with the context. */
void
Server::add_source (GSource *source, GSourceFunc call)
{
  g_source_set_callback (source, call, this, nullptr);
  g_source_attach (source, context_);
  g_source_unref (source);
}

Status
Server::start ()
{
  if (Status status = check_settings (); !status.ok ())
    return status;
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
  add_handlers ();
  add_source (g_timeout_source_new (kTick_ms), [] (gpointer self) -> gboolean {
    static_cast<Server *> (self)->tick ();
    return G_SOURCE_CONTINUE;
  });
  const auto run = [this] {
    g_main_context_push_thread_default (context_);
    g_main_loop_run (loop_);
    g_main_context_pop_thread_default (context_);
  };
  try {
    thread_ = std::thread (run);
  } catch (const std::system_error &error) {
    return {
        StatusCode::kInternal, std::string ("cannot start the server's thread: ") + error.what ()};
  }
  return {};
}

/* Has the server's thread call it, after what was posted before. */
void
Server::post (std::function<void ()> call)
{
  using Call = std::function<void ()>;
  const GSourceFunc run = [] (gpointer data) -> gboolean {
    (*static_cast<Call *> (data)) ();
    return G_SOURCE_REMOVE;
  };
  GSource *source = g_idle_source_new ();
  g_source_set_priority (source, G_PRIORITY_DEFAULT);
  g_source_set_callback (source, run, new Call (std::move (call)),
      [] (gpointer data) { delete static_cast<Call *> (data); });
  g_source_attach (source, context_);
  g_source_unref (source);
}

/* Says goodbye and does not wait for answers: a client that misses it finds the connection closed,
 * and connects again as well. */
void
Server::close_all ()
{
  soup_server_disconnect (soup_); /* no new ones; open WebSockets stay */
  for_each_client ([] (Client &client) { client.close (kCloseGoingAway, "the server stops"); });
  for (int i = 0; i < 100 && g_main_context_iteration (context_, FALSE); i++) { /* sends that */
  }
  for (const auto &socket : sockets_)
    g_socket_close (socket.get (), nullptr);
  clients_.clear ();
  const gint64 end = g_get_monotonic_time () + kMaxClosing_us;
  while (streams_.use_count () > 1 && g_get_monotonic_time () < end)
    if (!g_main_context_iteration (context_, FALSE))
      g_usleep (1000);
  g_main_loop_quit (loop_);
}

/* ---- HTTP ---- */

void
Server::add_handlers ()
{
  const auto started = [] (SoupServer *, SoupServerMessage *message, gpointer) {
    /* libsoup before 3.4 never closes its side of a connection that a client closed between two
     * requests, so each has one. An upgrade replaces this header. */
    soup_message_headers_replace (
        soup_server_message_get_response_headers (message), "Connection", "close");
    /* No request has a body of use; libsoup would keep it in memory. */
    soup_message_body_set_accumulate (soup_server_message_get_request_body (message), FALSE);
  };
  const SoupServerCallback check = [] (SoupServer *, SoupServerMessage *message, const char *path,
                                       GHashTable *, gpointer self) {
    auto server = static_cast<Server *> (self);
    const bool own_host = server->is_own_host (message);
    if (own_host && (!g_str_has_prefix (path, "/stream") || server->is_own_origin (message)))
      return;
    GST_WARNING_OBJECT (server->element_,
        "refusing %s: it asks for the host '%s' from a page of "
        "'%s'; add names and pages that are yours to origins",
        soup_server_message_get_remote_host (message), request_header (message, "Host"),
        request_header (message, "Origin"));
    soup_server_message_set_status (
        message, own_host ? SOUP_STATUS_FORBIDDEN : SOUP_STATUS_MISDIRECTED_REQUEST, nullptr);
  };
  const SoupServerCallback handle = [] (SoupServer *, SoupServerMessage *message, const char *path,
                                        GHashTable *, gpointer self) {
    if (g_str_equal (path, "/stream"))
      static_cast<Server *> (self)->upgrade (message);
    else
      static_cast<Server *> (self)->answer (message, path);
  };
  g_signal_connect (soup_, "request-started", GCallback (+started), nullptr);
  soup_server_add_early_handler (soup_, "/", check, this, nullptr);
  soup_server_add_handler (soup_, "/", handle, this, nullptr);
}

/* Without token and TLS, whoever makes a name of their own point here could let a browser of this
 * network read the stream for their page (DNS rebinding). Addresses, names without a dot and
 * .local are no such names; origins lists others. */
bool
Server::is_own_host (SoupServerMessage *message) const
{
  if (settings_.has_token () || !settings_.certificate.empty ())
    return true;
  const char *value = request_header (message, "Host");
  const std::string url = std::string ("http://") + (value ? value : "");
  g_autofree gchar *host = nullptr;
  if (!g_uri_split_network (url.c_str (), G_URI_FLAGS_NONE, nullptr, &host, nullptr, nullptr))
    return false;
  return g_hostname_is_ip_address (host) || !std::strchr (host, '.') ||
         std::strcmp (host, g_get_host_name ()) == 0 || g_str_has_suffix (host, ".local") ||
         has_origin (settings_.origins, url);
}

bool
Server::is_own_origin (SoupServerMessage *message) const
{
  const char *origin = request_header (message, "Origin"), *host = request_header (message, "Host");
  if (!origin) /* no page */
    return true;
  const char *name = std::strstr (origin, "://");
  return (host && name && std::strcmp (name + 3, host) == 0) ||
         has_origin (settings_.origins, origin);
}

void
Server::answer (SoupServerMessage *message, const std::string &path)
{
  SoupMessageHeaders *headers = soup_server_message_get_response_headers (message);
  soup_message_headers_append (headers, "Cache-Control", "no-cache");
  soup_message_headers_append (headers, "X-Content-Type-Options", "nosniff");
  soup_message_headers_append (headers, "Referrer-Policy", "no-referrer");
  const std::string &ancestors = settings_.frame_ancestors;
  soup_message_headers_append (headers, "Content-Security-Policy",
      ("default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self' "
       "'unsafe-inline'; img-src 'self' data: blob:; media-src blob:; connect-src *; object-src "
       "'none'; base-uri 'none'; frame-ancestors " +
          (ancestors.empty () ? "'none'" : ancestors))
          .c_str ());
  const char *method = soup_server_message_get_method (message);
  if (method != SOUP_METHOD_GET && method != SOUP_METHOD_HEAD)
    return soup_server_message_set_status (message, SOUP_STATUS_METHOD_NOT_ALLOWED, nullptr);
  const std::string name = path == "/"      ? "index.html"
                           : path == "/rig" ? "rig.html"
                                            : path.substr (1);
  const char *type = type_of (name);
  g_autofree gchar *contents = nullptr;
  gsize size = 0;
  if (name == "server.json") {
    type = "application/json";
    contents = g_strdup_printf ("{\"version\":%d,\"token\":%s,\"title\":%s}", kProtocolVersion,
        settings_.has_token () ? "true" : "false", json_string (settings_.title).c_str ());
    size = std::strlen (contents);
  } else if (!type || !g_file_get_contents (
                          (settings_.root + "/" + name).c_str (), &contents, &size, nullptr))
    return soup_server_message_set_status (message, SOUP_STATUS_NOT_FOUND, nullptr);
  soup_server_message_set_response (message, type, SOUP_MEMORY_COPY, contents, size);
  soup_server_message_set_status (message, SOUP_STATUS_OK, nullptr);
}

/* ---- clients ---- */

/* What soup_server_add_websocket_handler() does, but only where the subprotocol is offered and no
 * handler has refused the request. */
void
Server::upgrade (SoupServerMessage *message)
{
  const char *protocols[] = {kSubprotocol, nullptr};
  const char *offered = request_header (message, "Sec-WebSocket-Protocol");
  if (!offered || !soup_header_contains (offered, kSubprotocol))
    return soup_server_message_set_status (message, SOUP_STATUS_BAD_REQUEST, nullptr);
  const auto complete = [] (SoupServerMessage *upgraded, gpointer self) {
    static_cast<Server *> (self)->accept (upgraded);
  };
  if (soup_websocket_server_process_handshake (
          message, nullptr, const_cast<char **> (protocols), nullptr, nullptr))
    g_signal_connect (message, "wrote-informational", GCallback (+complete), this);
}

/* Clients that were not admitted do not block others. */
void
Server::drop_waiting_client ()
{
  const auto waiting =
      std::ranges::find_if (clients_, [] (const auto &one) { return !one->is_admitted (); });
  if (waiting == clients_.end ())
    return;
  GST_INFO_OBJECT (element_, "%s is evicted", (*waiting)->label ().c_str ());
  (*waiting)->close (kCloseLimit, "too many connections without hello");
  remove (**waiting);
}

void
Server::accept (SoupServerMessage *message)
{
  const char *host = soup_server_message_get_remote_host (message);
  const std::string address = host ? host : "unknown address";
  g_autoptr (GSocket) tcp = G_SOCKET (g_object_ref (soup_server_message_get_socket (message)));
  /* Who acknowledges but reads nothing must not let libsoup's queue grow. */
  g_socket_set_option (tcp, IPPROTO_TCP, TCP_USER_TIMEOUT, kMaxUnread_ms, nullptr);
  std::erase_if (sockets_, [] (const auto &one) { return g_socket_is_closed (one.get ()); });
  sockets_.emplace_back (G_SOCKET (g_object_ref (tcp)));
  g_autoptr (GUri) uri = g_uri_ref (soup_server_message_get_uri (message));
  g_autoptr (GIOStream) stream = soup_server_message_steal_connection (message);
  g_object_set_data_full (G_OBJECT (stream), "count", new std::shared_ptr<int> (streams_),
      [] (gpointer count) { delete static_cast<std::shared_ptr<int> *> (count); });
  g_autoptr (SoupWebsocketConnection) socket = soup_websocket_connection_new (
      stream, uri, SOUP_WEBSOCKET_CONNECTION_SERVER, nullptr, kSubprotocol, client_extensions ());
  counters_.connections++;
  if (clients_.size () >= settings_.max_clients)
    drop_waiting_client ();
  if (clients_.size () >= settings_.max_clients) {
    counters_.refused++;
    GST_WARNING_OBJECT (
        element_, "refusing %s: max-clients=%u", address.c_str (), settings_.max_clients);
    return soup_websocket_connection_close (socket, kCloseLimit,
        ("at most " + std::to_string (settings_.max_clients) + " viewers").c_str ());
  }
  GST_DEBUG_OBJECT (element_, "%s connected", address.c_str ());
  clients_.push_back (std::make_unique<Client> (*this, socket, tcp, address));
  counters_.clients++;
}

void
Server::remove (Client &client)
{
  counters_.clients--;
  if (Client *partner = partner_of (client))
    partner->send_text (R"({"type":"left"})");
  std::erase_if (clients_, [&] (const auto &one) { return one.get () == &client; });
}

Client *
Server::partner_of (const Client &client) const
{
  const auto partner = std::ranges::find_if (clients_, [&] (const auto &one) {
    return one.get () != &client && client.room () && one->room () == client.room ();
  });
  return partner == clients_.end () ? nullptr : partner->get ();
}

bool
Server::is_full (const std::string &room) const
{
  return std::ranges::count (clients_, std::optional (room), &Client::room) >= 2;
}

/* A client that is closed at once leaves the list. */
void
Server::for_each_client (const std::function<void (Client &)> &call)
{
  for (auto at = clients_.begin (); at != clients_.end ();)
    call (**at++);
}

bool
Server::admit (const std::string &token, std::string &name)
{
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
  counters_.refused += !admitted;
  return admitted;
}

std::string
Server::welcome () const
{
  return "{\"type\":\"welcome\",\"version\":" + std::to_string (kProtocolVersion) +
         ",\"window\":" + std::to_string (settings_.window) +
         ",\"audio\":" + (has_audio_ ? "true" : "false") + "}";
}

void
Server::request_key (Client &client)
{
  const gint64 now = g_get_monotonic_time ();
  if (now - key_requested_us_ < kKeyInterval_us || !request_key_ (element_))
    return;
  key_requested_us_ = now;
  GST_DEBUG_OBJECT (element_, "requesting a key frame set for %s", client.label ().c_str ());
  counters_.key_requests++;
}

/* ---- the stream ---- */

void
Server::push (BytesPtr units, bool key, bool discontinuity, gint64 captured_us)
{
  const auto number = guint32 (counters_.frame_sets++);
  const guint flushes = flushes_;
  discontinuity |= std::exchange (flushes_before_, flushes) != flushes;
  if (waiting_frame_sets_ >= kMaxWaitingFrameSets) {
    GST_DEBUG_OBJECT (element_, "the server is busy; dropping frame set %u", number);
    return;
  }
  waiting_frame_sets_++;
  const auto frame_set =
      std::make_shared<const FrameSet> (std::move (units), key, discontinuity, number, captured_us);
  post ([this, frame_set, flushes] {
    waiting_frame_sets_--;
    if (flushes == flushes_)
      for_each_client ([&] (Client &client) { client.send (*frame_set); });
  });
}

void
Server::push_audio (BytesPtr packet, gint64 captured_us)
{
  const auto audio =
      std::make_shared<const AudioPacket> (std::move (packet), next_audio_++, captured_us);
  if (waiting_audio_ >= kMaxWaitingAudio) {
    GST_DEBUG_OBJECT (element_, "the server is busy; dropping packet %u of speech", audio->number);
    return;
  }
  waiting_audio_++;
  post ([this, audio] {
    waiting_audio_--;
    for_each_client ([&] (Client &client) { client.send (*audio); });
  });
}

void
Server::set_audio (bool available)
{
  if (has_audio_.exchange (available) != available)
    post ([this, available] {
      for_each_client ([&] (Client &client) { client.set_audio (available); });
    });
}

void
Server::end ()
{
  post ([this] { for_each_client ([] (Client &client) { client.end (); }); });
}

/* ---- time and statistics ---- */

/* Anybody may send a datagram, so it goes on as a string, which the page reads with care. */
void
Server::read_stats ()
{
  std::array<gchar, kMaxDatagram + 1> datagram;
  for (guint i = 0; i < kMaxReports; i++) { /* others want to be served, too */
    const gssize size =
        g_socket_receive (stats_socket_, datagram.data (), datagram.size (), nullptr, nullptr);
    if (size < 0)
      return;
    if (gsize (size) > kMaxDatagram || n_reports_ >= kMaxReports ||
        !g_utf8_validate_len (datagram.data (), gsize (size), nullptr)) {
      GST_LOG_OBJECT (element_, "ignoring a datagram of %d bytes", int (size));
      continue;
    }
    const auto received_ms = g_get_real_time () / 1000;
    reports_ += (n_reports_++ ? ",{\"received\":" : "{\"received\":") +
                std::to_string (received_ms) +
                ",\"report\":" + json_string ({datagram.data (), gsize (size)}) + "}";
  }
}

void
Server::tick ()
{
  const std::string message =
      n_reports_ ? "{\"type\":\"stats\",\"reports\":[" + reports_ + "]}" : "";
  reports_.clear ();
  n_reports_ = 0;
  for_each_client ([&] (Client &client) {
    if (!message.empty () && client.wants_stats ())
      client.send_text (message);
    client.check ();
  });
}

} // namespace web
