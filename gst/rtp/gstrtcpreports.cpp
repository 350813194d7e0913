/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-rtcpreports
 * @title: rtcpreports
 *
 * Sends an upstream event RangecastReceiverReport for each RTCP report block about the stream that
 * passes from sink to src, read from the RTCP that passes from rtcp_sink to rtcp_src. Both streams
 * pass unchanged, except that only RTCP of the stream's receivers, and of at most max-receivers of
 * them, passes: rtpsession keeps a source for every SSRC that it sees.
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

#include <gst/net/gstnet.h>
#include <gst/rtp/rtp.h>

#include <mutex>
#include <optional>
#include <span>

#include "common/elementproperties.hpp"
#include "netarrival.hpp"
#include "rtcppackets.hpp"
#include "rtcpreceivers.hpp"

GST_DEBUG_CATEGORY_STATIC (gst_rtcp_reports_debug);
#define GST_CAT_DEFAULT gst_rtcp_reports_debug

namespace {
struct Settings {
  guint max_receivers = RtcpReceivers::kDefaultMax;
};
} // namespace

struct GstRtcpReportsPrivate {
  std::mutex lock; /* guards what follows; never held across a push */
  Settings settings;
  std::optional<guint32> ssrc; /* of the stream */
  int clock_rate = 90000;
  guint receivers = 0;                /* current number */
  guint64 refused = 0, malformed = 0; /* RTCP packets since start */

  /* streaming thread of rtcp_sink only */
  RtcpReceivers known;
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

/* ---- who sends an RTCP packet ---- */

namespace {

/* The stream at the time of an RTCP packet. */
struct Stream {
  guint32 ssrc;
  guint clock_rate;
};

/* What decides whether a compound packet is accepted. */
struct Compound {
  std::optional<guint32> source;          /* of all its packets but feedback */
  std::optional<guint32> feedback_source; /* of feedback packets */
  bool of_several = false; /* sources, as from mixers: one packet could add many sources */
  bool reports = false;    /* says something about the stream */

  void add_source (guint32 ssrc)
  {
    of_several |= source.value_or (ssrc) != ssrc;
    source = ssrc;
  }
};

} // namespace

/* RFC 5104, 4.3.1: full intra requests list their streams in the body. */
static bool
requests_intra (const RtcpPacket &packet, guint32 ssrc)
{
  if (packet.type != GST_RTCP_TYPE_PSFB || packet.count != GST_RTCP_PSFB_TYPE_FIR)
    return false;
  for (std::size_t i = 2; i + 1 < packet.body.size () / 4; i += 2)
    if (packet.word (i) == ssrc)
      return true;
  return false;
}

static void
read_source (const RtcpPacket &packet, guint32 ssrc, Compound &compound)
{
  std::span<const guint8> chunks = packet.body;
  guint32 source = 0;
  switch (packet.type) {
    case GST_RTCP_TYPE_RR:
    case GST_RTCP_TYPE_SR:
      compound.add_source (packet.word (0));
      for (guint i = 0; i < count_report_blocks (packet); i++)
        compound.reports |= read_report_block (packet, i).stream == ssrc;
      return;
    case GST_RTCP_TYPE_SDES:
      for (guint i = 0; i < packet.count && pop_sdes_chunk (chunks, source); i++)
        compound.add_source (source);
      return;
    case GST_RTCP_TYPE_BYE:
      for (guint i = 0; i < packet.count; i++)
        compound.add_source (packet.word (i));
      return;
    case GST_RTCP_TYPE_RTPFB:
    case GST_RTCP_TYPE_PSFB:
      compound.feedback_source = packet.word (0);
      compound.reports |= packet.word (1) == ssrc || requests_intra (packet, ssrc);
      return;
    default:
      return;
  }
}

static Compound
read_compound (std::span<const guint8> rtcp, guint32 ssrc)
{
  Compound compound;
  RtcpReader reader (rtcp);
  for (RtcpPacket packet; reader.next (packet);)
    read_source (packet, ssrc, compound);
  return compound;
}

/* @return the receiver that sent it; nullptr if it is refused */
static RtcpReceivers::Receiver *
admit (GstRtcpReports *self, GstBuffer *buffer, const Compound &compound, guint32 ssrc, guint max)
{
  const auto source = compound.source ? compound.source : compound.feedback_source;
  if (!source || compound.of_several || *source == ssrc) /* our own SSRC: looped, or forged */
    return nullptr;
  const GstNetAddressMeta *meta = gst_buffer_get_net_address_meta (buffer);
  return self->priv->known.admit (*source, meta ? meta->addr : nullptr, compound.reports,
      arrival_time (GST_ELEMENT (self), buffer), max);
}

/* ---- reports ---- */

/* Packets since the receiver's last report; 0: not known. */
static guint32
count_packets (RtcpReceivers::Receiver &receiver, const RtcpReportBlock &block)
{
  const bool is_new = !receiver.has_reported || receiver.stream != block.stream;
  const guint32 packets = is_new ? 0 : block.highest - receiver.highest;
  receiver.has_reported = true;
  receiver.stream = block.stream;
  receiver.highest = block.highest;
  return packets < (1u << 24) ? packets : 0;
}

/* RFC 3550, 6.4.1: arrival of the report - delay at the receiver - time of the sender report, in
 * units of 1/65536 s of NTP time, which rtpsession takes from the wall clock (ntp-time-source=ntp).
 * 0 if the result is impossible. */
static GstClockTime
round_trip_time (const RtcpReportBlock &block)
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
send_report (GstRtcpReports *self, RtcpReceivers::Receiver &receiver, const RtcpReportBlock &block,
    guint clock_rate)
{
  GstStructure *report = gst_structure_new ("RangecastReceiverReport", "ssrc", G_TYPE_UINT,
      receiver.ssrc, "fraction-lost", G_TYPE_DOUBLE, block.fraction_lost / 256.0, "packets",
      G_TYPE_UINT, count_packets (receiver, block), "jitter", G_TYPE_UINT64,
      gst_util_uint64_scale (block.jitter, GST_SECOND, clock_rate), "round-trip-time",
      G_TYPE_UINT64, round_trip_time (block), nullptr);
  GST_LOG_OBJECT (self, "%" GST_PTR_FORMAT, report);
  gst_pad_push_event (self->sink, gst_event_new_custom (GST_EVENT_CUSTOM_UPSTREAM, report));
}

static void
send_reports (GstRtcpReports *self, std::span<const guint8> rtcp, RtcpReceivers::Receiver &receiver,
    const Stream &stream)
{
  RtcpReader reader (rtcp);
  for (RtcpPacket packet; reader.next (packet);)
    for (guint i = 0; i < count_report_blocks (packet); i++) {
      const RtcpReportBlock block = read_report_block (packet, i);
      if (block.stream == stream.ssrc)
        send_report (self, receiver, block, stream.clock_rate);
    }
}

static GstFlowReturn
gst_rtcp_reports_rtcp_chain (GstPad *, GstObject *parent, GstBuffer *buffer)
{
  auto self = GST_RTCP_REPORTS (parent);
  GstRtcpReportsPrivate *priv = self->priv;
  std::optional<Stream> stream;
  guint max = 0;
  {
    std::lock_guard guard (priv->lock);
    max = priv->settings.max_receivers;
    if (priv->ssrc)
      stream = {*priv->ssrc, guint (priv->clock_rate)};
  }
  GstMapInfo map = GST_MAP_INFO_INIT;
  const bool mapped = gst_buffer_map (buffer, &map, GST_MAP_READ);
  const std::span<const guint8> rtcp (map.data, map.size);
  const bool sound = RtcpReader::is_sound (rtcp);
  RtcpReceivers::Receiver *receiver = nullptr;
  if (sound && stream)
    receiver = admit (self, buffer, read_compound (rtcp, stream->ssrc), stream->ssrc, max);
  if (receiver)
    send_reports (self, rtcp, *receiver, *stream);
  if (mapped)
    gst_buffer_unmap (buffer, &map);
  {
    std::lock_guard guard (priv->lock);
    priv->receivers = priv->known.size ();
    priv->malformed += !sound;
    priv->refused += sound && !receiver;
  }
  if (receiver)
    return gst_pad_push (self->rtcp_src, buffer);
  GST_DEBUG_OBJECT (self, "dropping RTCP: %s",
      !sound    ? "malformed"
      : !stream ? "there is no stream yet"
                : "not of a receiver of the stream, or too many");
  gst_buffer_unref (buffer);
  return GST_FLOW_OK;
}

/* ---- the stream itself ---- */

static void
record_ssrc (GstRtcpReports *self, GstBuffer *buffer)
{
  GstRTPBuffer rtp = GST_RTP_BUFFER_INIT;
  if (!gst_rtp_buffer_map (buffer, GST_MAP_READ, &rtp))
    return;
  const guint32 ssrc = gst_rtp_buffer_get_ssrc (&rtp);
  gst_rtp_buffer_unmap (&rtp);
  std::lock_guard guard (self->priv->lock);
  self->priv->ssrc = ssrc;
}

static GstFlowReturn
gst_rtcp_reports_chain (GstPad *, GstObject *parent, GstBuffer *buffer)
{
  auto self = GST_RTCP_REPORTS (parent);
  record_ssrc (self, buffer);
  return gst_pad_push (self->src, buffer);
}

static GstFlowReturn
gst_rtcp_reports_chain_list (GstPad *, GstObject *parent, GstBufferList *list)
{
  auto self = GST_RTCP_REPORTS (parent);
  if (gst_buffer_list_length (list) > 0)
    record_ssrc (self, gst_buffer_list_get (list, 0));
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

/* RTP and RTCP pass separately: events and queries of one are not forwarded to the other. */
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
    priv->ssrc.reset ();
    priv->known.clear ();
    priv->receivers = 0;
    priv->refused = priv->malformed = 0;
  }
  return result;
}

static PropertyTable<Settings> &
reports_properties ()
{
  using P = PropertyTable<Settings>;
  static P table = {
      P::number<&Settings::max_receivers> ("max-receivers", "Maximum receivers",
          "Maximum number of receivers whose RTCP is accepted at a time; one address may have a "
          "quarter of it",
          1, RtcpReceivers::kMax, kMutablePlaying),
  };
  return table;
}

static GstStructure *
make_stats (const GstRtcpReportsPrivate *priv)
{
  return gst_structure_new ("application/x-rtcpreports-stats", "receivers", G_TYPE_UINT64,
      guint64 (priv->receivers), "refused", G_TYPE_UINT64, priv->refused, "malformed",
      G_TYPE_UINT64, priv->malformed, nullptr);
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
  gst_pad_set_iterate_internal_links_function (pad, GST_DEBUG_FUNCPTR (gst_rtcp_reports_links));
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
  gst_pad_set_chain_function (self->sink, GST_DEBUG_FUNCPTR (gst_rtcp_reports_chain));
  gst_pad_set_chain_list_function (self->sink, GST_DEBUG_FUNCPTR (gst_rtcp_reports_chain_list));
  gst_pad_set_event_function (self->sink, GST_DEBUG_FUNCPTR (gst_rtcp_reports_sink_event));
  gst_pad_set_chain_function (self->rtcp_sink, gst_rtcp_reports_rtcp_chain);
}

static void
gst_rtcp_reports_class_init (GstRtcpReportsClass *klass)
{
  auto object_class = G_OBJECT_CLASS (klass);
  auto element_class = GST_ELEMENT_CLASS (klass);

  object_class->finalize = gst_rtcp_reports_finalize;

  install_properties<GstRtcpReports, reports_properties, make_stats> (object_class,
      "Current number of receivers, and the RTCP packets refused and malformed since the "
      "element was started");

  element_class->change_state = GST_DEBUG_FUNCPTR (gst_rtcp_reports_change_state);
  gst_element_class_add_static_pad_template (element_class, &sink_template);
  gst_element_class_add_static_pad_template (element_class, &src_template);
  gst_element_class_add_static_pad_template (element_class, &rtcp_sink_template);
  gst_element_class_add_static_pad_template (element_class, &rtcp_src_template);
  gst_element_class_set_static_metadata (element_class, "RTCP reports for encoders",
      "Network/RTP/Analyzer",
      "Reports loss, jitter and round-trip time from RTCP receiver reports to the encoder",
      "gst-rangecast");

  GST_DEBUG_CATEGORY_INIT (gst_rtcp_reports_debug, "rtcpreports", 0, "RTCP reports for encoders");
}
