/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstaggregator.h>
#include <gst/video/video.h>

#include <array>
#include <atomic>
#include <optional>
#include <span>

/** A stream to be matched with others, and what waits at its head. Times may be of any clock, or
 *  numbers of triggers, as long as they are the same for all streams and increase. */
struct MatchStream {
  enum class Head {
    kMissing, ///< may still come
    kEnded,   ///< nothing will come, or what waits there is skipped
    kGap,     ///< nothing comes from `time` to `end`
    kFrame,
  };
  bool required = false; ///< there is no set without it
  Head head = Head::kMissing;
  GstClockTime time = GST_CLOCK_TIME_NONE; ///< NONE: belongs to any set
  GstClockTime end = GST_CLOCK_TIME_NONE;  ///< of a gap: the last time of a frame that it replaces
  bool in_set = false;                     ///< set by match_streams()
};

enum class MatchStep {
  kWait, ///< for streams that are missing
  kEnd,  ///< a required stream has ended, or all have
  kDrop, ///< the head of one stream: it has no partner, or is a gap that has passed
  kSet,  ///< the frames `in_set` belong together
};

/** Finds the next frames that belong together: the oldest one, and those that are later by no more
 *  than the tolerance.
 *  @param timeout  do not wait for streams that are missing
 *  @param[out] dropped  the stream, with kDrop */
MatchStep match_streams (std::span<MatchStream *const> streams, GstClockTime tolerance,
    bool timeout, MatchStream *&dropped);

/** A sink pad of an aggregator, and the buffer that waits there. */
struct PadStream : MatchStream {
  GstAggregatorPad *pad = nullptr;
  GstBuffer *buffer = nullptr; ///< a reference, from peek() to release()
  GstClockTime running = GST_CLOCK_TIME_NONE;

  /** Sets `buffer`, `running`, `head`, and `time` and `end` as running times. */
  void peek (GstClockTime tolerance);
  void release () { gst_clear_buffer (&buffer); }
};

/** Matches the images of two or three sink pads of an aggregator by running time, for the streaming
 *  thread. An image waits for its partners until they have an image or a GAP of a later time. In a
 *  live pipeline it waits no longer than kPatience beyond the element's latency, so that a source
 *  that feeds several pads is never blocked for good. Times in which images were dropped because of
 *  a GAP are announced downstream by GAP events. */
class FrameMatcher {
public:
  static constexpr GstClockTime kPatience = GST_SECOND / 2;
  static constexpr std::size_t kMaxPads = 3;

  /** @param names  of the sink pads; the first two are required, the third one may come and go */
  FrameMatcher (
      GstElement *element, GstDebugCategory *category, std::span<const char *const> names);
  ~FrameMatcher () { stop (); }
  FrameMatcher (const FrameMatcher &) = delete;
  FrameMatcher &operator= (const FrameMatcher &) = delete;

  /** Takes the next set off the pads.
   *  @return GST_FLOW_OK with a set, GST_FLOW_EOS once one of the first two pads has ended, else
   *          GST_AGGREGATOR_FLOW_NEED_DATA */
  GstFlowReturn next (GstClockTime tolerance, bool timeout);
  /** Of the set; null if that pad has none. Valid until the next call of next() or flush(). */
  [[nodiscard]] GstBuffer *buffer (std::size_t pad) const { return set_[pad]; }
  [[nodiscard]] GstClockTime running () const { return running_; } ///< of the set's first image
  /** An image of the set, or one that was dropped before it, has DISCONT, or one had no partner. */
  [[nodiscard]] bool discont () const { return discont_; }
  void release ();

  /** For get_next_time(). */
  [[nodiscard]] GstClockTime next_time ();
  /** Images without partner since start(). Any thread. */
  [[nodiscard]] guint64 dropped (std::size_t pad) const { return dropped_[pad]; }
  /** Pads have received caps: posts an error if one of the required pads is not linked, and has no
   *  caps, one second later. */
  void watch_links ();
  void start (); ///< resets the counters
  void flush ();
  void stop (); ///< keeps the counters

private:
  void peek (GstClockTime tolerance);
  void release_heads ();
  GstFlowReturn take_set (GstClockTime tolerance, bool timeout);
  void warn_unmatched (std::size_t index);
  void drop (std::size_t index, GstClockTime tolerance);
  void push_gap (GstClockTime begin, GstClockTime end);

  GstElement *element_;
  GstDebugCategory *category_;
  std::span<const char *const> names_;
  std::array<PadStream, kMaxPads> streams_;
  std::array<MatchStream *, kMaxPads> order_{};
  std::array<GstBuffer *, kMaxPads> set_{};
  std::array<std::atomic<guint64>, kMaxPads> dropped_{};
  GstClockTime running_ = GST_CLOCK_TIME_NONE, output_end_ = 0;
  bool discont_ = false, dropped_since_set_ = false, segment_sent_ = false;
  bool warned_unmatched_ = false;
  guint64 unmatched_ = 0; /* images dropped since the last set */
  GstClockID link_timer_ = nullptr;
};

/** Reads and logs a pad's caps event. @return std::nullopt if the caps are not valid video caps */
std::optional<GstVideoInfo> parse_caps_event (
    GstDebugCategory *category, GstAggregatorPad *pad, GstEvent *event);

/** For sink_event(): takes an event that begins a stream of bytes, as files are without a parser,
 * and posts an error. */
bool refuse_bytes (GstAggregatorPad *pad, GstEvent *event);

/** Drops the buffers that an aggregator has queued and refuses further ones with GST_FLOW_EOS until
 *  STREAM_START or FLUSH_STOP: after EOS, GstAggregator of GStreamer 1.26 no longer flushes its
 * sink pads, and upstream's threads would block. A buffer behind a queued event stays. For
 * aggregate(). */
void end_inputs (GstAggregator *aggregator);

/** An element's aggregate(), after whose GST_FLOW_EOS, downstream's too, its inputs end. */
template <GstFlowReturn (*kAggregate) (GstAggregator *, gboolean)>
GstFlowReturn
aggregate_to_the_end (GstAggregator *aggregator, gboolean timeout)
{
  const GstFlowReturn flow = kAggregate (aggregator, timeout);
  if (flow == GST_FLOW_EOS)
    end_inputs (aggregator);
  return flow;
}

/** Frame duration of a pad's caps, ns; GST_CLOCK_TIME_NONE if there are none or the rate is
 *  unknown. */
GstClockTime frame_duration (const std::optional<GstVideoInfo> &info);

/** Adds the always pad of this name from its template; for instance_init.
 *  @return transfer none */
GstAggregatorPad *add_sink_pad (GstElement *aggregator, const char *name);
