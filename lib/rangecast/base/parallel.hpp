/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <algorithm>
#include <atomic>
#include <concepts>
#include <cstddef>
#include <memory>
#include <opencv2/core/utility.hpp>
#include <thread>
#include <vector>

namespace rangecast {

/** How many of n jobs in_parallel() runs at a time, at most. The number of cores is OpenCV's, which
 *  anybody may set at any time: who makes room for workers hands their number on, as `threads`.
 *  @param threads  at a time; 0 = number of cores */
inline std::size_t
workers_for (std::size_t n, int threads)
{
  const int most = threads > 0 ? threads : cv::getNumThreads ();
  return std::min (n, static_cast<std::size_t> (std::max (most, 1)));
}

/** Runs work (i), or work (i, worker), for each i below n, some at a time, and waits for all of
 *  them. Each begins when a thread is free, in order of i. Calls of different i must not touch the
 *  same memory, but for that of their worker: a number below workers_for() that no two calls have
 *  at the same time.
 *  @param threads  at a time; 0 = number of cores */
template <typename Work>
void
in_parallel (std::size_t n, int threads, const Work &work)
{
  const auto call = [&] (std::size_t i, [[maybe_unused]] std::size_t worker) {
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
  std::atomic<std::size_t> next{0};
  const auto run = [&] (std::size_t worker) {
    for (std::size_t i; (i = next.fetch_add (1)) < n;)
      call (i, worker);
  };
#ifdef __SANITIZE_THREAD__
  /* ThreadSanitizer cannot see how OpenCV's pool, built without it, hands work to its threads. */
  std::vector<std::jthread> workers_running;
  for (std::size_t worker = 0; worker < workers; worker++)
    workers_running.emplace_back (run, worker);
#else
  cv::parallel_for_ (
      cv::Range (0, static_cast<int> (workers)),
      [&] (const cv::Range &range) {
        for (int worker = range.start; worker < range.end; worker++)
          run (static_cast<std::size_t> (worker));
      },
      static_cast<double> (workers));
#endif
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
