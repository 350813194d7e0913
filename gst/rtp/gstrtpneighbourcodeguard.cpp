/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-rtpneighbourcodeguard
 * @title: rtpneighbourcodeguard
 *
 * Passes the RTP packets of one sender of coded frame sets (or of another payload, such as speech,
 * whose encoding-name is in the caps) and drops everything else that arrives at its port. A sender
 * is accepted after consecutive valid packets, and replaced by another when it has been silent,
 * sooner from the same address and port. Place it between udpsrc and rtpjitterbuffer, which accepts
 * any RTP packet. Directly behind udpsrc it attaches a socket filter, so that the kernel drops
 * floods of foreign packets.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 udpsrc port=5004
 * caps="application/x-rtp,media=video,clock-rate=90000,encoding-name=X-NEIGHBOUR-CODE" !
 * rtpneighbourcodeguard ! rtpjitterbuffer ! rtpneighbourcodedepay ! neighbourcodedec !
 * rangealign ! striprender ! glimagesink
 * ]|
 *
 * Since: 0.1
 */
#include "gstrtpneighbourcodeguard.h"

#include <gst/net/gstnet.h>
#include <gst/rtp/rtp.h>

#include <mutex>
#include <new>
#include <optional>
#include <rangecast/neighbourcode/bitstream/unit.hpp>
#include <span>

#include "common/properties.hpp"
#include "netarrival.hpp"
#include "senderfilter.hpp"
#include "senderprobation.hpp"
#include "senderrivals.hpp"

GST_DEBUG_CATEGORY_STATIC (gst_rtp_neighbour_code_guard_debug);
#define GST_CAT_DEFAULT gst_rtp_neighbour_code_guard_debug

enum : guint { PROP_STATS = 1, PROP_SETTINGS };

namespace {

/* Of two streams from one address and port the second waits for this silence of the first: it may
 * be a sender that was restarted, but also two senders behind one socket or relay. */
constexpr GstClockTime kRestartTimeout = 250 * GST_MSECOND;
/* Minimum number and duration of invalid packets, without a sender, for a warning. */
constexpr guint kMinInvalidPackets = 20;
constexpr GstClockTime kMinInvalidTime = 3 * GST_SECOND;
constexpr char kEncoding[] = "X-NEIGHBOUR-CODE";
constexpr std::size_t kRtxHeader = 2; /* the original sequence number, RFC 4588 */

struct Settings {
  GstClockTime timeout = 500 * GST_MSECOND; /* silence after which another sender is accepted */
};

/* Since start. */
struct Counters {
  guint64 passed = 0, foreign = 0, senders = 0;
};

} // namespace

struct GstRtpNeighbourCodeGuardPrivate {
  std::mutex lock; /* guards what follows; never held while pushing or posting */
  Settings settings;
  Counters counters;
  std::optional<guint32> ssrc; /* of the accepted sender */
  guint8 payload_type = 0;     /* of its packets of slices */

  /* streaming thread only */
  GstClockTime last_time = 0;          /* of the sender's last packet */
  std::optional<guint32> rtx_ssrc;     /* of its retransmissions */
  GSocketAddress *address = nullptr;   /* of the sender; null: unknown */
  SenderProbation probation;           /* of sources, before one is accepted */
  SenderRivals rivals, other_versions; /* while the sender sends */
  guint64 invalid = 0;                 /* packets since the last one that passed */
  GstClockTime invalid_since = 0;
  bool warned_of_version = false, warned_of_invalid = false;
  GSocket *filtered = nullptr; /* udpsrc's socket, if it has a filter */
  bool filter_paused = false;  /* while the sender is silent */
  GstCaps *caps = nullptr;     /* of the sink pad */
  bool any_payload = false;    /* the caps name another encoding, whose packets are not examined */
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

/* As version_of_units(); may throw std::bad_alloc. */
static int
read_units (std::span<const guint8> payload)
{
  using namespace rangecast;
  UnitReader reader (payload);
  UnitHeader header;
  SliceHeader slice;
  bool any = false;
  while (const auto unit = reader.next (header)) {
    if (header.type == static_cast<guint8> (UnitType::kSlice)) {
      if (!read_slice_header (*unit, slice).ok ())
        return 0;
      any = true;
    }
    any |= header.type == static_cast<guint8> (UnitType::kRigView);
  }
  if (reader.status ().ok ())
    return any ? kBitstreamVersion : 0;
  /* Of other versions only the sizes of units are known: they must lead to the end. */
  const int version = payload.empty () ? 0 : payload[0] >> 4;
  if (version == kBitstreamVersion)
    return 0;
  while (payload.size () >= kUnitHeaderSize) {
    const gsize size = payload[2] | payload[3] << 8;
    if (payload[0] >> 4 != version || size < kUnitHeaderSize || size > payload.size ())
      return 0;
    payload = payload.subspan (size);
  }
  return payload.empty () ? version : 0;
}

/* The version of the neighbour code if all bytes are its units, with a slice or a rig view among
 * them, which distinguishes them from other codecs and FEC; else 0. */
static int
version_of_units (std::span<const guint8> payload) noexcept
{
  try {
    return read_units (payload);
  } catch (const std::bad_alloc &) { /* for the text of a Status */
    return 0;
  }
}

namespace {

/* What decides about a packet. */
struct Packet {
  bool is_rtp = false; /* else only its address is set */
  guint32 ssrc = 0;
  guint16 sequence = 0;
  guint8 payload_type = 0;
  int version = 0; /* of the neighbour code; 0: another payload */
  bool units = false, repeated_units = false;
  GSocketAddress *address = nullptr; /* of the buffer */
};

} // namespace

/* @param any_payload  whether every RTP packet is a valid one */
static Packet
read_packet (GstBuffer *buffer, bool any_payload)
{
  Packet packet;
  GstRTPBuffer rtp = GST_RTP_BUFFER_INIT;
  if (const GstNetAddressMeta *meta = gst_buffer_get_net_address_meta (buffer))
    packet.address = meta->addr;
  if (!gst_rtp_buffer_map (buffer, GST_MAP_READ, &rtp))
    return packet;
  packet.is_rtp = true;
  const std::span<const guint8> payload (
      static_cast<const guint8 *> (gst_rtp_buffer_get_payload (&rtp)),
      gst_rtp_buffer_get_payload_len (&rtp));
  packet.ssrc = gst_rtp_buffer_get_ssrc (&rtp);
  packet.sequence = gst_rtp_buffer_get_seq (&rtp);
  packet.payload_type = gst_rtp_buffer_get_payload_type (&rtp);
  packet.version = any_payload ? rangecast::kBitstreamVersion : version_of_units (payload);
  packet.units = packet.version == rangecast::kBitstreamVersion;
  packet.repeated_units =
      !packet.units && payload.size () > kRtxHeader &&
      version_of_units (payload.subspan (kRtxHeader)) == rangecast::kBitstreamVersion;
  gst_rtp_buffer_unmap (&rtp);
  return packet;
}

/* ---- the socket filter ---- */

/* The socket of the udpsrc that is linked to the sink pad, or nullptr. */
static GSocket *
find_socket (GstRtpNeighbourCodeGuard *self)
{
  GSocket *socket = nullptr;
  GstPad *peer = gst_pad_get_peer (self->sinkpad);
  GstElement *source = peer ? gst_pad_get_parent_element (peer) : nullptr;
  if (source && g_object_class_find_property (G_OBJECT_GET_CLASS (source), "used-socket"))
    g_object_get (source, "used-socket", &socket, nullptr);
  gst_clear_object (&source);
  gst_clear_object (&peer);
  return socket;
}

static void
stop_filter (GstRtpNeighbourCodeGuardPrivate *priv)
{
  if (priv->filtered && !priv->filter_paused)
    SenderFilter::detach (priv->filtered);
  g_clear_object (&priv->filtered);
  priv->filter_paused = false;
}

/* While the sender is silent all packets are let in: the next sender may be among them. */
static void
pause_filter (GstRtpNeighbourCodeGuardPrivate *priv, bool paused)
{
  if (!priv->filtered || priv->filter_paused == paused)
    return;
  priv->filter_paused = paused;
  if (paused)
    SenderFilter::detach (priv->filtered);
  else
    SenderFilter::attach (priv->filtered, priv->address);
}

static void
start_filter (GstRtpNeighbourCodeGuard *self)
{
  GstRtpNeighbourCodeGuardPrivate *priv = self->priv;
  stop_filter (priv);
  GSocket *socket = priv->address ? find_socket (self) : nullptr;
  if (socket && SenderFilter::attach (socket, priv->address))
    priv->filtered = G_SOCKET (g_object_ref (socket));
  g_clear_object (&socket);
}

/* Adds the sender's SSRC to the caps, and removes the payload type, because of which the jitter
 * buffer would drop FEC packets. */
static void
push_caps (GstRtpNeighbourCodeGuard *self)
{
  GstRtpNeighbourCodeGuardPrivate *priv = self->priv;
  if (!priv->caps)
    return;
  GstCaps *caps = gst_caps_copy (priv->caps);
  if (!priv->any_payload)
    gst_structure_remove_field (gst_caps_get_structure (caps, 0), "payload");
  if (priv->ssrc)
    gst_caps_set_simple (caps, "ssrc", G_TYPE_UINT, *priv->ssrc, nullptr);
  GST_INFO_OBJECT (self, "%" GST_PTR_FORMAT, caps);
  gst_pad_push_event (self->srcpad, gst_event_new_caps (caps));
  gst_caps_unref (caps);
}

/* ---- classification of packets, under the lock ---- */

namespace {
enum class Verdict {
  kPasses,
  kPassesAsFirst, /* a new sender is accepted */
  kForeign,       /* dropped */
  /* dropped, with a warning */
  kInvalid,
  kRival,
  kOtherVersion
};
} // namespace

/* Whether it is a packet of the sender, or a retransmission.
 * @param here  it comes from the sender's address and port */
static bool
is_of_sender (GstRtpNeighbourCodeGuardPrivate *priv, const Packet &packet, bool here)
{
  if (!priv->ssrc || !here || !packet.is_rtp)
    return false;
  if (packet.ssrc == *priv->ssrc) /* slices, or FEC */
    return packet.units || packet.payload_type != priv->payload_type;
  if (packet.payload_type == priv->payload_type ||
      (!packet.repeated_units && packet.ssrc != priv->rtx_ssrc))
    return false;
  priv->rtx_ssrc = packet.ssrc;
  return true;
}

static void
accept_sender (GstRtpNeighbourCodeGuardPrivate *priv, const Packet &packet)
{
  priv->ssrc = packet.ssrc;
  priv->payload_type = packet.payload_type;
  g_set_object (&priv->address, packet.address);
  priv->rtx_ssrc.reset ();
  priv->probation.clear ();
  priv->rivals.clear ();
  priv->other_versions.clear ();
  priv->warned_of_invalid = false;
  priv->counters.senders++;
}

/* An invalid packet while there is no sender, or it is silent. */
static Verdict
classify_invalid (GstRtpNeighbourCodeGuardPrivate *priv, GstClockTime now)
{
  if (priv->invalid++ == 0)
    priv->invalid_since = now;
  const bool report = !priv->warned_of_invalid && priv->invalid >= kMinInvalidPackets &&
                      now >= priv->invalid_since && now - priv->invalid_since >= kMinInvalidTime;
  priv->warned_of_invalid |= report;
  return report ? Verdict::kInvalid : Verdict::kForeign;
}

/* A valid packet of another source while the sender sends. */
static Verdict
classify_rival (GstRtpNeighbourCodeGuardPrivate *priv, const SenderProbation::Packet &packet)
{
  if (packet.version == rangecast::kBitstreamVersion)
    return priv->rivals.add (packet, priv->last_time) ? Verdict::kRival : Verdict::kForeign;
  /* A source that sends this version, too, sends damaged copies. */
  if (packet.ssrc == *priv->ssrc || priv->rivals.comes_from (packet.address) ||
      priv->warned_of_version || !priv->other_versions.add (packet, priv->last_time))
    return Verdict::kForeign;
  priv->warned_of_version = true;
  return Verdict::kOtherVersion;
}

/* @param[out] stream  the packets that pass with kPassesAsFirst */
static Verdict
classify_packet (GstRtpNeighbourCodeGuardPrivate *priv, const Packet &packet, GstClockTime now,
    GstBuffer *buffer, SenderProbation::Stream &stream)
{
  /* Packets that rtprtxreceive has restored have no address; those from the network have one. */
  const bool here = !packet.address || same_sender (packet.address, priv->address);
  if (is_of_sender (priv, packet, here)) {
    if (packet.ssrc == *priv->ssrc)
      priv->last_time = now;
    priv->invalid = 0;
    pause_filter (priv, false);
    return Verdict::kPasses;
  }
  const GstClockTime waited = now > priv->last_time ? now - priv->last_time : 0;
  const bool silent =
      !priv->ssrc || waited >= priv->settings.timeout || (here && waited >= kRestartTimeout);
  if (!priv->ssrc || waited >= priv->settings.timeout)
    pause_filter (priv, true);
  if (packet.version == 0)
    return silent ? classify_invalid (priv, now) : Verdict::kForeign;
  const SenderProbation::Packet known = {
      packet.address, packet.ssrc, packet.sequence, packet.version, now};
  if (!silent)
    return classify_rival (priv, known);
  if (!packet.units && priv->warned_of_version)
    return Verdict::kForeign;
  if (!priv->probation.add (known, buffer, stream))
    return Verdict::kForeign;
  if (!packet.units) {
    priv->warned_of_version = true;
    return Verdict::kOtherVersion;
  }
  accept_sender (priv, packet);
  priv->last_time = now;
  priv->invalid = 0;
  return Verdict::kPassesAsFirst;
}

/* ---- output ---- */

/* Pushes the packets that a new sender sent during probation; `stream` is empty afterwards. */
static GstFlowReturn
push_first (GstRtpNeighbourCodeGuard *self, SenderProbation::Stream &stream)
{
  GST_INFO_OBJECT (self, "accepting packets of SSRC %08x", *self->priv->ssrc);
  start_filter (self);
  push_caps (self);
  GstFlowReturn flow = GST_FLOW_OK;
  bool first = true;
  for (GstBuffer *buffer : stream) {
    if (flow != GST_FLOW_OK) {
      gst_buffer_unref (buffer);
      continue;
    }
    if (first) {
      buffer = gst_buffer_make_writable (buffer);
      GST_BUFFER_FLAG_SET (buffer, GST_BUFFER_FLAG_DISCONT);
    }
    first = false;
    flow = gst_pad_push (self->srcpad, buffer);
  }
  stream.release ();
  return flow;
}

/* (transfer full) */
static gchar *
text_of (GSocketAddress *address)
{
  return G_IS_INET_SOCKET_ADDRESS (address)
             ? g_socket_connectable_to_string (G_SOCKET_CONNECTABLE (address))
             : g_strdup ("somewhere");
}

static void
warn_of_rival (GstRtpNeighbourCodeGuard *self, const Packet &packet)
{
  gchar *rival = text_of (packet.address), *sender = text_of (self->priv->address);
  GST_ELEMENT_WARNING (self, RESOURCE, BUSY,
      ("Two senders at one port: dropping packets of SSRC %08x from %s, accepting those of %08x "
       "from %s",
          packet.ssrc, rival, *self->priv->ssrc, sender),
      (nullptr));
  g_free (sender);
  g_free (rival);
}

static void
warn_of (GstRtpNeighbourCodeGuard *self, Verdict verdict, const Packet &packet, guint64 invalid)
{
  if (verdict == Verdict::kInvalid && self->priv->any_payload)
    GST_ELEMENT_WARNING (self, STREAM, WRONG_TYPE,
        ("%" G_GUINT64_FORMAT " packets that are not RTP, and no valid one", invalid), (nullptr));
  else if (verdict == Verdict::kInvalid)
    GST_ELEMENT_WARNING (self, STREAM, WRONG_TYPE,
        ("%" G_GUINT64_FORMAT " invalid packets and no valid one: expected coded frame sets of "
         "version %d; the stream is of another codec, or encrypted (--key)",
            invalid, rangecast::kBitstreamVersion),
        (nullptr));
  if (verdict == Verdict::kRival)
    warn_of_rival (self, packet);
  if (verdict == Verdict::kOtherVersion)
    GST_ELEMENT_WARNING (self, STREAM, WRONG_TYPE,
        ("A sender uses version %d of the neighbour code: dropped; expected version %d",
            packet.version, rangecast::kBitstreamVersion),
        (nullptr));
}

static GstFlowReturn
gst_rtp_neighbour_code_guard_chain (GstPad *, GstObject *parent, GstBuffer *buffer)
{
  auto self = GST_RTP_NEIGHBOUR_CODE_GUARD (parent);
  GstRtpNeighbourCodeGuardPrivate *priv = self->priv;
  const Packet packet = read_packet (buffer, priv->any_payload);
  Verdict verdict = Verdict::kForeign;
  SenderProbation::Stream stream;
  const GstClockTime now = arrival_time (GST_ELEMENT (self), buffer);
  guint64 invalid = 0;
  {
    std::lock_guard guard (priv->lock);
    verdict = classify_packet (priv, packet, now, buffer, stream);
    invalid = priv->invalid;
    priv->counters.passed += verdict == Verdict::kPasses          ? 1
                             : verdict == Verdict::kPassesAsFirst ? stream.size ()
                                                                  : 0;
    if (verdict == Verdict::kPassesAsFirst)
      priv->counters.foreign -= stream.size () - 1; /* counted during probation */
    else
      priv->counters.foreign += verdict != Verdict::kPasses;
  }
  if (verdict == Verdict::kPasses)
    return gst_pad_push (self->srcpad, buffer);
  if (verdict == Verdict::kPassesAsFirst) {
    gst_buffer_unref (buffer); /* the stream has a reference */
    return push_first (self, stream);
  }
  GST_DEBUG_OBJECT (self, "dropping a packet: SSRC %08x, %s", packet.ssrc,
      !packet.is_rtp        ? "not RTP"
      : packet.version == 0 ? "not the neighbour code"
                            : "not of the sender");
  warn_of (self, verdict, packet, invalid);
  stream.unref ();
  gst_buffer_unref (buffer);
  return GST_FLOW_OK;
}

/* Under the lock. */
static void
reset_sender (GstRtpNeighbourCodeGuardPrivate *priv)
{
  stop_filter (priv);
  priv->ssrc.reset ();
  priv->rtx_ssrc.reset ();
  priv->probation.clear ();
  priv->rivals.clear ();
  priv->other_versions.clear ();
  priv->invalid = 0;
  g_clear_object (&priv->address);
}

/* ---- events ---- */

static gboolean
gst_rtp_neighbour_code_guard_sink_event (GstPad *pad, GstObject *parent, GstEvent *event)
{
  auto self = GST_RTP_NEIGHBOUR_CODE_GUARD (parent);
  if (GST_EVENT_TYPE (event) == GST_EVENT_FLUSH_STOP) { /* times may start again */
    std::lock_guard guard (self->priv->lock);
    reset_sender (self->priv);
  }
  if (GST_EVENT_TYPE (event) != GST_EVENT_CAPS)
    return gst_pad_event_default (pad, parent, event);
  GstCaps *caps = nullptr;
  gst_event_parse_caps (event, &caps);
  const gchar *encoding =
      gst_structure_get_string (gst_caps_get_structure (caps, 0), "encoding-name");
  self->priv->any_payload = encoding && g_strcmp0 (encoding, kEncoding) != 0;
  gst_caps_replace (&self->priv->caps, caps);
  gst_event_unref (event);
  push_caps (self);
  return TRUE;
}

/* Sets SSRC and payload type of requests for key frame sets and lost packets, as rtpbin's
 * demultiplexers do: rtpsession turns them into PLI and NACK. A request of a viewer to a parent
 * names the parent's own stream, so existing values are replaced. */
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
    std::lock_guard guard (self->priv->lock);
    reset_sender (self->priv);
    self->priv->warned_of_version = self->priv->warned_of_invalid = false;
    self->priv->counters = {};
  }
  return result;
}

static PropertyTable<Settings> &
guard_properties ()
{
  using P = PropertyTable<Settings>;
  static P table = {
      P::number<&Settings::timeout> ("timeout", "Timeout",
          "Silence of the current sender in nanoseconds after which another sender is accepted "
          "(G_MAXUINT64 = never)",
          0, G_MAXUINT64, kMutablePlaying),
  };
  return table;
}

static void
gst_rtp_neighbour_code_guard_set_property (
    GObject *object, guint id, const GValue *value, GParamSpec *pspec)
{
  GstRtpNeighbourCodeGuardPrivate *priv = GST_RTP_NEIGHBOUR_CODE_GUARD (object)->priv;
  std::lock_guard guard (priv->lock);
  if (!guard_properties ().set (priv->settings, id, value))
    G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
}

static void
gst_rtp_neighbour_code_guard_get_property (
    GObject *object, guint id, GValue *value, GParamSpec *pspec)
{
  GstRtpNeighbourCodeGuardPrivate *priv = GST_RTP_NEIGHBOUR_CODE_GUARD (object)->priv;
  std::lock_guard guard (priv->lock);
  if (id == PROP_STATS)
    g_value_take_boxed (value,
        gst_structure_new ("application/x-rtpneighbourcodeguard-stats", "passed", G_TYPE_UINT64,
            priv->counters.passed, "foreign", G_TYPE_UINT64, priv->counters.foreign, "senders",
            G_TYPE_UINT64, priv->counters.senders, nullptr));
  else if (!guard_properties ().get (priv->settings, id, value))
    G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
}

static void
gst_rtp_neighbour_code_guard_finalize (GObject *object)
{
  GstRtpNeighbourCodeGuardPrivate *priv = GST_RTP_NEIGHBOUR_CODE_GUARD (object)->priv;
  gst_caps_replace (&priv->caps, nullptr);
  reset_sender (priv);
  delete priv;
  G_OBJECT_CLASS (gst_rtp_neighbour_code_guard_parent_class)->finalize (object);
}

static void
gst_rtp_neighbour_code_guard_init (GstRtpNeighbourCodeGuard *self)
{
  self->priv = new GstRtpNeighbourCodeGuardPrivate;
  self->sinkpad = gst_pad_new_from_static_template (&sink_template, "sink");
  gst_pad_set_chain_function (
      self->sinkpad, GST_DEBUG_FUNCPTR (gst_rtp_neighbour_code_guard_chain));
  gst_pad_set_event_function (
      self->sinkpad, GST_DEBUG_FUNCPTR (gst_rtp_neighbour_code_guard_sink_event));
  GST_PAD_SET_PROXY_ALLOCATION (self->sinkpad);
  gst_element_add_pad (GST_ELEMENT (self), self->sinkpad);
  self->srcpad = gst_pad_new_from_static_template (&src_template, "src");
  gst_pad_set_event_function (
      self->srcpad, GST_DEBUG_FUNCPTR (gst_rtp_neighbour_code_guard_src_event));
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

  guard_properties ().install (object_class, PROP_SETTINGS);
  install_stats (object_class, PROP_STATS,
      "Counters since the element was started: passed and foreign packets, and senders");

  gst_element_class_add_static_pad_template (element_class, &sink_template);
  gst_element_class_add_static_pad_template (element_class, &src_template);
  gst_element_class_set_static_metadata (element_class, "RTP neighbour code guard",
      "Filter/Network/RTP", "Passes the RTP packets of one sender and drops those of all others",
      "gst-rangecast");
  element_class->change_state = GST_DEBUG_FUNCPTR (gst_rtp_neighbour_code_guard_change_state);

  GST_DEBUG_CATEGORY_INIT (
      gst_rtp_neighbour_code_guard_debug, "rtpneighbourcodeguard", 0, "RTP neighbour code guard");
}
