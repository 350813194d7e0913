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

namespace rangecast {

/** Calls work (context, worker) on this thread with worker 0 and, where threads of the pool are
 * free, on them with other numbers below `workers`, each number at most once; returns when all
 * these calls have returned. One such call at a time has the pool: a nested one, and one from
 * another thread meanwhile, gets worker 0 alone. Allocates only when the pool has to grow.
 *
 *  The pool is the process's only one, so its definition is not part of the core, which several
 *  plugins link: libgstrange exports it, programs without libgstrange link rangecast_threads.
 *  @param work  must not throw */
[[gnu::visibility ("default")]] void run_workers (
    std::size_t workers, void (*work) (void *context, std::size_t worker), void *context);

/** How many of n jobs in_parallel() runs at a time, at most.
 *  @param threads  at a time; 0 = core_count() */
inline std::size_t
workers_for (std::size_t n, int threads)
{
  return std::min (n, static_cast<std::size_t> (threads > 0 ? threads : core_count ()));
}

/** Runs work (i), or work (i, worker), for each i below n, some at a time, and waits for all of
 *  them. Each begins when a thread is free, in order of i. Calls of different i must not touch the
 *  same memory, but for that of their worker: a number below workers_for() that no two calls have
 *  at the same time. If one throws, calls that have not begun are left out, and its exception is
 *  thrown here.
 *  @param threads  at a time; 0 = core_count() */
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
    std::exception_ptr error{}; /* whoever sets `failed` writes it */

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
  run_workers (
      workers,
      [] (void *context, std::size_t worker) { static_cast<Loop *> (context)->run (worker); },
      &loop);
  if (loop.error)
    std::rethrow_exception (loop.error);
}

/** Memory that jobs need while they run and that nobody needs afterwards; one for each worker, kept
 *  for the jobs to come. */
template <typename T> class WorkerMemory {
public:
  /** Makes room for so many workers; not while any of them runs. */
  void reserve (std::size_t workers)
  {
    if (workers > memory_.size ())
      memory_.resize (workers);
  }
  T &of (std::size_t worker)
  {
    std::unique_ptr<T> &memory = memory_[worker];
    if (!memory) /* a worker that never comes to a job needs none */
      memory = std::make_unique<T> ();
    return *memory;
  }

private:
  std::vector<std::unique_ptr<T>> memory_;
};

} // namespace rangecast
