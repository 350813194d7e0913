/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "trigger.hpp"

#include "camera/aravis/debug.hpp"
#include "clock.hpp"
#include "common/realtimepriority.hpp"

CameraStatus
CameraTrigger::start (Cameras cameras, std::uint32_t action_key, rangecast::TickRate rate)
{
  stop ();
  if (!settings_.triggers_cameras ())
    return {};
  if (settings_.trigger == TriggerMode::kAction) {
    std::vector<std::string> interfaces;
    for (const auto &camera : cameras)
      interfaces.push_back (camera->interface_address ());
    if (CameraStatus status = action_.open (interfaces); !status.ok ())
      return status;
  }
  if (settings_.trigger == TriggerMode::kSoftware && !start_callers (cameras.size ()))
    return {CameraFault::kFailed, "cannot start the threads that trigger the cameras"};
  cameras_ = std::move (cameras);
  action_key_ = action_key;
  rate_ = rate;
  last_tick_ = -1;
  std::lock_guard guard (lock_);
  running_ = paused_since_tick_ = true;
  const auto body = [] (gpointer self) -> gpointer {
    static_cast<CameraTrigger *> (self)->run ();
    return nullptr;
  };
  thread_ = g_thread_try_new ("camera-trigger", body, this, nullptr);
  return thread_ ? CameraStatus ()
                 : CameraStatus (CameraFault::kFailed, "cannot start the trigger thread");
}

void
CameraTrigger::stop ()
{
  {
    std::lock_guard guard (lock_);
    running_ = false;
    changed_.notify_all ();
    clock_wait_.interrupt ();
  }
  if (thread_)
    g_thread_join (std::exchange (thread_, nullptr));
  if (pool_)
    g_thread_pool_free (std::exchange (pool_, nullptr), FALSE, TRUE);
  clock_wait_.reset ();
  action_.close ();
  cameras_.clear ();
}

void
CameraTrigger::set_playing (bool playing)
{
  std::lock_guard guard (lock_);
  playing_ = playing;
  paused_since_tick_ |= !playing;
  changed_.notify_all ();
  if (!playing)
    clock_wait_.interrupt ();
}

/* ---- the thread ---- */

bool
CameraTrigger::start_callers (std::size_t count)
{
  const auto call = [] (gpointer camera, gpointer self) {
    /* For this call only: GLib gives threads of a pool to other pools afterwards. */
    const ScopedRealtimePriority priority;
    auto trigger = static_cast<CameraTrigger *> (self);
    auto called = static_cast<Camera *> (camera);
    CameraStatus status = called->loss_or_fault (called->trigger_software ());
    if (!status.ok ())
      trigger->events_.fail (std::move (status));
    std::lock_guard guard (trigger->lock_);
    trigger->calls_pending_--;
    trigger->changed_.notify_all ();
  };
  GError *error = nullptr;
  pool_ = g_thread_pool_new (call, this, static_cast<gint> (count), TRUE, &error);
  const bool started = !error;
  g_clear_error (&error);
  return started;
}

void
CameraTrigger::run ()
{
  const ScopedRealtimePriority priority;
  std::unique_lock guard (lock_);
  while (running_) {
    if (!playing_) {
      changed_.wait (guard);
      continue;
    }
    GstClock *clock = clock_of_element (element_);
    const GstClockTime time =
        next_tick (gst_clock_get_time (clock), gst_element_get_base_time (element_));
    const bool due = clock_wait_.wait_until (guard, clock, time);
    const GstClockTime now = gst_clock_get_time (clock);
    gst_object_unref (clock);
    if (!due)
      continue;
    guard.unlock ();
    handle_tick (time, now);
    guard.lock ();
  }
}

/* With the lock. */
GstClockTime
CameraTrigger::next_tick (GstClockTime now, GstClockTime base) const
{
  std::int64_t tick = rate_.at_or_after (static_cast<std::int64_t> (MAX (now, base)));
  if (tick <= last_tick_ && !paused_since_tick_)
    tick = last_tick_ + 1;
  return static_cast<GstClockTime> (rate_.time_of (tick));
}

/* A tick is triggered until half a period after it; after that it is missed. */
void
CameraTrigger::handle_tick (GstClockTime time, GstClockTime now)
{
  const bool ready = pairing_.may_trigger (monotonic_ns ());
  const std::int64_t tick = rate_.at_or_after (static_cast<std::int64_t> (time));
  const bool late = now > time + static_cast<GstClockTime> (rate_.period_ns ()) / 2;
  {
    std::lock_guard guard (lock_);
    if (!paused_since_tick_)
      missed_ += static_cast<guint64> (tick - last_tick_ - 1) + (late || !ready);
    paused_since_tick_ = false;
    last_tick_ = tick;
  }
  if (ready && !late)
    trigger (time);
  else
    GST_DEBUG_OBJECT (element_, "no trigger at %" GST_TIME_FORMAT ": %s", GST_TIME_ARGS (time),
        late ? "more than half a period late" : "cameras have not answered the previous one");
}

void
CameraTrigger::trigger (GstClockTime time)
{
  const std::int64_t now_ns = monotonic_ns ();
  last_trigger_ns_ = now_ns;
  /* before it is sent: a camera may answer before another one acknowledges */
  pairing_.add_trigger (time, now_ns);
  GST_LOG_OBJECT (element_, "trigger for %" GST_TIME_FORMAT, GST_TIME_ARGS (time));
  if (settings_.trigger == TriggerMode::kSoftware)
    trigger_software ();
  else if (CameraStatus status = action_.send (action_key_); !status.ok ())
    events_.fail (std::move (status));
}

/* All cameras at the same moment; returns when all have acknowledged. */
void
CameraTrigger::trigger_software ()
{
  busy_ = true;
  std::unique_lock guard (lock_);
  calls_pending_ = cameras_.size ();
  for (const auto &camera : cameras_)
    g_thread_pool_push (pool_, camera.get (), nullptr);
  changed_.wait (guard, [this] { return calls_pending_ == 0; });
  busy_ = false;
}
