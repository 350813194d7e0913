/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "clock.hpp"

void
FrameClock::start ()
{
  std::lock_guard guard (lock_);
  rate_ = {};
  skipped_ = 0;
  index_ = 0;
  frame_ = 0;
  since_ = 0;
  last_tick_.reset ();
  discont_ = true;
  paused_since_tick_ = interrupted_ = false;
}

bool
FrameClock::set_rate (int fps_n, int fps_d)
{
  std::lock_guard guard (lock_);
  if (rate_.frames == fps_n && rate_.seconds == fps_d)
    return false;
  if (rate_.valid ())
    since_ += time_of (frame_);
  frame_ = 0;
  last_tick_.reset ();
  rate_ = {fps_n, fps_d};
  return true;
}

FrameTime
FrameClock::next ()
{
  std::lock_guard guard (lock_);
  FrameTime frame;
  frame.pts = frame.capture_time = since_ + time_of (frame_);
  frame.duration = since_ + time_of (frame_ + 1) - frame.pts;
  frame.index = index_++;
  frame.tick = static_cast<guint64> (frame_++);
  frame.discont = discont_;
  discont_ = false;
  return frame;
}

bool
FrameClock::wait (GstElement *element, FrameTime &frame)
{
  std::unique_lock guard (lock_);
  changed_.wait (guard, [this] { return playing_ || interrupted_; });
  if (interrupted_)
    return false;
  GstClock *clock = clock_of_element (element);
  const GstClockTime base = gst_element_get_base_time (element);
  const std::int64_t tick = next_tick (gst_clock_get_time (clock), base);
  frame.capture_time = time_of (tick);
  frame.pts = frame.capture_time - base;
  frame.duration = time_of (tick + 1) - frame.capture_time;
  const bool due = clock_wait_.wait_until (guard, clock, frame.capture_time);
  gst_object_unref (clock);
  if (!due)
    return false;
  const bool gap = last_tick_ && tick != *last_tick_ + 1;
  if (gap && tick > *last_tick_ && !paused_since_tick_)
    skipped_ += static_cast<guint64> (tick - *last_tick_ - 1);
  frame.index = index_++;
  frame.tick = static_cast<guint64> (tick);
  frame.discont = discont_ || gap;
  discont_ = paused_since_tick_ = false;
  last_tick_ = tick;
  return true;
}

/* The first tick that is still to come, but not the last one again, should the clock have been set
 * back or run slower. A sink that waits for a frame's time, which is a period of latency after its
 * tick, returns just after the next tick: that one is captured late. With the lock. */
std::int64_t
FrameClock::next_tick (GstClockTime now, GstClockTime base) const
{
  if (last_tick_ && !paused_since_tick_) {
    const GstClockTime following = time_of (*last_tick_ + 1);
    if (following >= base && following < now && now - following < time_of (1) / 2)
      return *last_tick_ + 1;
  }
  const std::int64_t tick = rate_.at_or_after (static_cast<std::int64_t> (MAX (now, base)));
  return last_tick_ && tick == *last_tick_ ? tick + 1 : tick;
}

void
FrameClock::set_playing (bool playing)
{
  std::lock_guard guard (lock_);
  playing_ = playing;
  paused_since_tick_ |= !playing;
  changed_.notify_all ();
  if (!playing)
    clock_wait_.interrupt ();
}

void
FrameClock::pause ()
{
  std::lock_guard guard (lock_);
  paused_since_tick_ = true;
}

void
FrameClock::interrupt ()
{
  std::lock_guard guard (lock_);
  interrupted_ = true;
  changed_.notify_all ();
  clock_wait_.interrupt ();
}

GstClockTime
FrameClock::period ()
{
  std::lock_guard guard (lock_);
  return rate_.valid () ? time_of (1) : 0;
}
