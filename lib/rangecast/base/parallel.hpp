/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <algorithm>
#include <atomic>
#include <concepts>
#include <cstddef>
#include <exception>
#include <memory>
#include <vector>

#include "cpu.hpp"

/** Calls work (context, worker) on this thread with worker 0 and on free threads of the pool with
 *  other numbers below `workers`, each number at most once; returns when all these calls have
 *  returned. One such call at a time uses the pool: a nested one, and one from another thread
 *  meanwhile, gets worker 0 alone. Allocates only when the pool has to grow.
 *
 *  The pool is the process's only one, so its definition is not part of the core, which several
 *  plugins link: libgstrange exports it, programs without libgstrange link rangecast_threads. As a
 *  C symbol, it is the same to all compilers.
 *  @param work  must not throw */
extern "C" [[gnu::visibility ("default")]] void rangecast_run_workers (
    std::size_t workers, void (*work) (void *context, std::size_t worker), void *context);

namespace rangecast {

/** Greatest number of n jobs that in_parallel() runs concurrently.
 *  @param threads  limit; 0 = core_count() */
inline std::size_t
workers_for (std::size_t n, int threads)
{
  return std::min (n, static_cast<std::size_t> (threads > 0 ? threads : core_count ()));
}

/** Runs work (i), or work (i, worker), for each i below n concurrently, and waits for all. They
 * begin in order of i as threads become free. Calls must not write the same memory, except that of
 * their worker: a number below workers_for() that no two concurrent calls share. If one throws,
 * calls that have not begun are skipped, and its exception is rethrown here.
 *  @param threads  limit of concurrent calls; 0 = core_count() */
template <typename Work>
void
in_parallel (std::size_t n, int threads, const Work &work)
{
  const auto call = [&work] (std::size_t i, [[maybe_unused]] std::size_t worker) {
    if constexpr (std::invocable<const Work &, std::size_t, std::size_t>)
      work (i, worker);
    else
      work (i);
  };
  const std::size_t workers = workers_for (n, threads);
  if (workers < 2) {
    for (std::size_t i = 0; i < n; i++)
      call (i, 0);
    return;
  }
  struct Loop {
    const decltype (call) &call_one;
    const std::size_t count;
    std::atomic<std::size_t> next{0};
    std::atomic<bool> failed{false};
    std::exception_ptr error{}; /* written by the call that sets `failed` */

    void run (std::size_t worker) noexcept
    {
      try {
        for (std::size_t i; (i = next.fetch_add (1)) < count;)
          call_one (i, worker);
      } catch (...) {
        if (!failed.exchange (true))
          error = std::current_exception ();
        next = count;
      }
    }
  };
  Loop loop{call, n};
  rangecast_run_workers (
      workers,
      [] (void *context, std::size_t worker) { static_cast<Loop *> (context)->run (worker); },
      &loop);
  if (loop.error)
    std::rethrow_exception (loop.error);
}

/** Temporary memory of jobs, one for each worker, which is kept for later jobs. */
template <typename T> class WorkerMemory {
public:
  /** Makes room for so many workers; must not be called while any of them runs. */
  void reserve (std::size_t workers)
  {
    if (workers > memory_.size ())
      memory_.resize (workers);
  }
  T &of (std::size_t worker)
  {
    std::unique_ptr<T> &memory = memory_[worker];
    if (!memory) /* made on first use: some workers never get a job */
      memory = std::make_unique<T> ();
    return *memory;
  }

private:
  std::vector<std::unique_ptr<T>> memory_;
};

} // namespace rangecast
