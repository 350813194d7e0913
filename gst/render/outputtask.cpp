/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "outputtask.hpp"

bool
OutputTask::start (GstPad *src, Tick tick)
{
  {
    std::lock_guard guard (lock_);
    if (src_)
      return true;
    src_ = src;
    tick_ = tick;
    quit_ = false;
  }
  const auto function = [] (gpointer self) { static_cast<OutputTask *> (self)->iterate (); };
  if (gst_pad_start_task (src, function, this, nullptr))
    return true;
  /* Without a thread GstTask takes itself for running (1.22), and to join it would never end. */
  GST_OBJECT_LOCK (src);
  gst_clear_object (&GST_PAD_TASK (src));
  GST_OBJECT_UNLOCK (src);
  std::lock_guard guard (lock_);
  src_ = nullptr;
  return false;
}

void
OutputTask::stop ()
{
  GstPad *src;
  {
    std::lock_guard guard (lock_);
    quit_ = true;
    interrupt ();
    src = src_;
  }
  if (src)
    gst_pad_stop_task (src);
  std::lock_guard guard (lock_);
  src_ = nullptr;
  clock_wait_.reset ();
}

/* With the lock. */
void
OutputTask::interrupt ()
{
  clock_wait_.interrupt ();
  changed_.notify_all ();
}

void
OutputTask::set_playing (bool playing)
{
  std::lock_guard guard (lock_);
  playing_ = playing;
  woken_ = true; /* the base time is another */
  interrupt ();
}

void
OutputTask::wake ()
{
  std::lock_guard guard (lock_);
  woken_ = true;
  interrupt ();
}

void
OutputTask::wait (std::unique_lock<std::mutex> &guard, GstClockTime due)
{
  GstElement *element = GST_PAD_PARENT (src_);
  GstClock *clock = GST_CLOCK_TIME_IS_VALID (due) ? gst_element_get_clock (element) : nullptr;
  if (!clock) { /* nothing is due, or the clock has been removed: time does not go on */
    changed_.wait (guard, [this] { return quit_ || woken_; });
    return;
  }
  clock_wait_.wait_until (guard, clock, gst_element_get_base_time (element) + due);
  gst_object_unref (clock);
}

/* GstTask calls this again and again. */
void
OutputTask::iterate ()
{
  std::unique_lock guard (lock_);
  GstPad *src = src_; /* stop() clears it after the task */
  GST_PAD_STREAM_UNLOCK (src);
  changed_.wait (guard, [this] { return quit_ || playing_; });
  woken_ = false;
  if (!quit_) {
    const Tick tick = tick_;
    guard.unlock ();
    const GstClockTime due = tick (GST_PAD_PARENT (src));
    guard.lock ();
    if (!quit_ && !woken_ && due != 0)
      wait (guard, due);
  }
  guard.unlock ();
  GST_PAD_STREAM_LOCK (src);
}
