/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "exposure_sync.hpp"

#include <condition_variable>
#include <mutex>
#include <thread>

/* Belongs to the thread as well, which may be late to end. */
struct ExposureSync::Work {
  std::shared_ptr<Camera> leader;
  std::vector<std::shared_ptr<Camera>> followers;
  std::chrono::milliseconds period{};

  std::mutex lock; /* guards what follows; held while `failed` runs */
  std::condition_variable changed;
  Failed failed;
  bool quit = false, done = false;

  void run ();
  [[nodiscard]] CameraStatus follow () const;
};

CameraStatus
ExposureSync::Work::follow () const
{
  ImagingParameters parameters;
  CameraStatus status = leader->read_imaging (parameters);
  for (const auto &follower : followers)
    if (status.ok ())
      status = follower->write_imaging (parameters);
  return status;
}

void
ExposureSync::Work::run ()
{
  bool was_ok = true; /* a camera that refuses once would refuse every time */
  std::unique_lock guard (lock);
  while (!quit) {
    guard.unlock ();
    const CameraStatus status = follow ();
    guard.lock ();
    if (!quit && !status.ok () && was_ok && failed)
      failed (status);
    was_ok = status.ok ();
    changed.wait_for (guard, period, [this] { return quit; });
  }
  guard.unlock ();
  leader.reset ();
  followers.clear ();
  guard.lock ();
  done = true;
  changed.notify_all ();
}

void
ExposureSync::start (std::shared_ptr<Camera> leader, std::vector<std::shared_ptr<Camera>> followers,
    std::chrono::milliseconds period, Failed failed)
{
  stop ();
  work_ = std::make_shared<Work> ();
  work_->leader = std::move (leader);
  work_->followers = std::move (followers);
  work_->period = period;
  work_->failed = std::move (failed);
  std::thread ([work = work_] { work->run (); }).detach ();
}

void
ExposureSync::stop ()
{
  if (!work_)
    return;
  std::unique_lock guard (work_->lock);
  work_->quit = true;
  work_->failed = nullptr;
  work_->changed.notify_all ();
  work_->changed.wait_for (guard, std::chrono::seconds (1), [this] { return work_->done; });
  guard.unlock ();
  work_ = nullptr;
}
