/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-rangedemux
 * @title: rangedemux
 *
 * Splits a stream of frame sets into one stream per view; the inverse of rangemux. Pad `src_3` has
 * view 3. Pads are added with caps, whose rig names the views, and removed with a rig that lacks
 * them. Memories are shared. A view missing in a frame set is a GAP on its pad.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 avatartestsrc num-buffers=20 ! rangedemux name=d d.src_0 ! queue ! plyenc ! \
 *   multifilesink location=front-%05d.ply d.src_1 ! queue ! fakesink
 * ]|
 *
 * Since: 0.1
 */
/* Pads belong to the streaming thread, and to state changes while it does not run. */
#include <gst/gst.h>

#include <gst/base/gstflowcombiner.h>

#include <array>
#include <atomic>
#include <gstrange/gstrangeinfo.hpp>
#include <gstrange/gstrangemeta.h>
#include <gstrange/gstrangestatus.hpp>

#include "common/elementproperties.hpp"

using gstrange::RangeInfo;
using rangecast::kMaxViews;
using rangecast::Status;
using rangecast::View;

GST_DEBUG_CATEGORY_STATIC (gst_range_demux_debug);
#define GST_CAT_DEFAULT gst_range_demux_debug

namespace {

/* A view and its pad. */
struct DemuxPad {
  GstPad *pad = nullptr; /* owned by the element; nullptr: the rig has no such view */
  GstCaps *caps = nullptr;
  bool fresh = true; /* no buffer was pushed yet */
};

} // namespace

struct GstRangeDemuxPrivate {
  /* A bin sends a seek to each of its sinks, and all of them arrive here: one is forwarded. */
  std::atomic<guint32> last_seek = GST_SEQNUM_INVALID;

  /* streaming thread only */
  std::array<DemuxPad, kMaxViews> pads; /* by view-id */
  GstFlowCombiner *combiner = gst_flow_combiner_new ();
  RangeInfo info;
  bool had_pads = false; /* since start */
  guint group_id = GST_GROUP_ID_INVALID;

  ~GstRangeDemuxPrivate () { gst_flow_combiner_free (combiner); }
};

DECLARE_ELEMENT (GstRangeDemux, gst_range_demux, RANGE_DEMUX, GstElement)

static GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE (
    "sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS (GST_RANGE_CAPS));
static GstStaticPadTemplate src_template = GST_STATIC_PAD_TEMPLATE (
    "src_%u", GST_PAD_SRC, GST_PAD_SOMETIMES, GST_STATIC_CAPS (GST_RANGE_CAPS));

G_DEFINE_TYPE (GstRangeDemux, gst_range_demux, GST_TYPE_ELEMENT)
GST_ELEMENT_REGISTER_DEFINE (rangedemux, "rangedemux", GST_RANK_NONE, gst_range_demux_get_type ())

/* ---- data ---- */

/* Times, flags and reference timestamps; the capture time is the view's own. */
static void
copy_metadata (GstBuffer *view, GstBuffer *frame_set, GstClockTime capture)
{
  gst_buffer_copy_into (view, frame_set,
      GstBufferCopyFlags (GST_BUFFER_COPY_FLAGS | GST_BUFFER_COPY_TIMESTAMPS), 0, gsize (-1));
  gpointer state = nullptr;
  while (GstMeta *meta = gst_buffer_iterate_meta_filtered (
             frame_set, &state, GST_REFERENCE_TIMESTAMP_META_API_TYPE)) {
    auto time = reinterpret_cast<GstReferenceTimestampMeta *> (meta);
    gst_buffer_add_reference_timestamp_meta (
        view, time->reference, time->timestamp, time->duration);
  }
  if (GST_CLOCK_TIME_IS_VALID (capture))
    gst_range_buffer_set_capture_time (view, capture);
}

/* One view of the frame set, or nullptr if it is missing. */
static GstBuffer *
make_view (GstRangeDemux *self, GstBuffer *frame_set, int id)
{
  const GstRangeMeta *meta = gst_buffer_get_range_meta (frame_set, guint (id));
  GstBuffer *view = meta ? gst_range_buffer_copy_view (frame_set, meta) : nullptr;
  if (view)
    copy_metadata (view, frame_set, meta->capture_time);
  else if (meta)
    GST_DEBUG_OBJECT (self, "dropping view %d: its planes are not within the buffer", id);
  return view;
}

/* Tells downstream not to wait for the view. */
static GstFlowReturn
push_gap (GstRangeDemux *self, GstPad *pad, GstBuffer *frame_set)
{
  const GstClockTime time = GST_BUFFER_PTS (frame_set);
  const GstClockTime duration = GST_BUFFER_DURATION_IS_VALID (frame_set)
                                    ? GST_BUFFER_DURATION (frame_set)
                                    : self->priv->info.frame_duration ();
  GST_LOG_OBJECT (
      pad, "the frame set of %" GST_TIME_FORMAT " lacks the view", GST_TIME_ARGS (time));
  if (GST_CLOCK_TIME_IS_VALID (time))
    gst_pad_push_event (pad, gst_event_new_gap (time, duration));
  if (!gst_pad_is_linked (pad))
    return GST_FLOW_NOT_LINKED;
  const GstFlowReturn last = GST_PAD_LAST_FLOW_RETURN (pad);
  return last == GST_FLOW_NOT_LINKED ? GST_FLOW_OK : last; /* linked since then */
}

static GstFlowReturn
push_view (GstRangeDemux *self, GstBuffer *frame_set, int id)
{
  DemuxPad &entry = self->priv->pads[id];
  GstBuffer *view = make_view (self, frame_set, id);
  if (!view)
    return push_gap (self, entry.pad, frame_set);
  if (entry.fresh)
    GST_BUFFER_FLAG_SET (view, GST_BUFFER_FLAG_DISCONT);
  entry.fresh = false;
  GST_LOG_OBJECT (entry.pad, "%" GST_PTR_FORMAT, view);
  return gst_pad_push (entry.pad, view);
}

static GstFlowReturn
push_views (GstRangeDemux *self, GstBuffer *frame_set)
{
  GstRangeDemuxPrivate *priv = self->priv;
  GstFlowReturn flow = GST_FLOW_OK;
  for (int id = 0; id < kMaxViews; id++) {
    if (!priv->pads[id].pad)
      continue;
    const GstFlowReturn pushed = push_view (self, frame_set, id);
    flow = gst_flow_combiner_update_pad_flow (priv->combiner, priv->pads[id].pad, pushed);
    if (flow != GST_FLOW_OK && flow != GST_FLOW_NOT_LINKED)
      break;
  }
  return flow;
}

static GstFlowReturn
gst_range_demux_chain (GstPad *, GstObject *parent, GstBuffer *buffer)
{
  auto self = GST_RANGE_DEMUX (parent);
  GstRangeDemuxPrivate *priv = self->priv;
  const GstFlowReturn flow =
      priv->info.views () > 0 ? push_views (self, buffer) : GST_FLOW_NOT_NEGOTIATED;
  gst_buffer_unref (buffer);
  return flow;
}

/* ---- pads ---- */

static void
push_stream_start (GstRangeDemux *self, GstPad *pad, int id)
{
  gchar *name = g_strdup_printf ("view-%d", id);
  gchar *stream_id = gst_pad_create_stream_id (pad, GST_ELEMENT (self), name);
  GstEvent *event = gst_event_new_stream_start (stream_id);
  if (self->priv->group_id != GST_GROUP_ID_INVALID)
    gst_event_set_group_id (event, self->priv->group_id);
  gst_pad_push_event (pad, event);
  g_free (stream_id);
  g_free (name);
}

/* Caps with the size and rig of one view. */
static void
push_caps (GstRangeDemux *self, DemuxPad &entry, const View &view)
{
  const RangeInfo &all = self->priv->info;
  const RangeInfo info = gstrange::make_info ({{view}}, all.fps_n, all.fps_d);
  GstCaps *caps = gstrange::make_range_caps (info);
  GST_INFO_OBJECT (entry.pad, "%" GST_PTR_FORMAT, caps);
  if (!entry.caps || !gst_caps_is_equal (caps, entry.caps))
    gst_pad_push_event (entry.pad, gst_event_new_caps (caps));
  gst_caps_replace (&entry.caps, caps);
  gst_caps_unref (caps);
}

/* Segment, tags and other sticky events from before the pad was added. */
static gboolean
forward_sticky_event (GstPad *, GstEvent **event, gpointer pad)
{
  const GstEventType type = GST_EVENT_TYPE (*event);
  if (type != GST_EVENT_STREAM_START && type != GST_EVENT_CAPS && type != GST_EVENT_EOS)
    gst_pad_push_event (GST_PAD (pad), gst_event_ref (*event));
  return TRUE;
}

static gboolean
gst_range_demux_src_event (GstPad *pad, GstObject *parent, GstEvent *event)
{
  if (GST_EVENT_TYPE (event) == GST_EVENT_SEEK &&
      GST_RANGE_DEMUX (parent)->priv->last_seek.exchange (gst_event_get_seqnum (event)) ==
          gst_event_get_seqnum (event)) {
    gst_event_unref (event);
    return TRUE;
  }
  return gst_pad_event_default (pad, parent, event);
}

static void
add_pad (GstRangeDemux *self, const View &view, GstPad *sink)
{
  DemuxPad &entry = self->priv->pads[view.id];
  gchar *name = g_strdup_printf ("src_%d", view.id);
  entry.pad = gst_pad_new_from_static_template (&src_template, name);
  entry.fresh = true;
  g_free (name);
  gst_pad_use_fixed_caps (entry.pad);
  gst_pad_set_event_function (entry.pad, GST_DEBUG_FUNCPTR (gst_range_demux_src_event));
  gst_pad_set_active (entry.pad, TRUE);
  push_stream_start (self, entry.pad, view.id);
  push_caps (self, entry, view);
  gst_pad_sticky_events_foreach (sink, forward_sticky_event, entry.pad);
  gst_flow_combiner_add_pad (self->priv->combiner, entry.pad);
  gst_element_add_pad (GST_ELEMENT (self), entry.pad);
  self->priv->had_pads = true;
}

static void
remove_pad (GstRangeDemux *self, DemuxPad &entry)
{
  gst_flow_combiner_remove_pad (self->priv->combiner, entry.pad);
  gst_pad_set_active (entry.pad, FALSE);
  gst_element_remove_pad (GST_ELEMENT (self), entry.pad);
  entry.pad = nullptr;
  gst_caps_replace (&entry.caps, nullptr);
}

/* New pads are added before old ones are removed, so that an application always has one to show. */
static void
update_pads (GstRangeDemux *self, GstPad *sink)
{
  GstRangeDemuxPrivate *priv = self->priv;
  bool changed = false;
  for (const View &view : priv->info.rig.views)
    if (DemuxPad &entry = priv->pads[view.id]; entry.pad) {
      push_caps (self, entry, view);
    } else {
      add_pad (self, view, sink);
      changed = true;
    }
  for (int id = 0; id < kMaxViews; id++)
    if (DemuxPad &entry = priv->pads[id]; entry.pad && !priv->info.rig.find (id)) {
      gst_pad_push_event (entry.pad, gst_event_new_eos ());
      remove_pad (self, entry);
      changed = true;
    }
  if (changed)
    gst_element_no_more_pads (GST_ELEMENT (self));
}

/* ---- events ---- */

static gboolean
handle_caps (GstRangeDemux *self, GstPad *sink, GstEvent *event)
{
  GstRangeDemuxPrivate *priv = self->priv;
  GstCaps *caps;
  gst_event_parse_caps (event, &caps);
  const Status status = gstrange::parse_caps (caps, priv->info);
  gst_event_unref (event);
  if (gst_range_flow_return (GST_ELEMENT (self), status) != GST_FLOW_OK)
    return FALSE;
  update_pads (self, sink);
  return TRUE;
}

static gboolean
handle_stream_start (GstRangeDemux *self, GstEvent *event)
{
  GstRangeDemuxPrivate *priv = self->priv;
  if (!gst_event_parse_group_id (event, &priv->group_id))
    priv->group_id = GST_GROUP_ID_INVALID;
  gst_event_unref (event);
  for (int id = 0; id < kMaxViews; id++)
    if (priv->pads[id].pad) {
      push_stream_start (self, priv->pads[id].pad, id);
      gst_caps_replace (&priv->pads[id].caps, nullptr); /* sent again */
    }
  return TRUE;
}

static gboolean
gst_range_demux_sink_event (GstPad *sink, GstObject *parent, GstEvent *event)
{
  auto self = GST_RANGE_DEMUX (parent);
  switch (GST_EVENT_TYPE (event)) {
    case GST_EVENT_CAPS:
      return handle_caps (self, sink, event);
    case GST_EVENT_STREAM_START:
      return handle_stream_start (self, event);
    case GST_EVENT_FLUSH_STOP:
      gst_flow_combiner_reset (self->priv->combiner);
      break;
    case GST_EVENT_EOS:
      if (!self->priv->had_pads) /* sinks behind it would wait for EOS forever */
        GST_ELEMENT_ERROR (self, STREAM, DEMUX,
            ("The stream ended before caps with a rig, which names the views"), (nullptr));
      break;
    default:
      break;
  }
  return gst_pad_event_default (sink, parent, event);
}

/* ---- life ---- */

static GstStateChangeReturn
gst_range_demux_change_state (GstElement *element, GstStateChange transition)
{
  auto self = GST_RANGE_DEMUX (element);
  GstRangeDemuxPrivate *priv = self->priv;
  const GstStateChangeReturn result =
      GST_ELEMENT_CLASS (gst_range_demux_parent_class)->change_state (element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) { /* no streaming thread runs any more */
    for (DemuxPad &entry : priv->pads)
      if (entry.pad)
        remove_pad (self, entry);
    gst_flow_combiner_reset (priv->combiner);
    priv->info = {};
    priv->had_pads = false;
    priv->group_id = GST_GROUP_ID_INVALID;
    priv->last_seek = GST_SEQNUM_INVALID;
  }
  return result;
}

static void
gst_range_demux_init (GstRangeDemux *self)
{
  self->priv = new GstRangeDemuxPrivate;
  GstPad *sink = gst_pad_new_from_static_template (&sink_template, "sink");
  gst_pad_set_chain_function (sink, GST_DEBUG_FUNCPTR (gst_range_demux_chain));
  gst_pad_set_event_function (sink, GST_DEBUG_FUNCPTR (gst_range_demux_sink_event));
  gst_element_add_pad (GST_ELEMENT (self), sink);
}

static void
gst_range_demux_class_init (GstRangeDemuxClass *klass)
{
  auto object_class = G_OBJECT_CLASS (klass);
  auto element_class = GST_ELEMENT_CLASS (klass);

  object_class->finalize = delete_private<GstRangeDemux>;
  gst_element_class_add_static_pad_template (element_class, &sink_template);
  gst_element_class_add_static_pad_template (element_class, &src_template);
  gst_element_class_set_static_metadata (element_class, "Range demultiplexer", "Demuxer/Video",
      "Splits a stream of range frame sets into one stream per view", "gst-rangecast");

  element_class->change_state = GST_DEBUG_FUNCPTR (gst_range_demux_change_state);

  GST_DEBUG_CATEGORY_INIT (gst_range_demux_debug, "rangedemux", 0, "Range demultiplexer");
}
