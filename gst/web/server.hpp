/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>
#include <libsoup/soup.h>

#include <atomic>
#include <functional>
#include <list>
#include <memory>
#include <rangecast/base/status.hpp>
#include <string>
#include <thread>

#include "client.hpp"

namespace web {

/** The properties of rangewebsink. */
struct Settings {
  std::string address = "127.0.0.1";
  guint port = 8080; ///< 0: any that is free
  std::string root;  ///< folder of the page; empty: the installed one
  std::string title;
  std::string certificate, private_key; ///< PEM files; empty: no TLS
  std::string token, token_file;
  bool anonymous = false;
  std::string origins, frame_ancestors; ///< separated by spaces
  guint max_clients = 64;
  guint window = 3;          ///< frame sets
  std::string stats_address; ///< udp://HOST:PORT; empty: none
  std::string url;           ///< read-only: of the page, while the server runs

  /** Whether clients need a token. */
  [[nodiscard]] bool has_token () const { return !token.empty () || !token_file.empty (); }
};

struct SocketUnref {
  void operator() (GSocket *socket) const { g_object_unref (socket); }
};

/** Serves the page, and frame sets to its clients, on a thread and a main context of its own. There
 *  is no lock: streaming threads post what they have to that thread. */
class Server {
public:
  /** Has a key unit request sent upstream, without waiting for it; called on the server's thread.
   * @return false if the last one is still on its way */
  using RequestKey = bool (*) (GstObject *element);

  /** @param element  for the log and `request_key`; outlives the server */
  Server (GstObject *element, Settings settings, RequestKey request_key);
  /** Closes all connections, without waiting for clients. */
  ~Server ();
  Server (const Server &) = delete;
  Server &operator= (const Server &) = delete;

  /** Starts to listen. @return kBadValue, kNotFound or kInternal; the message names the property */
  rangecast::Status start ();
  /** Address of the page. After start(). */
  [[nodiscard]] const std::string &url () const { return url_; }

  /** @name The stream: the streaming threads of the sink pad and of the audio pad. What is pushed
   *  does not wait for the server's thread; if too much waits there, it is dropped. @{ */
  /** @param captured_us, discontinuity  see FrameSet */
  void push (BytesPtr units, bool key, bool discontinuity, gint64 captured_us);
  /** @param captured_us  on g_get_monotonic_time() */
  void push_audio (BytesPtr packet, gint64 captured_us);
  /** Whether there is sound to hear. */
  void set_audio (bool available);
  void end ();
  /** Drops the frame sets that wait; the next one does not continue them. */
  void flush () { flushes_++; }
  /** @} */

  struct Counters {
    std::atomic<guint> clients = 0;
    std::atomic<guint64> connections = 0, refused = 0, frame_sets = 0, key_requests = 0, bytes = 0;
  };
  /** Any thread. */
  [[nodiscard]] Counters &counters () { return counters_; }

  /** @name For clients: the server's thread @{ */
  [[nodiscard]] GstObject *element () const { return element_; }
  [[nodiscard]] const Settings &settings () const { return settings_; }
  /** @param[out] name  of the user, if tokens have names. @return false if the token is wrong */
  bool admit (const std::string &token, std::string &name);
  void request_key (Client &client);
  [[nodiscard]] std::string welcome () const; ///< the message
  void remove (Client &client);
  /** The other end of a client's call, or nullptr. */
  [[nodiscard]] Client *partner_of (const Client &client) const;
  [[nodiscard]] bool is_full (const std::string &room) const;
  /** @} */

private:
  rangecast::Status check_settings () const;
  rangecast::Status load_certificate ();
  rangecast::Status listen ();
  rangecast::Status open_stats ();
  void add_handlers ();
  void close_all ();
  void post (std::function<void ()> call);
  void for_each_client (const std::function<void (Client &)> &call);
  void upgrade (SoupServerMessage *message);
  void accept (SoupServerMessage *message);
  void drop_waiting_client ();
  void answer (SoupServerMessage *message, const std::string &path);
  [[nodiscard]] bool is_own_host (SoupServerMessage *message) const;
  [[nodiscard]] bool is_own_origin (SoupServerMessage *message) const;
  void add_source (GSource *source, GSourceFunc call);
  void tick ();
  void read_stats ();

  GstObject *element_;
  const Settings settings_;
  RequestKey request_key_;
  std::string url_;
  std::thread thread_;
  GMainContext *context_;
  GMainLoop *loop_;
  GSocket *stats_socket_ = nullptr;
  SoupServer *soup_ = nullptr;
  std::list<std::unique_ptr<Client>> clients_;
  std::list<std::unique_ptr<GSocket, SocketUnref>>
      sockets_; /* of WebSockets; closed, some of them */
  /* each stream of a WebSocket has a copy: libsoup closes them asynchronously */
  std::shared_ptr<int> streams_ = std::make_shared<int> ();
  gint64 key_requested_us_;
  std::string reports_; /* of hosts since the last tick, members of a JSON array */
  guint n_reports_ = 0;

  /* streaming threads: of the sink pad, of the audio pad */
  guint flushes_before_ = 0; /* the last frame set */
  guint32 next_audio_ = 0;

  Counters counters_;
  std::atomic<guint> flushes_ = 0;
  std::atomic<bool> has_audio_ = false;
  std::atomic<int> waiting_frame_sets_ = 0, waiting_audio_ = 0;
};

} // namespace web
