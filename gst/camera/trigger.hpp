/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include "camera/aravis/action_command.hpp"
#include <atomic>
#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <rangecast/sync/ticks.hpp>
#include <thread>

#include "cameras.hpp"
#include "common/clockwait.hpp"
#include "pairing.hpp"
#include "settings.hpp"

/** The thread that triggers the cameras at the multiples of the frame period on the pipeline clock,
 *  or at requested times, by software triggers or action commands. All hosts that share the clock
 *  trigger at the same moments. Does nothing where cameras run freely or others trigger them.
 *
 *  A thread of its own instead of a GstTask, because it has real-time priority, and GstTask borrows
 *  threads from a pool of the process. */
class CameraTrigger {
public:
  /** Called from trigger threads. */
  using Failed = std::function<void (CameraStatus)>;

  /** @param settings, pairing  outlive this */
  CameraTrigger (GstElement *element, const StereoCamSettings &settings, FramePairing &pairing)
      : element_ (element), settings_ (settings), pairing_ (pairing)
  {
  }
  ~CameraTrigger () { stop (); }
  CameraTrigger (const CameraTrigger &) = delete;
  CameraTrigger &operator= (const CameraTrigger &) = delete;

  /** @param rate  not valid: only requested triggers
   *  @return kFailed: no socket for action commands */
  CameraStatus start (Cameras cameras, rangecast::TickRate rate, Failed failed);
  /** Returns when no trigger is in progress. */
  void stop ();

  /* Any thread. */

  void set_playing (bool playing);
  /** Requests a trigger at that time on the pipeline clock; one that is NONE or has passed is now.
   *  @return false: not playing, not waiting for requests, or too many are pending */
  bool request (GstClockTime time);
  /** Time of the last trigger by g_get_monotonic_time, ns; 0: none yet. */
  [[nodiscard]] std::int64_t last_trigger_ns () const { return last_trigger_ns_; }
  /** Ticks without a trigger while the element played, since the first one. */
  [[nodiscard]] guint64 missed () const { return missed_; }

private:
  static constexpr std::size_t kMaxRequests = 64;

  void run ();
  GstClockTime next_request (GstClockTime now);
  [[nodiscard]] GstClockTime next_tick (GstClockTime now, GstClockTime base) const;
  void handle_request (GstClockTime time, GstClockTime now);
  void handle_tick (GstClockTime time, GstClockTime now);
  void trigger (GstClockTime time);
  void trigger_software ();

  GstElement *element_;
  const StereoCamSettings &settings_;
  FramePairing &pairing_;
  std::atomic<guint64> missed_ = 0;
  std::atomic<std::int64_t> last_trigger_ns_ = 0;

  /* Constant while the thread runs. */
  bool on_request_ = false; ///< single shots
  Cameras cameras_;
  Failed failed_;
  rangecast::TickRate rate_;
  GstClockTime lead_ = 0; ///< how long before their time action commands are sent
  ActionSender action_;

  /* The thread's. */
  std::int64_t last_tick_ = -1;
  GstClockTime last_requested_ = 0;
  GThreadPool *pool_ = nullptr; ///< a thread for each camera: a trigger waits for its camera

  std::mutex lock_; /* guards what follows; taken before the element's and the clock's */
  std::condition_variable changed_;
  ClockWait clock_wait_;
  bool running_ = false, playing_ = false, paused_since_tick_ = true;
  std::deque<GstClockTime> requests_;
  std::size_t calls_pending_ = 0;
  std::thread thread_;
};
