/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "ticker.hpp"

#include <algorithm>
#include <pthread.h>
#include <sched.h>
#include <sys/prctl.h>

/* A picture that was asked for in time may be taken so much later: the host is busy. */
static constexpr GstClockTime kLateWake = 20 * GST_MSECOND;

/* ---- the clock ---- */

void
CamSourceTicker::start (
    rangecast::TickRate rate, bool only_when_asked, GstClockTime lead, Actions actions)
{
  stop ();
  rate_ = rate;
  lead_ = lead;
  actions_ = std::move (actions);
  last_tick_ = -1;
  last_asked_ = 0;
  std::lock_guard guard (lock_);
  only_when_asked_ = only_when_asked || !rate.valid ();
  running_ = paused_since_tick_ = true;
  asked_.clear ();
  thread_ = std::thread ([this] { run (); });
}

void
CamSourceTicker::stop ()
{
  {
    std::lock_guard guard (lock_);
    running_ = false;
    changed_.notify_all ();
    if (waiting_)
      gst_clock_id_unschedule (waiting_);
  }
  if (thread_.joinable ())
    thread_.join ();
}

void
CamSourceTicker::set_playing (bool playing)
{
  std::lock_guard guard (lock_);
  playing_ = playing;
  paused_since_tick_ |= !playing;
  changed_.notify_all ();
  if (!playing && waiting_)
    gst_clock_id_unschedule (waiting_);
}

bool
CamSourceTicker::ask (GstClockTime time)
{
  std::lock_guard guard (lock_);
  if (!running_ || !playing_ || !only_when_asked_ || asked_.size () >= kMaxAsked)
    return false;
  asked_.push_back (time);
  wishes_++;
  changed_.notify_all ();
  if (waiting_) /* it may be due before what is waited for */
    gst_clock_id_unschedule (waiting_);
  return true;
}

/* Waits until there is something to wait for. @return false: look again */
bool
CamSourceTicker::next_time (GstClock *clock, GstClockTime base, GstClockTime &time)
{
  std::unique_lock guard (lock_);
  seen_wishes_ = wishes_;
  if (only_when_asked_) {
    if (asked_.empty ()) {
      changed_.wait_for (guard, std::chrono::milliseconds (100));
      return false;
    }
    const GstClockTime now = gst_clock_get_time (clock);
    auto soonest = asked_.begin ();
    for (auto it = asked_.begin (); it != asked_.end (); ++it) {
      if (!GST_CLOCK_TIME_IS_VALID (*it))
        *it = now + lead_;
      if (*it < *soonest)
        soonest = it;
    }
    time = *soonest;
    return true;
  }
  const GstClockTime now = MAX (gst_clock_get_time (clock) + lead_, base);
  gint64 tick = rate_.at_or_after (static_cast<gint64> (now));
  if (tick <= last_tick_ && !paused_since_tick_)
    tick = last_tick_ + 1;
  time = static_cast<GstClockTime> (rate_.time_of (tick));
  return true;
}

/* @return false: something has changed */
bool
CamSourceTicker::wait_until (GstClock *clock, GstClockTime time)
{
  GstClockID id = gst_clock_new_single_shot_id (clock, time - MIN (time, lead_));
  GstClockReturn result = GST_CLOCK_UNSCHEDULED;
  std::unique_lock guard (lock_);
  if (running_ && playing_ && seen_wishes_ == wishes_) {
    waiting_ = id;
    guard.unlock ();
    result = gst_clock_id_wait (id, nullptr);
    guard.lock ();
    waiting_ = nullptr;
  }
  gst_clock_id_unref (id);
  return result == GST_CLOCK_OK || result == GST_CLOCK_EARLY;
}

/* A picture that is taken late has the time when it is taken. */
void
CamSourceTicker::asked_shot (GstClockTime time, GstClockTime now, bool may)
{
  if (!may) { /* cameras are busy with the shot before */
    g_usleep (1000);
    return;
  }
  {
    std::lock_guard guard (lock_);
    if (const auto it = std::ranges::find (asked_, time); it != asked_.end ())
      asked_.erase (it);
  }
  GstClockTime taken = now + lead_ <= time + kLateWake + lead_ / 2 ? time : now + lead_;
  taken = MAX (taken, last_asked_ + 1);
  last_asked_ = taken;
  actions_.fire (taken);
}

/* A tick is fired until half a period behind it; with what passed then, it is missed. */
void
CamSourceTicker::one_shot ()
{
  GstClock *clock = gst_element_get_clock (element_);
  if (!clock) /* outside of a pipeline */
    clock = gst_system_clock_obtain ();
  GstClockTime time = 0;
  const GstClockTime base = gst_element_get_base_time (element_);
  const bool due = next_time (clock, base, time) && wait_until (clock, time);
  const GstClockTime now = due ? gst_clock_get_time (clock) : 0;
  gst_object_unref (clock);
  if (!due)
    return;
  const bool may = actions_.may_fire ();
  if (only_when_asked_) {
    asked_shot (time, MAX (now, base), may);
    return;
  }
  const gint64 tick = rate_.at_or_after (static_cast<gint64> (time));
  const bool late = now > time + static_cast<GstClockTime> (rate_.period_ns ()) / 2;
  {
    std::lock_guard guard (lock_);
    if (!paused_since_tick_)
      missed_ += static_cast<guint64> (tick - last_tick_ - 1) + (late || !may);
    paused_since_tick_ = false;
    last_tick_ = tick;
  }
  if (!may || late)
    return;
  last_shot_ns_ = g_get_monotonic_time () * 1000;
  actions_.fire (time);
}

void
make_thread_punctual ()
{
  sched_param parameters{};
  parameters.sched_priority = sched_get_priority_min (SCHED_RR);
  pthread_setschedparam (pthread_self (), SCHED_RR, &parameters); /* may be refused */
  prctl (PR_SET_TIMERSLACK, 1000UL, 0, 0, 0);                     /* ns */
}

void
CamSourceTicker::run ()
{
  make_thread_punctual ();
  for (;;) {
    {
      std::unique_lock guard (lock_);
      changed_.wait (guard, [this] { return !running_ || playing_; });
      if (!running_)
        return;
    }
    one_shot ();
  }
}

/* ---- calls at the same moment ---- */

void
SimultaneousCalls::start (int count, std::function<void (int)> call)
{
  stop ();
  std::lock_guard guard (lock_);
  call_ = std::move (call);
  count_ = count;
  busy_ = 0;
  running_ = true;
  for (int i = 0; i < count; i++)
    threads_[i] = std::thread ([this, i, seen = round_] { loop (i, seen); });
}

void
SimultaneousCalls::stop ()
{
  {
    std::lock_guard guard (lock_);
    running_ = false;
    begin_.notify_all ();
  }
  for (std::thread &thread : threads_)
    if (thread.joinable ())
      thread.join ();
}

void
SimultaneousCalls::run ()
{
  std::unique_lock guard (lock_);
  if (!running_)
    return;
  round_++;
  busy_ = count_;
  begin_.notify_all ();
  end_.wait (guard, [this] { return busy_ == 0; });
}

void
SimultaneousCalls::loop (int index, guint64 seen)
{
  make_thread_punctual ();
  std::unique_lock guard (lock_);
  for (;;) {
    begin_.wait (guard, [&] { return !running_ || round_ != seen; });
    if (round_ == seen)
      return;
    seen = round_;
    guard.unlock ();
    call_ (index);
    guard.lock ();
    if (--busy_ == 0)
      end_.notify_all ();
  }
}
