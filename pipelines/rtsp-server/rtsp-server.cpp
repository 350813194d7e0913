/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Serves the coded frame sets of a launch string over RTSP: one encoder, any number of viewers, by
 * UDP, multicast or interleaved in the RTSP connection, with digest authentication and TLS on
 * request.
 *
 * This is a shared GstRTSPMediaFactory (media.cpp) and what gst-rtsp-server 1.22 lacks or gets
 * wrong:
 *  - keep-alive.cpp: a shared media ends or stalls with its last or slowest viewer; sinks made for
 * a viewer that joins a running media can stop it for all;
 *  - tcp-viewer.cpp: a slow TCP viewer stops the stream of all others, or never gets a packet
 * again;
 *  - join.cpp: a viewer gets packets that depend on frame sets that it never had;
 *  - media.cpp: live frame sets are delayed by the pipeline's latency; RTCP BYE overtakes the last
 *    frame set; a first frame set is waited for with no way to cancel;
 *  - connections.cpp: idle connections use up file descriptors; connections closed outside of the
 *    thread that serves them, or before their TLS handshake, leak;
 *  - here: a media that ended keeps its viewers, and is given to new ones.
 *
 * Threads: the main loop runs timers and signal handlers and accepts connections. A few threads of
 * gst-rtsp-server serve them and call the request handlers. The launch string has its own threads;
 * the end of its stream is reported by any of them, and handled in the main loop. */
#include <glib-unix.h>
#include <gst/gst.h>
#include <gst/rtsp-server/rtsp-server.h>
#include <netinet/in.h>
#include <netinet/tcp.h>

#include <algorithm>
#include <atomic>
#include <clocale>
#include <cstdio>
#include <cstring>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <thread>

#include "connections.hpp"
#include "glue.hpp"
#include "join.hpp"
#include "keep-alive.hpp"
#include "media.hpp"
#include "options.hpp"
#include "tcp-viewer.hpp"

namespace {

constexpr guint kThreads = 4;        /* that serve connections */
constexpr guint kMaxContent = 16384; /* bytes of a request's body, which has a few lines */
constexpr int kBacklog = 64;         /* connections that wait in the kernel */
/* Maximum time that gst-rtsp-server waits for the first frame set before it answers. */
constexpr int kPrepareTimeout_s = 20;
/* Less than the 60 s after which gst-rtsp-server closes idle connections, which can leak. */
constexpr int kMaxIdle_s = 50;
constexpr guint kMaxEnd_ms = 3000;       /* from EOS at the payloader to EOS on the bus */
constexpr guint kEosGrace_ms = 500;      /* for EOS, or for the response to a failed request */
constexpr guint kResponseGrace_ms = 100; /* for the response, before the connection is closed */
constexpr gint64 kSecond_us = 1000000;   /* G_USEC_PER_SEC is an int, too small for a day */
/* A reported failure is over when frame sets have been coming for this time. */
constexpr gint64 kRecovery_us = 5 * kSecond_us;
constexpr std::size_t kMaxFailures = 16;
constexpr gint64 kMaxSetup_us = 2 * kSecond_us; /* from a player's DESCRIBE to its SETUP */

/* Object data of a media, guarded by Server::lock: its stream is over; its viewers were
 * disconnected. */
constexpr char kOverKey[] = "rangecast-over", kEndedKey[] = "rangecast-ended";

struct StopTimer {
  void operator() (GSource *timer) const
  {
    g_source_destroy (timer);
    g_source_unref (timer);
  }
};
using Timers = std::map<GstRTSPMedia *, std::unique_ptr<GSource, StopTimer>>;

struct Server {
  RtspOptions options;
  StreamCounts counts;
  MediaKeepAlive keep_alive;
  std::unique_ptr<Connections> connections;
  GMainLoop *loop = nullptr;
  GstRTSPServer *server = nullptr;
  GstRTSPMediaFactory *factory = nullptr;
  GstRTSPSessionPool *sessions = nullptr;
  gint64 idle_since_us = 0;    /* monotonic; since when there has been no viewer; 0: there is one */
  gint64 start_at_us = 0;      /* monotonic; --always starts the launch string no sooner */
  gint64 stats_at_us = 0;      /* monotonic; when the next line of --stats is due */
  guint stats_timer = 0;       /* 0: none */
  guint64 seen_frame_sets = 0; /* a second ago */
  gint64 runs_since_us = 0;    /* monotonic; frame sets came in each second since; 0: none did */
  std::thread starter;         /* --always: waits for the first frame set */
  std::atomic<bool> starting = false;
  std::atomic<bool> stopping = false;

  std::mutex lock;                /* guards what follows */
  Timers ending;                  /* call end_stream() */
  Timers late;                    /* call on_late_timer() */
  std::set<std::string> failures; /* reported since frame sets last came, without digits */
  gint64 failed_at_us = 0;        /* monotonic; the last failure */
};

/* ---- the end of the stream ---- */

bool
has_ended (Server &server, GstRTSPMedia *media)
{
  std::lock_guard guard (server.lock);
  return g_object_get_data (G_OBJECT (media), kEndedKey) != nullptr;
}

bool
is_ending (Server &server)
{
  std::lock_guard guard (server.lock);
  return !server.ending.empty ();
}

/* What a timer of either kind is about. */
struct Ending {
  Ending (Server &server, GstRTSPMedia *media)
      : server (server), media (GST_RTSP_MEDIA (g_object_ref (media)))
  {
  }
  ~Ending () { g_object_unref (media); }
  Server &server;
  GstRTSPMedia *media;
};

/* Sessions of UDP viewers outlive their connections. */
GstRTSPFilterResult
remove_session_of (GstRTSPSessionPool *, GstRTSPSession *session, gpointer user_data)
{
  const auto has = [] (GstRTSPSession *, GstRTSPSessionMedia *media, gpointer wanted) {
    return gst_rtsp_session_media_get_media (media) == wanted ? GST_RTSP_FILTER_REF
                                                              : GST_RTSP_FILTER_KEEP;
  };
  GList *found = gst_rtsp_session_filter (session, has, static_cast<Ending *> (user_data)->media);
  const bool is_viewer = found != nullptr;
  g_list_free_full (found, g_object_unref);
  return is_viewer ? GST_RTSP_FILTER_REMOVE : GST_RTSP_FILTER_KEEP;
}

/* Main loop, without the lock. */
void
disconnect_viewers (Ending &ending)
{
  Server &server = ending.server;
  server.connections->close_all (ending.media);
  g_list_free_full (
      gst_rtsp_session_pool_filter (server.sessions, remove_session_of, &ending), g_object_unref);
}

/* With the lock. Replaces the timer that the media has. */
void
start_timer (Server &server, Timers &timers, GstRTSPMedia *media, guint ms, GSourceFunc callback)
{
  GSource *timer = g_timeout_source_new (ms);
  g_source_set_callback (timer, callback, new Ending (server, media), delete_data<Ending>);
  g_source_attach (timer, nullptr);
  timers[media].reset (timer);
}

gboolean
on_late_timer (gpointer user_data)
{
  auto &ending = *static_cast<Ending *> (user_data);
  {
    std::lock_guard guard (ending.server.lock);
    ending.server.late.erase (ending.media);
  }
  disconnect_viewers (ending);
  return G_SOURCE_REMOVE;
}

/* A viewer that got the media when it had just ended would wait forever. */
void
disconnect_late_viewers (Server &server, GstRTSPMedia *media)
{
  std::lock_guard guard (server.lock);
  if (!server.stopping && server.late.count (media) == 0)
    start_timer (server, server.late, media, kResponseGrace_ms, on_late_timer);
}

gboolean
end_stream (gpointer user_data)
{
  auto &ending = *static_cast<Ending *> (user_data);
  Server &server = ending.server;
  {
    std::lock_guard guard (server.lock);
    g_object_set_data (G_OBJECT (ending.media), kEndedKey, ending.media);
  }
  disconnect_viewers (ending);
  server.keep_alive.release (ending.media);
  server.start_at_us = g_get_monotonic_time () + kSecond_us; /* it may fail again at once */
  std::lock_guard guard (server.lock);
  server.ending.erase (ending.media); /* maybe a later timer than this one */
  return G_SOURCE_REMOVE;
}

/* Timers hold references of medias. */
void
cancel_timers (Server &server)
{
  Timers ending, late; /* destroyed without the lock */
  std::lock_guard guard (server.lock);
  ending.swap (server.ending);
  late.swap (server.late);
}

/* Once, not for each run that fails alike: digits are ignored, since automatic element names count
 * up from run to run. */
void
report_failure (Server &server, const std::string &why)
{
  std::string failure;
  for (const char c : why)
    if (!g_ascii_isdigit (c))
      failure += c;
  {
    std::lock_guard guard (server.lock);
    server.failed_at_us = g_get_monotonic_time ();
    if (server.failures.size () >= kMaxFailures || !server.failures.insert (failure).second)
      return;
  }
  g_printerr ("rtsp-server: %s\n", why.c_str ());
}

void
report_recovery (Server &server)
{
  const guint64 frame_sets = server.counts.frame_sets;
  const bool runs = frame_sets != server.seen_frame_sets;
  server.seen_frame_sets = frame_sets;
  {
    std::lock_guard guard (server.lock);
    const gint64 now = g_get_monotonic_time ();
    if (!runs)
      server.runs_since_us = 0;
    else if (server.runs_since_us == 0)
      server.runs_since_us = now;
    if (!runs || server.failures.empty () ||
        now - std::max (server.failed_at_us, server.runs_since_us) < kRecovery_us)
      return;
    server.failures.clear ();
  }
  g_printerr ("rtsp-server: the stream runs again\n");
}

/* Called by any thread, several times for one end: from now on the factory gives viewers a new run.
 */
void
on_stream_end (Server &server, GstRTSPMedia *media, bool is_over, const std::string &why)
{
  {
    std::lock_guard guard (server.lock);
    const bool has_ended = g_object_get_data (G_OBJECT (media), kEndedKey);
    if (server.stopping || g_object_get_data (G_OBJECT (media), kOverKey) ||
        (has_ended && !is_over))
      return; /* of several messages about one failure, the first names the cause */
    if (is_over)
      g_object_set_data (G_OBJECT (media), kOverKey, media);
    if (!has_ended && server.ending.count (media) == 0)
      begin_new_run (server.factory);
    if (!has_ended)
      start_timer (server, server.ending, media, is_over ? kEosGrace_ms : kMaxEnd_ms, end_stream);
  }
  if (!why.empty ())
    report_failure (server, why);
}

/* ---- requests; in threads that serve connections ---- */

void
on_describe_or_setup (GstRTSPClient *client, GstRTSPContext *context, gpointer user_data)
{
  auto &server = *static_cast<Server *> (user_data);
  if (!context->media)
    return;
  server.connections->record_media (client, context->media);
  if (has_ended (server, context->media))
    disconnect_late_viewers (server, context->media);
  else /* gst-rtsp-server would end it with a viewer that leaves before PLAY, and fail the others */
    server.keep_alive.hold (context->media);
}

void
on_setup (GstRTSPClient *client, GstRTSPContext *context, gpointer user_data)
{
  static_cast<Server *> (user_data)->connections->record_viewer (client, context->session);
  on_describe_or_setup (client, context, user_data);
}

GstRTSPStatusCode
before_describe (GstRTSPClient *, GstRTSPContext *, gpointer user_data)
{
  auto server = static_cast<Server *> (user_data);
  while (is_ending (*server) && !server->stopping) /* the viewer gets the next run */
    g_usleep (20000);
  server->keep_alive.record_request (); /* this viewer has no session yet */
  return server->stopping ? GST_RTSP_STS_SERVICE_UNAVAILABLE : GST_RTSP_STS_OK;
}

/* GST_RTSP_LOWER_TRANS_UNKNOWN if the offer is malformed. */
GstRTSPLowerTrans
lower_transport_of (const char *offer)
{
  GstRTSPTransport *transport = nullptr;
  gst_rtsp_transport_new (&transport);
  const GstRTSPLowerTrans lower = gst_rtsp_transport_parse (offer, transport) == GST_RTSP_OK
                                      ? transport->lower_transport
                                      : GST_RTSP_LOWER_TRANS_UNKNOWN;
  gst_rtsp_transport_free (transport);
  return lower;
}

/* gst-rtsp-server takes the first offer that the factory allows. The factory always allows TCP, for
 * the keep-alive transport, so TCP is refused here where the server does not serve it. */
GstRTSPStatusCode
before_setup (GstRTSPClient *, GstRTSPContext *context, gpointer user_data)
{
  const RtspOptions &options = static_cast<Server *> (user_data)->options;
  gchar *offered = nullptr;
  gst_rtsp_message_get_header (context->request, GST_RTSP_HDR_TRANSPORT, &offered, 0);
  if (options.tcp || !offered)
    return GST_RTSP_STS_OK;
  const int served = (options.udp ? GST_RTSP_LOWER_TRANS_UDP : 0) |
                     (options.multicast.first.empty () ? 0 : GST_RTSP_LOWER_TRANS_UDP_MCAST);
  int chosen = GST_RTSP_LOWER_TRANS_UNKNOWN;
  gchar **offers = g_strsplit (offered, ",", -1);
  for (gchar **offer = offers; *offer && !chosen; offer++)
    chosen = lower_transport_of (g_strstrip (*offer)) & (served | GST_RTSP_LOWER_TRANS_TCP);
  g_strfreev (offers);
  return chosen == GST_RTSP_LOWER_TRANS_TCP ? GST_RTSP_STS_UNSUPPORTED_TRANSPORT : GST_RTSP_STS_OK;
}

GstRTSPStatusCode
before_play (GstRTSPClient *, GstRTSPContext *context, gpointer user_data)
{
  auto &server = *static_cast<Server *> (user_data);
  GstRTSPMedia *media = gst_rtsp_session_media_get_media (context->sessmedia);
  if (has_ended (server, media)) {
    disconnect_late_viewers (server, media);
    return GST_RTSP_STS_SERVICE_UNAVAILABLE;
  }
  /* A shared stream does not seek. Also, most players ask for its beginning; where that seek fails,
   * gst-rtsp-server 1.22 leaves the media in a state in which no request is answered again. */
  for (GstRTSPHeaderField field : {GST_RTSP_HDR_RANGE, GST_RTSP_HDR_SCALE, GST_RTSP_HDR_SPEED})
    gst_rtsp_message_remove_header (context->request, field, -1);
  server.keep_alive.hold (media);
  if (const auto gate = JoinGate::of (media))
    gate->hold_back (context->sessmedia,
        server.keep_alive.has_started (media) && !has_tcp_queues (context->sessmedia));
  return GST_RTSP_STS_OK;
}

void
on_play (GstRTSPClient *client, GstRTSPContext *context, gpointer user_data)
{
  auto &server = *static_cast<Server *> (user_data);
  server.connections->record_viewer (client, context->session);
  GstRTSPMedia *media = gst_rtsp_session_media_get_media (context->sessmedia);
  /* The first viewer gets the first frame set, which is a key frame set. */
  queue_tcp_transports (
      context->sessmedia, server.counts.left_out, server.keep_alive.has_started (media));
  disable_live_sync (media);
  if (const auto gate = JoinGate::of (media))
    gate->handle_playing (context->sessmedia);
  server.keep_alive.start (media);
  request_key_frame_set (media);
}

/* Before gst-rtsp-server removes the transports of a session. */
void
remove_viewer (GstRTSPSession *session)
{
  drop_tcp_transports (session);
  const auto remove = [] (GstRTSPSession *, GstRTSPSessionMedia *media, gpointer) {
    if (const auto gate = JoinGate::of (gst_rtsp_session_media_get_media (media)))
      gate->remove (media);
    return GST_RTSP_FILTER_KEEP;
  };
  g_list_free_full (gst_rtsp_session_filter (session, remove, nullptr), g_object_unref);
}

GstRTSPStatusCode
before_pause_or_teardown (GstRTSPClient *, GstRTSPContext *context, gpointer)
{
  remove_viewer (context->session);
  return GST_RTSP_STS_OK;
}

void
on_new_session (GstRTSPClient *, GstRTSPSession *session, gpointer user_data)
{
  gst_rtsp_session_set_timeout (
      session, guint (static_cast<Server *> (user_data)->options.timeout_s));
}

/* Data that waits in the kernel can no longer be dropped, and delays the viewer. */
void
limit_send_buffer (GstRTSPClient *client, int bytes)
{
  GstRTSPConnection *connection = gst_rtsp_client_get_connection (client);
  GSocket *socket = connection ? gst_rtsp_connection_get_write_socket (connection) : nullptr;
  if (!socket)
    return;
  g_socket_set_option (socket, IPPROTO_TCP, TCP_NODELAY, TRUE, nullptr);
#ifdef TCP_NOTSENT_LOWAT
  g_socket_set_option (socket, IPPROTO_TCP, TCP_NOTSENT_LOWAT, bytes, nullptr);
#endif
}

void
on_connected (GstRTSPServer *, GstRTSPClient *client, gpointer user_data)
{
  auto &server = *static_cast<Server *> (user_data);
  limit_send_buffer (client, server.options.send_buffer_kb * 1024);
  g_signal_connect (client, "pre-describe-request", G_CALLBACK (before_describe), &server);
  g_signal_connect (client, "pre-setup-request", G_CALLBACK (before_setup), &server);
  g_signal_connect (client, "describe-request", G_CALLBACK (on_describe_or_setup), &server);
  g_signal_connect (client, "setup-request", G_CALLBACK (on_setup), &server);
  g_signal_connect (client, "pre-play-request", G_CALLBACK (before_play), &server);
  g_signal_connect (client, "play-request", G_CALLBACK (on_play), &server);
  g_signal_connect (client, "pre-pause-request", G_CALLBACK (before_pause_or_teardown), &server);
  g_signal_connect (client, "pre-teardown-request", G_CALLBACK (before_pause_or_teardown), &server);
  g_signal_connect (client, "new-session", G_CALLBACK (on_new_session), &server);
  server.connections->add (client);
}

/* Connected before gst-rtsp-server's own handler, which removes the connection. */
void
on_session_removed (GstRTSPSessionPool *, GstRTSPSession *session, gpointer)
{
  remove_viewer (session);
}

gboolean
on_incoming (GSocket *socket, GIOCondition condition, gpointer user_data)
{
  auto &server = *static_cast<Server *> (user_data);
  if (!(condition & G_IO_IN))
    return gst_rtsp_server_io_func (socket, condition, server.server);
  server.connections->accept (socket);
  return G_SOURCE_CONTINUE;
}

/* ---- --always ---- */

/* Starts the launch string without a viewer, in a thread of its own, since gst_rtsp_media_prepare()
 * waits for the first frame set. */
void
start_media (Server &server)
{
  GstRTSPUrl *url = nullptr;
  const std::string text = "rtsp://localhost" + server.options.mount;
  gst_rtsp_url_parse (text.c_str (), &url);
  GstRTSPMedia *media = gst_rtsp_media_factory_construct (server.factory, url);
  gst_rtsp_url_free (url);
  if (media && !server.stopping) {
    GstRTSPThreadPool *pool = gst_rtsp_server_get_thread_pool (server.server);
    GstRTSPContext context = {};
    GstRTSPThread *thread =
        gst_rtsp_thread_pool_get_thread (pool, GST_RTSP_THREAD_TYPE_MEDIA, &context);
    if (gst_rtsp_media_prepare (media, thread)) {
      if (!server.stopping && server.keep_alive.hold (media))
        server.keep_alive.start (media);
      gst_rtsp_media_unprepare (media); /* keep_alive has prepared it, too */
    }
    g_object_unref (pool);
  }
  g_clear_object (&media);
  server.starting = false;
}

void
keep_running (Server &server)
{
  const gint64 now = g_get_monotonic_time ();
  if (server.starting || server.keep_alive.holds_any () || now < server.start_at_us)
    return;
  if (server.starter.joinable ())
    server.starter.join ();
  server.start_at_us = now + G_USEC_PER_SEC;
  server.starting = true;
  server.starter = std::thread (start_media, std::ref (server));
}

/* ---- the timer ---- */

void
print_stats (Server &server)
{
  const StreamCounts &counts = server.counts;
  std::printf ("viewers=%u frame-sets=%" G_GUINT64_FORMAT " bytes=%" G_GUINT64_FORMAT
               " left-out=%" G_GUINT64_FORMAT " key-requests=%" G_GUINT64_FORMAT "\n",
      gst_rtsp_session_pool_get_n_sessions (server.sessions), counts.frame_sets.load (),
      counts.bytes.load (), counts.left_out.load (), counts.key_requests.load ());
  std::fflush (stdout);
}

/* One timer a line, since a repeated GLib timer drifts.
 * @param last_us  monotonic; when the line before was due */
void
wait_for_stats (Server &server, gint64 last_us)
{
  const auto on_stats = [] (gpointer user_data) -> gboolean {
    auto &self = *static_cast<Server *> (user_data);
    print_stats (self);
    wait_for_stats (self, self.stats_at_us);
    return G_SOURCE_REMOVE;
  };
  const gint64 now = g_get_monotonic_time ();
  server.stats_at_us = std::max (last_us + server.options.stats_s * kSecond_us, now);
  server.stats_timer = g_timeout_add (guint ((server.stats_at_us - now) / 1000), on_stats, &server);
}

gboolean
on_second (gpointer user_data)
{
  auto &server = *static_cast<Server *> (user_data);
  gst_rtsp_session_pool_cleanup (server.sessions);
  server.connections->close_idle (
      std::min (server.options.timeout_s + kPrepareTimeout_s, kMaxIdle_s) * G_USEC_PER_SEC);
  const gint64 now = g_get_monotonic_time ();
  if (gst_rtsp_session_pool_get_n_sessions (server.sessions) > 0)
    server.idle_since_us = 0;
  else if (server.idle_since_us == 0)
    server.idle_since_us = now;
  if (server.options.always)
    keep_running (server);
  else if (server.idle_since_us > 0 && !is_ending (server) &&
           now - server.idle_since_us >= server.options.linger_s * kSecond_us)
    server.keep_alive.release_unless_asked_since (now - kMaxSetup_us);
  report_recovery (server);
  return G_SOURCE_CONTINUE;
}

/* ---- who may watch ---- */

GTlsCertificate *
load_certificate (const RtspOptions &options)
{
  GError *error = nullptr;
  GTlsCertificate *certificate = g_tls_certificate_new_from_files (
      options.certificate_file.c_str (), options.key_file.c_str (), &error);
  if (!certificate)
    g_printerr ("rtsp-server: --cert %s, --key %s: %s\n", options.certificate_file.c_str (),
        options.key_file.c_str (), error->message);
  g_clear_error (&error);
  return certificate;
}

bool
set_auth (Server &server)
{
  const RtspOptions &options = server.options;
  if (options.users.empty () && options.certificate_file.empty ())
    return true;
  GstRTSPAuth *auth = gst_rtsp_auth_new ();
  gst_rtsp_auth_set_supported_methods (auth, GST_RTSP_AUTH_DIGEST);
  gst_rtsp_auth_set_realm (auth, options.realm.c_str ());
  bool good = true;
  if (!options.certificate_file.empty ()) {
    GTlsCertificate *certificate = load_certificate (options);
    good = certificate != nullptr;
    if (good)
      gst_rtsp_auth_set_tls_certificate (auth, certificate);
    g_clear_object (&certificate);
  }
  GstRTSPToken *token =
      gst_rtsp_token_new (GST_RTSP_TOKEN_MEDIA_FACTORY_ROLE, G_TYPE_STRING, kViewerRole, nullptr);
  for (const RtspUser &user : options.users)
    gst_rtsp_auth_add_digest (auth, user.name.c_str (), user.password.c_str (), token);
  if (options.users.empty ())
    gst_rtsp_auth_set_default_token (auth, token);
  gst_rtsp_token_unref (token);
  gst_rtsp_server_set_auth (server.server, auth);
  g_object_unref (auth);
  return good;
}

/* ---- the run ---- */

bool
check_launch (const RtspOptions &options)
{
  GError *error = nullptr;
  GstElement *bin = make_stream_bin (options.launch, &error);
  if (bin)
    gst_object_unref (gst_object_ref_sink (bin));
  else
    g_printerr ("rtsp-server: launch string: %s\n", error->message);
  g_clear_error (&error);
  return bin != nullptr;
}

void
set_up (Server &server, std::size_t connections)
{
  const RtspOptions &options = server.options;
  disable_live_sync_at_play ();
  server.server = gst_rtsp_server_new ();
  server.connections = std::make_unique<Connections> (
      server.server, kThreads, connections, !options.certificate_file.empty ());
  gst_rtsp_server_set_address (server.server, options.address.c_str ());
  gst_rtsp_server_set_service (server.server, std::to_string (options.port).c_str ());
  gst_rtsp_server_set_content_length_limit (server.server, kMaxContent);
  gst_rtsp_server_set_backlog (server.server, kBacklog);
  server.sessions = gst_rtsp_server_get_session_pool (server.server);
  gst_rtsp_session_pool_set_max_sessions (server.sessions, guint (options.max_viewers));
  g_signal_connect (server.sessions, "session-removed", G_CALLBACK (on_session_removed), nullptr);
  server.factory = make_factory (options, server.counts,
      [&server] (GstRTSPMedia *media, bool is_over, const std::string &why) {
        on_stream_end (server, media, is_over, why);
      });
  GstRTSPMountPoints *mounts = gst_rtsp_server_get_mount_points (server.server);
  gst_rtsp_mount_points_add_factory (
      mounts, options.mount.c_str (), GST_RTSP_MEDIA_FACTORY (g_object_ref (server.factory)));
  g_object_unref (mounts);
  g_signal_connect (server.server, "client-connected", G_CALLBACK (on_connected), &server);
}

int
port_of (GSocket *socket)
{
  GSocketAddress *address = g_socket_get_local_address (socket, nullptr);
  const int port = address ? g_inet_socket_address_get_port (G_INET_SOCKET_ADDRESS (address)) : 0;
  g_clear_object (&address);
  return port;
}

/* @return the source of incoming connections; nullptr after reporting the error */
GSource *
listen (Server &server)
{
  const RtspOptions &options = server.options;
  GError *error = nullptr;
  GSocket *socket = gst_rtsp_server_create_socket (server.server, nullptr, &error);
  if (!socket) {
    g_printerr (
        "rtsp-server: %s, port %d: %s\n", options.address.c_str (), options.port, error->message);
    g_error_free (error);
    return nullptr;
  }
  GSource *source =
      g_socket_create_source (socket, GIOCondition (G_IO_IN | G_IO_ERR | G_IO_HUP), nullptr);
  g_source_set_callback (source, G_SOURCE_FUNC (on_incoming), &server, nullptr);
  g_source_attach (source, nullptr);
  std::printf ("serving %s://%s:%d%s\n", options.certificate_file.empty () ? "rtsp" : "rtsps",
      options.address.c_str (), port_of (socket), options.mount.c_str ());
  std::fflush (stdout);
  g_object_unref (socket);
  return source;
}

gboolean
on_signal (gpointer user_data)
{
  g_main_loop_quit (static_cast<Server *> (user_data)->loop);
  return G_SOURCE_CONTINUE;
}

void
close_all (Server &server)
{
  server.connections->end ();
  server.keep_alive.release ();
}

void
serve (Server &server, GSource *source)
{
  server.loop = g_main_loop_new (nullptr, FALSE);
  const guint interrupt = g_unix_signal_add (SIGINT, on_signal, &server);
  const guint terminate = g_unix_signal_add (SIGTERM, on_signal, &server);
  const guint timer = g_timeout_add_seconds (1, on_second, &server);
  if (server.options.stats_s > 0)
    wait_for_stats (server, g_get_monotonic_time ());
  if (server.options.always)
    keep_running (server);
  g_main_loop_run (server.loop);
  if (server.stats_timer > 0) {
    g_source_remove (server.stats_timer);
    print_stats (server);
  }
  server.stopping = true;
  g_source_remove (timer);
  g_source_remove (interrupt);
  g_source_remove (terminate);
  g_source_destroy (source);
  cancel_timers (server);
  end_waiting (server.factory);
  close_all (server);
  if (server.starter.joinable ())
    server.starter.join ();
  close_all (server); /* what the starter has started meanwhile */
  g_main_loop_unref (server.loop);
}

} // namespace

int
main (int argc, char **argv)
{
  setlocale (LC_CTYPE, ""); /* arguments are in the user's encoding */
  int result = 1;
  {
    Server server;
    if (!parse_arguments (argc, argv, server.options))
      return 2;
    const auto connections = max_connections (server.options.max_viewers);
    if (connections && check_launch (server.options)) {
      set_up (server, *connections);
      GSource *source = set_auth (server) ? listen (server) : nullptr;
      if (source) {
        serve (server, source);
        g_source_unref (source);
        result = 0;
      }
      g_object_unref (server.factory);
      g_object_unref (server.sessions);
      g_object_unref (server.server);
      server.connections.reset ();
    }
  }
  gst_deinit ();
  return result;
}
