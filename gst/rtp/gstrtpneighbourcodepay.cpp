/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-rtpneighbourcodepay
 * @title: rtpneighbourcodepay
 *
 * Packs coded frame sets into RTP packets of whole units, which decode independently. The format is
 * specified in docs/formats/rtp-payload.md.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 avatartestsrc is-live=true num-buffers=100 ! neighbourcodeenc ! \
 *   rtpneighbourcodepay ! udpsink host=127.0.0.1 port=5004
 * ]|
 *
 * Since: 0.1
 */
#include <gst/rtp/gstrtpbasepayload.h>

#include <gst/rtp/rtp.h>
#include <gst/video/video.h>

#include <atomic>
#include <gstrange/gstrangeinfo.hpp>
#include <gstrange/gstrangestatus.hpp>
#include <mutex>
#include <optional>
#include <rangecast/neighbourcode/bitstream/unit.hpp>
#include <string>
#include <utility>
#include <vector>

#include "common/codedunits.hpp"
#include "common/elementproperties.hpp"

using rangecast::Status;
using rangecast::UnitHeader;
using rangecast::UnitType;

GST_DEBUG_CATEGORY_STATIC (gst_rtp_neighbour_code_pay_debug);
#define GST_CAT_DEFAULT gst_rtp_neighbour_code_pay_debug

namespace {

constexpr guint kMinPayloadType = 96;

struct Settings {
  int config_interval = 1; /* s; 0: only a changed rig, -1: with every frame set */
};

} // namespace

struct GstRtpNeighbourCodePayPrivate {
  std::mutex lock; /* guards settings */
  Settings settings;
  std::atomic<guint64> frame_sets{0}, packets{0}, bytes{0}; /* since start */
  StatsReporter reporter;                                   /* any thread; has locks of its own */

  /* streaming thread only */
  std::vector<guint8> rig_units;
  bool rig_changed = false;                       /* and has not been sent since */
  GstClockTime last_config = GST_CLOCK_TIME_NONE; /* running time */
};

DECLARE_ELEMENT (
    GstRtpNeighbourCodePay, gst_rtp_neighbour_code_pay, RTP_NEIGHBOUR_CODE_PAY, GstRTPBasePayload)

G_DEFINE_TYPE (GstRtpNeighbourCodePay, gst_rtp_neighbour_code_pay, GST_TYPE_RTP_BASE_PAYLOAD)
GST_ELEMENT_REGISTER_DEFINE (rtpneighbourcodepay, "rtpneighbourcodepay", GST_RANK_SECONDARY,
    gst_rtp_neighbour_code_pay_get_type ())

/* ---- caps ---- */

/* For SDP: fmtp parameters, which are strings there, and rtcp-fb attributes for requests of key
 * frame sets (PLI, FIR), which an encoder upstream answers. */
static gboolean
set_output_caps (GstRTPBasePayload *base, const gstrange::RangeInfo &info)
{
  const std::vector<guint8> blob = rangecast::encode_rig (info.rig);
  gchar *rig = g_base64_encode (blob.data (), blob.size ());
  const std::string rate = std::to_string (info.fps_n) + "/" + std::to_string (info.fps_d);
  gst_rtp_base_payload_set_options (base, "video", TRUE, "X-NEIGHBOUR-CODE", 90000);
  const gboolean set = gst_rtp_base_payload_set_outcaps (base, "version", G_TYPE_STRING, "4",
      "views", G_TYPE_STRING, std::to_string (info.views ()).c_str (), "width", G_TYPE_STRING,
      std::to_string (info.width).c_str (), "height", G_TYPE_STRING,
      std::to_string (info.height).c_str (), "framerate", G_TYPE_STRING, rate.c_str (), "rig",
      G_TYPE_STRING, rig, "rtcp-fb-nack-pli", G_TYPE_BOOLEAN, TRUE, "rtcp-fb-ccm-fir",
      G_TYPE_BOOLEAN, TRUE, nullptr);
  g_free (rig);
  return set;
}

static gboolean
gst_rtp_neighbour_code_pay_set_caps (GstRTPBasePayload *base, GstCaps *caps)
{
  GstRtpNeighbourCodePayPrivate *priv = GST_RTP_NEIGHBOUR_CODE_PAY (base)->priv;
  gstrange::RangeInfo info;
  const Status status = gstrange::parse_caps (caps, info);
  priv->reporter.set_views (info.rig);
  if (gst_range_flow_return (GST_ELEMENT (base), status) != GST_FLOW_OK)
    return FALSE;
  if (const guint pt = GST_RTP_BASE_PAYLOAD_PT (base); pt < kMinPayloadType) {
    GST_ELEMENT_ERROR (
        base, LIBRARY, SETTINGS, ("pt=%u: set a dynamic payload type, 96 to 127", pt), (nullptr));
    return FALSE;
  }
  const std::vector<guint8> before = std::exchange (priv->rig_units, {});
  rangecast::write_rig_units ({info.rig, info.fps_n, info.fps_d}, priv->rig_units);
  priv->rig_changed |= !before.empty () && before != priv->rig_units;
  priv->last_config = GST_CLOCK_TIME_NONE;
  GST_INFO_OBJECT (base, "%" GST_PTR_FORMAT, caps);
  return set_output_caps (base, info);
}

/* ---- packets ---- */

namespace {

/* Makes packets of the units of one type, which share their memory. */
struct Packer {
  GstRTPBasePayload *base;
  GstBufferList *packets;
  gsize room; /* payload bytes of a packet */
  GstClockTime pts, dts;
  bool unreadable = false; /* an input buffer could not be mapped */

  void add (GstBuffer *units, gsize offset, gsize size)
  {
    GstBuffer *packet = gst_rtp_base_payload_allocate_output_buffer (base, 0, 0, 0);
    GST_BUFFER_PTS (packet) = pts;
    GST_BUFFER_DTS (packet) = dts;
    gst_buffer_copy_into (packet, units, GST_BUFFER_COPY_MEMORY, offset, size);
    gst_buffer_list_add (packets, packet);
  }

  /* @return the first unit that is too long for a packet, if any */
  std::optional<UnitHeader> pack (GstBuffer *buffer, UnitType type)
  {
    gsize begin = 0, end = 0; /* of the units for the next packet */
    std::optional<UnitHeader> too_long;
    Status damage; /* what follows it is skipped */
    const auto flush = [&] {
      if (end > begin)
        add (buffer, begin, end - begin);
      begin = end;
    };
    const auto handle = [&] (gsize offset, std::span<const guint8> unit, const UnitHeader &header) {
      if (header.type != guint8 (type))
        return true;
      if (unit.size () > room) {
        too_long = header;
        return false;
      }
      if (offset != end || end - begin + unit.size () > room)
        flush ();
      if (begin == end)
        begin = offset;
      end = offset + unit.size ();
      return true;
    };
    if (!for_each_unit (buffer, handle, damage)) {
      unreadable = true;
      return {};
    }
    if (!damage.ok ())
      GST_DEBUG_OBJECT (
          base, "dropping the rest of an access unit: %s", damage.message ().c_str ());
    if (!too_long)
      flush ();
    return too_long;
  }
};

} // namespace

/* Size of the fixed header and of the negotiated extensions, which the base class adds to the
 * packets later: one of at most 12 bytes each, as those for time and for transport-wide feedback.
 */
static gsize
header_size (GstRtpNeighbourCodePay *self)
{
  gsize extensions = 0;
  if (GstCaps *caps = gst_pad_get_current_caps (GST_RTP_BASE_PAYLOAD_SRCPAD (self))) {
    const GstStructure *structure = gst_caps_get_structure (caps, 0);
    for (int i = 0; i < gst_structure_n_fields (structure); i++)
      extensions +=
          g_str_has_prefix (gst_structure_nth_field_name (structure, guint (i)), "extmap-");
    gst_caps_unref (caps);
  }
  return gst_rtp_buffer_calc_header_len (0) + (extensions > 0 ? 4 + 12 * extensions : 0);
}

static bool
config_is_due (GstRtpNeighbourCodePay *self, GstClockTime running)
{
  GstRtpNeighbourCodePayPrivate *priv = self->priv;
  const int interval = settings_of (priv).config_interval;
  if (interval == 0 && !priv->rig_changed)
    return false;
  const bool due = priv->rig_changed || interval < 0 ||
                   !GST_CLOCK_TIME_IS_VALID (priv->last_config) ||
                   !GST_CLOCK_TIME_IS_VALID (running) || running < priv->last_config ||
                   running - priv->last_config >= GstClockTime (interval) * GST_SECOND;
  if (due) {
    priv->last_config = running;
    priv->rig_changed = false;
  }
  return due;
}

static void
set_marker (GstBufferList *packets)
{
  GstRTPBuffer rtp = GST_RTP_BUFFER_INIT;
  GstBuffer *last = gst_buffer_list_get_writable (packets, gst_buffer_list_length (packets) - 1);
  if (gst_rtp_buffer_map (last, GST_MAP_WRITE, &rtp)) {
    gst_rtp_buffer_set_marker (&rtp, TRUE);
    gst_rtp_buffer_unmap (&rtp);
  }
  GST_BUFFER_FLAG_SET (last, GST_BUFFER_FLAG_MARKER);
}

static GstFlowReturn
refuse_long_unit (GstRTPBasePayload *base, const UnitHeader &unit, guint mtu, gsize room)
{
  const bool is_slice = unit.type == guint8 (UnitType::kSlice);
  const std::string other =
      is_slice ? "max-slice-size=" + std::to_string (room) + " or less on neighbourcodeenc"
               : "config-interval=0, where receivers have the rig from caps or SDP";
  GST_ELEMENT_ERROR (base, LIBRARY, SETTINGS,
      ("A %s of %u bytes does not fit into RTP packets of mtu=%u; set mtu=%zu or more, or %s",
          is_slice ? "slice" : "rig view", guint (unit.size), mtu, unit.size + mtu - room,
          other.c_str ()),
      (nullptr));
  return GST_FLOW_ERROR;
}

/* Makes packets of the rig, if it is due, and of the slices of a frame set. The rig units of the
 * frame set itself come too often, or not when they are due. */
static std::optional<UnitHeader>
pack_all (GstRtpNeighbourCodePay *self, Packer &packer, GstBuffer *buffer, bool with_rig)
{
  std::optional<UnitHeader> too_long;
  if (with_rig) {
    GstBuffer *rig =
        gst_buffer_new_memdup (self->priv->rig_units.data (), self->priv->rig_units.size ());
    too_long = packer.pack (rig, UnitType::kRigView);
    gst_buffer_unref (rig);
  }
  return too_long ? too_long : packer.pack (buffer, UnitType::kSlice);
}

static GstFlowReturn
gst_rtp_neighbour_code_pay_handle_buffer (GstRTPBasePayload *base, GstBuffer *buffer)
{
  auto self = GST_RTP_NEIGHBOUR_CODE_PAY (base);
  const guint mtu = GST_RTP_BASE_PAYLOAD_MTU (base);
  const gsize header = header_size (self);
  Packer packer = {base, gst_buffer_list_new (), mtu > header ? mtu - header : 0,
      GST_BUFFER_PTS (buffer), GST_BUFFER_DTS (buffer)};
  const GstClockTime running =
      gst_segment_to_running_time (&base->segment, GST_FORMAT_TIME, GST_BUFFER_PTS (buffer));
  self->priv->frame_sets++;
  const auto too_long = pack_all (self, packer, buffer, config_is_due (self, running));
  self->priv->reporter.passed (GST_ELEMENT (self), buffer);
  gst_buffer_unref (buffer);
  if (packer.unreadable) {
    gst_buffer_list_unref (packer.packets);
    GST_ELEMENT_ERROR (self, RESOURCE, READ, (nullptr), ("cannot map an input buffer"));
    return GST_FLOW_ERROR;
  }
  if (too_long) {
    gst_buffer_list_unref (packer.packets);
    return refuse_long_unit (base, *too_long, mtu, packer.room);
  }
  if (gst_buffer_list_length (packer.packets) == 0) {
    gst_buffer_list_unref (packer.packets);
    return GST_FLOW_OK;
  }
  set_marker (packer.packets);
  GST_LOG_OBJECT (self, "%u packets of %" GST_TIME_FORMAT, gst_buffer_list_length (packer.packets),
      GST_TIME_ARGS (packer.pts));
  self->priv->packets += gst_buffer_list_length (packer.packets);
  self->priv->bytes += gst_buffer_list_calculate_size (packer.packets);
  return gst_rtp_base_payload_push_list (base, packer.packets);
}

/* ---- events ---- */

/* The rig is sent again with the key frame set that the event announces, if it asks for headers. */
static gboolean
gst_rtp_neighbour_code_pay_sink_event (GstRTPBasePayload *base, GstEvent *event)
{
  gboolean all_headers = FALSE;
  if (gst_video_event_is_force_key_unit (event) &&
      gst_video_event_parse_downstream_force_key_unit (
          event, nullptr, nullptr, nullptr, &all_headers, nullptr) &&
      all_headers)
    GST_RTP_NEIGHBOUR_CODE_PAY (base)->priv->last_config = GST_CLOCK_TIME_NONE;
  if (GST_EVENT_TYPE (event) == GST_EVENT_EOS)
    GST_RTP_NEIGHBOUR_CODE_PAY (base)->priv->reporter.finish ();
  return GST_RTP_BASE_PAYLOAD_CLASS (gst_rtp_neighbour_code_pay_parent_class)
      ->sink_event (base, event);
}

/* ---- life ---- */

static std::vector<StatsRow>
collect_stats (GstElement *element)
{
  const GstRtpNeighbourCodePayPrivate *priv = GST_RTP_NEIGHBOUR_CODE_PAY (element)->priv;
  return {
      {.counters = {.frames = priv->frame_sets, .bytes = priv->bytes, .packets = priv->packets}}};
}

static GstStateChangeReturn
gst_rtp_neighbour_code_pay_change_state (GstElement *element, GstStateChange transition)
{
  GstRtpNeighbourCodePayPrivate *priv = GST_RTP_NEIGHBOUR_CODE_PAY (element)->priv;
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED) {
    priv->frame_sets = priv->packets = priv->bytes = 0;
    priv->rig_units.clear ();
    priv->rig_changed = false;
    priv->reporter.start (element, collect_stats);
  }
  const GstStateChangeReturn result = GST_ELEMENT_CLASS (gst_rtp_neighbour_code_pay_parent_class)
                                          ->change_state (element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY)
    priv->reporter.stop ();
  return result;
}

static PropertyTable<Settings> &
pay_properties ()
{
  using P = PropertyTable<Settings>;
  static P table = {
      P::number<&Settings::config_interval> ("config-interval", "Config interval",
          "Interval in seconds at which the rig is repeated in band (0 = never, but a changed rig "
          "is sent once; -1 = with every frame set)",
          -1, 3600, kMutablePlaying),
  };
  return table;
}

static void
gst_rtp_neighbour_code_pay_init (GstRtpNeighbourCodePay *self)
{
  self->priv = new GstRtpNeighbourCodePayPrivate;
}

static void
gst_rtp_neighbour_code_pay_class_init (GstRtpNeighbourCodePayClass *klass)
{
  auto object_class = G_OBJECT_CLASS (klass);
  auto element_class = GST_ELEMENT_CLASS (klass);
  auto payload_class = GST_RTP_BASE_PAYLOAD_CLASS (klass);

  object_class->finalize = delete_private<GstRtpNeighbourCodePay>;
  install_properties<GstRtpNeighbourCodePay, pay_properties> (object_class);

  add_always_pads (element_class, GST_NEIGHBOUR_CODE_CAPS,
      "application/x-rtp, media = (string) video, "
      "payload = (int) [ 96, 127 ], clock-rate = (int) 90000, "
      "encoding-name = (string) X-NEIGHBOUR-CODE");
  gst_element_class_set_static_metadata (element_class, "RTP neighbour code payloader",
      "Codec/Payloader/Network/RTP", "Packs neighbour-coded frame sets into RTP packets",
      "gst-rangecast");

  element_class->change_state = GST_DEBUG_FUNCPTR (gst_rtp_neighbour_code_pay_change_state);
  payload_class->set_caps = GST_DEBUG_FUNCPTR (gst_rtp_neighbour_code_pay_set_caps);
  payload_class->sink_event = GST_DEBUG_FUNCPTR (gst_rtp_neighbour_code_pay_sink_event);
  payload_class->handle_buffer = GST_DEBUG_FUNCPTR (gst_rtp_neighbour_code_pay_handle_buffer);

  GST_DEBUG_CATEGORY_INIT (
      gst_rtp_neighbour_code_pay_debug, "rtpneighbourcodepay", 0, "RTP neighbour code payloader");
}
