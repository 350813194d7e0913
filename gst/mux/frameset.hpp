/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <rangecast/base/status.hpp>
#include <vector>

#include "common/recycledmemories.hpp"

/** Joins buffers of several streams into one, raw ones with their GstRangeMetas.
 *
 *  A GstBuffer holds gst_buffer_get_max_memory() memories. Up to that number they are shared and
 *  nothing is copied. For more, GStreamer would copy all of them into one memory, and again with
 *  each 16th one. Here all but one of the memories that fit are shared, and the others are copied
 *  once, into a recycled memory. Streaming thread. */
class FrameSetJoiner {
public:
  FrameSetJoiner () = default;
  ~FrameSetJoiner () { gst_clear_buffer (&frame_set_); }
  FrameSetJoiner (const FrameSetJoiner &) = delete;
  FrameSetJoiner &operator= (const FrameSetJoiner &) = delete;

  /** @param memories  number of memories of all buffers of the frame set */
  void begin (guint memories, bool coded);
  /** Appends the views of a buffer.
   *  @param buffer  transfer none; must live until finish()
   *  @return false, and nothing is added, if it is raw and has a view-id that was added before */
  bool add (GstBuffer *buffer);
  /** @param[out] frame_set  transfer full, without times; nullptr on error
   *  @return kNoSpace if memory is short, kBadData if a buffer cannot be mapped */
  rangecast::Status finish (GstBuffer *&frame_set);

  /** Frees the recycled memories. */
  void drop () { copies_.drop (); }

private:
  rangecast::Status copy_rest ();

  GstBuffer *frame_set_ = nullptr;
  bool coded_ = false;
  guint max_shared_ = 0;          /* memories */
  gsize size_ = 0;                /* bytes of all buffers */
  gsize rest_size_ = 0;           /* bytes of rest_ */
  std::vector<GstBuffer *> rest_; /* to be copied; kept for its memory */
  RecycledMemories copies_;
};
