/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include "camera/aravis/action_command.hpp"
#include <atomic>
#include <condition_variable>
#include <mutex>
#include <rangecast/sync/ticks.hpp>

#include "cameras.hpp"
#include "common/clockwait.hpp"
#include "events.hpp"
#include "pairing.hpp"
#include "settings.hpp"

/** The thread that triggers the cameras at the multiples of the frame period on the pipeline clock,
 *  by software triggers or action commands. All hosts that share the clock trigger at the same
 *  moments. Does nothing where cameras run freely or others trigger them.
 *
 *  A thread of its own instead of a GstTask, because it has real-time priority, and GstTask borrows
 *  threads from a pool of the process. */
class CameraTrigger {
public:
  /** @param settings, pairing, events  outlive this */
  CameraTrigger (GstElement *element, const StereoCamSettings &settings, FramePairing &pairing,
      CameraEvents &events)
      : element_ (element), settings_ (settings), pairing_ (pairing), events_ (events)
  {
  }
  ~CameraTrigger () { stop (); }
  CameraTrigger (const CameraTrigger &) = delete;
  CameraTrigger &operator= (const CameraTrigger &) = delete;

  /** @param action_key  ActionDeviceKey of the cameras
   *  @return kFailed: no socket for action commands, no thread */
  CameraStatus start (Cameras cameras, std::uint32_t action_key, rangecast::TickRate rate);
  /** Returns when no trigger is in progress. */
  void stop ();

  /* Any thread. */

  void set_playing (bool playing);
  /** Time of the last trigger by g_get_monotonic_time, ns; 0: none yet. */
  [[nodiscard]] std::int64_t last_trigger_ns () const { return last_trigger_ns_; }
  /** Whether a trigger is in progress. */
  [[nodiscard]] bool busy () const { return busy_; }
  /** Ticks without a trigger while the element played, since the first one. */
  [[nodiscard]] guint64 missed () const { return missed_; }

private:
  bool start_callers (std::size_t count);
  void run ();
  [[nodiscard]] GstClockTime next_tick (GstClockTime now, GstClockTime base) const;
  void handle_tick (GstClockTime time, GstClockTime now);
  void trigger (GstClockTime time);
  void trigger_software ();

  GstElement *element_;
  const StereoCamSettings &settings_;
  FramePairing &pairing_;
  CameraEvents &events_;
  std::atomic<guint64> missed_ = 0;
  std::atomic<std::int64_t> last_trigger_ns_ = 0;
  std::atomic<bool> busy_ = false;

  /* Constant while the thread runs. */
  Cameras cameras_;
  rangecast::TickRate rate_;
  ActionSender action_;
  std::uint32_t action_key_ = 0;

  /* The thread's. */
  std::int64_t last_tick_ = -1;
  GThreadPool *pool_ = nullptr; ///< a thread for each camera: a trigger waits for its camera

  std::mutex lock_; /* guards what follows; taken before the element's and the clock's */
  std::condition_variable changed_;
  ClockWait clock_wait_;
  bool running_ = false, playing_ = false, paused_since_tick_ = true;
  std::size_t calls_pending_ = 0;
  GThread *thread_ = nullptr;
};
