/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <rangecast/base/parallel.hpp>
#include <stdexcept>
#include <thread>
#include <vector>

using namespace rangecast;

namespace {

using Counters = std::vector<std::atomic<int>>;

bool
all_are (const Counters &counters, int value)
{
  return std::ranges::all_of (counters, [value] (const auto &count) { return count == value; });
}

TEST (Parallel, every_job_runs_once_however_many_threads)
{
  for (std::size_t n : {0, 1, 2, 3, 17, 1000})
    for (int threads : {0, 1, 2, 3, 64}) {
      Counters runs (n);
      in_parallel (n, threads, [&] (std::size_t i) { runs[i]++; });
      EXPECT_TRUE (all_are (runs, 1)) << n << " jobs, " << threads << " threads";
    }
}

TEST (Parallel, no_two_jobs_have_one_worker_at_a_time)
{
  for (int round = 0; round < 200; round++) {
    constexpr int kThreads = 4;
    const std::size_t workers = workers_for (64, kThreads);
    EXPECT_EQ (workers, std::size_t (kThreads));
    Counters busy (workers);
    std::atomic<int> clashes = 0;
    in_parallel (64, kThreads, [&] (std::size_t, std::size_t worker) {
      ASSERT_LT (worker, workers);
      clashes += busy[worker].exchange (1);
      std::this_thread::yield ();
      busy[worker] = 0;
    });
    ASSERT_EQ (clashes, 0);
  }
}

TEST (Parallel, jobs_run_at_the_same_time)
{
  if (core_count () < 2)
    GTEST_SKIP () << "one core";
  /* Each waits for the other: alone, the first would wait for its deadline. */
  std::atomic<int> begun = 0;
  const auto deadline = std::chrono::steady_clock::now () + std::chrono::seconds (20);
  in_parallel (2, 2, [&] (std::size_t) {
    begun++;
    while (begun < 2 && std::chrono::steady_clock::now () < deadline)
      std::this_thread::yield ();
    EXPECT_EQ (begun, 2);
  });
}

TEST (Parallel, nested_loops_run_on_the_thread_that_has_the_outer_job)
{
  Counters runs (16 * 16);
  in_parallel (16, 0, [&] (std::size_t i) {
    const auto self = std::this_thread::get_id ();
    in_parallel (16, 0, [&] (std::size_t j) {
      runs[16 * i + j]++;
      EXPECT_EQ (std::this_thread::get_id (), self);
    });
  });
  EXPECT_TRUE (all_are (runs, 1));
}

TEST (Parallel, many_threads_may_ask_at_once)
{
  constexpr std::size_t kJobs = 40;
  constexpr int kCallers = 8, kRounds = 300;
  Counters runs (kCallers * kJobs);
  {
    std::vector<std::jthread> callers;
    for (int caller = 0; caller < kCallers; caller++)
      callers.emplace_back ([&runs, caller] {
        for (int round = 0; round < kRounds; round++)
          in_parallel (kJobs, 0, [&] (std::size_t i) { runs[std::size_t (caller) * kJobs + i]++; });
      });
  }
  EXPECT_TRUE (all_are (runs, kRounds));
}

TEST (Parallel, an_exception_of_a_job_reaches_the_caller_and_the_pool_goes_on)
{
  for (int threads : {0, 1, 2, 8})
    for (std::size_t bad : {0, 5, 99}) {
      try {
        in_parallel (100, threads, [bad] (std::size_t i) {
          if (i >= bad)
            throw std::runtime_error ("job");
        });
        ADD_FAILURE () << "nothing thrown";
      } catch (const std::runtime_error &error) {
        EXPECT_STREQ (error.what (), "job");
      }
      Counters runs (100);
      in_parallel (100, threads, [&] (std::size_t i) { runs[i]++; });
      EXPECT_TRUE (all_are (runs, 1));
    }
}

TEST (Parallel, child_of_a_fork_does_its_work_alone)
{
  in_parallel (8, 0, [] (std::size_t) {}); /* so that there are threads to miss */
  const pid_t child = fork ();
  if (child == 0) {
    Counters runs (100);
    in_parallel (100, 0, [&] (std::size_t i) { runs[i]++; });
    _exit (all_are (runs, 1) ? 0 : 1);
  }
  int status = -1;
  ASSERT_EQ (waitpid (child, &status, 0), child);
  EXPECT_TRUE (WIFEXITED (status));
  EXPECT_EQ (WEXITSTATUS (status), 0);
}

} // namespace
