/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "exposure_sync.hpp"

#include <condition_variable>
#include <mutex>
#include <thread>

/* Shared with the thread, which may end late. */
struct ExposureSync::Worker {
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
ExposureSync::Worker::follow () const
{
  ImagingParameters parameters;
  CameraStatus status = leader->read_imaging (parameters);
  for (const auto &follower : followers)
    if (status.ok ())
      status = follower->write_imaging (parameters);
  return status;
}

void
ExposureSync::Worker::run ()
{
  bool was_ok = true; /* report a refusal once */
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
  worker_ = std::make_shared<Worker> ();
  worker_->leader = std::move (leader);
  worker_->followers = std::move (followers);
  worker_->period = period;
  worker_->failed = std::move (failed);
  std::thread ([worker = worker_] { worker->run (); }).detach ();
}

void
ExposureSync::stop ()
{
  if (!worker_)
    return;
  std::unique_lock guard (worker_->lock);
  worker_->quit = true;
  worker_->failed = nullptr;
  worker_->changed.notify_all ();
  worker_->changed.wait_for (guard, std::chrono::seconds (1), [this] { return worker_->done; });
  guard.unlock ();
  worker_ = nullptr;
}
