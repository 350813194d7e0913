/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <chrono>
#include <functional>
#include <future>
#include <glib.h>
#include <memory>
#include <utility>

/** Runs functions that may have to wait for a camera that does not answer, one after the other in a
 *  thread of their own. They are finished also when this object is gone. */
class TeardownQueue {
public:
  TeardownQueue () : pool_ (g_thread_pool_new (run_task, nullptr, 1, TRUE, &error_)) {}
  ~TeardownQueue ()
  {
    g_thread_pool_free (pool_, FALSE, FALSE);
    g_clear_error (&error_);
  }
  TeardownQueue (const TeardownQueue &) = delete;
  TeardownQueue &operator= (const TeardownQueue &) = delete;

  /** Why the thread could not be started; nullptr if it was. Without it nothing may be run. */
  [[nodiscard]] const GError *error () const { return error_; }
  /** @param wait_for_it  wait up to a second, unless an earlier function is still running */
  void run (std::function<void ()> function, bool wait_for_it)
  {
    wait_for_it = wait_for_it && wait (std::chrono::milliseconds (0));
    auto task = std::make_unique<Task> (std::move (function));
    done_ = task->done.get_future ();
    g_thread_pool_push (pool_, task.release (), nullptr);
    if (wait_for_it)
      wait (std::chrono::seconds (1));
  }
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
    std::function<void ()> function;
    std::promise<void> done;
  };
  static void run_task (gpointer data, gpointer)
  {
    const std::unique_ptr<Task> task (static_cast<Task *> (data));
    std::exchange (task->function, {}) (); /* releases what it holds before it counts as done */
    task->done.set_value ();
  }

  GError *error_ = nullptr;
  GThreadPool *pool_; /* exclusive: its thread starts with it */
  std::future<void> done_;
};
