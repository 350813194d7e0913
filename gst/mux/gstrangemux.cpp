/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-rangemux
 * @title: rangemux
 *
 * Combines the views of several streams, all raw or all coded, into frame sets by capture time. In
 * a live pipeline it waits for late streams up to #GstAggregator:latency, continues without streams
 * that are gone and includes them again when they return. Raw frame sets of up to 16 memories share
 * them without copying; of more, all are copied once. Coded ones are copied into an access unit
 * with the rig of all views.
 *
 * Recordings are aligned by capture time, independently of their PTS.
 *
 * With #GstRangeMux:clock-port it publishes the pipeline clock, so that all camera hosts can
 * trigger simultaneously.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 rangemux name=m ! rangealign ! cylinderfilter ! plyenc ! \
 *   multifilesink location=cloud-%05d.ply \
 *   avatartestsrc view-id=0 num-buffers=10 ! m. avatartestsrc view-id=1 num-buffers=10 ! m.
 * ]|
 *
 * Since: 0.1
 */
/* What happens to a buffer, in the order of this file; all of it in aggregate(), in the streaming
 * thread:
 *  1. It waits at its pad: StreamTimes::peek().
 *  2. Its stream is chosen for frame sets, or skipped: find_silent(), negotiate().
 *  3. It is dropped if no frame set can contain it, because it is late, of another clock or of a
 *     stream that is skipped: drop_unusable().
 *  4. It waits for buffers of the other streams, until the deadline; then it is joined with those
 *     within max-skew of the oldest one, and pushed: match_streams(), push_frame_set().
 *
 * Locking: the private lock guards what application threads read; it is never held across a push,
 * message or call into GstAggregator. The clock publisher and the statistics have their own. */
#include <gst/base/gstaggregator.h>

#include <algorithm>
#include <atomic>
#include <gstrange/gstrangeinfo.hpp>
#include <gstrange/gstrangemeta.h>
#include <gstrange/gstrangepairing.hpp>
#include <gstrange/gstrangestatus.hpp>
#include <mutex>
#include <rangecast/rigfile/rig_file.hpp>
#include <string>
#include <utility>
#include <vector>

#include "clockpublisher.hpp"
#include "common/capsadvice.hpp"
#include "common/elementproperties.hpp"
#include "common/matcher.hpp"
#include "frameset.hpp"
#include "streamtimes.hpp"

using rangecast::Status;
using rangecast::StatusCode;

GST_DEBUG_CATEGORY_STATIC (gst_range_mux_debug);
#define GST_CAT_DEFAULT gst_range_mux_debug

namespace {

using Head = MatchStream::Head;

/* States that last as long are reported; the backlog of a host that paused is not. */
constexpr GstClockTime kMinReportTime = GST_SECOND;
/* Of the capture times in a frame set, if the frame rate is unknown. */
constexpr GstClockTime kDefaultTolerance = 5 * GST_MSECOND;
/* Recordings: frames of a stream that are dropped as late before others go on. */
constexpr int kMaxLate = 3;

struct Settings {
  GstClockTime max_skew = 0; /* 0: half a frame period */
  int clock_port = 0;        /* UDP; 0: the clock is not published */
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
  rangecast::Rig rig;               /* of settings.rig_file; empty: any */
  MuxStreams current_streams;       /* see CurrentStreams */
  std::vector<MatchStream *> order; /* the same, for match_streams() */
  StreamTimes times;
  FrameSetJoiner joiner;
  GstClockTime frame_duration = GST_CLOCK_TIME_NONE;
};

DECLARE_ELEMENT (GstRangeMux, gst_range_mux, RANGE_MUX, GstAggregator)

static GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE ("sink_%u", GST_PAD_SINK,
    GST_PAD_REQUEST, GST_STATIC_CAPS (GST_RANGE_CAPS "; " GST_NEIGHBOUR_CODE_CAPS));
static GstStaticPadTemplate src_template = GST_STATIC_PAD_TEMPLATE ("src", GST_PAD_SRC,
    GST_PAD_ALWAYS, GST_STATIC_CAPS (GST_RANGE_CAPS "; " GST_NEIGHBOUR_CODE_CAPS));

G_DEFINE_TYPE_WITH_CODE (GstRangeMux, gst_range_mux, GST_TYPE_AGGREGATOR,
    G_IMPLEMENT_INTERFACE (GST_TYPE_CHILD_PROXY, init_pad_proxy))
GST_ELEMENT_REGISTER_DEFINE (rangemux, "rangemux", GST_RANK_NONE, gst_range_mux_get_type ())

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

/* Removes the next buffer of a stream, whose `buffer` stays a reference. */
static void
drop_buffer (GstRangeMuxPrivate *priv, MuxStream &stream)
{
  gst_aggregator_pad_drop_buffer (stream.pad);
  if (stream.head == Head::kGap)
    return;
  std::lock_guard guard (priv->lock);
  stream.received++;
}

/* ---- 2. which streams make up frame sets; caps with the union of their rigs ---- */

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
  GST_INFO_OBJECT (self, "%s is %s", stream.title ().c_str (), name_of (state));
  report_state (GST_ELEMENT (self), stream, state, priv->times.ahead (stream));
}

static GstFlowReturn
negotiate (GstRangeMux *self, const MuxStreams &streams)
{
  GstRangeMuxPrivate *priv = self->priv;
  gstrange::RangeInfo info;
  GstCaps *caps = nullptr;
  const Status status = choose_streams (streams, !priv->live, info, caps);
  if (const GstFlowReturn flow = gst_range_flow_return (GST_ELEMENT (self), status);
      flow != GST_FLOW_OK)
    return flow;
  for (const auto &stream : streams)
    if (stream->alive && (!stream->other_rig.ok () || !stream->clash.ok ()))
      set_state (self, *stream, stream->clash.ok () ? StreamState::kOtherRig : StreamState::kClash,
          priv->times.oldest ());
  if (!caps)
    return GST_FLOW_OK; /* no stream is left */
  GST_INFO_OBJECT (self, "%" GST_PTR_FORMAT, caps);
  gst_aggregator_set_src_caps (GST_AGGREGATOR (self), caps);
  gst_caps_unref (caps);
  priv->frame_duration = info.frame_duration ();
  priv->joiner.set_rig (info);
  priv->reporter.set_views (info.rig);
  return GST_FLOW_OK;
}

/* ---- 3. buffers that no frame set can contain ---- */

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

/* Whether a frame set can contain the frame at the head of a stream, and why not. */
static StreamState
classify_frame (const MuxStream &stream)
{
  if (!stream.chosen)
    return stream.other_rig.ok () ? StreamState::kClash : StreamState::kOtherRig;
  if (!stream.in_sync)
    return StreamState::kOutOfSync;
  return stream.late ? StreamState::kLate : StreamState::kIn;
}

static void
drop_frame (GstRangeMux *self, MuxStream &stream, StreamState state)
{
  GstRangeMuxPrivate *priv = self->priv;
  GST_DEBUG_OBJECT (stream.pad,
      "dropping a buffer: %s; capture time %" GST_TIME_FORMAT ", last frame set %" GST_TIME_FORMAT,
      name_of (state), GST_TIME_ARGS (stream.time), GST_TIME_ARGS (priv->times.last_capture ()));
  drop_buffer (priv, stream);
  {
    std::lock_guard guard (priv->lock);
    (state == StreamState::kLate           ? stream.dropped_late
        : state == StreamState::kOutOfSync ? stream.out_of_sync
                                           : stream.skipped)++;
  }
  set_state (self, stream, state, stream.running);
}

/* A recording that is late many times may be a loop shorter than others', which would wait for
 * ever: they go on without it, and its frame is dropped with their frame set.
 * @return whether any was dropped */
static bool
drop_unusable (GstRangeMux *self, const MuxStreams &streams)
{
  bool any = false;
  for (const auto &stream : streams) {
    const StreamState state = classify_frame (*stream);
    if (stream->head != Head::kFrame || state == StreamState::kIn)
      continue;
    if (state == StreamState::kLate && !self->priv->live && stream->late_in_row++ >= kMaxLate) {
      stream->head = Head::kEnded;
      continue;
    }
    stream->late = false;
    drop_frame (self, *stream, state);
    any = true;
  }
  return any;
}

/* ---- 4. one frame set: buffers are joined and pushed ---- */

/* Takes the buffers that match from their pads, and gives them to the joiner.
 * @return how many streams they are of */
static std::size_t
join_matching (GstRangeMux *self, const MuxStreams &streams, FrameTimes &times)
{
  GstRangeMuxPrivate *priv = self->priv;
  bool coded = false;
  std::size_t number = 0;
  for (const auto &stream : streams)
    if (stream->in_set) {
      coded = stream->coded;
      number++;
      times.capture = std::min (times.capture, stream->time); /* NONE is the maximum */
    }
  priv->joiner.begin (coded);
  for (const auto &stream : streams) {
    if (!stream->in_set)
      continue;
    times.running = std::min (times.running, stream->running);
    drop_buffer (priv, *stream);
    if (!priv->joiner.add (stream->buffer, stream->id_offset))
      GST_WARNING_OBJECT (stream->pad, "dropping a buffer: its view-id is that of another pad or "
                                       "above 63, or the frame set is too long");
    set_state (self, *stream, StreamState::kIn, stream->running);
    std::lock_guard guard (priv->lock);
    stream->matched++;
    stream->skew = GST_CLOCK_DIFF (times.capture, stream->time);
  }
  return number;
}

static GstFlowReturn
push_frame_set (GstRangeMux *self, const MuxStreams &streams, GstClockTime tolerance)
{
  GstRangeMuxPrivate *priv = self->priv;
  FrameTimes times;
  const std::size_t number = join_matching (self, streams, times);
  for (const auto &stream : streams) {
    stream->late_in_row = 0;
    if (stream->late) /* see drop_unusable() */
      drop_frame (self, *stream, StreamState::kLate);
  }
  const GstClockTime running = priv->times.add_frame_set (
      times, GST_CLOCK_TIME_IS_VALID (priv->frame_duration) ? priv->frame_duration : 2 * tolerance);
  GstBuffer *frame_set = nullptr;
  const Status status = priv->joiner.finish (running, frame_set);
  if (const GstFlowReturn flow = gst_range_flow_return (GST_ELEMENT (self), status);
      flow != GST_FLOW_OK)
    return flow;
  gstrange::stamp (GST_AGGREGATOR (self), frame_set, running, priv->frame_duration, times.capture);
  GST_LOG_OBJECT (self, "frame set of %zu of %zu streams: %" GST_PTR_FORMAT, number,
      streams.size (), frame_set);
  {
    std::lock_guard guard (priv->lock);
    priv->counters.frames++;
    priv->counters.complete += number == streams.size ();
  }
  priv->reporter.passed (GST_ELEMENT (self), frame_set);
  return gst_aggregator_finish_buffer (GST_AGGREGATOR (self), frame_set);
}

/* ---- all steps in order ---- */

static GstFlowReturn
make_frame_set (GstRangeMux *self, const MuxStreams &streams, bool timeout)
{
  GstRangeMuxPrivate *priv = self->priv;
  if (streams.empty ())
    return GST_AGGREGATOR_FLOW_NEED_DATA;
  const GstClockTime base = gst_element_get_base_time (GST_ELEMENT (self));
  StreamTimes &times = priv->times;
  times.peek (streams, priv->live, base, matching_tolerance (priv));
  const bool changed = times.find_silent (streams);
  for (const auto &stream : streams)
    if (changed && priv->live && !stream->alive && stream->head != Head::kEnded)
      set_state (self, *stream, StreamState::kSilent, times.oldest ());
  /* One that clashed with a stream that is silent now may take its place. */
  if (priv->caps_dirty.exchange (false) || changed)
    if (const GstFlowReturn flow = negotiate (self, streams); flow != GST_FLOW_OK)
      return flow;
  const GstClockTime tolerance = matching_tolerance (priv);
  if (priv->live)
    times.compare_clocks (streams, base);
  times.find_late (streams, tolerance);
  if (drop_unusable (self, streams))
    return GST_AGGREGATOR_FLOW_NEED_DATA; /* GstAggregator looks at the pads again: the next buffers
                                             may be there already */
  priv->order.clear ();
  for (const auto &stream : streams)
    priv->order.push_back (stream.get ());
  MatchStream *dropped = nullptr;
  switch (match_streams (priv->order, tolerance, timeout, dropped)) {
    case MatchStep::kDrop:
      GST_LOG_OBJECT (static_cast<MuxStream *> (dropped)->pad, "end of a gap");
      drop_buffer (priv, *static_cast<MuxStream *> (dropped));
      return GST_AGGREGATOR_FLOW_NEED_DATA;
    case MatchStep::kEnd:
      priv->reporter.finish ();
      return GST_FLOW_EOS;
    case MatchStep::kSet:
      return push_frame_set (self, streams, tolerance);
    default:
      return GST_AGGREGATOR_FLOW_NEED_DATA;
  }
}

static GstFlowReturn
gst_range_mux_aggregate (GstAggregator *aggregator, gboolean timeout)
{
  auto self = GST_RANGE_MUX (aggregator);
  GstRangeMuxPrivate *priv = self->priv;
  const CurrentStreams streams (priv);
  priv->live = gst_aggregator_get_latency (aggregator) != GST_CLOCK_TIME_NONE;
  const GstFlowReturn flow = make_frame_set (self, *streams, timeout);
  for (const auto &stream : *streams)
    stream->release ();
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
  const int id_offset = place_rig (GST_RANGE_MUX_PAD (stream.pad), info.rig);
  if (status.ok ())
    status = rangecast::validate (info.rig);
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
  stream.id_offset = id_offset;
  stream.has_caps = true;
  stream.chosen = false; /* displaces no other */
  self->priv->caps_dirty = true;
  std::lock_guard guard (self->priv->lock);
  stream.views = view_bits (stream.info.rig);
  return TRUE;
}

/* A region is that of one view: it is requested from the pad that has it, by the view-id there. */
static gboolean
gst_range_mux_src_event (GstAggregator *aggregator, GstEvent *event)
{
  guint id;
  if (!gst_event_has_name (event, "GstRangeRoi") ||
      !gst_structure_get_uint (gst_event_get_structure (event), "view-id", &id))
    return GST_AGGREGATOR_CLASS (gst_range_mux_parent_class)->src_event (aggregator, event);
  MuxStreams streams;
  {
    GstRangeMuxPrivate *priv = GST_RANGE_MUX (aggregator)->priv;
    std::lock_guard guard (priv->lock);
    std::ranges::copy_if (priv->streams, std::back_inserter (streams), [&] (const auto &stream) {
      return id < guint (rangecast::kMaxViews) && (stream->views >> id & 1);
    });
  }
  gboolean taken = FALSE;
  for (const auto &stream : streams) {
    GstEvent *own = gst_event_copy (event);
    gst_structure_set (gst_event_writable_structure (own), "view-id", G_TYPE_UINT,
        id - guint (stream->id_offset), nullptr);
    taken = gst_pad_push_event (GST_PAD (stream->pad), own) || taken;
  }
  gst_event_unref (event);
  return taken;
}

static gboolean
gst_range_mux_sink_event (GstAggregator *aggregator, GstAggregatorPad *pad, GstEvent *event)
{
  auto self = GST_RANGE_MUX (aggregator);
  if (refuse_bytes (pad, event))
    return FALSE;
  if (GST_EVENT_TYPE (event) == GST_EVENT_CAPS) {
    GstCaps *caps;
    gst_event_parse_caps (event, &caps);
    const CurrentStreams streams (self->priv);
    const auto stream =
        std::ranges::find (*streams, pad, [] (const auto &one) { return one->pad; });
    if (stream != (*streams).end () && !handle_caps (self, **stream, caps)) {
      gst_event_unref (event);
      return FALSE;
    }
  }
  return GST_AGGREGATOR_CLASS (gst_range_mux_parent_class)->sink_event (aggregator, pad, event);
}

static GstFlowReturn
gst_range_mux_flush (GstAggregator *aggregator)
{
  GstRangeMuxPrivate *priv = GST_RANGE_MUX (aggregator)->priv;
  priv->times.flush ();
  std::lock_guard guard (priv->lock);
  for (const auto &stream : priv->streams) {
    stream->shift_known = false;
    stream->seen = GST_CLOCK_TIME_NONE;
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

/* The pipeline selects its clock on the way to PLAYING, and may select another one later. */
static gboolean
gst_range_mux_set_clock (GstElement *element, GstClock *clock)
{
  GST_RANGE_MUX (element)->priv->clock.set_clock (element, clock);
  return GST_ELEMENT_CLASS (gst_range_mux_parent_class)->set_clock (element, clock);
}

/* ---- statistics, under the lock ---- */

static GstStructure *
make_stats (const GstRangeMuxPrivate *priv)
{
  const Counters &counters = priv->counters;
  guint64 late = 0, out_of_sync = 0, skipped = 0;
  for (const auto &stream : priv->streams) {
    late += stream->dropped_late;
    skipped += stream->skipped;
    out_of_sync += stream->out_of_sync;
  }
  GstStructure *stats = gst_structure_new ("application/x-rangemux-stats", "frames", G_TYPE_UINT64,
      counters.frames, "complete", G_TYPE_UINT64, counters.complete, "incomplete", G_TYPE_UINT64,
      counters.frames - counters.complete, "dropped-late", G_TYPE_UINT64, late, "out-of-sync",
      G_TYPE_UINT64, out_of_sync, "skipped", G_TYPE_UINT64, skipped, nullptr);
  for (const auto &stream : priv->streams) {
    GstStructure *of_pad = stream->stats ();
    gst_structure_set (stats, GST_PAD_NAME (stream->pad), GST_TYPE_STRUCTURE, of_pad, nullptr);
    gst_structure_free (of_pad);
  }
  return stats;
}

static std::vector<StatsRow>
collect_stats (GstElement *element)
{
  GstRangeMuxPrivate *priv = GST_RANGE_MUX (element)->priv;
  std::lock_guard guard (priv->lock);
  const Counters &counters = priv->counters;
  std::vector<StatsRow> rows (1);
  guint64 late = 0;
  for (const auto &stream : priv->streams) {
    rows.push_back (stream->row (counters.frames));
    late += stream->dropped_late + stream->out_of_sync;
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
  const Settings settings = settings_of (priv);
  priv->caps_dirty = true;
  priv->frame_duration = GST_CLOCK_TIME_NONE;
  priv->times.flush ();
  priv->rig = {};
  if (!settings.rig_file.empty ())
    if (Status s = rangecast::load_rig (settings.rig_file, priv->rig);
        gst_range_flow_return (GST_ELEMENT (self), s) != GST_FLOW_OK)
      return FALSE;
  if (!priv->clock.start (GST_ELEMENT (self), settings.clock_port))
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
          "UDP port on which to publish the pipeline clock for GstNetClientClock (0 = do not "
          "publish)",
          0, 65535, kMutableReady),
      P::text<&Settings::rig_file> ("rig", "Rig",
          "Rig file that all streams must agree with; a stream with other cameras is ignored when "
          "live, else it is an error (unset = no check)",
          kMutableReady),
  };
  return table;
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

  object_class->finalize = delete_private<GstRangeMux>;
  install_properties<GstRangeMux, mux_properties, make_stats> (object_class,
      "Counters since the element was started: frames, complete, incomplete, dropped-late, "
      "out-of-sync, skipped, and a structure for each sink pad");

  gst_element_class_add_static_pad_template_with_gtype (
      element_class, &sink_template, GST_TYPE_RANGE_MUX_PAD);
  gst_element_class_add_static_pad_template_with_gtype (
      element_class, &src_template, GST_TYPE_AGGREGATOR_PAD);
  gst_element_class_set_static_metadata (element_class, "Range multiplexer", "Muxer/Video",
      "Combines the views of several range streams into frame sets by capture time",
      "gst-rangecast");

  gst_type_mark_as_plugin_api (GST_TYPE_RANGE_MUX_PAD, GstPluginAPIFlags (0));

  announce_pads (element_class);
  element_class->release_pad = GST_DEBUG_FUNCPTR (gst_range_mux_release_pad);
  element_class->set_clock = GST_DEBUG_FUNCPTR (gst_range_mux_set_clock);

  aggregator_class->create_new_pad = GST_DEBUG_FUNCPTR (gst_range_mux_create_new_pad);
  aggregator_class->start = GST_DEBUG_FUNCPTR (gst_range_mux_start);
  aggregator_class->stop = GST_DEBUG_FUNCPTR (gst_range_mux_stop);
  aggregator_class->flush = GST_DEBUG_FUNCPTR (gst_range_mux_flush);
  aggregator_class->src_event = GST_DEBUG_FUNCPTR (gst_range_mux_src_event);
  aggregator_class->sink_event = GST_DEBUG_FUNCPTR (gst_range_mux_sink_event);
  aggregator_class->update_src_caps = GST_DEBUG_FUNCPTR (keep_src_caps);
  aggregator_class->negotiate = GST_DEBUG_FUNCPTR (negotiate_downstream);
  aggregator_class->get_next_time = GST_DEBUG_FUNCPTR (gst_range_mux_get_next_time);
  aggregator_class->clip = GST_DEBUG_FUNCPTR (gstrange::clip_to_segment);
  aggregator_class->aggregate = aggregate_to_the_end<gst_range_mux_aggregate>;

  GST_DEBUG_CATEGORY_INIT (gst_range_mux_debug, "rangemux", 0, "Range multiplexer");
}
