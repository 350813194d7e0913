/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "camera.hpp"

/** Keeps the look of cameras equal: reads what the leader's regulators chose, and writes it into
 * the followers, from a thread of its own. The cameras must outlive it or stop() comes first. */
class LookFollower {
public:
  using Failed = std::function<void (const CameraStatus &)>;

  LookFollower () = default;
  LookFollower (const LookFollower &) = delete;
  LookFollower &operator= (const LookFollower &) = delete;
  ~LookFollower () { stop (); }

  /** @param failed  from its thread; the first time that a camera refuses, and again after a
   * success */
  void start (Camera &leader, std::vector<Camera *> followers, std::chrono::milliseconds period,
      Failed failed);
  void stop ();

private:
  void run ();

  Camera *leader_ = nullptr;
  std::vector<Camera *> followers_;
  std::chrono::milliseconds period_{200};
  Failed failed_;
  std::mutex lock_; /* guards quit_ */
  std::condition_variable changed_;
  bool quit_ = false;
  std::thread thread_;
};
