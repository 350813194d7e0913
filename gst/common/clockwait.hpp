/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <mutex>

/** Waits for a time on a clock, as std::condition_variable waits for a condition: one thread waits
 *  and others end its wait, all with the same mutex locked. The mutex is unlocked meanwhile. */
class ClockWait {
public:
  /** Waits until `time` on `clock`; a time that has passed ends the wait at once.
   *  @param guard  locked; check the condition for waiting under this lock
   *  @return false if the time has not come: interrupt() ended the wait, or the clock cannot be
   * waited for, which costs 10 ms, so that callers may try again */
  bool wait_until (std::unique_lock<std::mutex> &guard, GstClock *clock, GstClockTime time)
  {
    GstClockID id = gst_clock_new_single_shot_id (clock, time);
    waiting_ = id;
    guard.unlock ();
    const GstClockReturn result = gst_clock_id_wait (id, nullptr);
    const bool reached = result == GST_CLOCK_OK || result == GST_CLOCK_EARLY;
    if (!reached && result != GST_CLOCK_UNSCHEDULED)
      g_usleep (10000);
    guard.lock ();
    waiting_ = nullptr;
    gst_clock_id_unref (id);
    return reached;
  }

  /** Ends the wait in progress, if there is one. Call with the mutex locked. */
  void interrupt ()
  {
    if (waiting_)
      gst_clock_id_unschedule (waiting_);
  }

private:
  GstClockID waiting_ = nullptr;
};

/** The element's clock, or the system clock for an element outside of a pipeline. Transfer full. */
inline GstClock *
clock_of_element (GstElement *element)
{
  GstClock *clock = gst_element_get_clock (element);
  return clock ? clock : gst_system_clock_obtain ();
}
