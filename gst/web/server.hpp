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
#include "guesslimiter.hpp"
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
  /** Has a key unit request sent upstream, without waiting for it; called on the server's thread.
   * @return false if the last one is still on its way */
  using RequestKey = bool (*) (GstObject *element);

  /** @param element  for the log and `request_key`; outlives the server */
  Server (GstObject *element, Settings settings, RequestKey request_key);
  /** Sets whether the welcome message announces speech. Any thread. */
  void set_audio (bool has_audio) { has_audio_ = has_audio; }
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

  /** @name From the streaming thread; they do not wait @{ */
  void set_rig (std::string rig_units);
  /** Takes the frame set; the server numbers it. @param captured_us, discontinuity  see FrameSet */
  void push (BytesPtr units, bool key, bool discontinuity, gint64 captured_us);
  /** Takes a packet of speech. @param captured_us  on g_get_monotonic_time() */
  void push_audio (BytesPtr packet, gint64 captured_us);
  void end ();
  /** Drops the frame sets that wait; the next one does not continue them. */
  void flush ();
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
  struct Item { /* a frame set, a packet of speech, or the end of the stream */
    FrameSet frame_set;
    bool is_end = false;
    AudioPacket audio{};
  };

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
  std::atomic<bool> has_audio_ = false;
  PageFiles page_; /* server's thread */
  gint64 key_requested_us_;
  guint64 gone_bytes_ = 0; /* of clients that left */
  GuessLimiter guesses_;
  StatsBoard board_;

  std::mutex lock_;
  std::deque<Item> queue_;
  bool woken_ = false;
  bool flushed_ = false; /* since the last frame set */
  std::shared_ptr<const std::string> rig_units_;
  guint32 next_number_ = 0, next_audio_ = 0;
  Counters counters_;
  std::vector<GstStructure *> client_stats_;
};

} // namespace web
