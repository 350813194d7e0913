/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <chrono>
#include <functional>
#include <future>
#include <thread>

/** Work that may have to wait for a camera that does not answer: one after the other, in threads of
 * its own. One that is late makes the next ones not be waited for. */
class TakeDown {
public:
  void run (std::function<void ()> work, bool patient)
  {
    patient = patient && wait (std::chrono::milliseconds (0));
    std::packaged_task<void ()> task ([before = done_, work = std::move (work)] {
      if (before.valid ())
        before.wait ();
      work ();
    });
    done_ = task.get_future ().share ();
    std::thread (std::move (task)).detach ();
    if (patient)
      wait (kPatience);
  }
  /* @return false: still at work */
  bool wait (std::chrono::milliseconds limit)
  {
    return !done_.valid () || done_.wait_for (limit) == std::future_status::ready;
  }

  static constexpr std::chrono::milliseconds kLongest =
      std::chrono::seconds (15); /* Aravis' tries end before */

private:
  static constexpr std::chrono::milliseconds kPatience = std::chrono::seconds (1);

  std::shared_future<void> done_;
};
