/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>
#include <libsoup/soup.h>

#include <deque>
#include <memory>
#include <string>

#include "protocol.hpp"

/** The debug category of rangewebsink, for all its files. */
GST_DEBUG_CATEGORY_EXTERN (gst_range_web_sink_debug);
#define GST_CAT_DEFAULT gst_range_web_sink_debug

namespace web {

class Server;

struct BytesUnref {
  void operator() (GBytes *bytes) const { g_bytes_unref (bytes); }
};
using BytesPtr = std::unique_ptr<GBytes, BytesUnref>;

/** A coded frame set on its way to all clients. */
struct FrameSet {
  BytesPtr units;
  bool key;           ///< refers to no earlier frame set, and holds the rig
  bool discontinuity; ///< does not continue the ones before
  guint32 number;
  gint64 captured_us; ///< on g_get_monotonic_time(); -1: unknown
};

/** A packet of Opus (RFC 6716) on its way to the clients that want to hear. */
struct AudioPacket {
  BytesPtr data;
  guint32 number;
  gint64 captured_us; ///< on g_get_monotonic_time()
};

/** For soup_websocket_connection_new(): lets a Client see each frame. Transfer full. */
GList *client_extensions ();

/** A browser's WebSocket. The server's thread only. */
class Client {
public:
  Client (Server &server, SoupWebsocketConnection *socket, GSocket *tcp, std::string address);
  ~Client ();
  Client (const Client &) = delete;
  Client &operator= (const Client &) = delete;

  /** Sends it, if the client is ready for it. */
  void send (const FrameSet &frame_set);
  /** Sends it, if the client wants to hear and keeps up. */
  void send (const AudioPacket &packet);
  /** The stream has ended; what is sent next begins another one. */
  void end ();
  /** Tells a client that wants to hear whether there is sound. */
  void set_audio (bool available);
  /** Sends a text message, if the client was admitted. */
  void send_text (const std::string &json);
  void close (gushort code, const std::string &reason);
  /** For each frame, before libsoup keeps or answers it. @return false: drop its payload */
  bool takes_frame (guint8 header, gsize size);
  /** Closes a client that has been silent for too long. */
  void check ();

  [[nodiscard]] bool is_admitted () const { return admitted_; }
  [[nodiscard]] bool wants_stats () const { return admitted_ && hello_.stats; }
  /** Of a call, if it is in one. */
  [[nodiscard]] const std::optional<std::string> &room () const { return hello_.room; }
  [[nodiscard]] const std::string &label () const { return label_; }

private:
  struct InFlight {
    guint32 number;
    gsize bytes;
  };

  static void on_message (SoupWebsocketConnection *, gint type, GBytes *message, gpointer self);
  static void on_closed (SoupWebsocketConnection *, gpointer self);
  void handle (std::string_view text);
  void enter (const JsonMessage &message);
  void acknowledge (const JsonMessage &message);
  [[nodiscard]] bool can_receive () const;
  [[nodiscard]] bool has_room (gsize bytes) const;
  void send_binary (guint8 *message, gsize size);
  void refuse (gushort code, const std::string &reason);

  Server &server_;
  GstObject *log_;
  SoupWebsocketConnection *socket_;
  GSocket *tcp_;
  GObject *extension_; /* of the socket */
  std::string label_;  /* address and user, for the log */
  Hello hello_;
  bool admitted_ = false, closing_ = false;
  gint64 opened_us_, rate_since_us_ = 0;
  guint frames_in_second_ = 0;
  gsize message_bytes_ = 0; /* so far, of the message that has begun */

  /* frame sets */
  bool any_ = false;                   /* the counts below have begun */
  bool needs_key_ = true;              /* an earlier frame set was not sent */
  guint32 first_ = 0;                  /* number of the first frame set since welcome */
  guint32 last_ = 0;                   /* of the last one that came by */
  gint64 last_us_ = 0;                 /* when that was */
  guint32 sent_ = 0;                   /* frame sets */
  gint64 unacknowledged_since_us_ = 0; /* 0: all is acknowledged */
  gsize in_flight_bytes_ = 0;
  std::deque<InFlight> in_flight_;
};

} // namespace web
