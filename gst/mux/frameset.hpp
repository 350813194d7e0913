/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <rangecast/base/status.hpp>
#include <vector>

#include "common/recycledmemories.hpp"

/** Puts buffers of several streams together into one, raw ones with their GstRangeMetas.
 *
 *  A GstBuffer holds gst_buffer_get_max_memory() memories. Where all that come are no more, they
 * are shared and nothing is copied. GStreamer would make room for more by copying all that are
 * there into one memory, again with each 16th more. Here the first ones are shared, all but one of
 * what a buffer holds, and the others are copied once, into one memory that is used again.
 * Streaming thread.
 */
class FrameSetJoiner {
public:
  FrameSetJoiner () = default;
  ~FrameSetJoiner () { gst_clear_buffer (&frame_set_); }
  FrameSetJoiner (const FrameSetJoiner &) = delete;
  FrameSetJoiner &operator= (const FrameSetJoiner &) = delete;

  /** @param memories  of all buffers that add() will be given, for this frame set */
  void begin (guint memories, bool coded);
  /** Adds the views of a buffer behind those that there are.
   *  @param buffer  transfer none: the caller keeps it until finish()
   *  @return false, and nothing is added, if a raw one has a view that is there already */
  bool add (GstBuffer *buffer);
  /** @param[out] frame_set  transfer full: without times; nullptr if it fails
   *  @return kNoSpace where memory is short, kBadData if a buffer to be copied cannot be read */
  rangecast::Status finish (GstBuffer *&frame_set);

  /** Gives back the memory that is kept. */
  void drop () { copies_.drop (); }

private:
  rangecast::Status copy_rest ();

  GstBuffer *frame_set_ = nullptr;
  bool coded_ = false;
  guint most_shared_ = 0;         /* memories */
  gsize size_ = 0;                /* of all that was added, bytes */
  gsize rest_size_ = 0;           /* of those in rest_ */
  std::vector<GstBuffer *> rest_; /* to be copied; kept for its memory */
  RecycledMemories copies_;
};
