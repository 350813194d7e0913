/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "clock.hpp"

void
AvatarClock::start ()
{
  std::lock_guard guard (lock_);
  fps_n_ = 0;
  fps_d_ = 1;
  skipped_ = 0;
  index_ = frame_ = 0;
  since_ = 0;
  position_ = GST_CLOCK_TIME_NONE;
  last_tick_ = kNone;
  discont_ = true;
  paused_since_tick_ = interrupted_ = false;
}

void
AvatarClock::seek (GstClockTime position)
{
  position_ = position; /* the rate may not be known yet: next() does the rest */
  discont_ = true;
}

GstClockTime
AvatarClock::time_of (guint64 frame) const
{
  return gst_util_uint64_scale (frame, GST_SECOND * guint64 (fps_d_), guint64 (fps_n_));
}

bool
AvatarClock::set_rate (int fps_n, int fps_d)
{
  if (fps_n_ == fps_n && fps_d_ == fps_d)
    return false;
  if (fps_n_ > 0)
    since_ += time_of (frame_);
  frame_ = 0;
  last_tick_ = kNone;
  std::lock_guard guard (lock_);
  fps_n_ = fps_n;
  fps_d_ = fps_d;
  return true;
}

AvatarMoment
AvatarClock::next ()
{
  if (GST_CLOCK_TIME_IS_VALID (position_)) {
    frame_ = gst_util_uint64_scale (position_, guint64 (fps_n_), GST_SECOND * guint64 (fps_d_));
    index_ = frame_;
    since_ = 0;
    position_ = GST_CLOCK_TIME_NONE;
  }
  AvatarMoment moment;
  moment.pts = moment.capture_time = since_ + time_of (frame_);
  moment.duration = since_ + time_of (frame_ + 1) - moment.pts;
  moment.index = index_++;
  moment.tick = frame_;
  moment.discont = discont_;
  discont_ = false;
  frame_++;
  return moment;
}

/* The first tick that is still to come; the last one is not taken twice, should the clock be set
 * back or run slower than this. A sink that waits for a picture's time, which is a period of
 * latency behind its tick, gives the thread back just after the next tick: that one is taken late.
 */
guint64
AvatarClock::next_tick (GstClockTime now, GstClockTime base)
{
  if (last_tick_ != kNone) {
    const GstClockTime following = time_of (last_tick_ + 1);
    std::lock_guard guard (lock_);
    if (!paused_since_tick_ && following >= base && following < now &&
        now - following < time_of (1) / 2)
      return last_tick_ + 1;
  }
  now = MAX (now, base);
  guint64 tick = gst_util_uint64_scale (now, guint64 (fps_n_), GST_SECOND * guint64 (fps_d_));
  while (time_of (tick) < now || tick == last_tick_)
    tick++;
  return tick;
}

bool
AvatarClock::wait (GstElement *element, AvatarMoment &moment)
{
  {
    std::unique_lock guard (lock_);
    wake_.wait (guard, [&] { return playing_ || interrupted_; });
    if (interrupted_)
      return false;
  }
  GstClock *clock = gst_element_get_clock (element);
  if (!clock) /* outside of a pipeline */
    clock = gst_system_clock_obtain ();
  const GstClockTime base = gst_element_get_base_time (element);
  const guint64 tick = next_tick (gst_clock_get_time (clock), base);
  moment.capture_time = time_of (tick);
  moment.pts = moment.capture_time - base;
  moment.duration = time_of (tick + 1) - moment.capture_time;
  const bool came = wait_until (clock, moment.capture_time);
  gst_object_unref (clock);
  if (came)
    take_tick (tick, moment);
  return came;
}

bool
AvatarClock::wait_until (GstClock *clock, GstClockTime time)
{
  GstClockID id = gst_clock_new_single_shot_id (clock, time);
  GstClockReturn result = GST_CLOCK_UNSCHEDULED;
  std::unique_lock guard (lock_);
  if (playing_ && !interrupted_) {
    waiting_ = id;
    guard.unlock ();
    result = gst_clock_id_wait (id, nullptr);
    guard.lock ();
    waiting_ = nullptr;
  }
  gst_clock_id_unref (id);
  return result != GST_CLOCK_UNSCHEDULED;
}

void
AvatarClock::take_tick (guint64 tick, AvatarMoment &moment)
{
  std::lock_guard guard (lock_);
  const bool gap = last_tick_ != kNone && tick != last_tick_ + 1;
  if (gap && tick > last_tick_ && !paused_since_tick_)
    skipped_ += tick - last_tick_ - 1;
  moment.index = index_++;
  moment.tick = tick;
  moment.discont = discont_ || gap;
  discont_ = paused_since_tick_ = false;
  last_tick_ = tick;
}

void
AvatarClock::set_playing (bool playing)
{
  std::lock_guard guard (lock_);
  playing_ = playing;
  paused_since_tick_ |= !playing;
  wake_.notify_all ();
  if (!playing && waiting_)
    gst_clock_id_unschedule (waiting_);
}

void
AvatarClock::note_rest ()
{
  std::lock_guard guard (lock_);
  paused_since_tick_ = true;
}

void
AvatarClock::interrupt ()
{
  std::lock_guard guard (lock_);
  interrupted_ = true;
  wake_.notify_all ();
  if (waiting_)
    gst_clock_id_unschedule (waiting_);
}

void
AvatarClock::resume ()
{
  std::lock_guard guard (lock_);
  interrupted_ = false;
}

GstClockTime
AvatarClock::period ()
{
  std::lock_guard guard (lock_);
  return fps_n_ > 0 ? time_of (1) : 0;
}

guint64
AvatarClock::skipped ()
{
  std::lock_guard guard (lock_);
  return skipped_;
}
