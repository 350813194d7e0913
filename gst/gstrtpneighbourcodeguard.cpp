/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-rtpneighbourcodeguard
 * @title: rtpneighbourcodeguard
 *
 * Lets the packets of one sender of coded frame sets through, and nothing else that arrives at its
 * port: no other bytes, no other codec, no second sender. A sender that comes back with another
 * SSRC, or from another address, takes over when the one before has been silent. It belongs between
 * udpsrc and rtpjitterbuffer, which one packet of a foreign stream brings out of step.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 udpsrc port=5004
 * caps="application/x-rtp,media=application,clock-rate=90000,encoding-name=X-NEIGHBOUR-CODE" !
 * rtpneighbourcodeguard ! rtpjitterbuffer ! rtpneighbourcodedepay ! neighbourcodedec !
 * cylinderfilter ! striprender ! glimagesink
 * ]|
 *
 * Since: 0.1
 */
#include "gstrtpneighbourcodeguard.h"

#include <gst/net/gstnetaddressmeta.h>
#include <gst/rtp/rtp.h>

#include <mutex>
#include <optional>
#include <rangecast/neighbourcode/unit.hpp>
#include <span>

GST_DEBUG_CATEGORY_STATIC (gst_rtp_neighbour_code_guard_debug);
#define GST_CAT_DEFAULT gst_rtp_neighbour_code_guard_debug

enum { PROP_0, PROP_TIMEOUT, PROP_STATS };

static constexpr GstClockTime kDefaultTimeout = 500 * GST_MSECOND;
static constexpr guint kRivalPackets = 100;  /* before somebody is told of them */
static constexpr std::size_t kRtxHeader = 2; /* the original sequence number, RFC 4588 */

struct GuardCounters {
  guint64 passed = 0, foreign = 0, senders = 0;
};

struct GstRtpNeighbourCodeGuardPrivate {
  std::mutex lock; /* guards what follows; never held while pushing or posting */
  GstClockTime timeout = kDefaultTimeout;
  GuardCounters counters;
  std::optional<guint32> ssrc;       /* of the sender whose packets pass */
  guint8 payload_type = 0;           /* of its packets of slices */
  GSocketAddress *address = nullptr; /* and where it sends from, if udpsrc says it */

  /* streaming thread only */
  GstClockTime last_time = 0;      /* of its last packet */
  std::optional<guint32> rtx_ssrc; /* under which its packets come again */
  guint rival_packets = 0;         /* of a second sender, since it began */
  GstCaps *caps = nullptr;         /* as they came */
};

struct _GstRtpNeighbourCodeGuard {
  GstElement parent;
  GstPad *sinkpad, *srcpad;
  GstRtpNeighbourCodeGuardPrivate *priv;
};

static GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE (
    "sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS ("application/x-rtp"));
static GstStaticPadTemplate src_template = GST_STATIC_PAD_TEMPLATE (
    "src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS ("application/x-rtp"));

G_DEFINE_TYPE (GstRtpNeighbourCodeGuard, gst_rtp_neighbour_code_guard, GST_TYPE_ELEMENT);
GST_ELEMENT_REGISTER_DEFINE (rtpneighbourcodeguard, "rtpneighbourcodeguard", GST_RANK_NONE,
    GST_TYPE_RTP_NEIGHBOUR_CODE_GUARD)

/* ---- packets ---- */

/* Whether the bytes are slices and views of a rig from the first to the last: what no other codec's
 * are, nor a FEC packet's. */
static bool
are_units (std::span<const guint8> payload)
{
  using namespace rangecast;
  UnitReader reader (payload);
  UnitHeader header;
  SliceHeader slice;
  bool any = false;
  while (const auto unit = reader.next (header)) {
    any = true;
    if (header.type == static_cast<guint8> (UnitType::kSlice)) {
      if (!read_slice_header (*unit, slice).ok ())
        return false;
    } else if (header.type != static_cast<guint8> (UnitType::kRigView)) {
      return false;
    }
  }
  return any && reader.status ().ok ();
}

/* What of a packet the guard looks at. */
struct Packet {
  guint32 ssrc = 0;
  guint8 payload_type = 0;
  bool units = false, repeated_units = false;
  GSocketAddress *address = nullptr; /* of the buffer */
};

static bool
is_from (GSocketAddress *a, GSocketAddress *b)
{
  if (!a || !b)
    return true;               /* not known */
  gchar first[64], second[64]; /* as the system has them: addresses and ports of IPv4 and IPv6 */
  const gssize size = g_socket_address_get_native_size (a);
  return size == g_socket_address_get_native_size (b) && size <= gssize (sizeof first) &&
         g_socket_address_to_native (a, first, sizeof first, nullptr) &&
         g_socket_address_to_native (b, second, sizeof second, nullptr) &&
         memcmp (first, second, gsize (size)) == 0;
}

static bool
read_packet (GstBuffer *buffer, Packet &packet)
{
  GstRTPBuffer rtp = GST_RTP_BUFFER_INIT;
  if (!gst_rtp_buffer_map (buffer, GST_MAP_READ, &rtp))
    return false;
  const std::span<const guint8> payload (
      static_cast<const guint8 *> (gst_rtp_buffer_get_payload (&rtp)),
      gst_rtp_buffer_get_payload_len (&rtp));
  if (GstNetAddressMeta *meta = gst_buffer_get_net_address_meta (buffer))
    packet.address = meta->addr;
  packet.ssrc = gst_rtp_buffer_get_ssrc (&rtp);
  packet.payload_type = gst_rtp_buffer_get_payload_type (&rtp);
  packet.units = are_units (payload);
  packet.repeated_units =
      !packet.units && payload.size () > kRtxHeader && are_units (payload.subspan (kRtxHeader));
  gst_rtp_buffer_unmap (&rtp);
  return true;
}

/* Downstream learns whose packets these are; a payload type, which would keep FEC packets from the
 * jitter buffer, is left out. */
static void
push_caps (GstRtpNeighbourCodeGuard *self)
{
  GstRtpNeighbourCodeGuardPrivate *priv = self->priv;
  if (!priv->caps)
    return;
  GstCaps *caps = gst_caps_copy (priv->caps);
  gst_structure_remove_field (gst_caps_get_structure (caps, 0), "payload");
  if (priv->ssrc)
    gst_caps_set_simple (caps, "ssrc", G_TYPE_UINT, *priv->ssrc, nullptr);
  gst_pad_push_event (self->srcpad, gst_event_new_caps (caps));
  gst_caps_unref (caps);
}

static GstClockTime
time_of (GstBuffer *buffer)
{
  const GstClockTime time = GST_BUFFER_DTS_OR_PTS (buffer);
  return GST_CLOCK_TIME_IS_VALID (time) ? time : gst_util_get_timestamp ();
}

enum class Verdict { kPasses, kPassesAsFirst, kForeign, kRival };

/* Under the lock. */
static Verdict
judge (GstRtpNeighbourCodeGuardPrivate *priv, const Packet &packet, GstClockTime now)
{
  const bool same_place = is_from (priv->address, packet.address);
  if (priv->ssrc && packet.ssrc == *priv->ssrc && same_place) {
    priv->last_time = now;
    priv->rival_packets = 0;
    if (packet.units)
      priv->payload_type = packet.payload_type;
    return Verdict::kPasses; /* or FEC */
  }
  if (priv->ssrc && same_place && packet.payload_type != priv->payload_type &&
      (packet.repeated_units || packet.ssrc == priv->rtx_ssrc)) {
    priv->rtx_ssrc = packet.ssrc;
    return Verdict::kPasses;
  }
  if (!packet.units)
    return Verdict::kForeign;
  if (priv->ssrc && now < priv->last_time + priv->timeout)
    return ++priv->rival_packets == kRivalPackets ? Verdict::kRival : Verdict::kForeign;
  priv->ssrc = packet.ssrc;
  g_set_object (&priv->address, packet.address);
  priv->payload_type = packet.payload_type;
  priv->last_time = now;
  priv->rtx_ssrc.reset ();
  priv->rival_packets = 0;
  priv->counters.senders++;
  return Verdict::kPassesAsFirst;
}

static GstFlowReturn
gst_rtp_neighbour_code_guard_chain (GstPad *, GstObject *parent, GstBuffer *buffer)
{
  auto self = GST_RTP_NEIGHBOUR_CODE_GUARD (parent);
  GstRtpNeighbourCodeGuardPrivate *priv = self->priv;
  Packet packet;
  Verdict verdict = Verdict::kForeign;
  const bool is_rtp = read_packet (buffer, packet);
  {
    std::lock_guard guard (priv->lock);
    if (is_rtp)
      verdict = judge (priv, packet, time_of (buffer));
    const bool passes = verdict == Verdict::kPasses || verdict == Verdict::kPassesAsFirst;
    (passes ? priv->counters.passed : priv->counters.foreign)++;
  }
  switch (verdict) {
    case Verdict::kPasses:
      return gst_pad_push (self->srcpad, buffer);
    case Verdict::kPassesAsFirst:
      GST_INFO_OBJECT (self, "SSRC %08x passes", packet.ssrc);
      push_caps (self);
      buffer = gst_buffer_make_writable (buffer);
      GST_BUFFER_FLAG_SET (buffer, GST_BUFFER_FLAG_DISCONT);
      return gst_pad_push (self->srcpad, buffer);
    case Verdict::kRival:
      GST_ELEMENT_WARNING (self, RESOURCE, BUSY,
          ("Two senders at one port: packets of SSRC %08x are dropped, expected those of %08x",
              packet.ssrc, *priv->ssrc),
          (nullptr));
      break;
    case Verdict::kForeign:
      break;
  }
  gst_buffer_unref (buffer);
  return GST_FLOW_OK;
}

/* ---- events ---- */

static gboolean
gst_rtp_neighbour_code_guard_sink_event (GstPad *pad, GstObject *parent, GstEvent *event)
{
  auto self = GST_RTP_NEIGHBOUR_CODE_GUARD (parent);
  if (GST_EVENT_TYPE (event) == GST_EVENT_FLUSH_STOP) { /* times may begin anew */
    std::lock_guard guard (self->priv->lock);
    self->priv->ssrc.reset ();
    g_clear_object (&self->priv->address);
  }
  if (GST_EVENT_TYPE (event) != GST_EVENT_CAPS)
    return gst_pad_event_default (pad, parent, event);
  GstCaps *caps = nullptr;
  gst_event_parse_caps (event, &caps);
  gst_caps_replace (&self->priv->caps, caps);
  gst_event_unref (event);
  push_caps (self);
  return TRUE;
}

/* Requests for a key frame set and for a lost packet say which stream they are about, as rtpbin's
 * demultiplexers do it: rtpsession makes a PLI or a NACK of such ones. One that a viewer sent to a
 * parent names the parent's own stream, so whatever it names is replaced. */
static gboolean
gst_rtp_neighbour_code_guard_src_event (GstPad *pad, GstObject *parent, GstEvent *event)
{
  auto self = GST_RTP_NEIGHBOUR_CODE_GUARD (parent);
  const GstStructure *structure = gst_event_get_structure (event);
  if (GST_EVENT_TYPE (event) == GST_EVENT_CUSTOM_UPSTREAM && structure &&
      (gst_structure_has_name (structure, "GstForceKeyUnit") ||
          gst_structure_has_name (structure, "GstRTPRetransmissionRequest"))) {
    std::lock_guard guard (self->priv->lock);
    if (self->priv->ssrc) {
      event = gst_event_make_writable (event);
      gst_structure_set (gst_event_writable_structure (event), "ssrc", G_TYPE_UINT,
          *self->priv->ssrc, "payload", G_TYPE_UINT, guint (self->priv->payload_type), nullptr);
    }
  }
  return gst_pad_event_default (pad, parent, event);
}

/* ---- life ---- */

static GstStateChangeReturn
gst_rtp_neighbour_code_guard_change_state (GstElement *element, GstStateChange transition)
{
  auto self = GST_RTP_NEIGHBOUR_CODE_GUARD (element);
  const GstStateChangeReturn result = GST_ELEMENT_CLASS (gst_rtp_neighbour_code_guard_parent_class)
                                          ->change_state (element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) {
    gst_caps_replace (&self->priv->caps, nullptr);
    self->priv->rtx_ssrc.reset ();
    self->priv->rival_packets = 0;
    std::lock_guard guard (self->priv->lock);
    self->priv->ssrc.reset ();
    g_clear_object (&self->priv->address);
    self->priv->counters = {};
  }
  return result;
}

static void
gst_rtp_neighbour_code_guard_set_property (
    GObject *object, guint id, const GValue *value, GParamSpec *pspec)
{
  GstRtpNeighbourCodeGuardPrivate *priv = GST_RTP_NEIGHBOUR_CODE_GUARD (object)->priv;
  if (id != PROP_TIMEOUT) {
    G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
    return;
  }
  std::lock_guard guard (priv->lock);
  priv->timeout = g_value_get_uint64 (value);
}

static void
gst_rtp_neighbour_code_guard_get_property (
    GObject *object, guint id, GValue *value, GParamSpec *pspec)
{
  GstRtpNeighbourCodeGuardPrivate *priv = GST_RTP_NEIGHBOUR_CODE_GUARD (object)->priv;
  std::lock_guard guard (priv->lock);
  switch (id) {
    case PROP_TIMEOUT:
      g_value_set_uint64 (value, priv->timeout);
      break;
    case PROP_STATS:
      g_value_take_boxed (value,
          gst_structure_new ("application/x-rtpneighbourcodeguard-stats", "passed", G_TYPE_UINT64,
              priv->counters.passed, "foreign", G_TYPE_UINT64, priv->counters.foreign, "senders",
              G_TYPE_UINT64, priv->counters.senders, nullptr));
      break;
    default:
      G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
  }
}

static void
gst_rtp_neighbour_code_guard_finalize (GObject *object)
{
  GstRtpNeighbourCodeGuardPrivate *priv = GST_RTP_NEIGHBOUR_CODE_GUARD (object)->priv;
  gst_caps_replace (&priv->caps, nullptr);
  g_clear_object (&priv->address);
  delete priv;
  G_OBJECT_CLASS (gst_rtp_neighbour_code_guard_parent_class)->finalize (object);
}

static void
gst_rtp_neighbour_code_guard_init (GstRtpNeighbourCodeGuard *self)
{
  self->priv = new GstRtpNeighbourCodeGuardPrivate;
  self->sinkpad = gst_pad_new_from_static_template (&sink_template, "sink");
  gst_pad_set_chain_function (self->sinkpad, gst_rtp_neighbour_code_guard_chain);
  gst_pad_set_event_function (self->sinkpad, gst_rtp_neighbour_code_guard_sink_event);
  GST_PAD_SET_PROXY_ALLOCATION (self->sinkpad);
  gst_element_add_pad (GST_ELEMENT (self), self->sinkpad);
  self->srcpad = gst_pad_new_from_static_template (&src_template, "src");
  gst_pad_set_event_function (self->srcpad, gst_rtp_neighbour_code_guard_src_event);
  gst_element_add_pad (GST_ELEMENT (self), self->srcpad);
}

static void
gst_rtp_neighbour_code_guard_class_init (GstRtpNeighbourCodeGuardClass *klass)
{
  auto object_class = G_OBJECT_CLASS (klass);
  auto element_class = GST_ELEMENT_CLASS (klass);

  object_class->set_property = gst_rtp_neighbour_code_guard_set_property;
  object_class->get_property = gst_rtp_neighbour_code_guard_get_property;
  object_class->finalize = gst_rtp_neighbour_code_guard_finalize;

  g_object_class_install_property (object_class, PROP_TIMEOUT,
      g_param_spec_uint64 ("timeout", "Timeout",
          "Another sender takes over when the one that passes has been silent for so long, "
          "nanoseconds",
          0, G_MAXUINT64, kDefaultTimeout,
          GParamFlags (G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_PLAYING)));
  g_object_class_install_property (object_class, PROP_STATS,
      g_param_spec_boxed ("stats", "Statistics",
          "Counters since start: packets passed, packets foreign (dropped), senders that passed",
          GST_TYPE_STRUCTURE, GParamFlags (G_PARAM_READABLE | G_PARAM_STATIC_STRINGS)));

  gst_element_class_add_static_pad_template (element_class, &sink_template);
  gst_element_class_add_static_pad_template (element_class, &src_template);
  gst_element_class_set_static_metadata (element_class, "RTP neighbour code guard",
      "Filter/Network/RTP", "Lets one sender of coded range frame sets through and nothing else",
      "gst-rangecast");
  element_class->change_state = gst_rtp_neighbour_code_guard_change_state;

  GST_DEBUG_CATEGORY_INIT (
      gst_rtp_neighbour_code_guard_debug, "rtpneighbourcodeguard", 0, "RTP neighbour code guard");
}
