/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "outputthread.hpp"

#include <pthread.h>

#include <exception>

bool
PictureThread::start (GstElement *element, Tick tick)
{
  std::lock_guard guard (lock_);
  if (thread_.joinable ())
    return true;
  quit_ = false;
  try {
    thread_ = std::thread ([this, element, tick] { run (element, tick); });
  } catch (const std::exception &error) {
    GST_WARNING ("could not start the drawing thread: %s", error.what ());
    return false;
  }
  return true;
}

/* Holding the lock. A clock that is about to be waited for returns at once, too. */
void
PictureThread::interrupt ()
{
  if (waiting_)
    gst_clock_id_unschedule (id_);
  changed_.notify_all ();
}

void
PictureThread::stop ()
{
  {
    std::lock_guard guard (lock_);
    quit_ = true;
    interrupt ();
  }
  if (thread_.joinable ())
    thread_.join ();
  if (id_)
    gst_clock_id_unref (id_);
  id_ = nullptr;
  gst_clear_object (&clock_);
}

void
PictureThread::set_playing (bool playing)
{
  std::lock_guard guard (lock_);
  playing_ = playing;
  woken_ = true; /* the base time is another */
  interrupt ();
}

void
PictureThread::wake ()
{
  std::lock_guard guard (lock_);
  woken_ = true;
  interrupt ();
}

void
PictureThread::wait_for_clock (
    std::unique_lock<std::mutex> &guard, GstElement *element, GstClockTime due)
{
  GstClock *clock = gst_element_get_clock (element);
  if (!clock) { /* taken away while playing: no time goes on */
    changed_.wait (guard, [this] { return quit_ || woken_; });
    return;
  }
  const GstClockTime time = gst_element_get_base_time (element) + due;
  if (clock != clock_ || !gst_clock_single_shot_id_reinit (clock, id_, time)) {
    if (id_)
      gst_clock_id_unref (id_);
    id_ = gst_clock_new_single_shot_id (clock, time);
    gst_object_replace (reinterpret_cast<GstObject **> (&clock_), GST_OBJECT (clock));
  }
  gst_object_unref (clock);
  waiting_ = true;
  guard.unlock ();
  gst_clock_id_wait (id_, nullptr);
  guard.lock ();
  waiting_ = false;
}

/* Applications give threads their priorities then. */
static void
tell (GstElement *element, GstStreamStatusType type)
{
  gst_element_post_message (
      element, gst_message_new_stream_status (GST_OBJECT (element), type, element));
}

void
PictureThread::run (GstElement *element, Tick tick)
{
#ifdef __GLIBC__
  pthread_setname_np (pthread_self (), "rangecast:draw");
#endif
  tell (element, GST_STREAM_STATUS_TYPE_ENTER);
  draw (element, tick);
  tell (element, GST_STREAM_STATUS_TYPE_LEAVE);
}

void
PictureThread::draw (GstElement *element, Tick tick)
{
  std::unique_lock guard (lock_);
  while (!quit_) {
    changed_.wait (guard, [this] { return quit_ || playing_; });
    if (quit_)
      break;
    woken_ = false;
    guard.unlock ();
    const GstClockTime due = tick (element);
    guard.lock ();
    if (quit_ || woken_ || due == 0)
      continue;
    if (GST_CLOCK_TIME_IS_VALID (due))
      wait_for_clock (guard, element, due);
    else
      changed_.wait (guard, [this] { return quit_ || woken_; });
  }
}
