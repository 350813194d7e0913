/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <future>
#include <glib.h>
#include <memory>
#include <utility>

/** Runs functions that may have to wait for a camera that does not answer, one after the other in a
 *  thread of GLib's pool. They are finished also when this object is gone. If no thread can be
 *  started, the calling thread runs them. */
class TeardownQueue {
public:
  TeardownQueue ()
      : pool_ (g_thread_pool_new_full (run_task, nullptr, drop_task, 1, FALSE, nullptr))
  {
  }
  /* Immediately if all are finished: without a thread, tasks that were run here are still queued.
   */
  ~TeardownQueue () { g_thread_pool_free (pool_, wait (std::chrono::milliseconds (0)), FALSE); }
  TeardownQueue (const TeardownQueue &) = delete;
  TeardownQueue &operator= (const TeardownQueue &) = delete;

  /** @param wait_for_it  wait up to a second, unless an earlier function is still running */
  void run (std::function<void ()> function, bool wait_for_it);
  /** @return false if the last function is still running after that time */
  bool wait (std::chrono::milliseconds limit)
  {
    return !done_.valid () || done_.wait_for (limit) == std::future_status::ready;
  }

  /** Longer than all tries of Aravis. */
  static constexpr std::chrono::milliseconds kMaxWait = std::chrono::seconds (15);

private:
  struct Task {
    explicit Task (std::function<void ()> f) : function (std::move (f)) {}
    void run ()
    {
      if (started.exchange (true))
        return;
      auto once = std::move (function); /* the queue keeps the task, but not what it holds */
      once ();
    }

    std::packaged_task<void ()> function;
    std::atomic<bool> started = false;
  };
  using TaskPointer = std::shared_ptr<Task>;

  static void run_task (gpointer task, gpointer)
  {
    (*static_cast<TaskPointer *> (task))->run ();
    drop_task (task);
  }
  static void drop_task (gpointer task) { delete static_cast<TaskPointer *> (task); }

  GThreadPool *pool_;
  std::future<void> done_;
};
