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
#include <rangecast/rigfile/rig_file.hpp>

#include "common/properties.hpp"
#include "rangemuxprivate.hpp"

using rangecast::Status;

GST_DEBUG_CATEGORY (gst_range_mux_debug);
#define GST_CAT_DEFAULT gst_range_mux_debug

enum { PROP_0, PROP_MAX_SKEW, PROP_CLOCK_PORT, PROP_RIG, PROP_STATS, PROP_STATS_INTERVAL };

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

/* The pads that there are, while it lives. For the streaming thread: allocates nothing. */
class PadsNow {
public:
  explicit PadsNow (GstRangeMux *self) : pads_ (self->priv->pads_now)
  {
    std::lock_guard guard (self->priv->lock);
    pads_ = self->priv->pads;
  }
  ~PadsNow () { pads_.clear (); } /* those that were released may go */
  PadsNow (const PadsNow &) = delete;
  const MuxPads &operator* () const { return pads_; }

private:
  MuxPads &pads_;
};

/* ---- caps: the union of the rigs of the streams that go together ---- */

static GstFlowReturn
negotiate (GstRangeMux *self, const MuxPads &pads)
{
  GstRangeMuxPrivate *priv = self->priv;
  MuxFormat format;
  const Status status = choose_streams (pads, !priv->live, format);
  if (const GstFlowReturn flow = gst_range_flow_return (GST_ELEMENT (self), status);
      flow != GST_FLOW_OK)
    return flow;
  for (const auto &entry : pads)
    if (entry->alive && (!entry->other_rig.ok () || !entry->clash.ok ()))
      set_state (
          self, *entry, entry->clash.ok () ? MuxState::kOtherRig : MuxState::kClash, priv->now);
  if (format.info.views () == 0)
    return GST_FLOW_OK; /* nobody is left */
  GstCaps *caps = format.coded ? gstrange::make_neighbour_code_caps (format.info, "access-unit")
                               : gstrange::make_range_caps (format.info);
  gst_aggregator_set_src_caps (GST_AGGREGATOR (self), caps);
  gst_caps_unref (caps);
  priv->frame_duration = format.info.frame_duration ();
  priv->reporter.set_views (format.info.rig);
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
  gstrange::RangeInfo info;
  Status status = gstrange::parse_caps (caps, info);
  if (!status.ok ())
    status = {
        status.code (), "pad " + std::string (GST_PAD_NAME (entry.pad)) + ": " + status.message ()};
  if (gst_range_flow_return (GST_ELEMENT (self), status) != GST_FLOW_OK)
    return FALSE;
  const rangecast::Rig &expected = self->priv->rig;
  entry.other_rig = expected.views.empty () ? Status{} : check_rig (info.rig, expected);
  entry.clash = {};
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

/* ---- frame sets ---- */

static GstFlowReturn
aggregate_waiting (
    GstRangeMux *self, const MuxPads &pads, const WaitingBuffers &waiting, bool timeout)
{
  GstRangeMuxPrivate *priv = self->priv;
  if (!priv->live && waiting.ended > 0)
    tell_strangers (self, pads);
  if (waiting.list.empty () && waiting.gaps.empty ()) {
    if (waiting.missing > 0 || waiting.ended == 0)
      return GST_AGGREGATOR_FLOW_NEED_DATA;
    priv->reporter.finish ();
    return GST_FLOW_EOS;
  }
  note_arrivals (self, pads, waiting);
  if (priv->caps_dirty.exchange (false)) {
    const GstFlowReturn flow = negotiate (self, pads);
    if (flow != GST_FLOW_OK)
      return flow;
  }
  if (priv->live)
    judge_steps (self, pads, waiting);
  else
    judge_recordings (self, waiting);
  const GstClockTime tolerance = matching_tolerance (priv);
  if (waiting.drop_past_gaps (priv->live, tolerance, timeout) ||
      drop_useless (self, waiting, tolerance))
    return GST_AGGREGATOR_FLOW_NEED_DATA; /* come again with what is behind them */
  if (waiting.list.empty () || (waiting.missing > 0 && !timeout))
    return GST_AGGREGATOR_FLOW_NEED_DATA;
  GstClockTime first = GST_CLOCK_TIME_NONE;
  for (const Waiting &w : waiting.list)
    first = std::min (first, w.capture); /* NONE is the greatest number there is */
  return push_frame_set (self, waiting, first, tolerance, pads.size ());
}

static GstFlowReturn
gst_range_mux_aggregate (GstAggregator *aggregator, gboolean timeout)
{
  auto self = GST_RANGE_MUX (aggregator);
  GstRangeMuxPrivate *priv = self->priv;
  const PadsNow pads (self);
  priv->live = gst_aggregator_get_latency (aggregator) != GST_CLOCK_TIME_NONE;
  priv->waiting.take (*pads, priv->live);
  const GstFlowReturn flow = aggregate_waiting (self, *pads, priv->waiting, timeout);
  priv->waiting.release ();
  return flow;
}

/* The deadline counts from the oldest buffer that waits. Without one there is nothing to wait for,
 * and so no deadline. */
static GstClockTime
gst_range_mux_get_next_time (GstAggregator *aggregator)
{
  GstClockTime oldest = GST_CLOCK_TIME_NONE;
  const PadsNow pads (GST_RANGE_MUX (aggregator));
  for (const auto &entry : *pads) {
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
  priv->last = {};
  priv->now = GST_CLOCK_TIME_NONE;
  priv->steps.reset ();
  for (const auto &entry : current_pads (GST_RANGE_MUX (aggregator))) {
    entry->offset_known = entry->shift_known = false;
    entry->seen = GST_CLOCK_TIME_NONE;
  }
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
  self->priv->caps_dirty = true; /* one less; one that clashed with it may have its place */
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

static std::vector<StatsRow>
collect_stats (GstElement *element)
{
  GstRangeMuxPrivate *priv = GST_RANGE_MUX (element)->priv;
  std::lock_guard guard (priv->lock);
  return rows_of (priv->pads, priv->sent);
}

static gboolean
gst_range_mux_stop (GstAggregator *aggregator)
{
  GST_RANGE_MUX (aggregator)->priv->reporter.stop ();
  GST_RANGE_MUX (aggregator)->priv->clock.stop ();
  GST_RANGE_MUX (aggregator)->priv->joiner.drop ();
  return TRUE;
}

static bool
load_rig_file (GstRangeMux *self)
{
  std::string file;
  {
    std::lock_guard guard (self->priv->lock);
    file = self->priv->rig_file;
  }
  self->priv->rig = {};
  const Status status = file.empty () ? Status{} : rangecast::load_rig (file, self->priv->rig);
  return gst_range_flow_return (GST_ELEMENT (self), status) == GST_FLOW_OK;
}

static gboolean
gst_range_mux_start (GstAggregator *aggregator)
{
  GstRangeMuxPrivate *priv = GST_RANGE_MUX (aggregator)->priv;
  priv->caps_dirty = true;
  priv->frame_duration = priv->now = GST_CLOCK_TIME_NONE;
  priv->last = {};
  priv->steps.reset ();
  if (!load_rig_file (GST_RANGE_MUX (aggregator)) || !publish_clock (GST_RANGE_MUX (aggregator)))
    return FALSE;
  priv->reporter.start (GST_ELEMENT (aggregator), collect_stats);
  std::lock_guard guard (priv->lock);
  priv->sent = {};
  for (const auto &entry : priv->pads)
    entry->reset ();
  return TRUE;
}

static void
gst_range_mux_set_property (GObject *object, guint id, const GValue *value, GParamSpec *pspec)
{
  GstRangeMuxPrivate *priv = GST_RANGE_MUX (object)->priv;
  if (id == PROP_STATS_INTERVAL) /* it has locks of its own, and sets a timer */
    return priv->reporter.set_interval (g_value_get_uint (value));
  std::lock_guard guard (priv->lock);
  switch (id) {
    case PROP_MAX_SKEW:
      priv->max_skew = g_value_get_uint64 (value);
      break;
    case PROP_CLOCK_PORT:
      priv->clock.set_port (g_value_get_int (value));
      break;
    case PROP_RIG:
      priv->rig_file = g_value_get_string (value) ? g_value_get_string (value) : "";
      break;
    default:
      G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
  }
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
    case PROP_RIG:
      g_value_set_string (value, priv->rig_file.empty () ? nullptr : priv->rig_file.c_str ());
      break;
    case PROP_STATS:
      g_value_take_boxed (value, make_stats (priv->pads, priv->sent));
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
          "Maximum difference of the capture times within a frame set in nanoseconds (0 = half a "
          "frame period, or 5 ms if the frame rate is unknown)",
          0, G_MAXINT64, 0, kMutablePlaying));
  g_object_class_install_property (object_class, PROP_CLOCK_PORT,
      g_param_spec_int ("clock-port", "Clock port",
          "UDP port on which to publish the pipeline clock for GstNetClientClock (-1 = do not "
          "publish, 0 = any free port, readable once published)",
          -1, 65535, ClockPublisher::kOff, kMutableReady));
  g_object_class_install_property (object_class, PROP_RIG,
      g_param_spec_string ("rig", "Rig",
          "Rig file that all streams must agree with; a stream with other cameras is left out when "
          "live, else it is an error (unset = no check)",
          nullptr, kMutableReady));
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
