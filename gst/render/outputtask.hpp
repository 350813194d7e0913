/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <condition_variable>
#include <mutex>

#include "common/clockwait.hpp"

/** The task of a source pad: calls back at times of the element's clock while the element plays.
 *
 *  GstTask calls its function with the pad's stream lock. That lock is released at once and taken
 *  again before the function returns: while the task waits for the clock, serialized events must
 *  pass, and the callback needs the sink pad's stream lock, which comes before it. So
 *  gst_pad_pause_task() does not wait for the callback; gst_pad_stop_task() does, as it joins. */
class OutputTask {
public:
  OutputTask () = default;
  OutputTask (const OutputTask &) = delete;
  OutputTask &operator= (const OutputTask &) = delete;

  /** Called without a lock.
   *  @return running time of the next call, ns; GST_CLOCK_TIME_NONE: when wake() is called */
  using Tick = GstClockTime (*) (GstElement *element);

  /** Starts the task unless it runs. @return false if there is no thread for it */
  bool start (GstPad *src, Tick tick);
  /** Ends a wait and the task, after the callback that runs. Call without a stream lock. */
  void stop ();
  /** The callback is called only while playing. Any thread. */
  void set_playing (bool playing);
  /** Calls back now. Any thread. */
  void wake ();

private:
  void iterate ();
  void wait (std::unique_lock<std::mutex> &guard, GstClockTime due);
  void interrupt ();

  std::mutex lock_; /* guards all; held neither in the callback nor while waiting for the clock */
  std::condition_variable changed_;
  GstPad *src_ = nullptr; /* while the task runs */
  Tick tick_ = nullptr;
  ClockWait clock_wait_;
  bool quit_ = false, playing_ = false, woken_ = false;
};
