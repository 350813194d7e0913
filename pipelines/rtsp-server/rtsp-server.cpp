/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Serves the coded frame sets of a launch string over RTSP: one encoder, any number of viewers, by
 * UDP, multicast or inside the RTSP connection, with digest authentication and TLS where asked for.
 *
 * Threads: the main loop has the timer and the signals; connections are served by a few threads of
 * gst-rtsp-server, which call on_play() and the like; the launch string runs in its own. The end of
 * the stream is told by any thread, and the main loop acts. */
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
#include "holder.hpp"
#include "join.hpp"
#include "media.hpp"
#include "options.hpp"
#include "tcp-viewer.hpp"
#include "threads.hpp"

static constexpr guint kThreads = 4; /* that serve connections */
/* Requests of RTSP have bodies of a few lines at most. */
static constexpr guint kMaxContent = 16384; /* bytes */
static constexpr int kBacklog = 64; /* connections that the kernel holds until they are taken */
/* So long gst-rtsp-server waits for the first frame set before it answers. */
static constexpr int kSlowestStart_s = 20;
/* Idle connections are closed here: gst-rtsp-server does it after 60 s, and not well, see there. */
static constexpr int kMaxPatience_s = 50;
/* So long the last frame set may last, after which a stream is over. */
static constexpr guint kSlowestEnd_ms = 3000;
static constexpr guint kLastWords_ms = 500;
static constexpr guint kLeave_ms = 100; /* its answer gets to who is sent away */

/* Of a media, under the lock of the server: it is over; its viewers were sent away. */
static constexpr char kOverKey[] = "rangecast-over", kEndedKey[] = "rangecast-ended";

struct StopTimer {
  void operator() (GSource *timer) const
  {
    g_source_destroy (timer);
    g_source_unref (timer);
  }
};
/* One for each media. */
using Timers = std::map<GstRTSPMedia *, std::unique_ptr<GSource, StopTimer>>;

struct Server {
  RtspOptions options;
  StreamCounts counts;
  MediaHolder holder;
  std::unique_ptr<Connections> connections;
  GMainLoop *loop = nullptr;
  GstRTSPServer *server = nullptr;
  GstRTSPMediaFactory *factory = nullptr;
  GstRTSPSessionPool *sessions = nullptr;
  gint64 idle_since_us = 0;    /* monotonic; since when there has been no viewer; 0: there is one */
  gint64 start_at_us = 0;      /* of --always: not before */
  gint64 stats_at_us = 0;      /* monotonic; when the next line of --stats is due */
  guint stats_timer = 0;       /* 0: none */
  guint64 seen_frame_sets = 0; /* a second ago */
  gint64 runs_since_us = 0;    /* monotonic; frame sets came in each second since; 0: none did */
  std::thread starter;         /* of --always: waits until the launch string runs */
  std::atomic<bool> starting = false;
  std::atomic<bool> stopping = false;

  std::mutex lock;                /* guards what follows */
  Timers ending;                  /* call end_stream() */
  Timers leaving;                 /* send those away who came when it had ended */
  std::set<std::string> failures; /* that were told, without digits, since it last ran well */
  gint64 failed_at_us = 0;        /* monotonic; when it last came */
};

/* G_USEC_PER_SEC is an int, and a day is too long for one. */
static constexpr gint64 kSecond_us = G_USEC_PER_SEC;
/* Who has run so long has not only begun again after a failure. */
static constexpr gint64 kRecovery_us = 5 * kSecond_us;
static constexpr std::size_t kMaxFailures = 16;
/* In which a player that has got its DESCRIBE goes on to SETUP. */
static constexpr gint64 kSetup_us = 2 * kSecond_us;

static bool
is_ending (Server &server)
{
  std::lock_guard guard (server.lock);
  return !server.ending.empty ();
}

/* ---- connections ---- */

/* What the kernel takes beyond what it can send soon only makes the viewer late. */
static void
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

/* ---- requests; in threads that serve connections ---- */

static void leave_ended_soon (Server &server, GstRTSPMedia *media);

static bool
has_ended (Server &server, GstRTSPMedia *media)
{
  std::lock_guard guard (server.lock);
  return g_object_get_data (G_OBJECT (media), kEndedKey) != nullptr;
}

static void
on_describe_or_setup (GstRTSPClient *client, GstRTSPContext *context, gpointer user_data)
{
  auto &server = *static_cast<Server *> (user_data);
  if (!context->media)
    return;
  server.connections->note_media (client, context->media);
  if (has_ended (server, context->media)) /* it came when the others were sent away */
    leave_ended_soon (server, context->media);
  else /* or it would end with a viewer that leaves before it plays, and who asks then fails */
    server.holder.hold (context->media);
}

static void
on_setup (GstRTSPClient *client, GstRTSPContext *context, gpointer user_data)
{
  static_cast<Server *> (user_data)->connections->note_viewer (client, context->session);
  on_describe_or_setup (client, context, user_data);
}

static GstRTSPStatusCode
before_describe (GstRTSPClient *, GstRTSPContext *, gpointer user_data)
{
  auto server = static_cast<Server *> (user_data);
  while (is_ending (*server) && !server->stopping) /* what ends is not joined: the next run is */
    g_usleep (20000);
  server->holder.note_asking (); /* has no session yet, but is not to be let down */
  return server->stopping ? GST_RTSP_STS_SERVICE_UNAVAILABLE : GST_RTSP_STS_OK;
}

/* UNKNOWN for what is no transport. */
static GstRTSPLowerTrans
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

/* The factory lets TCP pass, since the holder is such a viewer. The library takes the first offer
 * that the factory lets pass. */
static GstRTSPStatusCode
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

static GstRTSPStatusCode
before_play (GstRTSPClient *, GstRTSPContext *context, gpointer user_data)
{
  auto &server = *static_cast<Server *> (user_data);
  GstRTSPMedia *media = gst_rtsp_session_media_get_media (context->sessmedia);
  if (has_ended (server, media)) {
    leave_ended_soon (server, media);
    return GST_RTSP_STS_SERVICE_UNAVAILABLE;
  }
  /* The stream is not one viewer's to wind. Even to its beginning, as most players ask, the library
   * may fail to, and then that media never answers anybody again. */
  for (GstRTSPHeaderField field : {GST_RTSP_HDR_RANGE, GST_RTSP_HDR_SCALE, GST_RTSP_HDR_SPEED})
    gst_rtsp_message_remove_header (context->request, field, -1);
  server.holder.hold (media);
  if (const auto gate = JoinGate::of (media))
    gate->hold_back (context->sessmedia,
        server.holder.has_started (media) && !has_tcp_queues (context->sessmedia));
  return GST_RTSP_STS_OK;
}

static void
on_play (GstRTSPClient *client, GstRTSPContext *context, gpointer user_data)
{
  auto &server = *static_cast<Server *> (user_data);
  server.connections->note_viewer (client, context->session);
  GstRTSPMedia *media = gst_rtsp_session_media_get_media (context->sessmedia);
  /* Whose viewer is the first gets what comes first, which is a key frame set. */
  queue_tcp_transports (
      context->sessmedia, server.counts.left_out, server.holder.has_started (media));
  send_as_they_come (media);
  if (const auto gate = JoinGate::of (media))
    gate->note_playing (context->sessmedia);
  server.holder.start (media);
  request_key_frame_set (media);
}

/* Before the library takes a viewer away. */
static void
forget_viewer (GstRTSPSession *session)
{
  drop_tcp_transports (session);
  const auto forget = [] (GstRTSPSession *, GstRTSPSessionMedia *media, gpointer) {
    if (const auto gate = JoinGate::of (gst_rtsp_session_media_get_media (media)))
      gate->forget (media);
    return GST_RTSP_FILTER_KEEP;
  };
  g_list_free_full (gst_rtsp_session_filter (session, forget, nullptr), g_object_unref);
}

static GstRTSPStatusCode
before_pause_or_teardown (GstRTSPClient *, GstRTSPContext *context, gpointer)
{
  forget_viewer (context->session);
  return GST_RTSP_STS_OK;
}

static void
on_new_session (GstRTSPClient *, GstRTSPSession *session, gpointer user_data)
{
  gst_rtsp_session_set_timeout (
      session, guint (static_cast<Server *> (user_data)->options.timeout_s));
}

static void
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

/* It comes before the library's own handler, which takes the connection away. */
static void
on_session_removed (GstRTSPSessionPool *, GstRTSPSession *session, gpointer)
{
  forget_viewer (session);
}

static gboolean
on_incoming (GSocket *socket, GIOCondition condition, gpointer user_data)
{
  auto &server = *static_cast<Server *> (user_data);
  if (!(condition & G_IO_IN))
    return gst_rtsp_server_io_func (socket, condition, server.server);
  server.connections->take (socket);
  return G_SOURCE_CONTINUE;
}

/* ---- the stream ---- */

static void
close_all (Server &server)
{
  server.connections->end ();
  server.holder.release ();
}

/* A media, and the server that it is of. */
struct Ending {
  Ending (Server &server, GstRTSPMedia *media)
      : server (server), media (GST_RTSP_MEDIA (g_object_ref (media)))
  {
  }
  ~Ending () { g_object_unref (media); }
  Server &server;
  GstRTSPMedia *media;
};

static void
delete_ending (gpointer ending)
{
  delete static_cast<Ending *> (ending);
}

/* Those of UDP viewers outlive their connections. */
static GstRTSPFilterResult
close_session (GstRTSPSessionPool *, GstRTSPSession *session, gpointer user_data)
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

/* In the main loop. */
static void
send_viewers_away (Ending &ending)
{
  Server &server = ending.server;
  server.connections->close_all (ending.media);
  g_list_free_full (
      gst_rtsp_session_pool_filter (server.sessions, close_session, &ending), g_object_unref);
}

/* With the lock, and instead of the one that there was. */
static void
start_timer (Server &server, Timers &timers, GstRTSPMedia *media, guint ms, GSourceFunc callback)
{
  GSource *timer = g_timeout_source_new (ms);
  g_source_set_callback (timer, callback, new Ending (server, media), delete_ending);
  g_source_attach (timer, nullptr);
  timers[media].reset (timer);
}

static gboolean
leave_ended (gpointer user_data)
{
  auto &ending = *static_cast<Ending *> (user_data);
  {
    std::lock_guard guard (ending.server.lock);
    ending.server.leaving.erase (ending.media);
  }
  send_viewers_away (ending);
  return G_SOURCE_REMOVE;
}

/* Who got to a stream just when it had ended would see nothing for ever. */
static void
leave_ended_soon (Server &server, GstRTSPMedia *media)
{
  std::lock_guard guard (server.lock);
  if (!server.stopping && server.leaving.count (media) == 0)
    start_timer (server, server.leaving, media, kLeave_ms, leave_ended);
}

static gboolean
end_stream (gpointer user_data)
{
  auto &ending = *static_cast<Ending *> (user_data);
  Server &server = ending.server;
  {
    std::lock_guard guard (server.lock);
    g_object_set_data (G_OBJECT (ending.media), kEndedKey, ending.media);
  }
  send_viewers_away (ending);
  server.holder.release (ending.media);
  server.start_at_us = g_get_monotonic_time () + G_USEC_PER_SEC; /* it might fail again at once */
  std::lock_guard guard (server.lock);
  server.ending.erase (ending.media); /* it may be a later one than this */
  return G_SOURCE_REMOVE;
}

/* Each holds a reference of its media. */
static void
forget_endings (Server &server)
{
  Timers ending, leaving; /* end without the lock */
  std::lock_guard guard (server.lock);
  ending.swap (server.ending);
  leaving.swap (server.leaving);
}

/* Each failure once, not for every run that ends so. Elements that have no name of their own are
 * numbered on from run to run, so digits do not count. */
static void
tell_failure (Server &server, const std::string &why)
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

static void
tell_recovery (Server &server)
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

/* Whoever comes next gets a new run of the launch string. */
static void
on_stream_end (Server &server, GstRTSPMedia *media, bool is_over, const std::string &why)
{
  {
    std::lock_guard guard (server.lock);
    if (server.stopping || g_object_get_data (G_OBJECT (media), kOverKey))
      return; /* one failure often is several messages, of which the first says why */
    if (is_over)
      g_object_set_data (G_OBJECT (media), kOverKey, media);
    else if (g_object_get_data (G_OBJECT (media), kEndedKey))
      return;
    if (server.ending.count (media) == 0 && !g_object_get_data (G_OBJECT (media), kEndedKey))
      begin_new_run (server.factory);
    /* Before that EOS goes to the viewers, or the answer to who asked for what cannot run. */
    if (!g_object_get_data (G_OBJECT (media), kEndedKey))
      start_timer (
          server, server.ending, media, is_over ? kLastWords_ms : kSlowestEnd_ms, end_stream);
  }
  if (!why.empty ())
    tell_failure (server, why);
}

/* Runs the launch string before anybody asks for it. It takes as long as it waits for its first
 * frame set, so this is a thread of its own. */
static void
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
      if (!server.stopping && server.holder.hold (media))
        server.holder.start (media);
      gst_rtsp_media_unprepare (media); /* the holder has its own share of it */
    }
    g_object_unref (pool);
  }
  g_clear_object (&media);
  server.starting = false;
}

static void
keep_running (Server &server)
{
  const gint64 now = g_get_monotonic_time ();
  if (server.starting || server.holder.holds_any () || now < server.start_at_us)
    return;
  if (server.starter.joinable ())
    server.starter.join ();
  server.start_at_us = now + G_USEC_PER_SEC;
  server.starting = true;
  server.starter = std::thread (start_media, std::ref (server));
}

/* ---- the timer ---- */

static void
print_stats (Server &server)
{
  const StreamCounts &counts = server.counts;
  std::printf ("viewers=%u frame-sets=%" G_GUINT64_FORMAT " bytes=%" G_GUINT64_FORMAT
               " left-out=%" G_GUINT64_FORMAT " key-requests=%" G_GUINT64_FORMAT "\n",
      gst_rtsp_session_pool_get_n_sessions (server.sessions), counts.frame_sets.load (),
      counts.bytes.load (), counts.left_out.load (), counts.key_requests.load ());
  std::fflush (stdout);
}

/* A timer for each line: those of a repeated one would come a little later each time.
 * @param last_us  monotonic; when the line before was due */
static void
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

static gboolean
on_second (gpointer user_data)
{
  auto &server = *static_cast<Server *> (user_data);
  gst_rtsp_session_pool_cleanup (server.sessions);
  server.connections->close_idle (
      std::min (server.options.timeout_s + kSlowestStart_s, kMaxPatience_s) * G_USEC_PER_SEC);
  const gint64 now = g_get_monotonic_time ();
  if (gst_rtsp_session_pool_get_n_sessions (server.sessions) > 0)
    server.idle_since_us = 0;
  else if (server.idle_since_us == 0)
    server.idle_since_us = now;
  if (server.options.always)
    keep_running (server);
  else if (server.idle_since_us > 0 && !is_ending (server) &&
           now - server.idle_since_us >= server.options.linger_s * kSecond_us)
    server.holder.release_unless_asked_since (now - kSetup_us);
  tell_recovery (server);
  return G_SOURCE_CONTINUE;
}

/* ---- who may watch ---- */

static GTlsCertificate *
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

/* An RTSP server of the library has certificates and passwords in one object. */
static bool
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

static bool
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

static void
set_up (Server &server, std::size_t connections)
{
  const RtspOptions &options = server.options;
  let_live_media_play ();
  server.server = gst_rtsp_server_new ();
  server.connections = std::make_unique<Connections> (
      server.server, connections, !options.certificate_file.empty ());
  gst_rtsp_server_set_address (server.server, options.address.c_str ());
  gst_rtsp_server_set_service (server.server, std::to_string (options.port).c_str ());
  gst_rtsp_server_set_content_length_limit (server.server, kMaxContent);
  gst_rtsp_server_set_backlog (server.server, kBacklog);
  GstRTSPThreadPool *threads =
      make_thread_pool (kThreads, [&server] (GstRTSPClient *client, GstRTSPThread *thread) {
        server.connections->note_thread (client, thread);
      });
  gst_rtsp_server_set_thread_pool (server.server, threads);
  g_object_unref (threads);
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

static int
port_of (GSocket *socket)
{
  GSocketAddress *address = g_socket_get_local_address (socket, nullptr);
  const int port = address ? g_inet_socket_address_get_port (G_INET_SOCKET_ADDRESS (address)) : 0;
  g_clear_object (&address);
  return port;
}

/* @return the source that takes connections, nullptr after saying why there is none */
static GSource *
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

static gboolean
on_signal (gpointer user_data)
{
  g_main_loop_quit (static_cast<Server *> (user_data)->loop);
  return G_SOURCE_CONTINUE;
}

static void
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
  forget_endings (server);
  end_waiting (server.factory);
  close_all (server);
  if (server.starter.joinable ())
    server.starter.join ();
  close_all (server); /* what the starter may have started meanwhile */
  g_main_loop_unref (server.loop);
}

int
main (int argc, char **argv)
{
  setlocale (LC_CTYPE, ""); /* arguments are in the user's encoding */
  int result = 1;
  {
    Server server;
    if (!parse_arguments (argc, argv, server.options))
      return 2;
    const auto connections = fit_connections (server.options.max_viewers);
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
      end_threads ();
      server.connections.reset ();
    }
  }
  gst_deinit ();
  return result;
}
