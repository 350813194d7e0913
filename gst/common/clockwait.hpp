/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <mutex>

/** Waits for a time on a clock, as std::condition_variable waits for a condition: one thread waits
 *  and others end its wait, all with the same mutex locked. The mutex is unlocked meanwhile. */
class ClockWait {
public:
  ClockWait () = default;
  ~ClockWait () { reset (); }
  ClockWait (const ClockWait &) = delete;
  ClockWait &operator= (const ClockWait &) = delete;

  /** Waits until `time` on `clock`; a time that has passed ends the wait immediately. Keeps a
   *  reference to the clock until reset(), so that waiting for it again allocates nothing.
   *  @param guard  locked; check the condition for waiting under this lock
   *  @return false if the time has not come: interrupt() ended the wait, or the clock cannot be
   *  waited for, which takes 10 ms, so that callers may try again */
  bool wait_until (std::unique_lock<std::mutex> &guard, GstClock *clock, GstClockTime time)
  {
    if (clock != clock_ || !gst_clock_single_shot_id_reinit (clock, id_, time)) {
      reset ();
      clock_ = GST_CLOCK (gst_object_ref (clock));
      id_ = gst_clock_new_single_shot_id (clock, time);
    }
    waiting_ = true;
    guard.unlock ();
    const GstClockReturn result = gst_clock_id_wait (id_, nullptr);
    const bool reached = result == GST_CLOCK_OK || result == GST_CLOCK_EARLY;
    if (!reached && result != GST_CLOCK_UNSCHEDULED)
      g_usleep (10000);
    guard.lock ();
    waiting_ = false;
    return reached;
  }

  /** Ends the wait in progress, or about to begin, if there is one. Call with the mutex locked. */
  void interrupt ()
  {
    if (waiting_)
      gst_clock_id_unschedule (id_);
  }

  /** Gives up the clock. Call while nobody waits. */
  void reset ()
  {
    g_clear_pointer (&id_, gst_clock_id_unref);
    gst_clear_object (&clock_);
  }

private:
  GstClock *clock_ = nullptr; /* of id_ */
  GstClockID id_ = nullptr;
  bool waiting_ = false;
};

/** The element's clock, or the system clock for an element outside of a pipeline. Transfer full. */
inline GstClock *
clock_of_element (GstElement *element)
{
  GstClock *clock = gst_element_get_clock (element);
  return clock ? clock : gst_system_clock_obtain ();
}
