/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-rangemux
 * @title: rangemux
 *
 * Puts the views of several streams together, all raw or all coded, matched by capture time. In a
 * live pipeline it waits for a late stream no longer than #GstAggregator:latency, goes on without
 * one that is gone, and takes it back when it returns. No pixel is copied.
 *
 * With #GstRangeMux:clock-port it publishes the pipeline's clock, so that all camera hosts may fire
 * at the same time.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 rangemux name=m ! cylinderfilter ! plyenc ! multifilesink location=cloud-%05d.ply
 * avatartestsrc view-id=0 num-buffers=10 ! m. avatartestsrc view-id=1 num-buffers=10 ! m.
 * ]|
 *
 * Since: 0.1
 */
#include "gstrangemux.h"

#include <algorithm>
#include <gstrange/gstrangeinfo.hpp>
#include <gstrange/gstrangemeta.h>
#include <gstrange/gstrangepairing.hpp>
#include <gstrange/gstrangestatus.hpp>
#include <memory>
#include <mutex>
#include <vector>

#include "clockpublisher.hpp"
#include "statsreporter.hpp"

using gstrange::RangeInfo;
using rangecast::Status;
using rangecast::StatusCode;

GST_DEBUG_CATEGORY_STATIC (gst_range_mux_debug);
#define GST_CAT_DEFAULT gst_range_mux_debug

enum { PROP_0, PROP_MAX_SKEW, PROP_CLOCK_PORT, PROP_STATS, PROP_STATS_INTERVAL };

/* Capture times further than this from most others' are those of a clock that is not in step. */
static constexpr GstClockTime kOutOfStep = 2 * GST_SECOND;
static constexpr GstClockTime kDefaultTolerance = 5 * GST_MSECOND;

struct MuxPad {
  GstAggregatorPad *pad; /* owned by the element while this entry exists */
  bool has_caps = false, coded = false;
  RangeInfo info;
  bool clash_reported = false;
  guint64 views = 0; /* bits by view-id, for statistics */
  guint64 received = 0, late = 0, out_of_step = 0, matched = 0;
  GstClockTimeDiff last_skew = 0;

  explicit MuxPad (GstAggregatorPad *p) : pad (GST_AGGREGATOR_PAD (gst_object_ref (p))) {}
  ~MuxPad () { gst_object_unref (pad); }
};
using MuxPads = std::vector<std::shared_ptr<MuxPad>>;

struct GstRangeMuxPrivate {
  std::mutex lock; /* guards pads (the vector), counters and max_skew; never held across a push,
                      message or call into the aggregator */
  MuxPads pads;
  GstClockTime max_skew = 0;
  guint64 frames = 0, complete = 0;

  ClockPublisher clock;   /* has locks of its own */
  StatsReporter reporter; /* as well */

  /* streaming thread only */
  bool caps_dirty = true;
  GstClockTime frame_duration = GST_CLOCK_TIME_NONE;
  GstClockTime last_capture = GST_CLOCK_TIME_NONE; /* of the last frame set */
  GstClockTime last_running = GST_CLOCK_TIME_NONE;
};

struct _GstRangeMux {
  GstAggregator parent;
  GstRangeMuxPrivate *priv;
};

#define MUX_CAPS                                                                                   \
  GST_RANGE_CAPS "; " GST_NEIGHBOUR_CODE_MEDIA_TYPE                                                \
                 ", version = (int) 1, alignment = (string) access-unit, " GST_RANGE_SIZE_CAPS_

static GstStaticPadTemplate sink_template =
    GST_STATIC_PAD_TEMPLATE ("sink_%u", GST_PAD_SINK, GST_PAD_REQUEST, GST_STATIC_CAPS (MUX_CAPS));
static GstStaticPadTemplate src_template =
    GST_STATIC_PAD_TEMPLATE ("src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS (MUX_CAPS));

G_DEFINE_TYPE (GstRangeMux, gst_range_mux, GST_TYPE_AGGREGATOR)
GST_ELEMENT_REGISTER_DEFINE (rangemux, "rangemux", GST_RANK_NONE, GST_TYPE_RANGE_MUX)

static MuxPads
current_pads (GstRangeMux *self)
{
  std::lock_guard guard (self->priv->lock);
  return self->priv->pads;
}

/* ---- caps: the union of all rigs ---- */

static Status
unite (const MuxPads &pads, RangeInfo &united, bool &coded)
{
  const MuxPad *first = nullptr;
  rangecast::Rig rig;
  int fps_n = 0, fps_d = 1;
  for (const auto &entry : pads) {
    if (!entry->has_caps)
      continue;
    const std::string name = GST_PAD_NAME (entry->pad);
    if (first && entry->coded != first->coded)
      return {StatusCode::kBadValue, "pads " + std::string (GST_PAD_NAME (first->pad)) + " and " +
                                         name + ": expected all raw or all coded streams"};
    for (const auto &other : pads)
      if (other != entry && other->has_caps)
        for (const auto &view : entry->info.rig.views)
          if (other->info.rig.find (view.id))
            return {StatusCode::kBadValue, "pads " + std::string (GST_PAD_NAME (other->pad)) +
                                               " and " + name + ": both have view-id " +
                                               std::to_string (view.id) +
                                               "; expected each view once"};
    if (Status s = rangecast::merge (rig, entry->info.rig); !s.ok ())
      return s;
    if (!first) {
      first = entry.get ();
      fps_n = entry->info.fps_n;
      fps_d = entry->info.fps_d;
    }
  }
  if (first)
    coded = first->coded;
  united = gstrange::make_info (std::move (rig), fps_n, fps_d);
  return {};
}

static GstFlowReturn
negotiate (GstRangeMux *self, const MuxPads &pads)
{
  GstRangeMuxPrivate *priv = self->priv;
  RangeInfo united;
  bool coded = false;
  const GstFlowReturn flow =
      gst_range_flow_return (GST_ELEMENT (self), unite (pads, united, coded));
  if (flow != GST_FLOW_OK)
    return flow;
  GstCaps *caps = coded ? gstrange::make_neighbour_code_caps (united, "access-unit")
                        : gstrange::make_range_caps (united);
  gst_aggregator_set_src_caps (GST_AGGREGATOR (self), caps);
  gst_caps_unref (caps);
  priv->frame_duration = united.frame_duration ();
  priv->reporter.set_views (united.rig);
  priv->caps_dirty = false;
  return GST_FLOW_OK;
}

static GstFlowReturn
gst_range_mux_update_src_caps (GstAggregator *, GstCaps *, GstCaps **)
{
  return GST_AGGREGATOR_FLOW_NEED_DATA; /* caps are set before a frame set, see negotiate() */
}

static gboolean
take_caps (GstRangeMux *self, MuxPad &entry, GstCaps *caps)
{
  RangeInfo info;
  Status status = gstrange::parse_caps (caps, info);
  if (!status.ok ())
    status = {
        status.code (), "pad " + std::string (GST_PAD_NAME (entry.pad)) + ": " + status.message ()};
  if (gst_range_flow_return (GST_ELEMENT (self), status) != GST_FLOW_OK)
    return FALSE;
  entry.coded =
      gst_structure_has_name (gst_caps_get_structure (caps, 0), GST_NEIGHBOUR_CODE_MEDIA_TYPE);
  entry.info = std::move (info);
  entry.has_caps = true;
  self->priv->caps_dirty = true;
  std::lock_guard guard (self->priv->lock);
  entry.views = view_bits (entry.info.rig);
  return TRUE;
}

static gboolean
gst_range_mux_sink_event (GstAggregator *aggregator, GstAggregatorPad *pad, GstEvent *event)
{
  auto self = GST_RANGE_MUX (aggregator);
  if (GST_EVENT_TYPE (event) == GST_EVENT_CAPS) {
    GstCaps *caps;
    gst_event_parse_caps (event, &caps);
    for (const auto &entry : current_pads (self))
      if (entry->pad == pad && !take_caps (self, *entry, caps)) {
        gst_event_unref (event);
        return FALSE;
      }
  }
  return GST_AGGREGATOR_CLASS (gst_range_mux_parent_class)->sink_event (aggregator, pad, event);
}

/* ---- matching ---- */

/* A pad with the buffer that waits on it. */
struct Waiting {
  MuxPad *entry;
  GstBuffer *buffer; /* a reference of ours */
  GstClockTime capture, running;
};

/* All buffers that wait; unrefs them when it goes. */
class WaitingBuffers {
public:
  WaitingBuffers (const MuxPads &pads, bool live)
  {
    for (const auto &entry : pads) {
      GstBuffer *buffer = gst_aggregator_pad_peek_buffer (entry->pad);
      if (buffer)
        (gstrange::is_gap (buffer) ? gaps : list)
            .push_back ({entry.get (), buffer, gstrange::capture_time_of (entry->pad, buffer, live),
                gstrange::running_time_of (entry->pad, buffer)});
      else if (!gst_aggregator_pad_is_eos (entry->pad))
        missing++;
      else
        ended++;
    }
  }
  ~WaitingBuffers ()
  {
    for (const auto *waiting : {&list, &gaps})
      for (const Waiting &w : *waiting)
        gst_buffer_unref (w.buffer);
  }
  WaitingBuffers (const WaitingBuffers &) = delete;

  std::vector<Waiting> list, gaps;
  int missing = 0, ended = 0;
};

static GstClockTime
distance (GstClockTime a, GstClockTime b)
{
  return a > b ? a - b : b - a;
}

static GstClockTime
tolerance_of (GstRangeMuxPrivate *priv)
{
  std::lock_guard guard (priv->lock);
  if (priv->max_skew > 0)
    return priv->max_skew;
  return GST_CLOCK_TIME_IS_VALID (priv->frame_duration) ? priv->frame_duration / 2
                                                        : kDefaultTolerance;
}

/* Drops what can be part of no frame set any more: what is older than the last one, and what is
 * far from most others, from a host whose clock is not in step. @return whether anything went */
static bool
drop_useless (GstRangeMux *self, const WaitingBuffers &waiting, GstClockTime tolerance)
{
  GstRangeMuxPrivate *priv = self->priv;
  std::vector<GstClockTime> captures;
  for (const Waiting &w : waiting.list)
    captures.push_back (w.capture);
  if (captures.empty ())
    return false;
  std::ranges::nth_element (captures, captures.begin () + captures.size () / 2);
  const GstClockTime median = captures[captures.size () / 2];
  if (GST_CLOCK_TIME_IS_VALID (priv->last_capture) && median + kOutOfStep < priv->last_capture)
    priv->last_capture = GST_CLOCK_TIME_NONE; /* all of them began again */

  bool any = false;
  for (const Waiting &w : waiting.list) {
    const bool late =
        GST_CLOCK_TIME_IS_VALID (priv->last_capture) && w.capture <= priv->last_capture + tolerance;
    const bool astray = distance (w.capture, median) > kOutOfStep;
    if (!late && !astray)
      continue;
    gst_aggregator_pad_drop_buffer (w.entry->pad);
    std::lock_guard guard (priv->lock);
    w.entry->received++;
    (astray ? w.entry->out_of_step : w.entry->late)++;
    any = true;
  }
  return any;
}

/* A gap says that its pad has nothing for a while: nobody waits for that pad until another one's
 * frame is behind the gap. @return whether one went */
static bool
drop_past_gaps (const WaitingBuffers &waiting, GstClockTime tolerance, bool timeout)
{
  if (waiting.list.empty () && waiting.missing > 0 && !timeout)
    return false;
  GstClockTime first = GST_CLOCK_TIME_NONE;
  for (const Waiting &w : waiting.list)
    first = std::min (first, w.running);
  bool any = false;
  for (const Waiting &gap : waiting.gaps)
    if (waiting.list.empty () || first > gstrange::gap_end (gap.running, gap.buffer, tolerance)) {
      gst_aggregator_pad_drop_buffer (gap.entry->pad);
      any = true;
    }
  return any;
}

/* Adds the views of one stream. @return false if one of them is there already */
static bool
append (GstBuffer *frame_set, GstBuffer *buffer, bool coded)
{
  if (!coded)
    return gst_range_buffer_append (frame_set, buffer);
  gst_buffer_copy_into (frame_set, buffer, GST_BUFFER_COPY_MEMORY, 0, -1);
  if (GST_BUFFER_FLAG_IS_SET (buffer, GST_BUFFER_FLAG_DELTA_UNIT))
    GST_BUFFER_FLAG_SET (frame_set, GST_BUFFER_FLAG_DELTA_UNIT);
  gst_buffer_add_parent_buffer_meta (frame_set, buffer); /* its pool gets it back after us */
  return true;
}

static void
report_clash (GstRangeMux *self, MuxPad &entry)
{
  if (entry.clash_reported)
    return;
  entry.clash_reported = true;
  gst_range_post_warning (GST_ELEMENT (self),
      {StatusCode::kBadValue, "pad " + std::string (GST_PAD_NAME (entry.pad)) +
                                  ": its buffers have views that another pad has, too; dropped"});
}

static GstFlowReturn
push_frame_set (GstRangeMux *self, const WaitingBuffers &waiting, GstClockTime first,
    GstClockTime tolerance, std::size_t streams)
{
  GstRangeMuxPrivate *priv = self->priv;
  GstBuffer *frame_set = gst_buffer_new ();
  GstClockTime running = GST_CLOCK_TIME_NONE, last = first;
  std::size_t matched = 0;
  for (const Waiting &w : waiting.list) {
    if (w.capture > first + tolerance)
      continue;
    gst_aggregator_pad_drop_buffer (w.entry->pad); /* we hold a reference */
    if (!append (frame_set, w.buffer, w.entry->coded))
      report_clash (self, *w.entry);
    if (GST_CLOCK_TIME_IS_VALID (w.running))
      running = GST_CLOCK_TIME_IS_VALID (running) ? std::min (running, w.running) : w.running;
    last = std::max (last, w.capture);
    matched++;
    std::lock_guard guard (priv->lock);
    w.entry->received++;
    w.entry->matched++;
    w.entry->last_skew = GST_CLOCK_DIFF (first, w.capture);
  }
  if (GST_CLOCK_TIME_IS_VALID (running) && GST_CLOCK_TIME_IS_VALID (priv->last_running))
    running = std::max (running, priv->last_running); /* never backwards */
  priv->last_running = running;
  priv->last_capture = first;
  gstrange::stamp (GST_AGGREGATOR (self), frame_set, running, priv->frame_duration, first);
  {
    std::lock_guard guard (priv->lock);
    priv->frames++;
    priv->complete += matched == streams;
  }
  priv->reporter.passed (GST_ELEMENT (self), frame_set);
  return gst_aggregator_finish_buffer (GST_AGGREGATOR (self), frame_set);
}

static GstFlowReturn
gst_range_mux_aggregate (GstAggregator *aggregator, gboolean timeout)
{
  auto self = GST_RANGE_MUX (aggregator);
  GstRangeMuxPrivate *priv = self->priv;
  const MuxPads pads = current_pads (self);
  const bool live = gst_aggregator_get_latency (aggregator) != GST_CLOCK_TIME_NONE;
  const WaitingBuffers waiting (pads, live);
  if (waiting.list.empty () && waiting.gaps.empty ()) {
    if (waiting.missing > 0 || waiting.ended == 0)
      return GST_AGGREGATOR_FLOW_NEED_DATA;
    priv->reporter.finish ();
    return GST_FLOW_EOS;
  }
  if (priv->caps_dirty) {
    const GstFlowReturn flow = negotiate (self, pads);
    if (flow != GST_FLOW_OK)
      return flow;
  }
  const GstClockTime tolerance = tolerance_of (priv);
  if (drop_past_gaps (waiting, tolerance, timeout) || drop_useless (self, waiting, tolerance))
    return GST_AGGREGATOR_FLOW_NEED_DATA; /* come again with what is behind them */
  if (waiting.list.empty () || (waiting.missing > 0 && !timeout))
    return GST_AGGREGATOR_FLOW_NEED_DATA;
  GstClockTime first = GST_CLOCK_TIME_NONE;
  for (const Waiting &w : waiting.list)
    first = std::min (first, w.capture); /* NONE is the greatest number there is */
  return push_frame_set (self, waiting, first, tolerance, pads.size ());
}

/* The deadline counts from the oldest buffer that waits. Without one there is nothing to wait for,
 * and so no deadline. */
static GstClockTime
gst_range_mux_get_next_time (GstAggregator *aggregator)
{
  GstClockTime oldest = GST_CLOCK_TIME_NONE;
  for (const auto &entry : current_pads (GST_RANGE_MUX (aggregator))) {
    GstBuffer *buffer = gst_aggregator_pad_peek_buffer (entry->pad);
    if (!buffer)
      continue;
    if (!gstrange::is_gap (buffer))
      oldest = std::min (oldest, gstrange::running_time_of (entry->pad, buffer));
    gst_buffer_unref (buffer);
  }
  return oldest;
}

static GstFlowReturn
gst_range_mux_flush (GstAggregator *aggregator)
{
  GstRangeMuxPrivate *priv = GST_RANGE_MUX (aggregator)->priv;
  priv->last_capture = priv->last_running = GST_CLOCK_TIME_NONE;
  return GST_FLOW_OK;
}

/* ---- request pads ---- */

static GstPad *
gst_range_mux_request_new_pad (
    GstElement *element, GstPadTemplate *pad_template, const gchar *name, const GstCaps *caps)
{
  auto self = GST_RANGE_MUX (element);
  GstPad *pad = GST_ELEMENT_CLASS (gst_range_mux_parent_class)
                    ->request_new_pad (element, pad_template, name, caps);
  if (pad) {
    std::lock_guard guard (self->priv->lock);
    self->priv->pads.push_back (std::make_shared<MuxPad> (GST_AGGREGATOR_PAD (pad)));
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
        self->priv->pads, [&] (const auto &entry) { return GST_PAD (entry->pad) == pad; });
  }
  GST_ELEMENT_CLASS (gst_range_mux_parent_class)->release_pad (element, pad);
}

/* ---- the clock, for other hosts ---- */

/* Posts its error itself. */
static bool
report_clock (GstRangeMux *self, const Status &status)
{
  if (status.ok ())
    return true;
  GST_ELEMENT_ERROR (self, RESOURCE, BUSY, ("%s", status.message ().c_str ()), (nullptr));
  return false;
}

static bool
publish_clock (GstRangeMux *self)
{
  GstClock *clock = gst_element_get_clock (GST_ELEMENT (self));
  const Status status = self->priv->clock.start (clock);
  gst_clear_object (&clock);
  if (self->priv->clock.port () != ClockPublisher::kOff)
    g_object_notify (G_OBJECT (self), "clock-port"); /* 0 has become a number */
  return report_clock (self, status);
}

/* The pipeline chooses its clock on the way to PLAYING, and perhaps another one later. */
static gboolean
gst_range_mux_set_clock (GstElement *element, GstClock *clock)
{
  auto self = GST_RANGE_MUX (element);
  report_clock (self, self->priv->clock.use (clock));
  return GST_ELEMENT_CLASS (gst_range_mux_parent_class)->set_clock (element, clock);
}

/* ---- life ---- */

/* A stream's frame sets that went without it count from the element's start. */
static std::vector<StatsRow>
collect_stats (GstElement *element)
{
  GstRangeMuxPrivate *priv = GST_RANGE_MUX (element)->priv;
  std::lock_guard guard (priv->lock);
  std::vector<StatsRow> rows (1);
  guint64 late = 0;
  for (const auto &entry : priv->pads) {
    late += entry->late + entry->out_of_step;
    rows.push_back ({.pad = GST_PAD_NAME (entry->pad),
        .counters = {.frames = entry->received,
            .lost = priv->frames - std::min (priv->frames, entry->matched),
            .late = entry->late + entry->out_of_step},
        .views = entry->views});
  }
  rows[0].counters = {.frames = priv->frames, .lost = priv->frames - priv->complete, .late = late};
  return rows;
}

static gboolean
gst_range_mux_stop (GstAggregator *aggregator)
{
  GST_RANGE_MUX (aggregator)->priv->reporter.stop ();
  GST_RANGE_MUX (aggregator)->priv->clock.stop ();
  return TRUE;
}

static gboolean
gst_range_mux_start (GstAggregator *aggregator)
{
  GstRangeMuxPrivate *priv = GST_RANGE_MUX (aggregator)->priv;
  priv->caps_dirty = true;
  priv->frame_duration = priv->last_capture = priv->last_running = GST_CLOCK_TIME_NONE;
  if (!publish_clock (GST_RANGE_MUX (aggregator)))
    return FALSE;
  priv->reporter.start (GST_ELEMENT (aggregator), collect_stats);
  std::lock_guard guard (priv->lock);
  priv->frames = priv->complete = 0;
  for (const auto &entry : priv->pads) {
    entry->has_caps = entry->clash_reported = false;
    entry->received = entry->matched = entry->late = entry->out_of_step = 0;
  }
  return TRUE;
}

static void
gst_range_mux_set_property (GObject *object, guint id, const GValue *value, GParamSpec *pspec)
{
  GstRangeMuxPrivate *priv = GST_RANGE_MUX (object)->priv;
  std::lock_guard guard (priv->lock);
  switch (id) {
    case PROP_MAX_SKEW:
      priv->max_skew = g_value_get_uint64 (value);
      break;
    case PROP_CLOCK_PORT:
      priv->clock.set_port (g_value_get_int (value));
      break;
    case PROP_STATS_INTERVAL:
      priv->reporter.set_interval (g_value_get_uint (value));
      break;
    default:
      G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
  }
}

static GstStructure *
make_stats (const GstRangeMuxPrivate *priv)
{
  guint64 late = 0, out_of_step = 0;
  for (const auto &entry : priv->pads) {
    late += entry->late;
    out_of_step += entry->out_of_step;
  }
  GstStructure *stats = gst_structure_new ("application/x-rangemux-stats", "frames", G_TYPE_UINT64,
      priv->frames, "complete", G_TYPE_UINT64, priv->complete, "incomplete", G_TYPE_UINT64,
      priv->frames - priv->complete, "dropped-late", G_TYPE_UINT64, late, "out-of-step",
      G_TYPE_UINT64, out_of_step, nullptr);
  for (const auto &entry : priv->pads) {
    GstStructure *of_pad = gst_structure_new ("pad", "received", G_TYPE_UINT64, entry->received,
        "matched", G_TYPE_UINT64, entry->matched, "late", G_TYPE_UINT64, entry->late, "out-of-step",
        G_TYPE_UINT64, entry->out_of_step, "skew", G_TYPE_INT64, gint64 (entry->last_skew),
        nullptr);
    gst_structure_set (stats, GST_PAD_NAME (entry->pad), GST_TYPE_STRUCTURE, of_pad, nullptr);
    gst_structure_free (of_pad);
  }
  return stats;
}

static void
gst_range_mux_get_property (GObject *object, guint id, GValue *value, GParamSpec *pspec)
{
  GstRangeMuxPrivate *priv = GST_RANGE_MUX (object)->priv;
  std::lock_guard guard (priv->lock);
  switch (id) {
    case PROP_MAX_SKEW:
      g_value_set_uint64 (value, priv->max_skew);
      break;
    case PROP_CLOCK_PORT:
      g_value_set_int (value, priv->clock.port ());
      break;
    case PROP_STATS:
      g_value_take_boxed (value, make_stats (priv));
      break;
    case PROP_STATS_INTERVAL:
      g_value_set_uint (value, priv->reporter.interval ());
      break;
    default:
      G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
  }
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

  g_object_class_install_property (object_class, PROP_MAX_SKEW,
      g_param_spec_uint64 ("max-skew", "Maximum skew",
          "Capture times that differ by no more belong to one frame set, ns (default 0: half a "
          "frame period, or 5 ms where the frame rate is unknown)",
          0, G_MAXINT64, 0,
          GParamFlags (G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_PLAYING)));
  g_object_class_install_property (object_class, PROP_CLOCK_PORT,
      g_param_spec_int ("clock-port", "Clock port",
          "Publish the pipeline's clock on this UDP port, for GstNetClientClock on other hosts; -1 "
          "= no, 0 = any free port, which can be read while not in READY (default -1)",
          -1, 65535, ClockPublisher::kOff,
          GParamFlags (G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_READY)));
  g_object_class_install_property (object_class, PROP_STATS,
      g_param_spec_boxed ("stats", "Statistics",
          "Counters since start: frames, complete, incomplete, dropped-late, out-of-step; and a "
          "structure for each pad",
          GST_TYPE_STRUCTURE, GParamFlags (G_PARAM_READABLE | G_PARAM_STATIC_STRINGS)));
  StatsReporter::install (object_class, PROP_STATS_INTERVAL);

  gst_element_class_add_static_pad_template_with_gtype (
      element_class, &sink_template, GST_TYPE_AGGREGATOR_PAD);
  gst_element_class_add_static_pad_template_with_gtype (
      element_class, &src_template, GST_TYPE_AGGREGATOR_PAD);
  gst_element_class_set_static_metadata (element_class, "Range multiplexer", "Muxer/Video",
      "Puts the views of several range streams together, matched by capture time", "gst-rangecast");

  element_class->request_new_pad = gst_range_mux_request_new_pad;
  element_class->release_pad = gst_range_mux_release_pad;
  element_class->set_clock = gst_range_mux_set_clock;

  aggregator_class->start = gst_range_mux_start;
  aggregator_class->stop = gst_range_mux_stop;
  aggregator_class->flush = gst_range_mux_flush;
  aggregator_class->sink_event = gst_range_mux_sink_event;
  aggregator_class->update_src_caps = gst_range_mux_update_src_caps;
  aggregator_class->get_next_time = gst_range_mux_get_next_time;
  aggregator_class->clip = gstrange::clip_to_segment;
  aggregator_class->aggregate = gst_range_mux_aggregate;

  GST_DEBUG_CATEGORY_INIT (gst_range_mux_debug, "rangemux", 0, "Range multiplexer");
}
