/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <vector>

#include "camera.hpp"

/** Keeps the look of cameras equal: reads what the leader's regulators chose, and writes it into
 * the followers, from a thread of its own. */
class ExposureSync {
public:
  using Failed = std::function<void (const CameraStatus &)>;

  ExposureSync () = default;
  ExposureSync (const ExposureSync &) = delete;
  ExposureSync &operator= (const ExposureSync &) = delete;
  ~ExposureSync () { stop (); }

  /** @param failed  from its thread; the first time that a camera refuses, and again after a
   * success */
  void start (std::shared_ptr<Camera> leader, std::vector<std::shared_ptr<Camera>> followers,
      std::chrono::milliseconds period, Failed failed);
  /** `failed` does not come after it. A camera that does not answer is not waited for: its thread
   *  lets it go when Aravis gives up, within seconds. */
  void stop ();

private:
  struct Work;
  std::shared_ptr<Work> work_;
};
