/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstaggregator.h>

#include <gstrange/gstrangeinfo.hpp>
#include <memory>
#include <string>
#include <vector>

/** Whether a stream's buffers become part of frame sets, and why not. */
enum class StreamState {
  kIn,
  kSilent,        ///< no buffers for kSilentAfter
  kLate,          ///< its buffers arrive after their frame sets were pushed
  kOutOfSync,     ///< its capture times are of another clock
  kDifferentTime, ///< a recording of another time, or with another clock, than the others
  kClash,         ///< other streams have its view-id, or another format
  kOtherRig,      ///< its cameras are not those of the property `rig`
};

/** A stream without buffers for so long is silent: frame sets and caps are made without it. */
inline constexpr GstClockTime kSilentAfter = 2 * GST_SECOND;

struct WaitingBuffer;

/** Where a recording is in its round. All recordings begin a round together: when they are started,
 *  and each time all of them have begun again. */
struct RecordingRound {
  GstClockTime begin = GST_CLOCK_TIME_NONE;          ///< capture time of its first buffer
  GstClockTime newest = GST_CLOCK_TIME_NONE;         ///< greatest capture time in a frame set
  GstClockTime newest_running = GST_CLOCK_TIME_NONE; ///< running time of that buffer
  bool went_back = false; ///< the buffer at its pad is of the next round if all others' are
  bool over = false;      ///< the buffer at its pad is of the next round
  bool unsure = false;    ///< `over` is; the buffer after it tells whether its time is damaged
  bool damaged = false;   ///< the capture time of the buffer is; later ones go on

  void add (const WaitingBuffer &w);
};

/** A sink pad of rangemux and its stream. */
struct MuxStream {
  explicit MuxStream (GstAggregatorPad *p) : pad (GST_AGGREGATOR_PAD (gst_object_ref (p))) {}
  ~MuxStream ()
  {
    gst_clear_buffer (&held);
    gst_object_unref (pad);
  }
  MuxStream (const MuxStream &) = delete;

  /** Resets everything but the pad. */
  void reset ();
  /** "pad sink_1 (view 1)" */
  [[nodiscard]] std::string title () const;

  GstAggregatorPad *pad; ///< a reference

  /* streaming thread */
  bool has_caps = false, coded = false;
  gstrange::RangeInfo info;
  rangecast::Status other_rig;              ///< how it differs from the property `rig`
  rangecast::Status clash;                  ///< why it is not chosen
  bool chosen = false;                      ///< by choose_streams()
  bool alive = false;                       ///< not silent
  bool waits = false;                       ///< has a buffer at its pad
  bool clash_reported = false;              ///< of view-ids of buffers
  bool offset_known = false;                ///< `offset` is valid
  bool in_sync = true;                      ///< its capture times are of the clock of most streams
  bool shift_known = false;                 ///< `shift` is valid
  bool matched_others = false;              ///< was in a frame set with another stream
  bool different_time_reported = false;     ///< state kDifferentTime was reported
  GstClockTimeDiff shift = 0;               ///< capture time - running time of its last buffer, ns
  GstClockTimeDiff ahead = 0;               ///< recordings: capture time - that of the others, ns
  RecordingRound round;                     ///< not live
  GstClockTime seen = GST_CLOCK_TIME_NONE;  ///< running time of its last buffer
  GstClockTime since = GST_CLOCK_TIME_NONE; ///< running time at which it got its state
  StreamState reported = StreamState::kIn;  ///< the state that was reported last

  /** Its next buffer, taken from the pad to see the one after it; or nullptr. Streaming thread. */
  GstBuffer *held = nullptr;
  GstClockTime held_capture = GST_CLOCK_TIME_NONE, held_running = GST_CLOCK_TIME_NONE;

  /* the element's lock */
  StreamState state = StreamState::kIn;
  guint64 views = 0; ///< bits by view-id, for statistics
  guint64 received = 0, late = 0, out_of_sync = 0, left_out = 0, matched = 0;
  GstClockTimeDiff last_skew = 0; ///< capture time - the oldest of its frame set, ns
  GstClockTimeDiff offset = 0;    ///< capture time - pipeline clock as its buffer arrived, ns
};

using MuxStreams = std::vector<std::shared_ptr<MuxStream>>;

/** A buffer at a sink pad, or held. */
struct WaitingBuffer {
  MuxStream *stream;
  GstBuffer *buffer; ///< a reference
  GstClockTime capture, running;
  GstClockTime next_capture = GST_CLOCK_TIME_NONE; ///< of the buffer after one that is held
};

/** What the frame sets of the chosen streams are. */
struct MuxFormat {
  bool coded = false;
  gstrange::RangeInfo info;
};

/** Chooses the streams that make up frame sets: as many as agree on raw or coded, with each view-id
 *  once and at most kMaxRigPixels. Streams that were chosen before and are alive have priority, so
 *  that two hosts with the same view-id do not alternate. Sets `chosen` and `clash` of each.
 *  @param strict  return an error for the first stream that has to be left out */
rangecast::Status choose_streams (const MuxStreams &streams, bool strict, MuxFormat &format);

/** Nick for statistics and messages: "in", "silent", "late", "out-of-step", "apart", "clash",
 *  "other-rig". */
const char *name_of (StreamState state);

/** Posts a warning for the user, and an element message `rangemux-stream` for the application. Call
 *  it without locks.
 *  @param offset  of its capture times to the others', ns; not live and late: to that of the last
 *                 frame set */
void report_state (
    GstElement *element, MuxStream &stream, StreamState state, GstClockTimeDiff offset, bool live);
