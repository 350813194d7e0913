/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-rtcpreports
 * @title: rtcpreports
 *
 * Tells an encoder what receivers report in plain RTCP: of each report block about the stream that
 * goes through from sink to src, in the RTCP that goes through from rtcp_sink to rtcp_src, it sends
 * an event RangecastReceiverReport upstream. Both streams go through untouched.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 rtpbin name=r avatartestsrc is-live=true num-buffers=100 ! neighbourcodeenc
 * adaptive-bitrate=true ! rtpneighbourcodepay ! rtcpreports name=reports ! r.send_rtp_sink_0
 * r.send_rtp_src_0 ! udpsink host=127.0.0.1 port=5004 r.send_rtcp_src_0 ! udpsink host=127.0.0.1
 * port=5005 sync=false async=false udpsrc port=5006 ! reports.rtcp_sink reports.rtcp_src !
 * r.recv_rtcp_sink_0
 * ]|
 *
 * Since: 0.1
 */
#include "gstrtcpreports.h"

#include <gst/rtp/rtp.h>

#include <algorithm>
#include <array>
#include <mutex>

GST_DEBUG_CATEGORY_STATIC (gst_rtcp_reports_debug);
#define GST_CAT_DEFAULT gst_rtcp_reports_debug

/* What was last reported by one receiver of one stream. */
struct Known {
  guint32 receiver = 0, sender = 0, highest = 0;
  guint64 use = 0; /* 0: free; the least was used longest ago */
};

struct GstRtcpReportsPrivate {
  std::mutex lock; /* guards what follows; never held across a push */
  guint32 ssrc = 0;
  bool has_ssrc = false;
  int clock_rate = 90000;

  /* streaming thread of rtcp_sink only */
  std::array<Known, 64> known;
  guint64 uses = 0;
};

struct _GstRtcpReports {
  GstElement parent;
  GstPad *sink, *src, *rtcp_sink, *rtcp_src;
  GstRtcpReportsPrivate *priv;
};

static GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE (
    "sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS ("application/x-rtp"));
static GstStaticPadTemplate src_template = GST_STATIC_PAD_TEMPLATE (
    "src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS ("application/x-rtp"));
static GstStaticPadTemplate rtcp_sink_template = GST_STATIC_PAD_TEMPLATE (
    "rtcp_sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS ("application/x-rtcp"));
static GstStaticPadTemplate rtcp_src_template = GST_STATIC_PAD_TEMPLATE (
    "rtcp_src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS ("application/x-rtcp"));

G_DEFINE_TYPE (GstRtcpReports, gst_rtcp_reports, GST_TYPE_ELEMENT)
GST_ELEMENT_REGISTER_DEFINE (rtcpreports, "rtcpreports", GST_RANK_NONE, GST_TYPE_RTCP_REPORTS)

/* ---- reports ---- */

struct ReportBlock {
  guint32 receiver = 0, sender = 0, highest = 0, jitter = 0, last_sr = 0, delay = 0;
  guint8 fraction_lost = 0;
};

/* Packets since the receiver's last report; 0: not known. */
static guint32
count_packets (GstRtcpReportsPrivate *priv, const ReportBlock &block)
{
  const auto same = [&] (const Known &known) {
    return known.use > 0 && known.receiver == block.receiver && known.sender == block.sender;
  };
  auto known = std::ranges::find_if (priv->known, same);
  const bool is_new = known == priv->known.end ();
  if (is_new)
    known = std::ranges::min_element (priv->known, {}, &Known::use);
  const guint32 packets = is_new ? 0 : block.highest - known->highest;
  *known = {block.receiver, block.sender, block.highest, ++priv->uses};
  return packets < (1u << 24) ? packets : 0;
}

/* RFC 3550, 6.4.1: when the report came, less what the receiver waited, less when the sender's
 * report went, all in units of 1/65536 s of NTP time, which rtpsession takes from the clock of the
 * day (ntp-time-source=ntp). 0 where that makes no sense. */
static GstClockTime
round_trip_time (const ReportBlock &block)
{
  if (block.last_sr == 0)
    return 0;
  const auto now =
      guint32 (gst_util_uint64_scale (guint64 (g_get_real_time ()), 65536, G_USEC_PER_SEC) +
               (guint64{2208988800} << 16));
  const guint32 trip = now - block.last_sr - block.delay;
  return trip < 10 * 65536 ? gst_util_uint64_scale (trip, GST_SECOND, 65536) : 0;
}

static void
send_report (GstRtcpReports *self, const ReportBlock &block)
{
  GstRtcpReportsPrivate *priv = self->priv;
  guint clock_rate = 90000;
  {
    std::lock_guard guard (priv->lock);
    if (!priv->has_ssrc || priv->ssrc != block.sender)
      return;
    clock_rate = guint (priv->clock_rate);
  }
  GstStructure *report = gst_structure_new ("RangecastReceiverReport", "ssrc", G_TYPE_UINT,
      block.receiver, "fraction-lost", G_TYPE_DOUBLE, block.fraction_lost / 256.0, "packets",
      G_TYPE_UINT, count_packets (priv, block), "jitter", G_TYPE_UINT64,
      gst_util_uint64_scale (block.jitter, GST_SECOND, clock_rate), "round-trip-time",
      G_TYPE_UINT64, round_trip_time (block), nullptr);
  GST_LOG_OBJECT (self, "%" GST_PTR_FORMAT, report);
  gst_pad_push_event (self->sink, gst_event_new_custom (GST_EVENT_CUSTOM_UPSTREAM, report));
}

static void
send_reports (GstRtcpReports *self, GstRTCPPacket *packet)
{
  const GstRTCPType type = gst_rtcp_packet_get_type (packet);
  ReportBlock block;
  if (type == GST_RTCP_TYPE_RR)
    block.receiver = gst_rtcp_packet_rr_get_ssrc (packet);
  else if (type == GST_RTCP_TYPE_SR)
    gst_rtcp_packet_sr_get_sender_info (
        packet, &block.receiver, nullptr, nullptr, nullptr, nullptr);
  else
    return;
  for (guint i = 0; i < gst_rtcp_packet_get_rb_count (packet); i++) {
    gint32 lost_ever = 0;
    gst_rtcp_packet_get_rb (packet, i, &block.sender, &block.fraction_lost, &lost_ever,
        &block.highest, &block.jitter, &block.last_sr, &block.delay);
    send_report (self, block);
  }
}

static GstFlowReturn
gst_rtcp_reports_rtcp_chain (GstPad *, GstObject *parent, GstBuffer *buffer)
{
  auto self = GST_RTCP_REPORTS (parent);
  GstRTCPBuffer rtcp = GST_RTCP_BUFFER_INIT;
  if (gst_rtcp_buffer_validate_reduced (buffer) &&
      gst_rtcp_buffer_map (buffer, GST_MAP_READ, &rtcp)) {
    GstRTCPPacket packet;
    for (gboolean more = gst_rtcp_buffer_get_first_packet (&rtcp, &packet); more;
         more = gst_rtcp_packet_move_to_next (&packet))
      send_reports (self, &packet);
    gst_rtcp_buffer_unmap (&rtcp);
  }
  return gst_pad_push (self->rtcp_src, buffer);
}

/* ---- the stream itself ---- */

static void
note_packet (GstRtcpReports *self, GstBuffer *buffer)
{
  GstRTPBuffer rtp = GST_RTP_BUFFER_INIT;
  if (!gst_rtp_buffer_map (buffer, GST_MAP_READ, &rtp))
    return;
  const guint32 ssrc = gst_rtp_buffer_get_ssrc (&rtp);
  gst_rtp_buffer_unmap (&rtp);
  std::lock_guard guard (self->priv->lock);
  self->priv->ssrc = ssrc;
  self->priv->has_ssrc = true;
}

static GstFlowReturn
gst_rtcp_reports_chain (GstPad *, GstObject *parent, GstBuffer *buffer)
{
  auto self = GST_RTCP_REPORTS (parent);
  note_packet (self, buffer);
  return gst_pad_push (self->src, buffer);
}

static GstFlowReturn
gst_rtcp_reports_chain_list (GstPad *, GstObject *parent, GstBufferList *list)
{
  auto self = GST_RTCP_REPORTS (parent);
  if (gst_buffer_list_length (list) > 0)
    note_packet (self, gst_buffer_list_get (list, 0));
  return gst_pad_push_list (self->src, list);
}

static gboolean
gst_rtcp_reports_sink_event (GstPad *pad, GstObject *parent, GstEvent *event)
{
  auto self = GST_RTCP_REPORTS (parent);
  if (GST_EVENT_TYPE (event) == GST_EVENT_CAPS) {
    GstCaps *caps = nullptr;
    int rate = 0;
    gst_event_parse_caps (event, &caps);
    if (gst_structure_get_int (gst_caps_get_structure (caps, 0), "clock-rate", &rate) && rate > 0) {
      std::lock_guard guard (self->priv->lock);
      self->priv->clock_rate = rate;
    }
  }
  return gst_pad_event_default (pad, parent, event);
}

/* Each stream goes through on its own: events and queries of one are not for the other. */
static GstIterator *
gst_rtcp_reports_links (GstPad *pad, GstObject *parent)
{
  auto self = GST_RTCP_REPORTS (parent);
  GstPad *other = pad == self->sink        ? self->src
                  : pad == self->src       ? self->sink
                  : pad == self->rtcp_sink ? self->rtcp_src
                                           : self->rtcp_sink;
  GValue value = G_VALUE_INIT;
  g_value_init (&value, GST_TYPE_PAD);
  g_value_set_object (&value, other);
  GstIterator *links = gst_iterator_new_single (GST_TYPE_PAD, &value);
  g_value_unset (&value);
  return links;
}

/* ---- life ---- */

static GstStateChangeReturn
gst_rtcp_reports_change_state (GstElement *element, GstStateChange transition)
{
  const GstStateChangeReturn result =
      GST_ELEMENT_CLASS (gst_rtcp_reports_parent_class)->change_state (element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) {
    GstRtcpReportsPrivate *priv = GST_RTCP_REPORTS (element)->priv;
    std::lock_guard guard (priv->lock);
    priv->has_ssrc = false;
    priv->known = {};
    priv->uses = 0;
  }
  return result;
}

static void
gst_rtcp_reports_finalize (GObject *object)
{
  delete GST_RTCP_REPORTS (object)->priv;
  G_OBJECT_CLASS (gst_rtcp_reports_parent_class)->finalize (object);
}

static GstPad *
add_pad (GstRtcpReports *self, GstStaticPadTemplate *pad_template)
{
  GstPad *pad = gst_pad_new_from_static_template (pad_template, pad_template->name_template);
  gst_pad_set_iterate_internal_links_function (pad, gst_rtcp_reports_links);
  GST_PAD_SET_PROXY_CAPS (pad);
  GST_PAD_SET_PROXY_ALLOCATION (pad);
  gst_element_add_pad (GST_ELEMENT (self), pad);
  return pad;
}

static void
gst_rtcp_reports_init (GstRtcpReports *self)
{
  self->priv = new GstRtcpReportsPrivate;
  self->sink = add_pad (self, &sink_template);
  self->src = add_pad (self, &src_template);
  self->rtcp_sink = add_pad (self, &rtcp_sink_template);
  self->rtcp_src = add_pad (self, &rtcp_src_template);
  gst_pad_set_chain_function (self->sink, gst_rtcp_reports_chain);
  gst_pad_set_chain_list_function (self->sink, gst_rtcp_reports_chain_list);
  gst_pad_set_event_function (self->sink, gst_rtcp_reports_sink_event);
  gst_pad_set_chain_function (self->rtcp_sink, gst_rtcp_reports_rtcp_chain);
}

static void
gst_rtcp_reports_class_init (GstRtcpReportsClass *klass)
{
  auto object_class = G_OBJECT_CLASS (klass);
  auto element_class = GST_ELEMENT_CLASS (klass);

  object_class->finalize = gst_rtcp_reports_finalize;
  element_class->change_state = gst_rtcp_reports_change_state;
  gst_element_class_add_static_pad_template (element_class, &sink_template);
  gst_element_class_add_static_pad_template (element_class, &src_template);
  gst_element_class_add_static_pad_template (element_class, &rtcp_sink_template);
  gst_element_class_add_static_pad_template (element_class, &rtcp_src_template);
  gst_element_class_set_static_metadata (element_class, "RTCP reports for encoders",
      "Network/RTP/Analyzer",
      "Tells an encoder what receivers report in RTCP: loss, jitter, round trip", "gst-rangecast");

  GST_DEBUG_CATEGORY_INIT (gst_rtcp_reports_debug, "rtcpreports", 0, "RTCP reports for encoders");
}
