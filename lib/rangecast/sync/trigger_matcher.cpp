/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "trigger_matcher.hpp"

#include <cstdlib>

namespace rangecast {

void
TriggerMatcher::start (std::int64_t period_ns)
{
  *this = {};
  period_ns_ = period_ns;
}

void
TriggerMatcher::fired (std::int64_t trigger, std::int64_t time_ns, bool alone)
{
  triggers_[count_++ % kTriggers] = {trigger, time_ns};
  alone_ = alone;
}

const TriggerMatcher::Trigger *
TriggerMatcher::trigger_at (std::int64_t number) const
{
  for (std::int64_t i = count_ - 1; i >= 0 && i >= count_ - kTriggers; i--)
    if (triggers_[i % kTriggers].number == number)
      return &triggers_[i % kTriggers];
  return nullptr;
}

/* The trigger whose frame is expected nearest to a time. */
TriggerMatcher::Found
TriggerMatcher::nearest (std::int64_t time_ns) const
{
  Found found;
  for (std::int64_t i = count_ - 1; i >= 0 && i >= count_ - kTriggers; i--) {
    const Trigger &trigger = triggers_[i % kTriggers];
    const std::int64_t residual = time_ns - (trigger.time_ns + delay_ns_);
    if (found.known && std::llabs (residual) >= std::llabs (found.residual_ns))
      break; /* older ones are farther away still */
    found = {true, trigger.number, residual};
  }
  found.known = found.known && std::llabs (found.residual_ns) <= period_ns_;
  return found;
}

bool
TriggerMatcher::by_id (std::uint64_t frame_id, std::int64_t &trigger) const
{
  if (frame_id == 0 || last_id_ == 0)
    return false;
  trigger = last_trigger_ + static_cast<std::int64_t> (frame_id - last_id_);
  return trigger_at (trigger) != nullptr;
}

void
TriggerMatcher::accept (std::uint64_t frame_id, const Found &found)
{
  last_id_ = frame_id;
  last_trigger_ = found.trigger;
  unmatched_ = 0;
  if (std::llabs (found.residual_ns) < period_ns_ / 4)
    delay_ns_ += found.residual_ns / 16; /* follows the drift of the camera's clock */
}

TriggerMatcher::Found
TriggerMatcher::no_match ()
{
  unmatched_++;
  return {};
}

/* Only one trigger is pending: the frame answers it. The first frame of a stream often arrives
 * late, so two must agree. */
TriggerMatcher::Found
TriggerMatcher::learn (std::uint64_t frame_id, std::int64_t time_ns)
{
  if (count_ == 0 || !alone_)
    return no_match ();
  const Trigger &trigger = triggers_[(count_ - 1) % kTriggers];
  if (learnt_trigger_ == trigger.number)
    return {}; /* a second answer to one trigger */
  learnt_trigger_ = trigger.number;
  const std::int64_t delay = time_ns - trigger.time_ns;
  settled_ = learnt_ && std::llabs (delay - delay_ns_) < period_ns_ / 4;
  delay_ns_ = delay;
  learnt_ = true;
  const Found found{true, trigger.number, 0};
  accept (frame_id, found);
  return found;
}

TriggerMatcher::Found
TriggerMatcher::find (std::uint64_t frame_id, std::int64_t camera_ns, std::int64_t arrival_ns)
{
  if (count_ > 0 && !learnt_)
    stamped_ = camera_ns > 0;
  if (stamped_ && camera_ns <= 0)
    return no_match (); /* the stamp was lost with the frame's leader */
  const std::int64_t time_ns = stamped_ ? camera_ns : arrival_ns;
  if (!settled_)
    return learn (frame_id, time_ns);
  Found by_time = nearest (time_ns);
  std::int64_t numbered = 0;
  if (by_id (frame_id, numbered) && (!by_time.known || numbered != by_time.trigger)) {
    const Found by_number{true, numbered, time_ns - (trigger_at (numbered)->time_ns + delay_ns_)};
    const std::int64_t differs = by_time.trigger - numbered;
    contradictions_ = by_time.known && differs == contradiction_ ? contradictions_ + 1 : 1;
    contradiction_ = differs;
    /* Triggers on request may be closer than delays are alike; a missed one has passed long ago. */
    const bool apart =
        by_time.known && std::llabs (trigger_at (by_time.trigger)->time_ns -
                                     trigger_at (numbered)->time_ns) >= period_ns_ / 2;
    const bool near = apart && std::llabs (by_time.residual_ns) < period_ns_ / 4;
    const bool time_wins = near && (stamped_ || contradictions_ >= kMaxContradictions);
    if (!time_wins && std::llabs (by_number.residual_ns) < 2 * period_ns_)
      by_time = by_number;
  } else {
    contradictions_ = 0;
  }
  if (!by_time.known)
    return no_match ();
  accept (frame_id, by_time);
  return by_time;
}

} // namespace rangecast
