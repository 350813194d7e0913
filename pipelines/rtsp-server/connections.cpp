/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "connections.hpp"

#include <fcntl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <utility>

namespace {

/* Connections that are no viewers: only DESCRIBE, or no SETUP yet. */
constexpr rlim_t kSpare = 32, kMinSpare = 8;
/* Files of the server and its launch string: 27 with avatartestsrc, 34 with multicast. */
constexpr rlim_t kOwnFiles = 256, kMinOwnFiles = 40;
/* Left to a launch string that opens more than that. */
constexpr int kKeptFiles = 16;
/* Of kOwnFiles: closed connections keep their files until the threads that serve them free them,
 * and these may wait for a first frame set. */
constexpr std::size_t kMaxClosing = 128;
/* end() waits in turns. */
constexpr gulong kEndTurn_us = 10000;
constexpr int kEndTurns = 300, kTurnsPerClosing = 50;
/* accept() waits for the file of the connection that it closed. */
constexpr int kClosingTurns = 5;
constexpr gulong kClosing_us = 2000;
/* The socket stays readable while nothing can be accepted. */
constexpr gulong kNoFiles_us = 20000;

} // namespace

std::optional<std::size_t>
max_connections (int max_viewers)
{
  const auto viewers = rlim_t (max_viewers);
  struct rlimit files = {};
  if (getrlimit (RLIMIT_NOFILE, &files) != 0)
    return viewers + kSpare;
  const rlim_t wanted = viewers + kSpare + kOwnFiles;
  if (files.rlim_cur < wanted) {
    const rlim_t before = files.rlim_cur;
    files.rlim_cur = std::min (wanted, files.rlim_max);
    if (setrlimit (RLIMIT_NOFILE, &files) != 0)
      files.rlim_cur = before;
  }
  const rlim_t most = files.rlim_cur - std::min (files.rlim_cur, kMinSpare + kMinOwnFiles);
  if (viewers > most) {
    g_printerr (
        "rtsp-server: --max-viewers: expected at most %d, because a process may have %d open "
        "files here (ulimit -n), got '%d'\n",
        int (most), int (files.rlim_cur), max_viewers);
    return std::nullopt;
  }
  const rlim_t others = files.rlim_cur - std::min (files.rlim_cur, viewers + kOwnFiles);
  return viewers + std::clamp (others, kMinSpare, kSpare);
}

namespace {

/* New files get the lowest free number, so the uppermost numbers stay free of connections. */
bool
are_files_short (GSocket *socket)
{
  struct rlimit files = {};
  const int next = fcntl (g_socket_get_fd (socket), F_DUPFD_CLOEXEC, 0);
  if (next < 0)
    return true;
  ::close (next);
  return getrlimit (RLIMIT_NOFILE, &files) == 0 && rlim_t (next + kKeptFiles) >= files.rlim_cur;
}

} // namespace

/* ---- the threads that serve them ---- */

/* A thread pool that reports which thread a connection gets, before that serves it. */
G_BEGIN_DECLS
struct ConnectionThreads {
  GstRTSPThreadPool parent;
  Connections *owner;
};
struct ConnectionThreadsClass {
  GstRTSPThreadPoolClass parent_class;
};
G_END_DECLS
G_DEFINE_TYPE (ConnectionThreads, connection_threads, GST_TYPE_RTSP_THREAD_POOL)

static GstRTSPThread *
connection_threads_get_thread (
    GstRTSPThreadPool *pool, GstRTSPThreadType type, GstRTSPContext *context)
{
  GstRTSPThread *thread = GST_RTSP_THREAD_POOL_CLASS (connection_threads_parent_class)
                              ->get_thread (pool, type, context);
  if (thread && type == GST_RTSP_THREAD_TYPE_CLIENT && context && context->client)
    reinterpret_cast<ConnectionThreads *> (pool)->owner->record_thread (context->client, thread);
  return thread;
}

static void
connection_threads_init (ConnectionThreads *)
{
}

static void
connection_threads_class_init (ConnectionThreadsClass *klass)
{
  GST_RTSP_THREAD_POOL_CLASS (klass)->get_thread = connection_threads_get_thread;
}

Connections::Connections (
    GstRTSPServer *server, int n_threads, std::size_t max_connections, bool has_tls)
    : server_ (server), max_connections_ (max_connections), has_tls_ (has_tls)
{
  auto threads =
      static_cast<ConnectionThreads *> (g_object_new (connection_threads_get_type (), nullptr));
  threads->owner = this;
  gst_rtsp_thread_pool_set_max_threads (GST_RTSP_THREAD_POOL (threads), n_threads);
  gst_rtsp_server_set_thread_pool (server, GST_RTSP_THREAD_POOL (threads));
  g_object_unref (threads);
}

Connections::~Connections ()
{
  /* gst_rtsp_thread_pool_cleanup() ends the GThreadPool of its own class, not that of this one. */
  auto klass =
      static_cast<GstRTSPThreadPoolClass *> (g_type_class_peek (connection_threads_get_type ()));
  if (klass->pool)
    g_thread_pool_free (std::exchange (klass->pool, nullptr), FALSE, TRUE);
  std::lock_guard guard (lock_); /* synchronises with what the threads wrote */
  connections_.clear ();
}

/* ---- what each asks for; in the threads that serve them ---- */

void
Connections::on_gone (gpointer connections, GObject *client)
{
  auto self = static_cast<Connections *> (connections);
  std::unique_lock guard (self->lock_);
  const auto gone = self->connections_.extract (reinterpret_cast<GstRTSPClient *> (client));
  guard.unlock (); /* before its socket and its thread are released */
}

void
Connections::record_media (GstRTSPClient *client, const GstRTSPMedia *media)
{
  std::lock_guard guard (lock_);
  const auto found = connections_.find (client);
  if (found == connections_.end ())
    return;
  found->second.media = media;
  found->second.since_us = g_get_monotonic_time ();
}

void
Connections::record_viewer (GstRTSPClient *client, GstRTSPSession *session)
{
  const std::string id = gst_rtsp_session_get_sessionid (session);
  std::lock_guard guard (lock_);
  for (auto &[other, connection] : connections_) {
    if (other == client)
      connection.session = id;
    else if (connection.session == id)
      connection.session.clear ();
  }
}

bool
Connections::asked_for (GstRTSPClient *client, const GstRTSPMedia *media)
{
  std::lock_guard guard (lock_);
  const auto found = connections_.find (client);
  return found != connections_.end () && found->second.media == media;
}

/* ---- closing; main loop ---- */

void
Connections::add (GstRTSPClient *client)
{
  g_object_weak_ref (G_OBJECT (client), on_gone, this);
  accepted_++;
  GstRTSPConnection *connection = gst_rtsp_client_get_connection (client);
  std::lock_guard guard (lock_);
  Connection &added = connections_[client];
  added.since_us = g_get_monotonic_time ();
  if (has_tls_ && connection)
    added.socket.reset (G_SOCKET (g_object_ref (gst_rtsp_connection_get_read_socket (connection))));
}

void
Connections::record_thread (GstRTSPClient *client, GstRTSPThread *thread)
{
  std::lock_guard guard (lock_);
  connections_[client].thread.reset (gst_rtsp_thread_ref (thread));
}

namespace {

struct Closing {
  GstRTSPClient *client;
  GstRTSPThread *thread; /* with a use that gst_rtsp_thread_stop() ends */
};

gboolean
close_client (gpointer closing)
{
  gst_rtsp_client_close (static_cast<Closing *> (closing)->client);
  return G_SOURCE_REMOVE;
}

void
delete_closing (gpointer user_data)
{
  auto closing = static_cast<Closing *> (user_data);
  g_object_unref (closing->client);
  gst_rtsp_thread_stop (closing->thread);
  delete closing;
}

/* Unless the thread, and so the connection, is ending. */
void
close_in_its_thread (GstRTSPClient *client, GstRTSPThread *thread)
{
  if (!gst_rtsp_thread_reuse (thread))
    return;
  GSource *source = g_idle_source_new ();
  g_source_set_priority (source, G_PRIORITY_HIGH); /* before requests that have arrived */
  g_source_set_callback (source, close_client,
      new Closing{GST_RTSP_CLIENT (g_object_ref (client)), thread}, delete_closing);
  g_source_attach (source, thread->context);
  g_source_unref (source);
}

} // namespace

/* gst-rtsp-server 1.22 must close a connection in the thread that serves it, which may otherwise
 * read from it forever. Closing a TLS connection before the end of its handshake leaks its
 * descriptor and memory, but shutting down its socket, as a peer would, does not. A connection that
 * survives this is closed when it has been idle again. */
void
Connections::close (GstRTSPClient *client)
{
  SocketRef socket;
  ThreadRef thread;
  {
    std::lock_guard guard (lock_);
    const auto found = connections_.find (client);
    if (found == connections_.end ())
      return;
    Connection &connection = found->second;
    connection.is_closing = true;
    connection.since_us = g_get_monotonic_time ();
    socket = std::move (connection.socket);
    if (!socket && connection.thread)
      thread.reset (gst_rtsp_thread_ref (connection.thread.get ()));
  }
  if (socket)
    g_socket_shutdown (socket.get (), TRUE, TRUE, nullptr);
  else if (thread)
    close_in_its_thread (client, thread.get ());
}

void
Connections::close_all (const GstRTSPMedia *media)
{
  GList *clients = gst_rtsp_server_client_filter (server_, nullptr, nullptr);
  for (GList *item = clients; item; item = item->next) {
    auto client = GST_RTSP_CLIENT (item->data);
    if (!media || asked_for (client, media))
      close (client);
  }
  g_list_free_full (clients, g_object_unref);
}

void
Connections::end ()
{
  for (int turn = 0; turn < kEndTurns && count (false) + count (true) > 0; turn++) {
    if (turn % kTurnsPerClosing == 0) /* TLS connections may survive the first time */
      close_all (nullptr);
    g_usleep (kEndTurn_us);
  }
}

/* Its session may have ended. */
bool
Connections::is_viewer (GstRTSPClient *client)
{
  std::string id;
  {
    std::lock_guard guard (lock_);
    const auto found = connections_.find (client);
    if (found != connections_.end ())
      id = found->second.session;
  }
  if (id.empty ())
    return false;
  const auto has = [] (GstRTSPClient *, GstRTSPSession *session, gpointer wanted) {
    return *static_cast<std::string *> (wanted) == gst_rtsp_session_get_sessionid (session)
               ? GST_RTSP_FILTER_REF
               : GST_RTSP_FILTER_KEEP;
  };
  GList *found = gst_rtsp_client_session_filter (client, has, &id);
  const bool is = found != nullptr;
  g_list_free_full (found, g_object_unref);
  return is;
}

void
Connections::close_idle (gint64 max_idle_us)
{
  const gint64 until_us = g_get_monotonic_time () - max_idle_us;
  GList *clients = gst_rtsp_server_client_filter (server_, nullptr, nullptr);
  for (GList *item = clients; item; item = item->next) {
    auto client = GST_RTSP_CLIENT (item->data);
    std::unique_lock guard (lock_);
    const auto found = connections_.find (client);
    const bool is_late = found != connections_.end () && found->second.since_us < until_us;
    guard.unlock ();
    if (is_late && !is_viewer (client))
      close (client);
  }
  g_list_free_full (clients, g_object_unref);
}

std::size_t
Connections::count (bool closing)
{
  std::lock_guard guard (lock_);
  return std::size_t (std::count_if (connections_.begin (), connections_.end (),
      [=] (const auto &one) { return one.second.is_closing == closing; }));
}

/* @return whether there was one that is no viewer */
bool
Connections::close_oldest ()
{
  GstRTSPClient *oldest = nullptr;
  gint64 since_us = G_MAXINT64;
  GList *clients = gst_rtsp_server_client_filter (server_, nullptr, nullptr);
  for (GList *item = clients; item; item = item->next) {
    auto client = GST_RTSP_CLIENT (item->data);
    if (is_viewer (client))
      continue;
    std::lock_guard guard (lock_);
    const auto found = connections_.find (client);
    if (found == connections_.end () || found->second.is_closing ||
        found->second.since_us >= since_us)
      continue;
    oldest = client;
    since_us = found->second.since_us;
  }
  if (oldest)
    close (oldest);
  g_list_free_full (clients, g_object_unref);
  return oldest != nullptr;
}

/* Many idle connections must neither keep viewers out nor use up the files that the stream needs.
 */
bool
Connections::make_room (GSocket *socket)
{
  if (count (true) >= kMaxClosing)
    return false;
  if (count (false) < max_connections_ && !are_files_short (socket))
    return true;
  if (!close_oldest ())
    return false;
  for (int i = 0; i < kClosingTurns && are_files_short (socket); i++)
    g_usleep (kClosing_us);
  return !are_files_short (socket);
}

void
Connections::accept (GSocket *socket)
{
  const guint64 before = accepted_;
  GSocket *refused = nullptr;
  if (make_room (socket))
    gst_rtsp_server_io_func (socket, G_IO_IN, server_); /* calls add() on success */
  else
    refused = g_socket_accept (socket, nullptr, nullptr);
  if (!refused && accepted_ == before)
    g_usleep (kNoFiles_us);
  g_clear_object (&refused);
}
