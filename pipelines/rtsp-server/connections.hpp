/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The connections of an RTSP server: which of them are viewers, and how many there may be. */
#pragma once

#include <gst/rtsp-server/rtsp-server.h>

#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

/** How many connections there may be at a time, of which so many are viewers, beside the files that
 *  the server itself and its launch string have open. Raises the limit of this process on open
 *  files where it must and may.
 *  @return nothing after saying that the limit is too low */
[[nodiscard]] std::optional<std::size_t> fit_connections (int max_viewers);

/** A viewer is a connection that sent SETUP or PLAY, of those with one session only the last one.
 *  Anybody can name a session, so that makes nobody a viewer. Others are closed to make room, the
 *  oldest first. Any thread, where nothing else is said. */
class Connections {
public:
  /** @param most  at a time, viewers and others */
  Connections (GstRTSPServer *server, std::size_t most, bool has_tls)
      : server_ (server), most_ (most), has_tls_ (has_tls)
  {
  }
  /** All connections must be gone. */
  ~Connections ();
  Connections (const Connections &) = delete;

  /** Forgets it by itself when it is gone. Main loop, as what says so below. */
  void add (GstRTSPClient *client);
  /** It is served by that thread. */
  void note_thread (GstRTSPClient *client, GstRTSPThread *thread);
  /** It asks for something. */
  void note_media (GstRTSPClient *client, const GstRTSPMedia *media);
  /** It is the viewer of a session from now on. */
  void note_viewer (GstRTSPClient *client, GstRTSPSession *session);
  /** @return whether it was told of that media last */
  bool was_told_of (GstRTSPClient *client, const GstRTSPMedia *media);

  /** Main loop. Closes those that are no viewers and have not asked for anything for so long. */
  void close_idle (gint64 patience_us);
  /** Main loop. Closes those that were told of the media last, or all. */
  void close_all (const GstRTSPMedia *media);
  /** Main loop. Closes all, and waits until they are gone, some seconds at most. */
  void end ();
  /** Main loop. Takes the connection that waits, and closes the oldest that is no viewer where
   *  there would be too many. Where there is none it is refused. */
  void take (GSocket *socket);

private:
  struct Unref {
    void operator() (GSocket *socket) const { g_object_unref (socket); }
    void operator() (GstRTSPThread *thread) const { gst_rtsp_thread_unref (thread); }
  };
  using SocketRef = std::unique_ptr<GSocket, Unref>;
  using ThreadRef = std::unique_ptr<GstRTSPThread, Unref>;
  struct Connection {
    gint64 since_us = 0;                 /* monotonic */
    const GstRTSPMedia *media = nullptr; /* that it was told of last; only to compare with */
    std::string session;                 /* that it is the viewer of; empty: none */
    bool is_closing = false;             /* soon, in its thread */
    ThreadRef thread = nullptr;          /* that serves it */
    SocketRef socket = nullptr;          /* with TLS, until it is shut down */
  };
  static void on_gone (gpointer connections, GObject *client);
  bool is_viewer (GstRTSPClient *client);
  std::size_t count (bool closing);
  void close (GstRTSPClient *client);
  bool close_oldest ();
  bool make_room (GSocket *socket);

  GstRTSPServer *server_;
  const std::size_t most_;
  const bool has_tls_;
  guint64 taken_ = 0; /* ever; main loop */
  std::mutex lock_; /* guards what follows; not held while anything is called; after the server's */
  std::map<GstRTSPClient *, Connection> connections_;
};
