/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstaggregator.h>
#include <gst/video/video.h>

#include <atomic>
#include <optional>

/** Pairs the buffers of two sink pads of an aggregator by running time, and announces downstream
 *  the times without pairs. Streaming thread. All times are running times in ns; each dropped
 *  buffer is logged with its reason. */
class PairMatcher {
public:
  PairMatcher (GstAggregatorPad *first, GstAggregatorPad *second, GstDebugCategory *category)
      : pads_{first, second}, category_ (category)
  {
  }

  struct Pair {
    GstBuffer *first = nullptr;  ///< transfer full
    GstBuffer *second = nullptr; ///< transfer full
    bool discont = false;        ///< it, or what was dropped before it, has the flag DISCONT
  };

  /** Takes the next pair off the pads. Buffers whose running times differ by no more than
   *  gstrange::pairing_tolerance() are a pair; of two that differ more, the older one is dropped
   *  and counted. Buffers without PTS are paired in order of arrival. A GAP on one pad drops (and
   *  counts) the buffers of the other pad during that time. In a live pipeline, of two that differ
   *  by more than 10 s the newer one is dropped if it is that far ahead of the clock, too, but not
   *  more than five in a row; the first of those is a warning message.
   *  @param frame_duration  ns, or GST_CLOCK_TIME_NONE
   *  @return GST_FLOW_OK with a pair, GST_FLOW_EOS once one pad has ended,
   *          GST_AGGREGATOR_FLOW_NEED_DATA while one pad has no buffer */
  GstFlowReturn pop_pair (GstClockTime frame_duration, Pair &pair);

  /** A buffer is about to be pushed. Both times may be GST_CLOCK_TIME_NONE. */
  void record_output (GstClockTime running_time, GstClockTime duration);

  /** Takes the time without pairs that pop_pair() has found since the last call, from the end of
   *  the output so far.
   *  @param until  running time of the next pair, or GST_CLOCK_TIME_NONE
   *  @return false if there is none */
  bool pop_gap (GstClockTime until, GstClockTime &begin, GstClockTime &end);

  /** Pushes a GAP event, preceded by the segment if that was not sent yet. Caps must have been
   *  sent. */
  void push_gap (GstAggregator *aggregator, GstClockTime begin, GstClockTime end);

  /** Buffers dropped since reset(). Any thread. */
  [[nodiscard]] guint64 dropped_first () const { return dropped_[0]; }
  [[nodiscard]] guint64 dropped_second () const { return dropped_[1]; }

  /** After a flush. */
  void flush ();
  void reset ();

private:
  struct Front;

  bool is_far_ahead (const Front &front, const Front &other, int side) const;
  void warn_far_ahead (const Front &front, int side);
  void drop (const Front (&fronts)[2], int side, GstClockTime tolerance);

  GstAggregatorPad *pads_[2];
  GstDebugCategory *category_;
  std::atomic<guint64> dropped_[2] = {0, 0};
  GstClockTime gap_begin_ = GST_CLOCK_TIME_NONE, gap_end_ = 0; /* NONE: no gap found */
  GstClockTime output_end_ = 0;
  bool segment_sent_ = false;
  int far_ahead_[2] = {0, 0}; /* dropped for that since the last pair */
  bool warned_far_ahead_ = false;
  bool discont_ = false; /* of the buffers dropped since the last pair */
};

/** Takes the buffer of a further pad that belongs to a pair. Older ones are dropped and logged; a
 *  buffer without PTS belongs to any pair.
 *  @param running_time  of the pair, ns, or GST_CLOCK_TIME_NONE
 *  @param tolerance     gstrange::pairing_tolerance()
 *  @param timeout       true: do not wait for a buffer that has not arrived
 *  @param dropped       is increased by the number of dropped buffers, without GAPs
 *  @param[out] buffer   transfer full; null if it was lost or the pad has ended
 *  @return GST_FLOW_OK, or GST_AGGREGATOR_FLOW_NEED_DATA while it may still arrive */
GstFlowReturn pop_companion (GstAggregatorPad *pad, GstDebugCategory *category,
    GstClockTime running_time, GstClockTime tolerance, bool timeout, guint64 &dropped,
    GstBuffer **buffer);

/** Logs that a pad has no frame; for get_next_time(), which GstAggregator calls before it waits.
 *  aggregate() is not called without a frame on every pad, unless live. */
void log_waiting (GstDebugCategory *category, GstAggregatorPad *pad);

/** Reads and logs a pad's caps event. @return std::nullopt if the caps are not valid video caps */
std::optional<GstVideoInfo> parse_caps_event (
    GstDebugCategory *category, GstAggregatorPad *pad, GstEvent *event);

/** Frame duration of a pad's caps, ns; GST_CLOCK_TIME_NONE if there are none or the rate is
 *  unknown. */
GstClockTime frame_duration (const std::optional<GstVideoInfo> &info);

/** Adds the always pad of this name from its template; for instance_init.
 *  @return transfer none */
GstAggregatorPad *add_sink_pad (GstElement *aggregator, const char *name);
