/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-rangemux
 * @title: rangemux
 *
 * Combines the views of several streams, all raw or all coded, into frame sets by capture time. In
 * a live pipeline it waits for late streams up to #GstAggregator:latency, continues without streams
 * that are gone and includes them again when they return. Frame sets of up to 16 memories share
 * them without copying; of more, the first 15 are shared and the others copied once.
 *
 * Recordings that begin at different times are aligned by capture time, independently of their PTS.
 *
 * With #GstRangeMux:clock-port it publishes the pipeline clock, so that all camera hosts can
 * trigger simultaneously.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 rangemux name=m ! rangealign ! cylinderfilter ! plyenc ! multifilesink location=cloud-%05d.ply
 * avatartestsrc view-id=0 num-buffers=10 ! m. avatartestsrc view-id=1 num-buffers=10 ! m.
 * ]|
 *
 * Since: 0.1
 */
/* What happens to a buffer, in the order of this file; all of it in aggregate(), in the streaming
 * thread:
 *  1. It waits at its pad: WaitingBuffers.
 *  2. Its stream is chosen for frame sets, or left out: update_streams(), negotiate().
 *  3. Its capture time is compared with those of the other streams: compare_clocks() if live,
 *     compare_recordings() if not. Of recordings that have begun again, it waits for the others.
 *  4. It is dropped if no frame set can contain it, because it is late, out of sync or of a stream
 *     that is left out: drop_unusable().
 *  5. It waits for buffers of the other streams, until the deadline; then it is joined with those
 *     within max-skew of the oldest one, and pushed: join_matching(), push_frame_set().
 * make_frame_set() does these steps in order, and decides whether to wait.
 *
 * Locking: the private lock guards what application threads read; it is never held across a push,
 * message or call into GstAggregator. The clock publisher and the statistics have their own. */
#include "gstrangemux.h"

#include <algorithm>
#include <atomic>
#include <gstrange/gstrangeinfo.hpp>
#include <gstrange/gstrangemeta.h>
#include <gstrange/gstrangepairing.hpp>
#include <gstrange/gstrangestatus.hpp>
#include <mutex>
#include <rangecast/rigfile/rig_file.hpp>
#include <string>
#include <vector>

#include "clockconsensus.hpp"
#include "clockpublisher.hpp"
#include "common/downstream.hpp"
#include "common/properties.hpp"
#include "common/statsreporter.hpp"
#include "frameset.hpp"
#include "recordings.hpp"
#include "rigcheck.hpp"
#include "streams.hpp"
#include "waitingbuffers.hpp"

using rangecast::Status;
using rangecast::StatusCode;

GST_DEBUG_CATEGORY_STATIC (gst_range_mux_debug);
#define GST_CAT_DEFAULT gst_range_mux_debug

enum : guint { PROP_STATS = 1, PROP_STATS_INTERVAL, PROP_SETTINGS };

namespace {

/* States that last as long are reported; the backlog of a host that paused is not. */
constexpr GstClockTime kMinReportTime = GST_SECOND;
/* Of the capture times in a frame set, if the frame rate is unknown. */
constexpr GstClockTime kDefaultTolerance = 5 * GST_MSECOND;

struct Settings {
  GstClockTime max_skew = 0; /* 0: half a frame period */
  int clock_port = ClockPublisher::kOff;
  std::string rig_file;
};

/* Frame sets since start: pushed, and of these with a buffer of every pad. */
struct Counters {
  guint64 frames = 0, complete = 0;
};

} // namespace

struct GstRangeMuxPrivate {
  std::mutex lock; /* guards what follows, and members of MuxStream */
  Settings settings;
  MuxStreams streams; /* by time of request */
  Counters counters;

  /* any thread; have locks of their own */
  ClockPublisher clock;
  StatsReporter reporter;
  std::atomic<bool> caps_dirty = true; /* choose_streams() is to run again */

  /* streaming thread only; vectors are kept for their memory */
  bool live = false;
  rangecast::Rig rig;         /* of settings.rig_file; empty: any */
  MuxStreams current_streams; /* see CurrentStreams */
  WaitingBuffers waiting;
  ClockConsensus consensus;
  std::vector<ClockConsensus::Stream> clock_offsets;
  std::vector<MuxStream *> offset_streams; /* in the order of clock_offsets */
  Recordings recordings;
  FrameSetJoiner joiner;
  GstClockTime oldest_running = GST_CLOCK_TIME_NONE; /* of the buffers that wait */
  GstClockTime frame_duration = GST_CLOCK_TIME_NONE;
  FrameTimes last; /* of the last frame set */
};

struct _GstRangeMux {
  GstAggregator parent;
  GstRangeMuxPrivate *priv;
};

#define MUX_CAPS                                                                                   \
  GST_RANGE_CAPS "; " GST_NEIGHBOUR_CODE_MEDIA_TYPE                                                \
                 ", version = (int) 3, alignment = (string) access-unit, " GST_RANGE_SIZE_CAPS_

static GstStaticPadTemplate sink_template =
    GST_STATIC_PAD_TEMPLATE ("sink_%u", GST_PAD_SINK, GST_PAD_REQUEST, GST_STATIC_CAPS (MUX_CAPS));
static GstStaticPadTemplate src_template =
    GST_STATIC_PAD_TEMPLATE ("src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS (MUX_CAPS));

G_DEFINE_TYPE (GstRangeMux, gst_range_mux, GST_TYPE_AGGREGATOR)
GST_ELEMENT_REGISTER_DEFINE (rangemux, "rangemux", GST_RANK_NONE, GST_TYPE_RANGE_MUX)

/* ---- 1. buffers at the pads ---- */

namespace {

/* References to the streams of all pads. For the streaming thread: allocates nothing. */
class CurrentStreams {
public:
  explicit CurrentStreams (GstRangeMuxPrivate *priv) : streams_ (priv->current_streams)
  {
    std::lock_guard guard (priv->lock);
    streams_ = priv->streams;
  }
  ~CurrentStreams () { streams_.clear (); } /* frees those whose pads were released */
  CurrentStreams (const CurrentStreams &) = delete;
  const MuxStreams &operator* () const { return streams_; }

private:
  MuxStreams &streams_;
};

} // namespace

/* Removes the next buffer of a stream: priv->waiting has a reference. */
static void
drop_buffer (GstRangeMuxPrivate *priv, MuxStream &stream)
{
  if (stream.held) {
    gst_clear_buffer (&stream.held); /* was counted */
    return;
  }
  gst_aggregator_pad_drop_buffer (stream.pad);
  std::lock_guard guard (priv->lock);
  stream.received++;
}

/* Takes buffers from their pads that may have a damaged capture time: the next ones will tell.
 * @return whether any */
static bool
hold_unsure (GstRangeMuxPrivate *priv)
{
  bool any = false;
  for (const WaitingBuffer &w : priv->waiting.next_round) {
    MuxStream &stream = *w.stream;
    if (!stream.round.unsure || stream.held)
      continue;
    drop_buffer (priv, stream);
    stream.held = gst_buffer_ref (w.buffer);
    stream.held_capture = w.capture;
    stream.held_running = w.running;
    any = true;
  }
  return any;
}

/* ---- 2. which streams make up frame sets; caps with the union of their rigs ---- */

static void
report (GstRangeMux *self, MuxStream &stream, StreamState state)
{
  GstRangeMuxPrivate *priv = self->priv;
  GST_INFO_OBJECT (self, "%s is %s", stream.title ().c_str (), name_of (state));
  GstClockTimeDiff offset = stream.ahead;
  if (priv->live)
    offset = stream.offset_known ? stream.offset - priv->consensus.reference () : 0;
  report_state (GST_ELEMENT (self), stream, state, offset, priv->live);
}

/* Sets a stream's state, and reports it when it changes: kLate and kOutOfSync once they have lasted
 * kMinReportTime.
 * @param running  of the buffer that shows the state, or GST_CLOCK_TIME_NONE */
static void
set_state (GstRangeMux *self, MuxStream &stream, StreamState state, GstClockTime running)
{
  GstRangeMuxPrivate *priv = self->priv;
  if (state != stream.state) {
    std::lock_guard guard (priv->lock);
    stream.state = state;
    stream.since = running;
  }
  if (state == stream.reported)
    return;
  const bool lasts = GST_CLOCK_TIME_IS_VALID (running) && GST_CLOCK_TIME_IS_VALID (stream.since) &&
                     running >= stream.since + kMinReportTime;
  if (!lasts && (state == StreamState::kLate || state == StreamState::kOutOfSync))
    return;
  report (self, stream, state);
}

/* Reports streams that have ended and of which all buffers were dropped, in less than
 * kMinReportTime. */
static void
report_all_dropped (GstRangeMux *self, const MuxStreams &streams)
{
  for (const auto &stream : streams)
    if (stream->received > 0 && stream->late + stream->out_of_sync == stream->received &&
        stream->reported == StreamState::kIn && gst_aggregator_pad_is_eos (stream->pad))
      report (self, *stream, stream->state);
}

/* Finds which streams are silent: those without a buffer whose last one is much older than the
 * oldest buffer that waits, so that a stream whose times jump silences no other. The streams are
 * chosen again when one becomes silent or returns: one that clashed with it may take its place. */
static void
update_streams (GstRangeMux *self, const MuxStreams &streams)
{
  GstRangeMuxPrivate *priv = self->priv;
  GstClockTime now = GST_CLOCK_TIME_NONE; /* the greatest number there is */
  for (const auto &stream : streams)
    stream->waits = false;
  for (const auto *buffers : {&priv->waiting.list, &priv->waiting.gaps, &priv->waiting.next_round})
    for (const WaitingBuffer &w : *buffers) {
      w.stream->waits = true;
      if (!GST_CLOCK_TIME_IS_VALID (w.running))
        continue;
      w.stream->seen = w.running;
      now = std::min (now, w.running);
    }
  priv->oldest_running = now;
  if (!GST_CLOCK_TIME_IS_VALID (now))
    return;
  for (const auto &stream : streams) {
    if (!GST_CLOCK_TIME_IS_VALID (stream->seen))
      stream->seen = now; /* it has not begun yet */
    const bool alive = stream->waits || now <= stream->seen || now - stream->seen <= kSilentAfter;
    if (alive != stream->alive)
      priv->caps_dirty = true;
    stream->alive = alive;
    if (!alive && priv->live && !gst_aggregator_pad_is_eos (stream->pad))
      set_state (self, *stream, StreamState::kSilent, now);
  }
}

static GstFlowReturn
negotiate (GstRangeMux *self, const MuxStreams &streams)
{
  GstRangeMuxPrivate *priv = self->priv;
  MuxFormat format;
  const Status status = choose_streams (streams, !priv->live, format);
  if (const GstFlowReturn flow = gst_range_flow_return (GST_ELEMENT (self), status);
      flow != GST_FLOW_OK)
    return flow;
  for (const auto &stream : streams)
    if (stream->alive && (!stream->other_rig.ok () || !stream->clash.ok ()))
      set_state (self, *stream, stream->clash.ok () ? StreamState::kOtherRig : StreamState::kClash,
          priv->oldest_running);
  if (format.info.views () == 0)
    return GST_FLOW_OK; /* no stream is left */
  GstCaps *caps = format.coded ? gstrange::make_neighbour_code_caps (format.info, "access-unit")
                               : gstrange::make_range_caps (format.info);
  GST_INFO_OBJECT (self, "%d views: %" GST_PTR_FORMAT, format.info.views (), caps);
  gst_aggregator_set_src_caps (GST_AGGREGATOR (self), caps);
  gst_caps_unref (caps);
  priv->frame_duration = format.info.frame_duration ();
  priv->reporter.set_views (format.info.rig);
  return GST_FLOW_OK;
}

/* ---- 3. streams with capture times of the same clock, recordings of the same time ---- */

/* Live: compares offsets of capture times from the pipeline clock, which takes no buffers of other
 * streams to wait for. */
static void
compare_clocks (GstRangeMux *self, const MuxStreams &streams)
{
  GstRangeMuxPrivate *priv = self->priv;
  const GstClockTime base = gst_element_get_base_time (GST_ELEMENT (self));
  for (const WaitingBuffer &w : priv->waiting.list)
    if (GST_CLOCK_TIME_IS_VALID (w.running)) {
      std::lock_guard guard (priv->lock);
      w.stream->offset = ClockConsensus::offset_of (w.capture, base + w.running);
      w.stream->offset_known = true;
    }
  priv->clock_offsets.clear ();
  priv->offset_streams.clear ();
  for (const auto &stream : streams)
    if (stream->chosen && stream->alive && stream->offset_known) {
      priv->clock_offsets.push_back ({stream->offset});
      priv->offset_streams.push_back (stream.get ());
    }
  if (priv->consensus.update (priv->clock_offsets)) {
    GST_DEBUG_OBJECT (self, "most streams have another clock now: its offset is %" GST_STIME_FORMAT,
        GST_STIME_ARGS (priv->consensus.reference ()));
    priv->last.capture = GST_CLOCK_TIME_NONE; /* a time of the other clock */
  }
  for (std::size_t i = 0; i < priv->offset_streams.size (); i++)
    priv->offset_streams[i]->in_sync = priv->clock_offsets[i].in_sync;
}

/* Not live: compares capture times. */
static void
compare_recordings (GstRangeMux *self)
{
  GstRangeMuxPrivate *priv = self->priv;
  if (priv->recordings.compare (priv->waiting, priv->last.capture)) {
    GST_DEBUG_OBJECT (self, "the recordings have begun again");
    priv->last.capture = GST_CLOCK_TIME_NONE;
  }
  if (const WaitingBuffer *w = Recordings::find_different_time (priv->waiting)) {
    w->stream->different_time_reported = true;
    set_state (self, *w->stream, StreamState::kDifferentTime, w->running);
  }
}

/* Not live: reports recordings that have ended without a frame set in common with another. */
static void
report_unmatched (GstRangeMux *self, const MuxStreams &streams)
{
  while (MuxStream *unmatched = Recordings::find_unmatched (streams)) {
    unmatched->different_time_reported = true;
    unmatched->ahead = 0;
    set_state (self, *unmatched, StreamState::kDifferentTime, GST_CLOCK_TIME_NONE);
  }
}

/* ---- 4. buffers that no frame set can contain ---- */

/* Maximum difference of the capture times of a frame set, ns. */
static GstClockTime
matching_tolerance (GstRangeMuxPrivate *priv)
{
  std::lock_guard guard (priv->lock);
  if (priv->settings.max_skew > 0)
    return priv->settings.max_skew;
  return GST_CLOCK_TIME_IS_VALID (priv->frame_duration) ? priv->frame_duration / 2
                                                        : kDefaultTolerance;
}

/* Drops gaps that end before the other streams' buffers; until then their streams are not waited
 * for. Without the running times of live streams the end of a gap in capture time is computed from
 * the stream's last buffer.
 * @return whether any was dropped */
static bool
drop_past_gaps (GstRangeMux *self, GstClockTime tolerance, bool timeout)
{
  GstRangeMuxPrivate *priv = self->priv;
  const WaitingBuffers &waiting = priv->waiting;
  if (waiting.list.empty () && waiting.missing > 0 && !timeout)
    return false;
  GstClockTime running = GST_CLOCK_TIME_NONE, capture = GST_CLOCK_TIME_NONE;
  for (const WaitingBuffer &w : waiting.list) {
    running = std::min (running, w.running);
    capture = std::min (capture, w.capture);
  }
  bool any = false;
  for (const WaitingBuffer &gap : waiting.gaps) {
    const GstClockTime end = gstrange::gap_end (gap.running, gap.buffer, tolerance);
    const bool by_capture = !priv->live && gap.stream->shift_known && GST_CLOCK_TIME_IS_VALID (end);
    const bool past =
        by_capture ? GST_CLOCK_DIFF (end, capture) > gap.stream->shift : running > end;
    if (!waiting.list.empty () && !past)
      continue;
    GST_LOG_OBJECT (gap.stream->pad, "gap until %" GST_TIME_FORMAT, GST_TIME_ARGS (end));
    gst_aggregator_pad_drop_buffer (gap.stream->pad);
    any = true;
  }
  return any;
}

/* Whether a frame set can contain a buffer, and why not. */
static StreamState
classify_buffer (const GstRangeMuxPrivate *priv, const WaitingBuffer &w, GstClockTime tolerance)
{
  if (!w.stream->chosen)
    return w.stream->other_rig.ok () ? StreamState::kClash : StreamState::kOtherRig;
  if (!w.stream->in_sync)
    return StreamState::kOutOfSync;
  const bool late =
      GST_CLOCK_TIME_IS_VALID (priv->last.capture) && w.capture <= priv->last.capture + tolerance;
  if (!priv->live && late && w.stream->round.went_back && priv->waiting.missing > 0)
    return StreamState::kIn; /* recordings begin again if the others' next buffers went back, too */
  return late ? StreamState::kLate : StreamState::kIn;
}

/* Here late views are dropped. @return whether any was dropped */
static bool
drop_unusable (GstRangeMux *self, GstClockTime tolerance)
{
  GstRangeMuxPrivate *priv = self->priv;
  bool any = false;
  for (const WaitingBuffer &w : priv->waiting.list) {
    MuxStream &stream = *w.stream;
    const StreamState state = classify_buffer (priv, w, tolerance);
    if (state == StreamState::kIn)
      continue;
    GST_DEBUG_OBJECT (stream.pad,
        "dropping a buffer: %s; capture time %" GST_TIME_FORMAT
        ", last frame set %" GST_TIME_FORMAT,
        name_of (state), GST_TIME_ARGS (w.capture), GST_TIME_ARGS (priv->last.capture));
    any = true;
    if (state == StreamState::kLate && !priv->live)
      stream.ahead = GST_CLOCK_DIFF (priv->last.capture, w.capture);
    drop_buffer (priv, stream);
    {
      std::lock_guard guard (priv->lock);
      switch (state) {
        case StreamState::kLate:
          stream.late++;
          break;
        case StreamState::kOutOfSync:
          stream.out_of_sync++;
          break;
        default:
          stream.left_out++;
      }
    }
    set_state (self, stream, state, w.running);
  }
  return any;
}

/* ---- 5. one frame set: buffers are joined and pushed ---- */

namespace {
/* The buffers of one frame set. */
struct Match {
  std::size_t streams = 0;
  FrameTimes times; /* running time: of the oldest buffer by that */
  double speed = 1; /* of that one, see speed_of() */
};
} // namespace

/* Takes the buffers from their pads whose capture time is within the tolerance of the oldest one,
 * `first`, and gives them to the joiner. */
static Match
join_matching (GstRangeMux *self, GstClockTime first, GstClockTime tolerance)
{
  GstRangeMuxPrivate *priv = self->priv;
  const auto matches = [&] (const WaitingBuffer &w) { return w.capture <= first + tolerance; };
  guint memories = 0;
  Match match;
  match.times.capture = first;
  for (const WaitingBuffer &w : priv->waiting.list)
    if (matches (w)) {
      memories += gst_buffer_n_memory (w.buffer);
      match.streams++;
    }
  priv->joiner.begin (memories, priv->waiting.list.front ().stream->coded);
  for (const WaitingBuffer &w : priv->waiting.list) {
    if (!matches (w))
      continue;
    MuxStream &stream = *w.stream;
    if (w.running < match.times.running) { /* NONE is the greatest number there is */
      match.times.running = w.running;
      match.speed = speed_of (w);
    }
    drop_buffer (priv, stream);
    if (!priv->joiner.add (w.buffer)) {
      GST_DEBUG_OBJECT (stream.pad, "dropping a buffer with the view-id of another pad");
      if (!stream.clash_reported)
        gst_range_post_warning (GST_ELEMENT (self),
            {StatusCode::kBadValue, "pad " + std::string (GST_PAD_NAME (stream.pad)) +
                                        ": its buffers have view-ids of another pad; dropped"});
      stream.clash_reported = true;
    }
    stream.round.add (w);
    stream.matched_others = stream.matched_others || match.streams > 1;
    set_state (self, stream, StreamState::kIn, w.running);
    std::lock_guard guard (priv->lock);
    stream.matched++;
    stream.last_skew = GST_CLOCK_DIFF (first, w.capture);
  }
  return match;
}

/* Running times of live streams can be compared; those of recordings follow the capture times. */
static GstClockTime
output_running_time (const GstRangeMuxPrivate *priv, const Match &match)
{
  if (!priv->live)
    return running_time_after (priv->last, match.times, match.speed);
  if (GST_CLOCK_TIME_IS_VALID (match.times.running) && GST_CLOCK_TIME_IS_VALID (priv->last.running))
    return std::max (match.times.running, priv->last.running); /* never backwards */
  return match.times.running;
}

/* @param streams  of a complete frame set */
static GstFlowReturn
push_frame_set (GstRangeMux *self, std::size_t streams, GstClockTime tolerance)
{
  GstRangeMuxPrivate *priv = self->priv;
  GstClockTime first = GST_CLOCK_TIME_NONE; /* the greatest number there is */
  for (const WaitingBuffer &w : priv->waiting.list)
    first = std::min (first, w.capture);
  const Match match = join_matching (self, first, tolerance);
  GstBuffer *frame_set = nullptr;
  const Status status = priv->joiner.finish (frame_set);
  if (const GstFlowReturn flow = gst_range_flow_return (GST_ELEMENT (self), status);
      flow != GST_FLOW_OK)
    return flow;
  const GstClockTime period =
      GST_CLOCK_TIME_IS_VALID (priv->frame_duration) ? priv->frame_duration : 2 * tolerance;
  priv->last = {first, output_running_time (priv, match), period};
  gstrange::stamp (
      GST_AGGREGATOR (self), frame_set, priv->last.running, priv->frame_duration, first);
  GST_LOG_OBJECT (
      self, "frame set of %zu of %zu streams: %" GST_PTR_FORMAT, match.streams, streams, frame_set);
  {
    std::lock_guard guard (priv->lock);
    priv->counters.frames++;
    priv->counters.complete += match.streams == streams;
  }
  priv->reporter.passed (GST_ELEMENT (self), frame_set);
  return gst_aggregator_finish_buffer (GST_AGGREGATOR (self), frame_set);
}

/* ---- all steps in order; wait or go ---- */

static GstFlowReturn
make_frame_set (GstRangeMux *self, const MuxStreams &streams, bool timeout)
{
  GstRangeMuxPrivate *priv = self->priv;
  const WaitingBuffers &waiting = priv->waiting;
  if (waiting.ended > 0)
    report_all_dropped (self, streams);
  if (waiting.ended > 0 && !priv->live)
    report_unmatched (self, streams);
  if (waiting.list.empty () && waiting.gaps.empty ()) {
    if (waiting.missing > 0 || waiting.ended == 0)
      return GST_AGGREGATOR_FLOW_NEED_DATA;
    priv->reporter.finish ();
    return GST_FLOW_EOS;
  }
  update_streams (self, streams);
  if (priv->caps_dirty.exchange (false))
    if (const GstFlowReturn flow = negotiate (self, streams); flow != GST_FLOW_OK)
      return flow;
  if (priv->live)
    compare_clocks (self, streams);
  else
    compare_recordings (self);
  if (!priv->live && hold_unsure (priv))
    return GST_AGGREGATOR_FLOW_NEED_DATA;
  const GstClockTime tolerance = matching_tolerance (priv);
  if (drop_past_gaps (self, tolerance, timeout) || drop_unusable (self, tolerance))
    return GST_AGGREGATOR_FLOW_NEED_DATA; /* GstAggregator looks at the pads again: the next buffers
                                             may be there already */
  if (waiting.list.empty () || (waiting.missing > 0 && !timeout)) {
    GST_LOG_OBJECT (self, "waiting for %d streams", waiting.missing);
    return GST_AGGREGATOR_FLOW_NEED_DATA;
  }
  return push_frame_set (self, streams.size (), tolerance);
}

static GstFlowReturn
gst_range_mux_aggregate (GstAggregator *aggregator, gboolean timeout)
{
  auto self = GST_RANGE_MUX (aggregator);
  GstRangeMuxPrivate *priv = self->priv;
  const CurrentStreams streams (priv);
  const bool live = gst_aggregator_get_latency (aggregator) != GST_CLOCK_TIME_NONE;
  if (live != priv->live)
    for (const auto &stream : *streams)
      stream->round = {};
  priv->live = live;
  priv->waiting.collect (*streams, priv->live);
  const GstFlowReturn flow = make_frame_set (self, *streams, timeout);
  priv->waiting.release ();
  return flow;
}

/* The deadline counts from the oldest buffer that waits; without one there is no deadline. */
static GstClockTime
gst_range_mux_get_next_time (GstAggregator *aggregator)
{
  GstClockTime oldest = GST_CLOCK_TIME_NONE;
  const CurrentStreams streams (GST_RANGE_MUX (aggregator)->priv);
  for (const auto &stream : *streams) {
    GstBuffer *buffer = gst_aggregator_pad_peek_buffer (stream->pad);
    if (!buffer)
      continue;
    if (!gstrange::is_gap (buffer))
      oldest = std::min (oldest, gstrange::running_time_of (stream->pad, buffer));
    gst_buffer_unref (buffer);
  }
  return oldest;
}

/* ---- caps of the streams, flush ---- */

static gboolean
handle_caps (GstRangeMux *self, MuxStream &stream, GstCaps *caps)
{
  gstrange::RangeInfo info;
  Status status = gstrange::parse_caps (caps, info);
  if (!status.ok ())
    status = {status.code (),
        "pad " + std::string (GST_PAD_NAME (stream.pad)) + ": " + status.message ()};
  if (gst_range_flow_return (GST_ELEMENT (self), status) != GST_FLOW_OK) {
    stream.clash = status;
    stream.reported = StreamState::kClash;
    return FALSE;
  }
  GST_INFO_OBJECT (stream.pad, "%" GST_PTR_FORMAT, caps);
  const rangecast::Rig &expected = self->priv->rig;
  stream.other_rig = expected.views.empty () ? Status{} : check_rig (info.rig, expected);
  stream.clash = {};
  stream.coded =
      gst_structure_has_name (gst_caps_get_structure (caps, 0), GST_NEIGHBOUR_CODE_MEDIA_TYPE);
  stream.info = std::move (info);
  stream.has_caps = true;
  self->priv->caps_dirty = true;
  std::lock_guard guard (self->priv->lock);
  stream.views = view_bits (stream.info.rig);
  return TRUE;
}

static std::shared_ptr<MuxStream>
find_stream (GstRangeMuxPrivate *priv, GstAggregatorPad *pad)
{
  std::lock_guard guard (priv->lock);
  const auto found =
      std::ranges::find (priv->streams, pad, [] (const auto &stream) { return stream->pad; });
  return found == priv->streams.end () ? nullptr : *found;
}

static gboolean
gst_range_mux_sink_event (GstAggregator *aggregator, GstAggregatorPad *pad, GstEvent *event)
{
  auto self = GST_RANGE_MUX (aggregator);
  if (GST_EVENT_TYPE (event) == GST_EVENT_CAPS) {
    GstCaps *caps;
    gst_event_parse_caps (event, &caps);
    const auto stream = find_stream (self->priv, pad);
    if (stream && !handle_caps (self, *stream, caps)) {
      gst_event_unref (event);
      return FALSE;
    }
  }
  return GST_AGGREGATOR_CLASS (gst_range_mux_parent_class)->sink_event (aggregator, pad, event);
}

static GstFlowReturn
gst_range_mux_update_src_caps (GstAggregator *, GstCaps *, GstCaps **)
{
  return GST_AGGREGATOR_FLOW_NEED_DATA; /* negotiate() sets them */
}

static GstFlowReturn
gst_range_mux_flush (GstAggregator *aggregator)
{
  GstRangeMuxPrivate *priv = GST_RANGE_MUX (aggregator)->priv;
  priv->last = {};
  priv->oldest_running = GST_CLOCK_TIME_NONE;
  priv->consensus.reset ();
  std::lock_guard guard (priv->lock);
  for (const auto &stream : priv->streams) {
    stream->offset_known = stream->shift_known = false;
    stream->seen = GST_CLOCK_TIME_NONE;
    stream->round = {};
    gst_clear_buffer (&stream->held);
  }
  return GST_FLOW_OK;
}

/* ---- request pads ---- */

/* The stream exists before the pad is added: a handler of pad-added may link it, and caps follow.
 */
static GstAggregatorPad *
gst_range_mux_create_new_pad (
    GstAggregator *aggregator, GstPadTemplate *pad_template, const gchar *name, const GstCaps *caps)
{
  GstRangeMuxPrivate *priv = GST_RANGE_MUX (aggregator)->priv;
  GstAggregatorPad *pad = GST_AGGREGATOR_CLASS (gst_range_mux_parent_class)
                              ->create_new_pad (aggregator, pad_template, name, caps);
  if (pad) {
    std::lock_guard guard (priv->lock);
    priv->streams.push_back (std::make_shared<MuxStream> (pad));
  }
  return pad;
}

static void
gst_range_mux_release_pad (GstElement *element, GstPad *pad)
{
  auto self = GST_RANGE_MUX (element);
  {
    std::lock_guard guard (self->priv->lock);
    std::erase_if (
        self->priv->streams, [&] (const auto &stream) { return GST_PAD (stream->pad) == pad; });
  }
  self->priv->caps_dirty = true; /* a stream that clashed with it may take its place */
  GST_ELEMENT_CLASS (gst_range_mux_parent_class)->release_pad (element, pad);
}

/* ---- the clock for other hosts ---- */

static bool
report_clock_error (GstRangeMux *self, const Status &status)
{
  if (!status.ok ())
    GST_ELEMENT_ERROR (self, RESOURCE, BUSY, ("%s", status.message ().c_str ()), (nullptr));
  return status.ok ();
}

static bool
publish_clock (GstRangeMux *self, int port)
{
  GstClock *clock = gst_element_get_clock (GST_ELEMENT (self));
  const Status status = self->priv->clock.start (port, clock);
  gst_clear_object (&clock);
  if (self->priv->clock.port () != ClockPublisher::kOff)
    g_object_notify (G_OBJECT (self), "clock-port"); /* 0 has become a number */
  return report_clock_error (self, status);
}

/* The pipeline selects its clock on the way to PLAYING, and may select another one later. */
static gboolean
gst_range_mux_set_clock (GstElement *element, GstClock *clock)
{
  auto self = GST_RANGE_MUX (element);
  report_clock_error (self, self->priv->clock.set_clock (clock));
  return GST_ELEMENT_CLASS (gst_range_mux_parent_class)->set_clock (element, clock);
}

/* ---- statistics, under the lock ---- */

static GstStructure *
make_stats (const GstRangeMuxPrivate *priv)
{
  const Counters &counters = priv->counters;
  guint64 late = 0, out_of_sync = 0, left_out = 0;
  for (const auto &stream : priv->streams) {
    late += stream->late;
    left_out += stream->left_out;
    out_of_sync += stream->out_of_sync;
  }
  GstStructure *stats = gst_structure_new ("application/x-rangemux-stats", "frames", G_TYPE_UINT64,
      counters.frames, "complete", G_TYPE_UINT64, counters.complete, "incomplete", G_TYPE_UINT64,
      counters.frames - counters.complete, "dropped-late", G_TYPE_UINT64, late, "out-of-step",
      G_TYPE_UINT64, out_of_sync, "left-out", G_TYPE_UINT64, left_out, nullptr);
  for (const auto &s : priv->streams) {
    GstStructure *of_pad = gst_structure_new ("pad", "received", G_TYPE_UINT64, s->received,
        "matched", G_TYPE_UINT64, s->matched, "late", G_TYPE_UINT64, s->late, "out-of-step",
        G_TYPE_UINT64, s->out_of_sync, "left-out", G_TYPE_UINT64, s->left_out, "skew", G_TYPE_INT64,
        gint64 (s->last_skew), "state", G_TYPE_STRING, name_of (s->state), "offset", G_TYPE_INT64,
        gint64 (s->offset), nullptr);
    gst_structure_set (stats, GST_PAD_NAME (s->pad), GST_TYPE_STRUCTURE, of_pad, nullptr);
    gst_structure_free (of_pad);
  }
  return stats;
}

/* A pad's `lost` counts the frame sets that its stream is missing from, also those before its first
 * buffer. */
static std::vector<StatsRow>
collect_stats (GstElement *element)
{
  GstRangeMuxPrivate *priv = GST_RANGE_MUX (element)->priv;
  std::lock_guard guard (priv->lock);
  const Counters &counters = priv->counters;
  std::vector<StatsRow> rows (1);
  guint64 late = 0;
  for (const auto &stream : priv->streams) {
    late += stream->late + stream->out_of_sync;
    rows.push_back ({.pad = GST_PAD_NAME (stream->pad),
        .counters = {.frames = stream->received,
            .lost = counters.frames - std::min (counters.frames, stream->matched),
            .late = stream->late + stream->out_of_sync},
        .views = stream->views});
  }
  rows[0].counters = {
      .frames = counters.frames, .lost = counters.frames - counters.complete, .late = late};
  return rows;
}

/* ---- states, properties ---- */

static gboolean
gst_range_mux_start (GstAggregator *aggregator)
{
  auto self = GST_RANGE_MUX (aggregator);
  GstRangeMuxPrivate *priv = self->priv;
  Settings settings;
  {
    std::lock_guard guard (priv->lock);
    settings = priv->settings;
  }
  priv->caps_dirty = true;
  priv->frame_duration = priv->oldest_running = GST_CLOCK_TIME_NONE;
  priv->last = {};
  priv->consensus.reset ();
  priv->rig = {};
  if (!settings.rig_file.empty ())
    if (Status s = rangecast::load_rig (settings.rig_file, priv->rig);
        gst_range_flow_return (GST_ELEMENT (self), s) != GST_FLOW_OK)
      return FALSE;
  if (!publish_clock (self, settings.clock_port))
    return FALSE;
  priv->reporter.start (GST_ELEMENT (aggregator), collect_stats);
  std::lock_guard guard (priv->lock);
  priv->counters = {};
  for (const auto &stream : priv->streams)
    stream->reset ();
  return TRUE;
}

static gboolean
gst_range_mux_stop (GstAggregator *aggregator)
{
  GstRangeMuxPrivate *priv = GST_RANGE_MUX (aggregator)->priv;
  priv->reporter.stop ();
  priv->clock.stop ();
  priv->joiner.drop ();
  std::lock_guard guard (priv->lock);
  for (const auto &stream : priv->streams)
    gst_clear_buffer (&stream->held);
  return TRUE;
}

static PropertyTable<Settings> &
mux_properties ()
{
  using P = PropertyTable<Settings>;
  static P table = {
      P::number<&Settings::max_skew> ("max-skew", "Maximum skew",
          "Maximum difference of the capture times within a frame set in nanoseconds (0 = half a "
          "frame period, or 5 ms if the frame rate is unknown)",
          0, G_MAXINT64, kMutablePlaying),
      P::number<&Settings::clock_port> ("clock-port", "Clock port",
          "UDP port on which to publish the pipeline clock for GstNetClientClock (-1 = do not "
          "publish, 0 = any free port, readable once published)",
          -1, 65535, kMutableReady),
      P::text<&Settings::rig_file> ("rig", "Rig",
          "Rig file that all streams must agree with; a stream with other cameras is left out when "
          "live, else it is an error (unset = no check)",
          kMutableReady),
  };
  return table;
}

static void
gst_range_mux_set_property (GObject *object, guint id, const GValue *value, GParamSpec *pspec)
{
  GstRangeMuxPrivate *priv = GST_RANGE_MUX (object)->priv;
  if (id == PROP_STATS_INTERVAL) /* without our lock: the reporter sets a timer */
    return priv->reporter.set_interval (g_value_get_uint (value));
  std::lock_guard guard (priv->lock);
  if (!mux_properties ().set (priv->settings, id, value))
    G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
}

static void
gst_range_mux_get_property (GObject *object, guint id, GValue *value, GParamSpec *pspec)
{
  GstRangeMuxPrivate *priv = GST_RANGE_MUX (object)->priv;
  std::lock_guard guard (priv->lock);
  if (id == PROP_STATS)
    return g_value_take_boxed (value, make_stats (priv));
  if (id == PROP_STATS_INTERVAL)
    return g_value_set_uint (value, priv->reporter.interval ());
  Settings settings = priv->settings;
  if (priv->clock.port () != ClockPublisher::kOff)
    settings.clock_port = priv->clock.port ();
  if (!mux_properties ().get (settings, id, value))
    G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
}

static void
gst_range_mux_finalize (GObject *object)
{
  delete GST_RANGE_MUX (object)->priv;
  G_OBJECT_CLASS (gst_range_mux_parent_class)->finalize (object);
}

static void
gst_range_mux_init (GstRangeMux *self)
{
  self->priv = new GstRangeMuxPrivate;
}

static void
gst_range_mux_class_init (GstRangeMuxClass *klass)
{
  auto object_class = G_OBJECT_CLASS (klass);
  auto element_class = GST_ELEMENT_CLASS (klass);
  auto aggregator_class = GST_AGGREGATOR_CLASS (klass);

  object_class->set_property = gst_range_mux_set_property;
  object_class->get_property = gst_range_mux_get_property;
  object_class->finalize = gst_range_mux_finalize;

  mux_properties ().install (object_class, PROP_SETTINGS);
  install_stats (object_class, PROP_STATS,
      "Counters since the element was started: frames, complete, incomplete, dropped-late, "
      "out-of-step, left-out, and a structure for each sink pad");
  StatsReporter::install (object_class, PROP_STATS_INTERVAL);

  gst_element_class_add_static_pad_template_with_gtype (
      element_class, &sink_template, GST_TYPE_AGGREGATOR_PAD);
  gst_element_class_add_static_pad_template_with_gtype (
      element_class, &src_template, GST_TYPE_AGGREGATOR_PAD);
  gst_element_class_set_static_metadata (element_class, "Range multiplexer", "Muxer/Video",
      "Combines the views of several range streams into frame sets by capture time",
      "gst-rangecast");

  element_class->release_pad = GST_DEBUG_FUNCPTR (gst_range_mux_release_pad);
  element_class->set_clock = GST_DEBUG_FUNCPTR (gst_range_mux_set_clock);

  aggregator_class->create_new_pad = GST_DEBUG_FUNCPTR (gst_range_mux_create_new_pad);
  aggregator_class->start = GST_DEBUG_FUNCPTR (gst_range_mux_start);
  aggregator_class->stop = GST_DEBUG_FUNCPTR (gst_range_mux_stop);
  aggregator_class->flush = GST_DEBUG_FUNCPTR (gst_range_mux_flush);
  aggregator_class->sink_event = GST_DEBUG_FUNCPTR (gst_range_mux_sink_event);
  aggregator_class->update_src_caps = GST_DEBUG_FUNCPTR (gst_range_mux_update_src_caps);
  aggregator_class->negotiate = GST_DEBUG_FUNCPTR (negotiate_downstream);
  aggregator_class->get_next_time = GST_DEBUG_FUNCPTR (gst_range_mux_get_next_time);
  aggregator_class->clip = GST_DEBUG_FUNCPTR (gstrange::clip_to_segment);
  aggregator_class->aggregate = GST_DEBUG_FUNCPTR (gst_range_mux_aggregate);

  GST_DEBUG_CATEGORY_INIT (gst_range_mux_debug, "rangemux", 0, "Range multiplexer");
}
