/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <array>
#include <atomic>
#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <rangecast/sync/frame_sets.hpp>
#include <rangecast/sync/ticks.hpp>
#include <thread>

/** Fires the cameras at the multiples of the frame period of the pipeline's clock, or when asked.
 *  All hosts that share the clock fire at the same moments. */
class CamSourceTicker {
public:
  /** What is done at a tick, from the ticker's thread. */
  struct Actions {
    /** Whether a shot may be fired now; if not, the tick passes without one. */
    std::function<bool ()> may_fire;
    /** Does it. @param tick  when it is due, on the pipeline's clock */
    std::function<void (GstClockTime tick)> fire;
  };

  explicit CamSourceTicker (GstElement *element) : element_ (element) {}
  ~CamSourceTicker () { stop (); }
  CamSourceTicker (const CamSourceTicker &) = delete;
  CamSourceTicker &operator= (const CamSourceTicker &) = delete;

  /** @param rate  not valid: only when asked
   *  @param lead  ns that fire() is called before its tick */
  void start (rangecast::TickRate rate, bool only_when_asked, GstClockTime lead, Actions actions);
  /** Waits for the thread's end. */
  void stop ();

  /* Any thread. */

  void set_playing (bool playing);
  /** Fires at that time, at once if it has passed or is NONE. @return false: it does not run, or
   * too many wait */
  bool ask (GstClockTime time);
  /** When it last fired, g_get_monotonic_time, ns; 0: never. */
  [[nodiscard]] gint64 last_shot_ns () const { return last_shot_ns_; }
  /** Ticks that passed without a shot while the element played, since the first one. */
  [[nodiscard]] guint64 missed () const { return missed_; }

private:
  static constexpr std::size_t kMaxAsked = 64;

  void run ();
  bool next_time (GstClock *clock, GstClockTime base, GstClockTime &time);
  bool wait_until (GstClock *clock, GstClockTime time);
  void one_shot ();
  void asked_shot (GstClockTime time, GstClockTime now, bool may);

  GstElement *element_;
  rangecast::TickRate rate_;
  GstClockTime lead_ = 0;
  Actions actions_;
  std::atomic<guint64> missed_ = 0;
  std::atomic<gint64> last_shot_ns_ = 0;
  gint64 last_tick_ = -1;       ///< the thread's
  guint64 seen_wishes_ = 0;     ///< the thread's
  GstClockTime last_asked_ = 0; ///< the thread's: a picture that was asked for

  std::mutex lock_; /* guards what follows */
  std::condition_variable changed_;
  bool running_ = false, playing_ = false, paused_since_tick_ = true, only_when_asked_ = false;
  std::deque<GstClockTime> asked_;
  guint64 wishes_ = 0; ///< calls of ask(): a wait that began before one is over
  GstClockID waiting_ = nullptr;
  std::thread thread_;
};

/** For threads that must do a little at a moment: first in the queue where the system allows it (it
 *  asks for the right to real-time scheduling, RLIMIT_RTPRIO), and no slack in the timers. */
void make_thread_punctual ();

/** Calls one function a camera at the same moment, each in a thread of its own: a call waits for
 *  its camera's answer. */
class SimultaneousCalls {
public:
  SimultaneousCalls () = default;
  ~SimultaneousCalls () { stop (); }
  SimultaneousCalls (const SimultaneousCalls &) = delete;
  SimultaneousCalls &operator= (const SimultaneousCalls &) = delete;

  void start (int count, std::function<void (int)> call);
  void stop ();
  /** Returns when all calls have. */
  void run ();

private:
  /** @param seen  the round when it was started, for it may begin to run after the next one has */
  void loop (int index, guint64 seen);

  std::function<void (int)> call_;
  std::mutex lock_; /* guards what follows */
  std::condition_variable begin_, end_;
  guint64 round_ = 0;
  int count_ = 0, busy_ = 0;
  bool running_ = false;
  std::array<std::thread, rangecast::kMaxCameras> threads_;
};
