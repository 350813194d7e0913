/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <rangecast/base/status.hpp>
#include <vector>

#include "common/accessunitwriter.hpp"
#include "common/recycledmemories.hpp"

/** Joins buffers of several streams into one: raw ones with their GstRangeMetas, coded ones into an
 *  access unit of their slices, with the rig of all.
 *
 *  A GstBuffer holds gst_buffer_get_max_memory() memories. Up to that number raw ones are shared
 *  and nothing is copied. Of more, GStreamer would copy all into one, and again with each 16th;
 *  here all are copied once, into a recycled memory. Streaming thread. */
class FrameSetJoiner {
public:
  FrameSetJoiner () = default;
  ~FrameSetJoiner () { gst_clear_buffer (&frame_set_); }
  FrameSetJoiner (const FrameSetJoiner &) = delete;
  FrameSetJoiner &operator= (const FrameSetJoiner &) = delete;

  void set_rig (const gstrange::RangeInfo &info) { writer_.set_rig (info); }
  void begin (bool coded);
  /** Appends the views of a buffer.
   *  @param buffer  transfer none; must live until finish()
   *  @param id_offset  added to its view-ids
   *  @return false, and nothing is added, if it is raw and has a view-id that was added before or
   *  is too large, or if it would make a coded frame set too long */
  bool add (GstBuffer *buffer, int id_offset);
  /** @param time  in the byte stream of coded ones
   *  @param[out] frame_set  transfer full, without times; nullptr on error
   *  @return kNoSpace if memory is short, kBadData if a buffer cannot be mapped */
  rangecast::Status finish (GstClockTime time, GstBuffer *&frame_set);

  /** Frees the recycled memories. */
  void drop ()
  {
    copies_.drop ();
    writer_.drop ();
  }

private:
  struct Part {
    GstBuffer *buffer;
    int id_offset;
  };

  rangecast::Status copy_parts ();
  rangecast::Status write_access_unit (GstClockTime time);

  GstBuffer *frame_set_ = nullptr;
  bool coded_ = false;
  bool is_key_ = true;      /* coded */
  gsize size_ = 0;          /* bytes of all buffers */
  guint memories_ = 0;      /* of all buffers */
  std::vector<Part> parts_; /* kept for its memory */
  RecycledMemories copies_;
  AccessUnitWriter writer_;
};
