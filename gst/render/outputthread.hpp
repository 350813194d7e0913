/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <condition_variable>
#include <mutex>
#include <thread>

/** A thread that calls back at times of an element's clock while the element plays. Its own lock is
 *  held neither in the callback nor while it waits for the clock. STREAM_STATUS messages tell of
 * its begin and end. */
class PictureThread {
public:
  PictureThread () = default;
  PictureThread (const PictureThread &) = delete;
  PictureThread &operator= (const PictureThread &) = delete;
  ~PictureThread () { stop (); }

  /** Does what is due. @return running time of the next call, ns; GST_CLOCK_TIME_NONE: once woken
   */
  using Tick = GstClockTime (*) (GstElement *element);

  /** Begins; does nothing if it has begun. @return false if the system has no thread to give */
  bool start (GstElement *element, Tick tick);
  /** Ends a wait and the thread, after the call that is under way. */
  void stop ();
  /** Calls come only while playing; it may change at any time. */
  void set_playing (bool playing);
  /** Has the next call come at once. */
  void wake ();

private:
  void run (GstElement *element, Tick tick);
  void draw (GstElement *element, Tick tick);
  void interrupt ();
  void wait_for_clock (std::unique_lock<std::mutex> &guard, GstElement *element, GstClockTime due);

  std::mutex lock_;
  std::condition_variable changed_;
  std::thread thread_;
  GstClock *clock_ = nullptr; /* of id_, which is used again and again */
  GstClockID id_ = nullptr;
  bool quit_ = false, playing_ = false, woken_ = false, waiting_ = false;
};
