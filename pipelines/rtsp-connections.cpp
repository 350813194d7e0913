/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "rtsp-connections.hpp"

#include <algorithm>

/* ---- what each does; in threads that serve connections ---- */

void
Connections::on_gone (gpointer connections, GObject *client)
{
  auto self = static_cast<Connections *> (connections);
  std::lock_guard guard (self->lock_);
  self->connections_.erase (reinterpret_cast<GstRTSPClient *> (client));
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
  std::lock_guard guard (lock_);
  connections_[client].since_us = g_get_monotonic_time ();
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
      gst_rtsp_client_close (client);
  }
  g_list_free_full (clients, g_object_unref);
}

std::size_t
Connections::count ()
{
  std::lock_guard guard (lock_);
  return std::size_t (std::count_if (connections_.begin (), connections_.end (),
      [] (const auto &one) { return !one.second.is_closing; }));
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
  if (oldest) {
    std::unique_lock guard (lock_);
    connections_[oldest].is_closing = true;
    guard.unlock ();
    gst_rtsp_client_close (oldest);
  }
  g_list_free_full (clients, g_object_unref);
  return oldest != nullptr;
}

/* Each connection is a file descriptor, whoever is behind it. A crowd that says nothing must not
 * keep others out. */
void
Connections::take (GSocket *socket)
{
  if (count () < most_ || close_oldest ()) {
    gst_rtsp_server_io_func (socket, G_IO_IN, server_);
    return;
  }
  GSocket *refused = g_socket_accept (socket, nullptr, nullptr);
  g_clear_object (&refused);
}
