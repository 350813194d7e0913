/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <array>
#include <gstrange/gstrangeframe.hpp>
#include <rangecast/neighbourcode/access_unit.hpp>

/** neighbourcodedec conceal=last: repeats pixels of the last output frame set where slices are
 *  lost, and views that do not come, for at most kMaxAge (in the .cpp). Streaming thread only. */
class Concealment {
public:
  ~Concealment () { reset (); }

  void reset () { gst_clear_buffer (&last_); }

  /** Begins a frame set with the times and flags of `input`. @return the frame set to take pixels
   *  from, or nullptr */
  GstBuffer *begin (GstBuffer *input);
  /** Adds the views of a frame set to `buffer`: those that the decoder has planned, then those of
   *  `older` that did not come. */
  rangecast::Status add_views (const rangecast::AccessUnitDecoder &decoder,
      std::span<const rangecast::RangeImage> older, GstBuffer *buffer);
  /** The output of this frame set. */
  void keep (GstBuffer *output) { gst_buffer_replace (&last_, output); }

private:
  /* A reference makes the buffer unwritable: downstream copies it before it writes. */
  GstBuffer *last_ = nullptr;
  GstClockTime now_ = GST_CLOCK_TIME_NONE;                     /* of the current frame set */
  std::array<GstClockTime, rangecast::kMaxViews> last_seen_{}; /* by view-id */
};
