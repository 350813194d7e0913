/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "connections.hpp"

#include <fcntl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>

/* Connections that are no viewers: those that ask only, or have not got so far. */
static constexpr rlim_t kSpare = 32, kMinSpare = 8;
/* Files that the server and its launch string have open. With one of avatartestsrc they are 27,
 * with multicast 34. */
static constexpr rlim_t kOwnFiles = 256, kMinOwnFiles = 40;
/* Where a launch string has more than that: connections leave so many to it. */
static constexpr int kKeptFiles = 16;
/* Those that were closed are freed, files and all, by the threads that serve them, which may wait
 * for a first frame set meanwhile. Of kOwnFiles. */
static constexpr std::size_t kMaxClosing = 128;
/* A thread that serves them may be at work for one. */
static constexpr gulong kEndTurn_us = 10000;
static constexpr int kEndTurns = 300, kTurnsPerClosing = 50;
/* Its file is free when its thread has closed it, which is at once unless that is at work. */
static constexpr int kClosingTurns = 5;
static constexpr gulong kClosing_us = 2000;
/* The socket stays readable where nobody can be taken. */
static constexpr gulong kNoFiles_us = 20000;

std::optional<std::size_t>
fit_connections (int max_viewers)
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
    g_printerr ("rtsp-server: --max-viewers: expected %d at most, since a process may have %d open "
                "files here (ulimit -n), got '%d'\n",
        int (most), int (files.rlim_cur), max_viewers);
    return std::nullopt;
  }
  const rlim_t others = files.rlim_cur - std::min (files.rlim_cur, viewers + kOwnFiles);
  return viewers + std::clamp (others, kMinSpare, kSpare);
}

/* A new file gets the lowest number that is free, so connections never have the uppermost ones. */
static bool
are_files_short (GSocket *socket)
{
  struct rlimit files = {};
  const int next = fcntl (g_socket_get_fd (socket), F_DUPFD_CLOEXEC, 0);
  if (next < 0)
    return true;
  ::close (next);
  return getrlimit (RLIMIT_NOFILE, &files) == 0 && rlim_t (next + kKeptFiles) >= files.rlim_cur;
}

/* ---- what each does; in threads that serve connections ---- */

void
Connections::on_gone (gpointer connections, GObject *client)
{
  auto self = static_cast<Connections *> (connections);
  std::unique_lock guard (self->lock_);
  const auto gone = self->connections_.extract (reinterpret_cast<GstRTSPClient *> (client));
  guard.unlock (); /* before its socket and its thread go */
}

void
Connections::note_media (GstRTSPClient *client, const GstRTSPMedia *media)
{
  std::lock_guard guard (lock_);
  const auto found = connections_.find (client);
  if (found == connections_.end ())
    return;
  found->second.media = media;
  found->second.since_us = g_get_monotonic_time ();
}

void
Connections::note_viewer (GstRTSPClient *client, GstRTSPSession *session)
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
Connections::was_told_of (GstRTSPClient *client, const GstRTSPMedia *media)
{
  std::lock_guard guard (lock_);
  const auto found = connections_.find (client);
  return found != connections_.end () && found->second.media == media;
}

/* ---- too many of them; in the main loop ---- */

Connections::~Connections ()
{
  std::lock_guard guard (lock_); /* with which the threads wrote to it */
  connections_.clear ();
}

void
Connections::add (GstRTSPClient *client)
{
  g_object_weak_ref (G_OBJECT (client), on_gone, this);
  taken_++;
  GstRTSPConnection *connection = gst_rtsp_client_get_connection (client);
  std::lock_guard guard (lock_);
  Connection &added = connections_[client];
  added.since_us = g_get_monotonic_time ();
  if (has_tls_ && connection)
    added.socket.reset (G_SOCKET (g_object_ref (gst_rtsp_connection_get_read_socket (connection))));
}

void
Connections::note_thread (GstRTSPClient *client, GstRTSPThread *thread)
{
  std::lock_guard guard (lock_);
  connections_[client].thread.reset (gst_rtsp_thread_ref (thread));
}

struct Closing {
  GstRTSPClient *client;
  GstRTSPThread *thread; /* of gst_rtsp_thread_reuse(), which takes a reference */
};

static gboolean
close_client (gpointer closing)
{
  gst_rtsp_client_close (static_cast<Closing *> (closing)->client);
  return G_SOURCE_REMOVE;
}

static void
delete_closing (gpointer user_data)
{
  auto closing = static_cast<Closing *> (user_data);
  g_object_unref (closing->client);
  gst_rtsp_thread_stop (closing->thread);
  delete closing;
}

/* In its thread, unless that ends, and the connection with it. */
static void
close_in_its_thread (GstRTSPClient *client, GstRTSPThread *thread)
{
  if (!gst_rtsp_thread_reuse (thread))
    return;
  GSource *source = g_idle_source_new ();
  g_source_set_priority (source, G_PRIORITY_HIGH); /* before what it still asks for */
  g_source_set_callback (source, close_client,
      new Closing{GST_RTSP_CLIENT (g_object_ref (client)), thread}, delete_closing);
  g_source_attach (source, thread->context);
  g_source_unref (source);
}

/* The library (1.22) can close a connection only in the thread that serves it: else that one may
 * read from it for ever. With TLS it loses the descriptor and the memory of a connection that it
 * closes before its handshake is over; but not of those that end by themselves. One that goes on
 * is closed when it has been idle for so long again. */
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

/* All that are of this one, or just all. */
void
Connections::close_all (const GstRTSPMedia *media)
{
  GList *clients = gst_rtsp_server_client_filter (server_, nullptr, nullptr);
  for (GList *item = clients; item; item = item->next) {
    auto client = GST_RTSP_CLIENT (item->data);
    if (!media || was_told_of (client, media))
      close (client);
  }
  g_list_free_full (clients, g_object_unref);
}

void
Connections::end ()
{
  for (int turn = 0; turn < kEndTurns && count (false) + count (true) > 0; turn++) {
    if (turn % kTurnsPerClosing == 0) /* with TLS, who goes on after the first time */
      close_all (nullptr);
    g_usleep (kEndTurn_us);
  }
}

/* Of a session that there still is. */
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
Connections::close_idle (gint64 patience_us)
{
  const gint64 until_us = g_get_monotonic_time () - patience_us;
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

/* Of those that are no viewers.
 * @return whether there was one */
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

/* Each connection is a file descriptor, whoever is behind it. A crowd that says nothing must not
 * keep others out, nor take the files that the stream needs. */
bool
Connections::make_room (GSocket *socket)
{
  if (count (true) >= kMaxClosing)
    return false;
  if (count (false) < most_ && !are_files_short (socket))
    return true;
  if (!close_oldest ())
    return false;
  for (int i = 0; i < kClosingTurns && are_files_short (socket); i++)
    g_usleep (kClosing_us);
  return !are_files_short (socket);
}

void
Connections::take (GSocket *socket)
{
  const guint64 before = taken_;
  GSocket *refused = nullptr;
  if (make_room (socket))
    gst_rtsp_server_io_func (socket, G_IO_IN, server_); /* which calls add(), if it can */
  else
    refused = g_socket_accept (socket, nullptr, nullptr);
  if (!refused && taken_ == before)
    g_usleep (kNoFiles_us);
  g_clear_object (&refused);
}
