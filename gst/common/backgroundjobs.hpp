/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <glib.h>

#include <chrono>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <stop_token>
#include <utility>

/** Runs jobs one after the other on one thread (a GThreadPool), and lets another thread wait for
 *  them. start() and stop() are called by one thread at a time; the others are thread-safe. */
class BackgroundJobs {
public:
  /** Must return soon once the token requests it. */
  using Job = std::function<void (std::stop_token)>;

  BackgroundJobs () = default;
  BackgroundJobs (const BackgroundJobs &) = delete;
  BackgroundJobs &operator= (const BackgroundJobs &) = delete;
  ~BackgroundJobs () { stop (); }

  /** @return false if the system refuses a thread */
  [[nodiscard]] bool start ()
  {
    const auto run = [] (gpointer job, gpointer self) {
      static_cast<BackgroundJobs *> (self)->run (std::unique_ptr<Job> (static_cast<Job *> (job)));
    };
    const auto discard = [] (gpointer job) { delete static_cast<Job *> (job); };
    stop ();
    std::lock_guard guard (lock_);
    GError *error = nullptr;
    pool_ = g_thread_pool_new_full (run, this, discard, 1, TRUE, &error);
    if (error) {
      g_thread_pool_free (pool_, TRUE, FALSE);
      pool_ = nullptr;
      g_error_free (error);
    }
    stop_source_ = {};
    flushing_ = false;
    pending_ = 0;
    return pool_;
  }
  /** Skips jobs that have not begun, asks the current one to return, and ends all waits. */
  void interrupt ()
  {
    std::lock_guard guard (lock_);
    stop_source_.request_stop ();
    changed_.notify_all ();
  }
  /** interrupt(), and waits for the current job. */
  void stop ()
  {
    interrupt ();
    GThreadPool *pool;
    {
      std::lock_guard guard (lock_);
      pool = std::exchange (pool_, nullptr);
    }
    if (pool) /* without the lock, which jobs take */
      g_thread_pool_free (pool, TRUE, TRUE);
    std::lock_guard guard (lock_);
    pending_ = 0; /* those that had not begun are gone */
  }
  /** While flushing, waits end immediately; jobs go on. */
  void set_flushing (bool flushing)
  {
    std::lock_guard guard (lock_);
    flushing_ = flushing;
    changed_.notify_all ();
  }
  /** Does nothing while stopped or interrupted. */
  void post (Job job)
  {
    std::lock_guard guard (lock_);
    if (!pool_ || stop_source_.stop_requested ())
      return;
    pending_++;
    g_thread_pool_push (pool_, new Job (std::move (job)), nullptr);
  }
  [[nodiscard]] bool idle ()
  {
    std::lock_guard guard (lock_);
    return pending_ == 0;
  }
  /** @return false if stopped, interrupted or flushing; there may still be jobs */
  [[nodiscard]] bool wait_until_idle ()
  {
    std::unique_lock guard (lock_);
    const auto ended = [&] { return !pool_ || stop_source_.stop_requested () || flushing_; };
    changed_.wait (guard, [&] { return ended () || pending_ == 0; });
    return !ended ();
  }

  /** @return false if there are still jobs after that time */
  [[nodiscard]] bool wait_until_idle (std::chrono::milliseconds limit)
  {
    std::unique_lock guard (lock_);
    return changed_.wait_for (guard, limit, [&] { return pending_ == 0; });
  }

private:
  void run (std::unique_ptr<Job> job)
  {
    std::unique_lock guard (lock_);
    const std::stop_token token = stop_source_.get_token ();
    guard.unlock ();
    if (!token.stop_requested ())
      (*job) (token);
    job.reset (); /* what it holds may take locks */
    guard.lock ();
    pending_--;
    changed_.notify_all ();
  }

  std::mutex lock_; /* guards all members */
  std::condition_variable changed_;
  GThreadPool *pool_ = nullptr; /* null: stopped */
  std::stop_source stop_source_;
  int pending_ = 0; /* jobs posted and not done */
  bool flushing_ = false;
};
