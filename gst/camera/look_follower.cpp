/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "look_follower.hpp"

void
LookFollower::start (Camera &leader, std::vector<Camera *> followers,
    std::chrono::milliseconds period, Failed failed)
{
  stop ();
  leader_ = &leader;
  followers_ = std::move (followers);
  period_ = period;
  failed_ = std::move (failed);
  quit_ = false;
  thread_ = std::thread ([this] { run (); });
}

void
LookFollower::stop ()
{
  {
    std::lock_guard guard (lock_);
    quit_ = true;
  }
  changed_.notify_all ();
  if (thread_.joinable ())
    thread_.join ();
}

void
LookFollower::run ()
{
  bool was_ok = true; /* a camera that refuses once would refuse five times a second */
  std::unique_lock guard (lock_);
  while (!quit_) {
    guard.unlock ();
    CameraLook look;
    CameraStatus status = leader_->read_look (look);
    for (Camera *follower : followers_)
      if (status.ok ())
        status = follower->write_look (look);
    if (!status.ok () && was_ok && failed_)
      failed_ (status);
    was_ok = status.ok ();
    guard.lock ();
    changed_.wait_for (guard, period_, [this] { return quit_; });
  }
}
