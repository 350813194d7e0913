/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <arv.h>
#include <atomic>
#include <memory>
#include <mutex>

#include "camera.hpp"
#include "frame.hpp"

/** The buffers of one stream, each an ArvBuffer with one GstBuffer about its pixels. A GstBuffer
 * that was let go takes its ArvBuffer back to the stream, and is used again: nothing is allocated
 * per frame. Where somebody keeps the memory without the buffer, or changed the buffer, its memory
 * does that, and the next frame gets a new GstBuffer. Buffers that are out when the store is closed
 * live on by themselves.
 *
 *  The lock guards stream_; never held while Aravis or GStreamer could call back. */
class FrameStore : public std::enable_shared_from_this<FrameStore> {
public:
  /** @param stream  not owned: close() comes before its end */
  FrameStore (ArvStream *stream, const CameraFormat &format) : stream_ (stream), format_ (format) {}

  /** Gives the stream `count` buffers of `size` bytes, no less than a picture. */
  void fill (int count, std::size_t size);
  /** A complete ArvBuffer, popped from the stream (transfer full), as a buffer without time stamps.
   */
  GstBufferPtr wrap (ArvBuffer *frame);
  /** Any thread: back to the stream (transfer full). */
  void give_back (ArvBuffer *frame);
  /** From now on buffers that come back are deleted. */
  void close ();
  /** Buffers that are downstream. */
  [[nodiscard]] int out () const { return out_; }

  /** The frame id of a buffer that has none yet: Aravis only writes it when the first packet came.
   */
  static constexpr std::uint64_t kNoId = G_MAXUINT64;

private:
  struct Slot;
  static bool is_unchanged (GstBuffer *buffer, const Slot &slot);
  static gboolean dispose (GstMiniObject *object);
  static void memory_gone (gpointer slot);
  GstBuffer *make_buffer (Slot &slot);
  bool is_closed ();

  std::mutex lock_;
  ArvStream *stream_;
  const CameraFormat format_;
  std::atomic<int> out_{0};
};
