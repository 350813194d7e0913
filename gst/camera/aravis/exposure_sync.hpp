/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <vector>

#include "camera.hpp"

/** Keeps exposure, gain and white balance of cameras equal: reads what the leader has chosen and
 *  writes it to the followers. Its thread is detached, and no GstTask, since nobody may have to
 *  wait for a camera that does not answer. */
class ExposureSync {
public:
  using Failed = std::function<void (const CameraStatus &)>;

  ExposureSync () = default;
  ExposureSync (const ExposureSync &) = delete;
  ExposureSync &operator= (const ExposureSync &) = delete;
  ~ExposureSync () { stop (); }

  /** @param failed  from its thread, at the first refusal of a camera, and at the first one after a
   *  success */
  void start (std::shared_ptr<Camera> leader, std::vector<std::shared_ptr<Camera>> followers,
      std::chrono::milliseconds period, Failed failed);
  /** `failed` is not called after it. Does not wait for a camera that does not answer: the thread
   *  releases it when Aravis gives up, within seconds. */
  void stop ();

private:
  struct Worker;
  std::shared_ptr<Worker> worker_;
};
