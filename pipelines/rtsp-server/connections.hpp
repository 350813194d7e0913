/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The connections of an RTSP server: the threads that serve them, which of them are viewers, and
 * how many there may be. gst-rtsp-server 1.22 limits sessions only: idle connections use up the
 * file descriptors of the process. */
#pragma once

#include <gst/rtsp-server/rtsp-server.h>

#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

/** The connections that the limit on open files allows beside the files of the server and its
 *  launch string: max_viewers and some that are no viewers. Raises the soft limit as needed.
 *  @return nothing after reporting that the limit is too low */
[[nodiscard]] std::optional<std::size_t> max_connections (int max_viewers);

/** A viewer is a connection that sent SETUP or PLAY; of several that named the same session, the
 *  last one, since anybody can name a session. Other connections are closed to make room, the
 *  oldest first. Any thread, unless a function says otherwise. */
class Connections {
public:
  /** Sets the server's thread pool.
   *  @param n_threads        that serve the connections
   *  @param max_connections  viewers and others */
  Connections (GstRTSPServer *server, int n_threads, std::size_t max_connections, bool has_tls);
  /** All connections and medias must be gone. Returns when all threads of the pool have ended. */
  ~Connections ();
  Connections (const Connections &) = delete;

  /** Main loop. Removed by itself when the client is finalized. */
  void add (GstRTSPClient *client);
  /** The connection is served by that thread. Main loop, with the server's lock. */
  void record_thread (GstRTSPClient *client, GstRTSPThread *thread);
  /** The connection asked for that media, and was not idle. */
  void record_media (GstRTSPClient *client, const GstRTSPMedia *media);
  /** The connection is the viewer of that session from now on. */
  void record_viewer (GstRTSPClient *client, GstRTSPSession *session);

  /** Main loop. Closes connections that are no viewers and were idle for so long. */
  void close_idle (gint64 max_idle_us);
  /** Main loop. Closes connections that asked for that media last; nullptr: all. */
  void close_all (const GstRTSPMedia *media);
  /** Main loop. Closes all, and waits until they are gone, 3 s at most. */
  void end ();
  /** Main loop. Accepts the next connection. Where there would be too many it closes the oldest
   *  that is no viewer; where all are viewers it refuses the new one. */
  void accept (GSocket *socket);

private:
  struct Unref {
    void operator() (GSocket *socket) const { g_object_unref (socket); }
    void operator() (GstRTSPThread *thread) const { gst_rtsp_thread_unref (thread); }
  };
  using SocketRef = std::unique_ptr<GSocket, Unref>;
  using ThreadRef = std::unique_ptr<GstRTSPThread, Unref>;
  struct Connection {
    gint64 since_us = 0;                 /* monotonic */
    const GstRTSPMedia *media = nullptr; /* that it asked for last; only to compare with */
    std::string session;                 /* that it is the viewer of; empty: none */
    bool is_closing = false;             /* in its thread */
    ThreadRef thread = nullptr;          /* that serves it */
    SocketRef socket = nullptr;          /* with TLS, until it is shut down */
  };
  static void on_gone (gpointer connections, GObject *client);
  bool asked_for (GstRTSPClient *client, const GstRTSPMedia *media);
  bool is_viewer (GstRTSPClient *client);
  std::size_t count (bool closing);
  void close (GstRTSPClient *client);
  bool close_oldest ();
  bool make_room (GSocket *socket);

  GstRTSPServer *server_;
  const std::size_t max_connections_;
  const bool has_tls_;
  guint64 accepted_ = 0; /* ever; main loop */
  std::mutex lock_; /* guards what follows; no calls with it; taken after GstRTSPServer's lock */
  std::map<GstRTSPClient *, Connection> connections_;
};
