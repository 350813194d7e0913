/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* From the buffers of a camera's stream to frames. */
#pragma once

#include <arv.h>
#include <atomic>
#include <memory>
#include <mutex>

#include "camera.hpp"

/** Continues the frame ids of one stream as 64-bit numbers. GigE Vision has 16 bits without 0
 *  (65535 is followed by 1), or 64 bits from 1; USB3 Vision 64 bits from 0. */
class FrameCounter {
public:
  enum class Ids { kGigE, kUsb };

  explicit FrameCounter (Ids ids = Ids::kGigE) : ids_ (ids) {}

  /** Whether the standard allows such an id. */
  [[nodiscard]] bool is_id (std::uint64_t id) const { return ids_ == Ids::kUsb || id != 0; }
  /** The number of that id, from 0 for the standard's first id. Grows strictly: an id that cannot
   *  follow the last one (a camera that starts over, a leap) counts as the next. */
  std::uint64_t number (std::uint64_t id)
  {
    if (!begun_)
      number_ = id < kLeap ? id - (ids_ == Ids::kGigE) : 0;
    else
      number_ += step_to (id);
    begun_ = true;
    last_id_ = id;
    return number_;
  }

private:
  static constexpr std::uint64_t kRound = 65535;
  static constexpr std::uint64_t kLeap = std::uint64_t (1) << 31;

  [[nodiscard]] std::uint64_t step_to (std::uint64_t id) const
  {
    if (id > last_id_)
      return id - last_id_ < kLeap ? id - last_id_ : 1;
    if (ids_ == Ids::kGigE && last_id_ <= kRound && last_id_ - id > kRound / 2)
      return id + kRound - last_id_;
    return 1;
  }

  Ids ids_;
  bool begun_ = false;
  std::uint64_t last_id_ = 0, number_ = 0;
};

/** The buffers of one stream. A GstBuffer has the pixels of an ArvBuffer, which returns to the
 *  stream when that memory is released. Buffers that are downstream when the store is closed are
 *  freed with their last reference.
 *
 *  The lock guards stream_; it is not held while Aravis or GStreamer could call back. */
class FrameStore : public std::enable_shared_from_this<FrameStore> {
public:
  /** @param stream  not owned: close() comes before its end */
  FrameStore (ArvStream *stream, const CameraFormat &format) : stream_ (stream), format_ (format) {}

  /** Gives the stream `count` buffers of `size` bytes, at least an image each. */
  void fill (int count, std::size_t size);
  /** A complete ArvBuffer, popped from the stream (transfer full), as a buffer without time stamps.
   */
  GstBufferPtr wrap (ArvBuffer *frame);
  /** Any thread: returns a buffer to the stream (transfer full). */
  void give_back (ArvBuffer *frame);
  /** From now on buffers that return are deleted. */
  void close ();
  /** Buffers that are downstream. */
  [[nodiscard]] int out () const { return out_; }

  /** The frame id of a buffer until Aravis writes it with the first packet. */
  static constexpr std::uint64_t kNoId = G_MAXUINT64;

private:
  std::mutex lock_;
  ArvStream *stream_;
  const CameraFormat format_;
  std::atomic<int> out_{0};
};

/** A camera's stream from start() to stop(). */
struct CameraRun {
  std::mutex lock; /* guards all, held while `arrived` runs; only the stream's thread waits */
  Camera::Arrived arrived;
  ArvStream *stream = nullptr; /* owned; deleted by Camera::stop() */
  std::shared_ptr<FrameStore> store;
  FrameCounter counter;
  CameraFormat format;
  std::uint64_t missing_packets = 0; /* reported so far */
  bool stopped = false;

  void on_done ();
  void deliver (ArvBuffer *buffer);
  [[nodiscard]] bool fits (ArvBuffer *buffer) const;
  /** Aravis' counters. */
  [[nodiscard]] CameraStatistics statistics () const;
};
