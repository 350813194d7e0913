/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include "camera/aravis/types.hpp"
#include <condition_variable>
#include <mutex>
#include <utility>
#include <vector>

/** What cameras and triggers report to the thread of a session. Any thread. */
struct CameraEvents {
  struct Frame {
    int camera;
    CameraFrame frame;
  };

  std::mutex lock; /* guards all, and state of the session that is changed along with it */
  std::condition_variable changed;
  std::vector<Frame> frames;
  CameraStatus fault; ///< the first one: the cause of others
  bool stop = false;  ///< the session is to end

  void add_frame (int camera, CameraFrame frame)
  {
    std::lock_guard guard (lock);
    frames.push_back ({camera, std::move (frame)});
    changed.notify_all ();
  }
  void fail (CameraStatus status)
  {
    std::lock_guard guard (lock);
    if (!fault.ok ())
      return;
    fault = std::move (status);
    changed.notify_all ();
  }
  bool stopping ()
  {
    std::lock_guard guard (lock);
    return stop;
  }
};
