/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <rangecast/sync/ticks.hpp>

#include "common/clockwait.hpp"

/** When a frame is captured. */
struct FrameTime {
  GstClockTime pts, duration, capture_time;
  guint64 index; ///< frames before it
  guint64 tick;  ///< number of the frame period that begins at capture_time, at the present rate
  bool discont;
};

/** Tells the streaming thread when the next frame is due: at once, frame after frame, or, live, at
 *  the multiples of the frame period on the pipeline clock. */
class FrameClock {
public:
  /* Streaming thread, or while it stands still. */

  /** Begins a stream at time 0. */
  void start ();
  /** Time goes on where the old rate left it. @return whether the rate has changed */
  bool set_rate (int fps_n, int fps_d);
  /** Gives up the clock that wait() used. */
  void stop () { clock_wait_.reset (); }
  /** The frame after the last one. */
  FrameTime next ();
  /** Waits for the next multiple of the frame period. Those that have passed are skipped, except
   *  that the one after the last frame is due until half a period after it.
   *  @return false if interrupted: look why, and call again */
  bool wait (GstElement *element, FrameTime &frame);

  /* Any thread. */

  /** Live frames are captured only while the element plays. */
  void set_playing (bool playing);
  /** The thread pauses: ticks from now to the next frame do not count as skipped. */
  void pause ();
  /** Ends wait(), and all later ones until start(). */
  void interrupt ();
  /** Nanoseconds; 0 while the rate is not known. */
  GstClockTime period ();
  /** Ticks that passed without a frame while the element played. */
  [[nodiscard]] guint64 skipped () const { return skipped_; }

private:
  [[nodiscard]] std::int64_t next_tick (GstClockTime now, GstClockTime base) const;
  [[nodiscard]] GstClockTime time_of (std::int64_t tick) const
  {
    return static_cast<GstClockTime> (rate_.time_of (tick));
  }

  std::mutex lock_; /* guards all; taken before the element's and the clock's */
  std::condition_variable changed_;
  ClockWait clock_wait_;
  bool playing_ = false, interrupted_ = false, paused_since_tick_ = false;
  std::atomic<guint64> skipped_ = 0;
  rangecast::TickRate rate_;
  guint64 index_ = 0;
  bool discont_ = true;

  std::int64_t frame_ = 0; ///< not live: the next one has PTS since_ + time_of (frame_)
  GstClockTime since_ = 0; ///< not live: when the rate changed
  std::optional<std::int64_t> last_tick_; ///< live
};
