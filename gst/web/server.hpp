/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>
#include <libsoup/soup.h>

#include <atomic>
#include <deque>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <rangecast/base/status.hpp>
#include <string>
#include <thread>
#include <vector>

#include "client.hpp"
#include "pagefiles.hpp"
#include "settings.hpp"
#include "statsboard.hpp"

namespace web {

/** Serves the page, and frame sets to its clients, on a thread and a main context of its own.
 *
 *  Locking: `lock_` guards what the streaming thread and the server's thread share. It is never
 *  held while anything is sent, and the server's thread holds no lock when it calls `request_key`.
 */
class Server : private Client::Host {
public:
  /** Sends a key unit request upstream; called on the server's thread. */
  using RequestKey = void (*) (GstObject *element);

  /** @param element  for the log and `request_key`; outlives the server */
  Server (GstObject *element, Settings settings, RequestKey request_key);
  /** Closes all connections. */
  ~Server () override;
  Server (const Server &) = delete;
  Server &operator= (const Server &) = delete;

  /** Starts to listen. @return kBadValue, kNotFound or kInternal; the message names the property */
  rangecast::Status start ();
  /** Address of the page. After start(). */
  [[nodiscard]] const std::string &url () const { return url_; }

  /** @name From the streaming thread; they do not wait @{ */
  void set_stream (std::string caps, std::string rig_units);
  /** Takes the frame set; the server numbers it. @param captured_us  see FrameSet */
  void push (BytesPtr units, bool key, gint64 captured_us);
  void end ();
  /** @} */

  struct Counters {
    guint clients = 0;
    guint64 connections = 0, refused = 0, frame_sets = 0, key_requests = 0, bytes = 0;
  };
  /** Any thread. */
  [[nodiscard]] Counters counters ();
  /** Structures "client", as they were within the last second. Any thread. Returns: (transfer full)
   */
  void take_client_stats (GValue *array);

private:
  /** Connections of WebSockets that are not closed yet; may outlive the server. */
  using ConnectionCount = std::shared_ptr<std::atomic<int>>;
  struct Item { /* a frame set, or the end of the stream */
    FrameSet frame_set;
    bool is_end = false;
  };

  bool admit (const std::string &token, std::string &name) override;
  void request_key (Client &client) override;
  std::string welcome () override;
  bool offers_rtc () override;
  GMainContext *context () override { return context_; }
  void entered (Client &client) override;
  void closed (Client &client) override;

  rangecast::Status listen ();
  rangecast::Status load_certificate ();
  rangecast::Status open_stats ();
  void add_handlers ();
  void run ();
  void run_for (gint64 time_us, const std::function<bool ()> &happened);
  void close_all ();
  void wake ();
  void deliver ();
  void upgrade (SoupServerMessage *message, const char *path);
  void accept (SoupServerMessage *message);
  void drop_waiting_client ();
  void answer (SoupServerMessage *message, const char *path);
  [[nodiscard]] bool is_own_host (SoupServerMessage *message) const;
  [[nodiscard]] bool is_own_origin (SoupServerMessage *message) const;
  void tick ();
  void send_stats ();
  void send_stats_to (Client &client);
  void read_stats ();

  GstObject *element_;
  const Settings settings_;
  RequestKey request_key_;
  std::string url_;

  std::thread thread_;
  GMainContext *context_;
  GMainLoop *loop_;
  std::vector<GSource *> timers_;
  GSocket *stats_socket_ = nullptr;
  SoupServer *soup_ = nullptr;
  std::list<std::unique_ptr<Client>> clients_;
  ConnectionCount connections_ = std::make_shared<std::atomic<int>> (0);
  bool rtc_ = false; /* data channels are offered */
  PageFiles page_;   /* server's thread */
  gint64 key_requested_us_;
  guint64 gone_bytes_ = 0; /* of clients that left */
  StatsBoard board_;

  std::mutex lock_;
  std::deque<Item> queue_;
  bool woken_ = false;
  std::string caps_;
  std::shared_ptr<const std::string> rig_units_;
  guint32 next_number_ = 0;
  Counters counters_;
  std::vector<GstStructure *> client_stats_;
};

} // namespace web
