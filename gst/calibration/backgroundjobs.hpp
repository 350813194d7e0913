/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <stop_token>
#include <thread>

/* One thread that does jobs one after the other. */
class BackgroundJobs {
public:
  /* Must end by itself, and soon once the token says so. */
  using Job = std::function<void (std::stop_token)>;

  BackgroundJobs () = default;
  BackgroundJobs (const BackgroundJobs &) = delete;
  BackgroundJobs &operator= (const BackgroundJobs &) = delete;
  ~BackgroundJobs () { stop (); }

  void start ()
  {
    stop ();
    std::lock_guard guard (lock_);
    quit_ = flushing_ = false;
    stop_source_ = {};
    thread_ = std::thread ([this] { run (); });
  }
  /* Any thread: forgets jobs that have not begun, asks the one that has to end, ends all waits. */
  void interrupt ()
  {
    std::deque<Job> forgotten; /* they go without the lock */
    {
      std::lock_guard guard (lock_);
      quit_ = true;
      forgotten.swap (jobs_);
      stop_source_.request_stop ();
    }
    changed_.notify_all ();
  }
  /* interrupt(), and waits until no job is left. */
  void stop ()
  {
    interrupt ();
    if (thread_.joinable ())
      thread_.join ();
  }
  /* While flushing, nobody waits; jobs go on. */
  void set_flushing (bool flushing)
  {
    {
      std::lock_guard guard (lock_);
      flushing_ = flushing;
    }
    changed_.notify_all ();
  }
  /* Does nothing while stopped. */
  void post (Job job)
  {
    {
      std::lock_guard guard (lock_);
      if (quit_)
        return;
      jobs_.push_back (std::move (job));
    }
    changed_.notify_all ();
  }
  [[nodiscard]] bool idle ()
  {
    std::lock_guard guard (lock_);
    return jobs_.empty () && !busy_;
  }
  /* @return false: stopped or flushing, jobs may still be there */
  [[nodiscard]] bool wait_until_idle ()
  {
    std::unique_lock guard (lock_);
    changed_.wait (guard, [&] { return quit_ || flushing_ || (jobs_.empty () && !busy_); });
    return !quit_ && !flushing_;
  }

private:
  void run ()
  {
    std::unique_lock guard (lock_);
    while (!quit_) {
      if (jobs_.empty ()) {
        changed_.wait (guard);
        continue;
      }
      Job job = std::move (jobs_.front ());
      jobs_.pop_front ();
      busy_ = true;
      const std::stop_token token = stop_source_.get_token ();
      guard.unlock ();
      job (token);
      job = nullptr; /* what it holds goes without the lock */
      guard.lock ();
      busy_ = false;
      changed_.notify_all ();
    }
  }

  std::mutex lock_; /* guards what follows but thread_, which start() and stop() alone touch */
  std::condition_variable changed_;
  std::deque<Job> jobs_;
  std::stop_source stop_source_;
  bool busy_ = false, quit_ = true, flushing_ = false;
  std::thread thread_;
};
