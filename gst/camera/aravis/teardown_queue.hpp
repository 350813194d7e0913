/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <chrono>
#include <functional>
#include <future>
#include <glib.h>
#include <memory>

/** Runs functions that may have to wait for a camera that does not answer, one after the other in a
 *  thread of GLib's pool. They are finished also when this object is gone. */
class TeardownQueue {
public:
  TeardownQueue () : pool_ (g_thread_pool_new (run_task, nullptr, 1, FALSE, nullptr)) {}
  ~TeardownQueue () { g_thread_pool_free (pool_, FALSE, FALSE); }
  TeardownQueue (const TeardownQueue &) = delete;
  TeardownQueue &operator= (const TeardownQueue &) = delete;

  /** @param wait_for_it  wait up to a second, unless an earlier function is still running */
  void run (std::function<void ()> function, bool wait_for_it)
  {
    wait_for_it = wait_for_it && wait (std::chrono::milliseconds (0));
    auto task = std::make_unique<Task> (std::move (function));
    done_ = task->get_future ();
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
  using Task = std::packaged_task<void ()>;

  static void run_task (gpointer task, gpointer)
  {
    (*std::unique_ptr<Task> (static_cast<Task *> (task))) ();
  }

  GThreadPool *pool_;
  std::future<void> done_;
};
