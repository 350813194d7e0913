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

  void reset ();
  /** Keeps the last frame set if the views of the new rig have the same size and depth unit. */
  void set_rig (const rangecast::Rig &before, const rangecast::Rig &now);

  /** Begins a frame set with the times and flags of `input`. @return the frame set to take pixels
   *  from, or nullptr */
  GstBuffer *begin (GstBuffer *input);
  /** Adds the views of a frame set to `buffer`: those that the decoder has planned (where most of
   *  the ROI is missing with the ROI of the older image included), then those of `older` that did
   *  not come at all. */
  rangecast::Status add_views (const rangecast::AccessUnitDecoder &decoder,
      std::span<const rangecast::RangeImage> older, GstBuffer *buffer);
  /** Fills what add_views() added from `older`, and decodes into it. */
  static rangecast::Status decode (rangecast::AccessUnitDecoder &decoder,
      std::span<const rangecast::RangeImage> images, std::span<const rangecast::RangeImage> older,
      int threads, rangecast::DecoderResult &result);
  /** The output of this frame set. */
  void keep (GstBuffer *output);

private:
  GstBuffer *last_ = nullptr;
  bool skips_ = false;                      /* the current frame set: its time jumps */
  GstClockTime now_ = GST_CLOCK_TIME_NONE;  /* of the current frame set */
  GstClockTime jump_ = GST_CLOCK_TIME_NONE; /* of the one before, if its time jumped */
  std::array<GstClockTime, rangecast::kMaxViews> last_seen_{}; /* by view-id */
};
