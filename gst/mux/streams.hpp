/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstaggregator.h>

#include <atomic>
#include <gstrange/gstrangeinfo.hpp>
#include <memory>
#include <string>
#include <vector>

#include "common/matcher.hpp"
#include "common/statsreporter.hpp"

G_BEGIN_DECLS

/* Sink pad of rangemux, with the properties view-id-offset, x, y, z and yaw. */
#define GST_TYPE_RANGE_MUX_PAD (gst_range_mux_pad_get_type ())
G_DECLARE_FINAL_TYPE (GstRangeMuxPad, gst_range_mux_pad, GST, RANGE_MUX_PAD, GstAggregatorPad)

G_END_DECLS

/** Renumbers and moves the views of a stream as the pad's properties say. @return view-id-offset */
int place_rig (GstRangeMuxPad *pad, rangecast::Rig &rig);

/** Whether a stream's buffers become part of frame sets, and why not. */
enum class StreamState {
  kIn,
  kSilent,    ///< no buffers for kSilentAfter
  kLate,      ///< its buffers arrive after their frame sets were pushed
  kOutOfSync, ///< its capture times are of another clock
  kClash,     ///< other streams have its view-id, or another format
  kOtherRig,  ///< its cameras are not those of the property `rig`
};

/** A stream without buffers for so long is silent: frame sets and caps are made without it. */
inline constexpr GstClockTime kSilentAfter = 2 * GST_SECOND;

/** A sink pad of rangemux and its stream. `time` is the capture time. */
struct MuxStream : PadStream {
  explicit MuxStream (GstAggregatorPad *p) { pad = GST_AGGREGATOR_PAD (gst_object_ref (p)); }
  ~MuxStream ()
  {
    release ();
    gst_object_unref (pad);
  }
  MuxStream (const MuxStream &) = delete;

  /** Resets everything but the pad. */
  void reset ();
  /** "pad sink_1 (view 1)" */
  [[nodiscard]] std::string title () const;

  /* under the element's lock */
  [[nodiscard]] GstStructure *stats () const; ///< transfer full
  /** @param frames  of the element: `lost` counts those that the stream is missing from, also
   *  before its first buffer */
  [[nodiscard]] StatsRow row (guint64 frames) const;

  /* streaming thread */
  bool has_caps = false, coded = false;
  gstrange::RangeInfo info;                 ///< moved as the pad's properties say
  rangecast::Status other_rig;              ///< how it differs from the property `rig`
  rangecast::Status clash;                  ///< why it is not chosen
  bool chosen = false;                      ///< by choose_streams()
  bool alive = false;                       ///< not silent
  bool in_sync = true;                      ///< live: its capture times are of the right clock
  bool late = false;                        ///< the frame at its head is
  int late_in_row = 0;                      ///< such frames since the last frame set
  bool shift_known = false;                 ///< `shift` is valid
  GstClockTimeDiff shift = 0;               ///< capture time - running time of its last buffer, ns
  GstClockTime seen = GST_CLOCK_TIME_NONE;  ///< running time of its last buffer
  GstClockTime since = GST_CLOCK_TIME_NONE; ///< running time at which it got its state
  StreamState reported = StreamState::kIn;  ///< the state that was reported last

  /* the element's lock */
  StreamState state = StreamState::kIn;
  guint64 views = 0; ///< bits by view-id, for statistics
  guint64 received = 0, dropped_late = 0, out_of_sync = 0, skipped = 0, matched = 0;
  GstClockTimeDiff skew = 0; ///< capture time - the oldest of its frame set, ns

  /* any thread */
  std::atomic<int> id_offset = 0;           ///< what was added to its view-ids
  std::atomic<GstClockTimeDiff> offset = 0; ///< live: capture time - pipeline clock on arrival, ns
};

using MuxStreams = std::vector<std::shared_ptr<MuxStream>>;

/** Checks that the views of a stream are cameras of the expected rig, with the same pose and focal
 *  length. The expected rig may hold range views or stereo pairs, also of other image sizes with
 *  the same aspect ratio.
 *  @return kBadValue that names the difference */
rangecast::Status check_rig (const rangecast::Rig &stream, const rangecast::Rig &expected);

/** Chooses the streams that make up frame sets: those of the format of the first one, raw or coded,
 *  with each view-id once and at most kMaxRigPixels. Streams that were chosen before and are alive
 *  have priority, so that two hosts with the same view-id do not alternate. Sets `chosen` and
 *  `clash` of each.
 *  @param strict  return an error for the first stream that has to be skipped
 *  @param[out] info, caps  of the frame sets; caps are transfer full, null if no stream is left */
rangecast::Status choose_streams (
    const MuxStreams &streams, bool strict, gstrange::RangeInfo &info, GstCaps *&caps);

/** Nick for statistics and messages. */
const char *name_of (StreamState state);

/** Posts a warning for the user, and an element message `rangemux-stream` for the application. Call
 *  it without locks.
 *  @param offset  of its capture times to the others', ns */
void report_state (
    GstElement *element, MuxStream &stream, StreamState state, GstClockTimeDiff offset);
