/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstaggregator.h>

#include <atomic>

#include "gstrange-prelude.h"

namespace gstrange {

/** How far the running times of buffers that belong together may lie apart, ns: half a frame, or 5
 * ms if the duration of frames is GST_CLOCK_TIME_NONE. */
GST_RANGE_API GstClockTime pairing_tolerance (GstClockTime frame_duration);

/** Pairs the buffers of two pads of one aggregator by running time; for the streaming thread. */
class GST_RANGE_API PairMatcher {
public:
  PairMatcher (GstAggregatorPad *first, GstAggregatorPad *second) : pads_{first, second} {}

  struct Pair {
    GstBuffer *first = nullptr;  ///< transfer full
    GstBuffer *second = nullptr; ///< transfer full
  };

  /** Takes the next pair. Buffers whose running times differ by no more than pairing_tolerance()
   *  belong together; the older of two that do not is dropped and counted. Buffers without PTS are
   *  paired as they come. A GAP drops, and counts, what the other pad has for the same time.
   *  @param frame_duration  ns, or GST_CLOCK_TIME_NONE
   *  @return GST_FLOW_OK with a pair, GST_FLOW_EOS once one pad has ended,
   *          GST_AGGREGATOR_FLOW_NEED_DATA while one pad has nothing */
  GstFlowReturn take (GstClockTime frame_duration, Pair &pair);

  /** The time, in running time, of which take() found since the last call that there will be no
   * pair because of GAPs.
   *  @return false if there is none */
  bool take_gap (GstClockTime &begin, GstClockTime &end);

  [[nodiscard]] guint64 dropped_first () const { return dropped_[0]; }
  [[nodiscard]] guint64 dropped_second () const { return dropped_[1]; }
  void reset ()
  {
    dropped_[0] = dropped_[1] = 0;
    gap_begin_ = GST_CLOCK_TIME_NONE;
  }

private:
  GstFlowReturn look (GstClockTime tolerance, int &drop);

  void note_gap (GstBuffer *dropped, GstClockTime time, GstClockTime tolerance);

  GstAggregatorPad *pads_[2];
  GstClockTime gap_begin_ = GST_CLOCK_TIME_NONE, gap_end_ = 0;
  std::atomic<guint64> dropped_[2] = {0, 0}; // also read by whoever asks for statistics
};

/** Takes from a further pad the buffer that belongs to a pair; older ones are dropped. A buffer
 *  without PTS is taken as it comes.
 *  @param running_time  of the pair, ns, or GST_CLOCK_TIME_NONE
 *  @param tolerance     pairing_tolerance()
 *  @param timeout       what is not there yet is not waited for
 *  @param dropped       gets the number of dropped buffers added, not counting GAPs
 *  @param[out] buffer   transfer full; null if it is lost, or the pad has ended
 *  @return GST_FLOW_OK, or GST_AGGREGATOR_FLOW_NEED_DATA while it may still come */
GST_RANGE_API GstFlowReturn take_companion (GstAggregatorPad *pad, GstClockTime running_time,
    GstClockTime tolerance, bool timeout, guint64 &dropped, GstBuffer **buffer);

/** Adds the always pad of that template and name to an aggregator; for instance_init.
 *  @return transfer none: the element owns it */
GST_RANGE_API GstAggregatorPad *add_sink_pad (GstElement *aggregator, const char *name);

/** Whether this is the empty buffer that GstAggregator makes of a GAP event. */
GST_RANGE_API bool is_gap (GstBuffer *buffer);

/** GstAggregator's clip: drops what lies wholly outside of the pad's segment, as the first frames
 *  after an accurate seek do. Pictures are not cut. */
GST_RANGE_API GstBuffer *clip_to_segment (
    GstAggregator *aggregator, GstAggregatorPad *pad, GstBuffer *buffer);

/** The last running time of a frame that a gap stands for, ns: the gap's end less the tolerance;
 *  one frame is in a gap without duration. */
GST_RANGE_API GstClockTime gap_end (
    GstClockTime running_time, GstBuffer *gap, GstClockTime tolerance);

/** Running time of a buffer on this pad, or GST_CLOCK_TIME_NONE. */
GST_RANGE_API GstClockTime running_time_of (GstAggregatorPad *pad, GstBuffer *buffer);

/** When a buffer was captured: what its GstReferenceTimestampMeta says; else, in a live pipeline,
 *  the clock time of its running time; else its running time. */
GST_RANGE_API GstClockTime capture_time_of (GstAggregatorPad *pad, GstBuffer *buffer, bool live);

/** Gives a combined buffer PTS and duration in the aggregator's output segment, which begins at
 *  the first buffer's running time, and its capture time.
 *  @param running_time  may be GST_CLOCK_TIME_NONE (no PTS) */
GST_RANGE_API void stamp (GstAggregator *aggregator, GstBuffer *buffer, GstClockTime running_time,
    GstClockTime duration, GstClockTime capture_time);

/** Tells downstream of an aggregator of times of which nothing will come, so that it does not wait
 *  for it. For the streaming thread. Running times, ns. */
class GST_RANGE_API GapSender {
public:
  /** A buffer goes out. Both may be GST_CLOCK_TIME_NONE. */
  void note_buffer (GstClockTime running_time, GstClockTime duration);
  /** Cuts off what has come out already. @return whether anything is left */
  bool cut (GstClockTime &begin, GstClockTime end) const;
  /** Sends a GAP, in front of it the segment if that did not go out yet; caps must have.
   *  @param cause  of that segment: its sequence number is that of this pad's */
  void push (
      GstAggregator *aggregator, GstAggregatorPad *cause, GstClockTime begin, GstClockTime end);
  /** After a flush, or at a start. */
  void reset () { *this = GapSender (); }

private:
  bool segment_sent_ = false;
  GstClockTime position_ = 0; /* where the output so far ends */
};

} // namespace gstrange
