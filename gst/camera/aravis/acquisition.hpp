/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <arv.h>
#include <memory>
#include <mutex>

#include "camera.hpp"
#include "frame_counter.hpp"
#include "frame_store.hpp"

/** A camera's stream from start() to stop(). */
struct CameraRun {
  std::mutex lock; /* guards all, held while `arrived` runs; only the stream's thread waits */
  Camera::Arrived arrived;
  ArvStream *stream = nullptr; /* owned; deleted by the teardown queue */
  std::shared_ptr<FrameStore> store;
  FrameCounter counter;
  CameraFormat format;
  ArvPixelFormat code = 0;
  std::uint64_t missing_packets = 0; /* reported so far */
  bool stopped = false;

  void on_done ();
  void deliver (ArvBuffer *buffer);
  [[nodiscard]] bool fits (ArvBuffer *buffer) const;
};

/** Aravis' counters. */
CameraStatistics count_stream (ArvStream *stream);
