/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <arv.h>
#include <atomic>
#include <memory>
#include <mutex>

#include "camera.hpp"
#include "frame.hpp"

/** The buffers of one stream, each an ArvBuffer with a GstBuffer around its pixels. A GstBuffer
 *  that is released returns its ArvBuffer to the stream and is used again: nothing is allocated per
 *  frame. If its memory was kept or the buffer was changed, the memory returns the ArvBuffer when
 *  it is released, and the next frame gets a new GstBuffer. Buffers that are downstream when the
 *  store is closed are freed with their last reference.
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
