/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <array>
#include <gstrange/gstrangeframe.hpp>
#include <rangecast/neighbourcode/access_unit.hpp>

/** What neighbourcodedec conceal=last shows where nothing came: the frame set shown last, and for
 *  how long views of which nothing comes may stay. Streaming thread only. */
class Concealment {
public:
  ~Concealment () { forget (); }

  void forget ();
  /** Keeps what there is if it fits the new views. */
  void change_rig (const rangecast::Rig &before, const rangecast::Rig &now);

  /** Begins a frame set with the times and flags of `input`. @return the frame set to take pixels
   *  from, or nullptr */
  GstBuffer *begin (GstBuffer *input);
  /** Adds the views of a frame set to a buffer: those that were planned, of which nearly nothing
   *  came with all that was shown last, and those that did not come at all but were shown. */
  rangecast::Status lay_out (const rangecast::AccessUnitDecoder &decoder,
      std::span<const rangecast::RangeImage> older, GstBuffer *buffer);
  /** Fills what lay_out() added from `older`, and decodes into it. */
  static rangecast::Status decode (rangecast::AccessUnitDecoder &decoder,
      std::span<const rangecast::RangeImage> images, std::span<const rangecast::RangeImage> older,
      int threads, rangecast::DecoderResult &result);
  /** This frame set is shown. */
  void keep (GstBuffer *output);

private:
  GstBuffer *last_ = nullptr;
  bool skips_ = false;                      /* the frame set at hand: its time jumps */
  GstClockTime now_ = GST_CLOCK_TIME_NONE;  /* of the frame set at hand */
  GstClockTime jump_ = GST_CLOCK_TIME_NONE; /* of the one before, if its time jumped */
  std::array<GstClockTime, rangecast::kMaxViews> came_{}; /* by view-id: when it did last */
};
