/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "teardown_queue.hpp"

#include "debug.hpp"

void
TeardownQueue::run (std::function<void ()> function, bool wait_for_it)
{
  wait_for_it = wait_for_it && wait (std::chrono::milliseconds (0));
  auto task = std::make_shared<Task> (std::move (function));
  done_ = task->function.get_future ();
  GError *error = nullptr;
  if (!g_thread_pool_push (pool_, new TaskPointer (task), &error)) { /* it is queued all the same */
    GST_WARNING ("no thread to release the camera in, releasing it here: %s", error->message);
    g_clear_error (&error);
    task->run ();
  }
  if (wait_for_it)
    wait (std::chrono::seconds (1));
}
