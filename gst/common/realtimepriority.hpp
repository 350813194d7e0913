/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <pthread.h>
#include <sched.h>
#include <sys/prctl.h>

/** While it exists, the calling thread and the threads that it starts run under SCHED_RR at the
 *  lowest priority, and their timers expire without slack. Without permission (RLIMIT_RTPRIO) the
 *  scheduling class stays as it is. For work that takes microseconds and must happen on time:
 *  answers about the clock, triggers. */
class ScopedRealtimePriority {
public:
  ScopedRealtimePriority ()
  {
    if (pthread_getschedparam (pthread_self (), &policy_, &priority_) == 0 &&
        policy_ == SCHED_OTHER) {
      const sched_param lowest = {sched_get_priority_min (SCHED_RR)};
      changed_ = pthread_setschedparam (pthread_self (), SCHED_RR, &lowest) == 0;
    }
    prctl (PR_SET_TIMERSLACK, 1000UL, 0, 0, 0);
  }
  ~ScopedRealtimePriority ()
  {
    prctl (PR_SET_TIMERSLACK, static_cast<unsigned long> (slack_ns_), 0, 0, 0);
    if (changed_)
      pthread_setschedparam (pthread_self (), policy_, &priority_);
  }
  ScopedRealtimePriority (const ScopedRealtimePriority &) = delete;
  ScopedRealtimePriority &operator= (const ScopedRealtimePriority &) = delete;

private:
  int policy_ = SCHED_OTHER;
  sched_param priority_{};
  bool changed_ = false;
  int slack_ns_ = prctl (PR_GET_TIMERSLACK, 0, 0, 0, 0);
};
