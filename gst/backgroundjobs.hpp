/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>

/* One thread that does jobs one after the other. Jobs must end by themselves. */
class BackgroundJobs {
public:
  BackgroundJobs () = default;
  BackgroundJobs (const BackgroundJobs &) = delete;
  BackgroundJobs &operator= (const BackgroundJobs &) = delete;
  ~BackgroundJobs () { stop (); }

  void start ()
  {
    stop ();
    std::lock_guard guard (lock_);
    quit_ = false;
    thread_ = std::thread ([this] { run (); });
  }
  /* Forgets jobs that have not begun and waits for the one that has. */
  void stop ()
  {
    {
      std::lock_guard guard (lock_);
      quit_ = true;
      jobs_.clear ();
    }
    changed_.notify_all ();
    if (thread_.joinable ())
      thread_.join ();
  }
  /* Does nothing while stopped. */
  void post (std::function<void ()> job)
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
  void wait_until_idle ()
  {
    std::unique_lock guard (lock_);
    changed_.wait (guard, [&] { return quit_ || (jobs_.empty () && !busy_); });
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
      const std::function<void ()> job = std::move (jobs_.front ());
      jobs_.pop_front ();
      busy_ = true;
      guard.unlock ();
      job ();
      guard.lock ();
      busy_ = false;
      changed_.notify_all ();
    }
  }

  std::mutex lock_; /* guards what follows but thread_, which start() and stop() alone touch */
  std::condition_variable changed_;
  std::deque<std::function<void ()>> jobs_;
  bool busy_ = false, quit_ = true;
  std::thread thread_;
};
