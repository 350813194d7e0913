/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <arv.h>
#include <memory>
#include <mutex>

#include "camera.hpp"
#include "frame_counter.hpp"
#include "frame_store.hpp"

/** One run of a camera's stream, from start() to stop(). */
struct CameraRun {
  std::mutex lock; /* guards all of it, held while `arrived` runs; only the stream's thread waits */
  Camera::Arrived arrived;
  ArvStream *stream = nullptr; /* transfer full; deleted by take-down */
  std::shared_ptr<FrameStore> store;
  FrameCounter counter;
  CameraFormat format;
  ArvPixelFormat code = 0;
  std::uint64_t missing_packets = 0; /* told so far */
  bool stopped = false;

  void on_done ();
  void deliver (ArvBuffer *buffer);
  [[nodiscard]] bool fits (ArvBuffer *buffer) const;
};

/** What Aravis counted so far. */
CameraStatistics count_stream (ArvStream *stream);
