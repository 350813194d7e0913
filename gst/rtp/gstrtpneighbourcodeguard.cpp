/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-rtpneighbourcodeguard
 * @title: rtpneighbourcodeguard
 *
 * Passes the RTP packets of one sender of coded frame sets (or of another payload, such as audio,
 * whose encoding-name is in the caps) and drops all others at its port. It accepts the address and
 * SSRC of the first three consecutive packets, until they are silent for half a second. Place it
 * between udpsrc (or srtpdec) and rtpjitterbuffer, which accepts any RTP packet. It is no
 * protection against forged packets; SRTP is.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 udpsrc port=5004 \
 *   caps="application/x-rtp,media=video,clock-rate=90000,encoding-name=X-NEIGHBOUR-CODE" ! \
 *   rtpneighbourcodeguard ! rtpjitterbuffer ! rtpneighbourcodedepay ! neighbourcodedec ! \
 *   rangealign ! striprender ! glimagesink
 * ]|
 *
 * Since: 0.1
 */
#include <gst/gst.h>

#include <gst/net/gstnet.h>
#include <gst/rtp/rtp.h>

#include <array>
#include <mutex>
#include <optional>
#include <rangecast/neighbourcode/bitstream/unit.hpp>
#include <span>
#include <string>
#include <utility>

#include "common/elementproperties.hpp"

GST_DEBUG_CATEGORY_STATIC (gst_rtp_neighbour_code_guard_debug);
#define GST_CAT_DEFAULT gst_rtp_neighbour_code_guard_debug

namespace {

constexpr gsize kConsecutive = 3;                     /* packets of a new sender */
constexpr GstClockTime kSilence = 500 * GST_MSECOND;  /* then another sender is accepted */
constexpr GstClockTime kBothSend = 2 * GST_SECOND;    /* then there is a warning, ... */
constexpr guint kInvalidPackets = 20;                 /* ... and after so many invalid packets */
constexpr GstClockTime kInvalidTime = 3 * GST_SECOND; /* in this time */
constexpr char kEncoding[] = "X-NEIGHBOUR-CODE";

struct Packet {
  bool valid = false; /* RTP with coded frame sets, or with the other payload of the caps */
  bool is_rtp = false;
  guint32 ssrc = 0;
  guint16 sequence = 0;
  guint8 payload_type = 0;
  GSocketAddress *address = nullptr; /* of the buffer; null: unknown */
};

/* Consecutive packets of one address and SSRC that may become the sender. The first one is valid,
 * FEC may follow. */
struct Candidate {
  GSocketAddress *address = nullptr; /* a reference */
  guint32 ssrc = 0;
  guint8 payload_type = 0;
  guint16 next = 0; /* sequence number */
  gsize count = 0;
  std::array<GstBuffer *, kConsecutive> packets = {}; /* references */

  void clear ()
  {
    for (gsize i = 0; i < count; i++)
      gst_buffer_unref (packets[i]);
    count = 0;
    g_clear_object (&address);
  }
};

} // namespace

struct GstRtpNeighbourCodeGuardPrivate {
  std::mutex lock; /* guards what follows; never held while pushing or posting */
  guint64 passed = 0, foreign = 0, senders = 0; /* since start */
  std::optional<guint32> ssrc;                  /* of the sender */
  guint8 payload_type = 0;                      /* of its coded frame sets */

  /* streaming thread only */
  GSocketAddress *address = nullptr; /* of the sender; null: unknown */
  GstClockTime last_time = 0;        /* of the sender's last packet */
  Candidate candidate;
  std::string other; /* a second sender, not yet warned of */
  GstClockTime other_since = 0;
  bool has_other = false; /* a second sender was found since the sender was accepted */
  guint invalid = 0;      /* packets in a row without a sender */
  GstClockTime invalid_since = 0;
  bool warned_of_invalid = false;
  GstCaps *caps = nullptr;  /* of the sink pad */
  bool any_payload = false; /* the caps name another encoding, whose packets are not examined */
};

G_DECLARE_FINAL_TYPE (GstRtpNeighbourCodeGuard, gst_rtp_neighbour_code_guard, GST,
    RTP_NEIGHBOUR_CODE_GUARD, GstElement)

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
    gst_rtp_neighbour_code_guard_get_type ())

/* ---- packets ---- */

namespace {

/* Whether all bytes are units of this version: those of other codecs, of FEC and of encrypted
 * packets are not. */
bool
is_units (std::span<const guint8> payload)
{
  if (payload.empty ())
    return false;
  while (payload.size () >= rangecast::kUnitHeaderSize) {
    const gsize size = payload[2] | payload[3] << 8;
    if (payload[0] >> 4 != rangecast::kBitstreamVersion || size < rangecast::kUnitHeaderSize ||
        size > payload.size ())
      return false;
    payload = payload.subspan (size);
  }
  return payload.empty ();
}

Packet
read_packet (GstBuffer *buffer, bool any_payload)
{
  Packet packet;
  GstRTPBuffer rtp = GST_RTP_BUFFER_INIT;
  if (const GstNetAddressMeta *meta = gst_buffer_get_net_address_meta (buffer))
    packet.address = meta->addr;
  if (!gst_rtp_buffer_map (buffer, GST_MAP_READ, &rtp))
    return packet;
  packet.is_rtp = true;
  packet.ssrc = gst_rtp_buffer_get_ssrc (&rtp);
  packet.sequence = gst_rtp_buffer_get_seq (&rtp);
  packet.payload_type = gst_rtp_buffer_get_payload_type (&rtp);
  packet.valid =
      any_payload || is_units ({static_cast<const guint8 *> (gst_rtp_buffer_get_payload (&rtp)),
                         gst_rtp_buffer_get_payload_len (&rtp)});
  gst_rtp_buffer_unmap (&rtp);
  return packet;
}

/* Whether both are one address and port; unknown ones (null) are equal. */
bool
same_address (GSocketAddress *a, GSocketAddress *b)
{
  if (a == b)
    return true;
  if (!G_IS_INET_SOCKET_ADDRESS (a) || !G_IS_INET_SOCKET_ADDRESS (b))
    return false;
  const auto x = G_INET_SOCKET_ADDRESS (a), y = G_INET_SOCKET_ADDRESS (b);
  return g_inet_socket_address_get_port (x) == g_inet_socket_address_get_port (y) &&
         g_inet_address_equal (
             g_inet_socket_address_get_address (x), g_inet_socket_address_get_address (y));
}

std::string
sender_text (guint32 ssrc, GSocketAddress *address)
{
  gchar *from = G_IS_INET_SOCKET_ADDRESS (address)
                    ? g_socket_connectable_to_string (G_SOCKET_CONNECTABLE (address))
                    : g_strdup ("an unknown address");
  gchar *text = g_strdup_printf ("SSRC %08x from %s", ssrc, from);
  const std::string result = text;
  g_free (text);
  g_free (from);
  return result;
}

/* @return whether it is the last one needed */
bool
add_packet (Candidate &candidate, const Packet &packet, GstBuffer *buffer)
{
  const bool follows = candidate.count > 0 && packet.is_rtp && packet.ssrc == candidate.ssrc &&
                       packet.sequence == candidate.next &&
                       same_address (packet.address, candidate.address);
  if (!follows && !packet.valid)
    return false;
  if (!follows) {
    candidate.clear ();
    candidate.ssrc = packet.ssrc;
    candidate.payload_type = packet.payload_type;
    g_set_object (&candidate.address, packet.address);
  }
  candidate.next = guint16 (packet.sequence + 1);
  candidate.packets[candidate.count++] = gst_buffer_ref (buffer);
  return candidate.count == kConsecutive;
}

/* The running time at which udpsrc received a packet, or the current one if the buffer has no time.
 * Without a pipeline clock, when no packet can have a time, it is the monotonic time. */
GstClockTime
arrival_time (GstElement *element, GstBuffer *buffer)
{
  GstClockTime time = GST_BUFFER_DTS_OR_PTS (buffer);
  if (!GST_CLOCK_TIME_IS_VALID (time))
    time = gst_element_get_current_running_time (element);
  return GST_CLOCK_TIME_IS_VALID (time) ? time : gst_util_get_timestamp ();
}

} // namespace

/* Whether it is a packet of the sender: with its SSRC coded frame sets and FEC, with another SSRC
 * retransmissions, which have another payload type. */
static bool
is_of_sender (const GstRtpNeighbourCodeGuardPrivate *priv, const Packet &packet)
{
  if (!priv->ssrc || !packet.is_rtp)
    return false;
  /* Packets that rtprtxreceive has restored have no address. */
  if (!packet.address || !same_address (packet.address, priv->address))
    return !packet.address && packet.ssrc == *priv->ssrc;
  return packet.ssrc == *priv->ssrc || packet.payload_type != priv->payload_type;
}

/* A sender counts its SSRC up when its sequence numbers have wrapped (pipelines/run/srtp-key.cpp);
 * the numbers go on. */
static bool
is_next_ssrc (const GstRtpNeighbourCodeGuardPrivate *priv, const Packet &packet)
{
  return priv->ssrc && packet.valid && packet.ssrc == *priv->ssrc + 1 &&
         (!packet.address || same_address (packet.address, priv->address));
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

/* Makes the candidate the sender, and pushes its packets. */
static GstFlowReturn
accept_candidate (GstRtpNeighbourCodeGuard *self)
{
  GstRtpNeighbourCodeGuardPrivate *priv = self->priv;
  Candidate &candidate = priv->candidate;
  const gsize count = std::exchange (candidate.count, 0);
  {
    std::lock_guard guard (priv->lock);
    priv->ssrc = candidate.ssrc;
    priv->payload_type = candidate.payload_type;
    priv->senders++;
    priv->passed += count;
    priv->foreign -= count - 1; /* counted when they came */
  }
  g_set_object (&priv->address, candidate.address);
  g_clear_object (&candidate.address);
  priv->has_other = priv->warned_of_invalid = false;
  priv->other.clear ();
  GST_INFO_OBJECT (self, "accepting %s", sender_text (*priv->ssrc, priv->address).c_str ());
  push_caps (self);
  candidate.packets[0] = gst_buffer_make_writable (candidate.packets[0]);
  GST_BUFFER_FLAG_SET (candidate.packets[0], GST_BUFFER_FLAG_DISCONT);
  GstFlowReturn flow = GST_FLOW_OK;
  for (gsize i = 0; i < count; i++)
    if (flow == GST_FLOW_OK)
      flow = gst_pad_push (self->srcpad, candidate.packets[i]);
    else
      gst_buffer_unref (candidate.packets[i]);
  return flow;
}

/* ---- warnings ---- */

static void
warn_of_second_sender (GstRtpNeighbourCodeGuard *self, GstClockTime now)
{
  GstRtpNeighbourCodeGuardPrivate *priv = self->priv;
  if (priv->other.empty () || now < priv->other_since + kBothSend)
    return;
  GST_ELEMENT_WARNING (self, RESOURCE, BUSY,
      ("Two senders at one port: dropping packets of %s, accepting those of %s; give one of them "
       "another port",
          std::exchange (priv->other, {}).c_str (),
          sender_text (*priv->ssrc, priv->address).c_str ()),
      (nullptr));
}

static void
warn_of_invalid (GstRtpNeighbourCodeGuard *self, GstClockTime now)
{
  GstRtpNeighbourCodeGuardPrivate *priv = self->priv;
  if (priv->invalid++ == 0)
    priv->invalid_since = now;
  if (priv->warned_of_invalid || priv->invalid < kInvalidPackets ||
      now < priv->invalid_since + kInvalidTime)
    return;
  priv->warned_of_invalid = true;
  GST_ELEMENT_WARNING (self, STREAM, WRONG_TYPE,
      ("%u invalid packets and no valid one: the sender uses another codec or version (this is "
       "version %d of the neighbour code), or encrypts (set --key)",
          priv->invalid, rangecast::kBitstreamVersion),
      (nullptr));
}

/* ---- chain ---- */

static GstFlowReturn
gst_rtp_neighbour_code_guard_chain (GstPad *, GstObject *parent, GstBuffer *buffer)
{
  auto self = GST_RTP_NEIGHBOUR_CODE_GUARD (parent);
  GstRtpNeighbourCodeGuardPrivate *priv = self->priv;
  const Packet packet = read_packet (buffer, priv->any_payload);
  const GstClockTime now = arrival_time (GST_ELEMENT (self), buffer);
  if (is_of_sender (priv, packet)) {
    if (packet.ssrc == *priv->ssrc)
      priv->last_time = now;
    priv->invalid = 0;
    {
      std::lock_guard guard (priv->lock);
      priv->passed++;
    }
    warn_of_second_sender (self, now);
    return gst_pad_push (self->srcpad, buffer);
  }
  const bool next = is_next_ssrc (priv, packet);
  if (next)
    priv->candidate.clear ();
  const bool complete = add_packet (priv->candidate, packet, buffer) || next;
  const bool silent = !priv->ssrc || now >= priv->last_time + kSilence;
  if (complete && (silent || next)) {
    gst_buffer_unref (buffer); /* the candidate has a reference */
    priv->last_time = now;
    priv->invalid = 0;
    return accept_candidate (self);
  }
  GST_DEBUG_OBJECT (self, "dropping a packet: SSRC %08x, %s", packet.ssrc,
      !packet.is_rtp  ? "not RTP"
      : !packet.valid ? "not the neighbour code"
                      : "not of the sender");
  {
    std::lock_guard guard (priv->lock);
    priv->foreign++;
  }
  if (complete) {
    priv->candidate.clear ();
    if (!std::exchange (priv->has_other, true)) {
      priv->other = sender_text (packet.ssrc, packet.address);
      priv->other_since = now;
    }
  }
  if (!packet.valid && silent)
    warn_of_invalid (self, now);
  gst_buffer_unref (buffer);
  return GST_FLOW_OK;
}

static void
reset_sender (GstRtpNeighbourCodeGuardPrivate *priv)
{
  {
    std::lock_guard guard (priv->lock);
    priv->ssrc.reset ();
  }
  priv->candidate.clear ();
  priv->other.clear ();
  priv->has_other = priv->warned_of_invalid = false;
  priv->invalid = 0;
  g_clear_object (&priv->address);
}

/* ---- events ---- */

static gboolean
gst_rtp_neighbour_code_guard_sink_event (GstPad *pad, GstObject *parent, GstEvent *event)
{
  auto self = GST_RTP_NEIGHBOUR_CODE_GUARD (parent);
  if (GST_EVENT_TYPE (event) == GST_EVENT_FLUSH_STOP) /* times may start again */
    reset_sender (self->priv);
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
    reset_sender (self->priv);
    std::lock_guard guard (self->priv->lock);
    self->priv->passed = self->priv->foreign = self->priv->senders = 0;
  }
  return result;
}

static GstStructure *
make_stats (const GstRtpNeighbourCodeGuardPrivate *priv)
{
  return gst_structure_new ("application/x-rtpneighbourcodeguard-stats", "passed", G_TYPE_UINT64,
      priv->passed, "foreign", G_TYPE_UINT64, priv->foreign, "senders", G_TYPE_UINT64,
      priv->senders, nullptr);
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

  object_class->finalize = gst_rtp_neighbour_code_guard_finalize;

  install_properties<GstRtpNeighbourCodeGuard, nullptr, make_stats> (object_class,
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
