/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>
#include <libsoup/soup.h>

#include <atomic>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <rangecast/base/status.hpp>
#include <string>
#include <thread>
#include <vector>

#include "client.hpp"
#include "guesslimiter.hpp"
#include "pagefiles.hpp"
#include "settings.hpp"
#include "statsboard.hpp"
#include "streamqueue.hpp"

namespace web {

/** Serves the page, and frame sets to its clients, on a thread and a main context of its own.
 *
 *  Locking: `lock_` guards counters and statistics, which any thread reads. It is never
 *  held while anything is sent, and the server's thread holds no lock when it calls `request_key`.
 */
class Server : private Client::Host {
public:
  /** Has a key unit request sent upstream, without waiting for it; called on the server's thread.
   * @return false if the last one is still on its way */
  using RequestKey = bool (*) (GstObject *element);

  /** @param element  for the log and `request_key`; outlives the server */
  Server (GstObject *element, Settings settings, RequestKey request_key);
  /** Waits until stop() is complete: clients have half a second to confirm that they are closed. */
  ~Server () override;
  Server (const Server &) = delete;
  Server &operator= (const Server &) = delete;

  /** Starts to listen. @return kBadValue, kNotFound or kInternal; the message names the property */
  rangecast::Status start ();
  /** Frees the ports. Connections are closed on the server's thread afterwards. */
  void stop ();
  /** After stop(): whether all connections are closed, so that the destructor does not wait. */
  [[nodiscard]] bool has_stopped () const { return stopped_; }
  /** Address of the page. After start(). */
  [[nodiscard]] const std::string &url () const { return url_; }

  /** What clients are sent. */
  [[nodiscard]] StreamQueue &stream () { return stream_; }

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

  Admission admit (
      const std::string &address, const std::string &token, std::string &name) override;
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
  void stop_listening ();
  void close_all ();
  void deliver (const StreamItem &item);
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
  bool stopping_ = false; /* stop() was called */
  std::atomic<bool> stopped_ = false;
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
  GuessLimiter guesses_;
  StatsBoard board_;
  StreamQueue stream_;

  std::mutex lock_;
  Counters counters_;
  std::vector<GstStructure *> client_stats_;
};

} // namespace web
