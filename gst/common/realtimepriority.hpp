/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <pthread.h>
#include <sched.h>

/** While it lives, the calling thread and the threads that it starts come before ordinary ones
 *  (SCHED_RR, lowest priority), where the user may have that (RLIMIT_RTPRIO); else nothing is
 * different. For what takes microseconds and must happen at its time: answers about the clock,
 * triggers. */
class PromptThread {
public:
  PromptThread ()
  {
    if (pthread_getschedparam (pthread_self (), &policy_, &priority_) == 0 &&
        policy_ == SCHED_OTHER) {
      const sched_param prompt = {1};
      changed_ = pthread_setschedparam (pthread_self (), SCHED_RR, &prompt) == 0;
    }
  }
  ~PromptThread ()
  {
    if (changed_)
      pthread_setschedparam (pthread_self (), policy_, &priority_);
  }
  PromptThread (const PromptThread &) = delete;
  PromptThread &operator= (const PromptThread &) = delete;

private:
  int policy_ = SCHED_OTHER;
  sched_param priority_{};
  bool changed_ = false;
};
