/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstaggregator.h>

#include <gstrange/gstrangeinfo.hpp>
#include <memory>
#include <string>
#include <vector>

#include "states.hpp"

/** A stream of which nothing came for so long is silent: it has no say any more. */
inline constexpr GstClockTime kSilentAfter = 2 * GST_SECOND;

/** A sink pad of rangemux and what is known of its stream. */
struct MuxPad {
  explicit MuxPad (GstAggregatorPad *p) : pad (GST_AGGREGATOR_PAD (gst_object_ref (p))) {}
  ~MuxPad () { gst_object_unref (pad); }
  MuxPad (const MuxPad &) = delete;

  /** Forgets the stream. */
  void reset ();
  /** "pad sink_1 (view 1)" */
  [[nodiscard]] std::string title () const;
  /** Of its first view, or -1 if it has no caps yet. */
  [[nodiscard]] int view_id () const { return has_caps ? info.rig.views.front ().id : -1; }

  GstAggregatorPad *pad; ///< a reference

  /* streaming thread */
  bool has_caps = false, coded = false;
  gstrange::RangeInfo info;
  rangecast::Status other_rig;              ///< what differs from the rig that was asked for
  rangecast::Status clash;                  ///< why it is not chosen
  bool chosen = false;                      ///< by choose_streams()
  bool alive = false;                       ///< something came lately
  bool waits = false;                       ///< a buffer of it waits
  bool clash_reported = false;              ///< of buffers
  bool offset_known = false;                ///< `offset` is of its last buffer
  bool in_step = true;                      ///< its capture times are of the clock that most have
  bool shift_known = false;                 ///< `shift` is of its last buffer
  bool met = false;                         ///< was in a frame set with another stream
  bool told_apart = false;                  ///< state `kApart` was told
  GstClockTimeDiff shift = 0;               ///< from running time to capture time, ns
  GstClockTimeDiff ahead = 0;               ///< of its capture times, of the others'; not live; ns
  GstClockTime seen = GST_CLOCK_TIME_NONE;  ///< running time of its last buffer
  GstClockTime since = GST_CLOCK_TIME_NONE; ///< running time from which it has its state
  MuxState said = MuxState::kIn;            ///< the state that was told last

  /* the element's lock */
  MuxState state = MuxState::kIn;
  guint64 views = 0; ///< bits by view-id, for statistics
  guint64 received = 0, late = 0, out_of_step = 0, left_out = 0, matched = 0;
  GstClockTimeDiff last_skew = 0; ///< ns behind the oldest of its frame set
  GstClockTimeDiff offset = 0;    ///< ns, capture time ahead of the pipeline's clock as it came
};

using MuxPads = std::vector<std::shared_ptr<MuxPad>>;

/** What the frame sets of the chosen streams are. */
struct MuxFormat {
  bool coded = false;
  gstrange::RangeInfo info;
};

/** Chooses the streams that make up frame sets: as many as agree on raw or coded, with each view-id
 *  once and no more pixels than a rig may have. Those that were chosen before and still come go
 *  first, so that two hosts with one view-id do not take turns. Sets `chosen` and `clash` of each.
 *  @param strict  the first stream that has to be left out is an error, which is returned */
rangecast::Status choose_streams (const MuxPads &pads, bool strict, MuxFormat &format);

/** Whether the views of a stream are cameras of this rig, in the same places. The rig may hold
 * range views or stereo pairs, of other sizes of the same shape, too.
 *  @return kBadValue that says what differs */
rangecast::Status check_rig (const rangecast::Rig &stream, const rangecast::Rig &expected);
