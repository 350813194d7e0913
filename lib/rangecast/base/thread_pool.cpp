/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The pool behind in_parallel(). A process must have one, so this file is compiled into libgstrange
 * and into rangecast_threads only. */
#include <pthread.h>

#include <condition_variable>
#include <mutex>
#include <thread>

#include "parallel.hpp"

namespace rangecast {
namespace {

class ThreadPool {
public:
  void run (std::size_t workers, void (*work) (void *, std::size_t), void *context)
  {
    if (workers < 2 || busy_.exchange (true, std::memory_order_acquire)) {
      work (context, 0);
      return;
    }
    const std::size_t helpers = start_threads (workers - 1);
    {
      const std::lock_guard guard (lock_);
      work_ = work;
      context_ = context;
      next_ = 1;
      end_ = helpers + 1;
    }
    for (std::size_t i = 0; i < helpers; i++)
      wake_.notify_one ();
    work (context, 0);
    {
      std::unique_lock guard (lock_);
      end_ = next_; /* helpers that have not begun are no longer needed */
      idle_.wait (guard, [this] { return running_ == 0; });
    }
    busy_.store (false, std::memory_order_release);
  }

private:
  /* Called by the thread that has set busy_. Starts no more threads than there are cores.
   * @return how many threads there are, at most `wanted`; fewer if the system has no more */
  std::size_t start_threads (std::size_t wanted)
  {
    wanted = std::min (wanted, std::size_t (core_count ()) - 1);
    try {
      while (threads_ < wanted) {
        std::thread ([this] { serve (); }).detach ();
        threads_++;
      }
    } catch (...) {
    }
    return std::min (threads_, wanted);
  }

  [[noreturn]] void serve ()
  {
    pthread_setname_np (pthread_self (), "rangecast-pool");
    std::unique_lock guard (lock_);
    for (;;) {
      wake_.wait (guard, [this] { return next_ < end_; });
      const std::size_t worker = next_++;
      const auto work = work_;
      void *const context = context_;
      running_++;
      guard.unlock ();
      work (context, worker);
      guard.lock ();
      if (--running_ == 0)
        idle_.notify_one ();
    }
  }

  std::atomic<bool> busy_ = false;
  std::size_t threads_ = 0; /* owned by the thread that has set busy_ */

  std::mutex lock_; /* of all below; not held while work runs */
  std::condition_variable wake_, idle_;
  void (*work_) (void *, std::size_t) = nullptr;
  void *context_ = nullptr;
  std::size_t next_ = 0, end_ = 0; /* numbers of workers that have not begun */
  std::size_t running_ = 0;        /* threads within work */
};

} // namespace
} // namespace rangecast

/* The pool is never destroyed: its threads wait until the process ends. In a child of fork() there
 * are none, and the caller does all of the work. */
void
rangecast_run_workers (std::size_t workers, void (*work) (void *, std::size_t), void *context)
{
  static rangecast::ThreadPool &pool = *new rangecast::ThreadPool;
  pool.run (workers, work, context);
}
