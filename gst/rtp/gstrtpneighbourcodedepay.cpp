/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-rtpneighbourcodedepay
 * @title: rtpneighbourcodedepay
 *
 * Extracts coded frame sets from RTP packets. Incomplete frame sets are output; damaged packets are
 * counted and dropped. The rig comes with the caps (from SDP) or in band; nothing is output before
 * it is known. The format is specified in docs/formats/rtp-payload.md.
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
#include <gst/rtp/gstrtpbasedepayload.h>

#include <gst/rtp/rtp.h>

#include <gstrange/gstrangeinfo.hpp>
#include <gstrange/gstrangemeta.h>
#include <gstrange/gstrangestatus.hpp>
#include <mutex>
#include <optional>
#include <rangecast/neighbourcode/bitstream/key_check.hpp>
#include <rangecast/neighbourcode/bitstream/unit.hpp>
#include <span>
#include <vector>

#include "common/accessunitwriter.hpp"
#include "common/capsadvice.hpp"
#include "common/elementproperties.hpp"

using rangecast::Status;
using rangecast::StatusCode;
using rangecast::UnitHeader;
using rangecast::UnitReader;
using rangecast::UnitType;

GST_DEBUG_CATEGORY_STATIC (gst_rtp_neighbour_code_depay_debug);
#define GST_CAT_DEFAULT gst_rtp_neighbour_code_depay_debug

namespace {
/* Since start; units without rig views. */
struct Counters {
  guint64 packets = 0, units = 0, bad_units = 0, access_units = 0, unmarked = 0, without_rig = 0,
          lost_packets = 0, bytes = 0;
};

} // namespace

struct GstRtpNeighbourCodeDepayPrivate {
  std::mutex lock; /* guards counters */
  Counters counters;
  StatsReporter reporter; /* any thread; has locks of its own */

  /* streaming thread only */
  rangecast::RigCollector collector; /* of rig units in band */
  unsigned used_generation = 0;      /* of collector: the rig of the source caps */
  bool warned_of_size = false;       /* of a rig that is too large */
  bool have_caps = false;
  std::size_t rig_views = 0;
  guint64 view_bits = 0;              /* of the rig, by view-id; 0: not known yet */
  std::optional<guint16> sequence;    /* of the last packet */
  std::optional<guint8> payload_type; /* of the last undamaged packet */

  /* the access unit that is being assembled; streaming thread only */
  std::vector<guint8> slices; /* so far */
  gsize n_slices = 0;         /* how many they are */
  AccessUnitWriter writer;
  rangecast::KeyCheck key_check;
  bool has_gap = false;  /* packets were lost before or between its units */
  guint32 timestamp = 0; /* RTP time */
  GstClockTime pts = GST_CLOCK_TIME_NONE, capture_time = GST_CLOCK_TIME_NONE;
};

DECLARE_ELEMENT (GstRtpNeighbourCodeDepay, gst_rtp_neighbour_code_depay, RTP_NEIGHBOUR_CODE_DEPAY,
    GstRTPBaseDepayload)

G_DEFINE_TYPE (GstRtpNeighbourCodeDepay, gst_rtp_neighbour_code_depay, GST_TYPE_RTP_BASE_DEPAYLOAD)
GST_ELEMENT_REGISTER_DEFINE (rtpneighbourcodedepay, "rtpneighbourcodedepay", GST_RANK_SECONDARY,
    gst_rtp_neighbour_code_depay_get_type ())

static void
reset_access_unit (GstRtpNeighbourCodeDepayPrivate *priv)
{
  constexpr gsize kMaxKept = gsize{1} << 20; /* one huge access unit keeps none of its memory */
  priv->slices.clear ();
  if (priv->slices.capacity () > kMaxKept)
    priv->slices.shrink_to_fit ();
  priv->n_slices = 0;
  priv->key_check.reset ();
  priv->has_gap = false;
  priv->pts = priv->capture_time = GST_CLOCK_TIME_NONE;
}

/* ---- caps ---- */

static void
set_source_caps (GstRTPBaseDepayload *base, const rangecast::StreamInfo &stream)
{
  GstRtpNeighbourCodeDepayPrivate *priv = GST_RTP_NEIGHBOUR_CODE_DEPAY (base)->priv;
  const auto info = gstrange::make_info (stream.rig, stream.fps_n, stream.fps_d);
  GstCaps *caps = gstrange::make_neighbour_code_caps (info);
  GST_INFO_OBJECT (base, "%" GST_PTR_FORMAT, caps);
  GstPad *src = GST_RTP_BASE_DEPAYLOAD_SRCPAD (base);
  priv->have_caps = require_downstream (GST_ELEMENT (base), src);
  if (priv->have_caps)
    gst_pad_set_caps (src, caps);
  gst_caps_unref (caps);
  priv->writer.set_rig (info);
  priv->rig_views = stream.rig.views.size ();
  priv->view_bits = view_bits (stream.rig);
  priv->reporter.set_views (stream.rig);
}

static Status
rig_from_caps (const GstStructure *structure, rangecast::StreamInfo &stream)
{
  gsize size = 0;
  guchar *blob = g_base64_decode (gst_structure_get_string (structure, "rig"), &size);
  Status status = rangecast::decode_rig ({blob, size}, stream.rig);
  g_free (blob);
  if (!status.ok ())
    return {status.code (), "RTP caps: field \"rig\" (base64): " + status.message ()};
  for (const rangecast::View &view : stream.rig.views)
    if (!view.is_range_view ())
      return {StatusCode::kBadData,
          "RTP caps: field \"rig\": view " + std::to_string (view.id) + " is not rectified"};
  const gchar *rate = gst_structure_get_string (structure, "framerate");
  int n = 0, d = 1;
  if (rate && sscanf (rate, "%d/%d", &n, &d) == 2 && n >= 0 && d > 0) {
    stream.fps_n = n;
    stream.fps_d = d;
  }
  return {};
}

static gboolean
gst_rtp_neighbour_code_depay_set_caps (GstRTPBaseDepayload *base, GstCaps *caps)
{
  GstRtpNeighbourCodeDepayPrivate *priv = GST_RTP_NEIGHBOUR_CODE_DEPAY (base)->priv;
  const GstStructure *structure = gst_caps_get_structure (caps, 0);
  const gchar *version = gst_structure_get_string (structure, "version");
  base->clock_rate = 90000;
  reset_access_unit (priv);
  if (version && g_strcmp0 (version, "4") != 0) {
    gst_range_flow_return (GST_ELEMENT (base),
        {StatusCode::kUnsupported, std::string ("RTP caps: needs version 4, got ") + version});
    return FALSE;
  }
  if (!gst_structure_has_field_typed (structure, "rig", G_TYPE_STRING))
    return TRUE; /* the rig comes in band */
  rangecast::StreamInfo stream;
  const Status status = rig_from_caps (structure, stream);
  if (gst_range_flow_return (GST_ELEMENT (base), status) != GST_FLOW_OK)
    return FALSE;
  set_source_caps (base, stream);
  priv->collector.reset (); /* of another rig in band the same units count again */
  priv->used_generation = 0;
  return TRUE;
}

/* ---- a packet arrives ---- */

/* Counts the packets missing before this one. @return whether there are any */
static bool
count_lost (GstRtpNeighbourCodeDepay *self, guint16 sequence)
{
  GstRtpNeighbourCodeDepayPrivate *priv = self->priv;
  const std::optional<guint16> last = std::exchange (priv->sequence, sequence);
  const guint16 missing = last ? guint16 (sequence - *last - 1) : 0;
  if (missing > 0 && missing < 0x8000) { /* else it goes back: another sender, or too late */
    GST_DEBUG_OBJECT (self, "%u packets are missing before number %u", missing, sequence);
    std::lock_guard guard (priv->lock);
    priv->counters.lost_packets += missing;
  }
  return missing > 0;
}

/* Whether it is a FEC packet: rtpulpfecdec passes them, with a payload type of their own. */
static bool
has_other_payload (GstRtpNeighbourCodeDepayPrivate *priv, GstRTPBuffer *rtp)
{
  const guint8 type = gst_rtp_buffer_get_payload_type (rtp);
  if (priv->payload_type == type)
    return false;
  UnitReader reader ({static_cast<const guint8 *> (gst_rtp_buffer_get_payload (rtp)),
      gst_rtp_buffer_get_payload_len (rtp)});
  UnitHeader header;
  while (reader.next (header)) {
  }
  if (reader.status ().ok ())
    priv->payload_type = type;
  return priv->payload_type && priv->payload_type != type;
}

/* ---- its units ---- */

/* @return false if the unit is damaged */
static bool
handle_rig_view (GstRtpNeighbourCodeDepay *self, std::span<const guint8> unit)
{
  GstRtpNeighbourCodeDepayPrivate *priv = self->priv;
  const Status status = priv->collector.add (unit);
  priv->writer.repeat_rig (); /* who begins to record where no key frame sets come needs it, too */
  if (status.code () == StatusCode::kBadSize && !priv->warned_of_size) {
    priv->warned_of_size = true; /* once: nothing can be decoded without the rig */
    gst_range_post_warning (GST_ELEMENT (self), status);
  }
  return status.ok ();
}

/* Adds a slice to the access unit. @return false if it is dropped */
static bool
add_slice (GstRtpNeighbourCodeDepay *self, std::span<const guint8> unit)
{
  GstRtpNeighbourCodeDepayPrivate *priv = self->priv;
  rangecast::SliceHeader slice;
  const bool is_readable = rangecast::read_slice_header (unit, slice).ok ();
  /* Behind rangemux such a slice would be drawn over the view of another host. */
  if (is_readable && priv->view_bits != 0 && !(priv->view_bits >> slice.view_id & 1)) {
    GST_DEBUG_OBJECT (self, "dropping a slice of a view that is not in the rig");
    return false;
  }
  std::vector<guint8> &slices = priv->slices;
  if (slices.size () + unit.size () > priv->writer.max_size () ||
      priv->n_slices == rangecast::kMaxSlices) {
    GST_DEBUG_OBJECT (self, "dropping a slice: the access unit is too long");
    return false;
  }
  slices.insert (slices.end (), unit.begin (), unit.end ());
  priv->n_slices++;
  if (!is_readable)
    return true;
  priv->key_check.add (slice);
  /* The earliest, because the views of a frame set may differ by parts of a frame. */
  if (!GST_CLOCK_TIME_IS_VALID (priv->capture_time) || slice.capture_time_ns < priv->capture_time)
    priv->capture_time = slice.capture_time_ns;
  return true;
}

static void
handle_units (GstRtpNeighbourCodeDepay *self, std::span<const guint8> payload)
{
  GstRtpNeighbourCodeDepayPrivate *priv = self->priv;
  UnitReader reader (payload);
  UnitHeader header;
  guint64 good = 0, bad = 0;
  while (const auto unit = reader.next (header)) {
    if (header.type == static_cast<guint8> (UnitType::kRigView))
      bad += !handle_rig_view (self, *unit);
    else if (header.type == static_cast<guint8> (UnitType::kSlice) && add_slice (self, *unit))
      good++;
    else
      bad++;
  }
  bad += !reader.status ().ok ();
  if (bad > 0)
    GST_DEBUG_OBJECT (self, "dropped %" G_GUINT64_FORMAT " damaged or unusable units", bad);
  {
    std::lock_guard guard (priv->lock);
    priv->counters.packets++;
    priv->counters.units += good;
    priv->counters.bad_units += bad;
  }
  if (priv->collector.generation () != priv->used_generation) {
    priv->used_generation = priv->collector.generation ();
    set_source_caps (GST_RTP_BASE_DEPAYLOAD (self), priv->collector.info ());
  }
}

/* ---- the access unit goes out ---- */

/* Whether a decoder can begin here: no slice refers to earlier frame sets, and none is missing that
 * might, or at least no view. */
static bool
is_key_unit (GstRtpNeighbourCodeDepayPrivate *priv, bool has_end)
{
  const bool is_whole = has_end && !priv->has_gap;
  return priv->key_check.is_key () && (is_whole || priv->key_check.views () == priv->rig_views);
}

/* @param has_end  its last packet has come
 * @return the access unit; nullptr if it is empty or its rig is not known */
static GstBuffer *
finish_access_unit (GstRtpNeighbourCodeDepay *self, bool has_end)
{
  GstRtpNeighbourCodeDepayPrivate *priv = self->priv;
  GstBuffer *buffer = nullptr;
  if (!priv->slices.empty () && !priv->have_caps) {
    GST_DEBUG_OBJECT (self, "dropping an access unit: the rig is not known yet");
    std::lock_guard guard (priv->lock);
    priv->counters.without_rig++;
  } else if (!priv->slices.empty ()) {
    const bool key = is_key_unit (priv, has_end);
    const Status status = priv->writer.begin (key, priv->slices.size ());
    if (gst_range_flow_return (GST_ELEMENT (self), status) != GST_FLOW_OK)
      return nullptr;
    priv->writer.add (priv->slices);
    buffer =
        priv->writer.finish (byte_stream_time (GST_RTP_BASE_DEPAYLOAD (self)->segment, priv->pts));
    GST_BUFFER_PTS (buffer) = priv->pts;
    set_key (buffer, key);
    if (GST_CLOCK_TIME_IS_VALID (priv->capture_time))
      gst_range_buffer_set_capture_time (buffer, priv->capture_time);
    GST_LOG_OBJECT (self, "%s%" GST_PTR_FORMAT, priv->has_gap ? "incomplete: " : "", buffer);
    {
      std::lock_guard guard (priv->lock);
      priv->counters.access_units++;
      priv->counters.bytes += gst_buffer_get_size (buffer);
    }
    priv->reporter.passed (GST_ELEMENT (self), buffer);
  }
  reset_access_unit (priv);
  return buffer;
}

/* Pushes an access unit whose last packet, with the marker, is lost. */
static void
push_unmarked (GstRtpNeighbourCodeDepay *self)
{
  GstRtpNeighbourCodeDepayPrivate *priv = self->priv;
  if (priv->slices.empty ())
    return;
  GST_DEBUG_OBJECT (self, "the last packet of an access unit is missing");
  {
    std::lock_guard guard (priv->lock);
    priv->counters.unmarked++;
  }
  if (GstBuffer *buffer = finish_access_unit (self, false))
    gst_rtp_base_depayload_push (GST_RTP_BASE_DEPAYLOAD (self), buffer);
}

static GstBuffer *
gst_rtp_neighbour_code_depay_process (GstRTPBaseDepayload *base, GstRTPBuffer *rtp)
{
  auto self = GST_RTP_NEIGHBOUR_CODE_DEPAY (base);
  GstRtpNeighbourCodeDepayPrivate *priv = self->priv;
  const guint32 timestamp = gst_rtp_buffer_get_timestamp (rtp);
  const bool after_gap = count_lost (self, gst_rtp_buffer_get_seq (rtp));
  if (has_other_payload (priv, rtp)) {
    GST_LOG_OBJECT (self, "dropping a packet of another payload type");
    priv->has_gap = priv->has_gap || after_gap;
    return nullptr;
  }
  if (timestamp != priv->timestamp)
    push_unmarked (self);
  priv->has_gap = priv->has_gap || after_gap;
  if (priv->slices.empty ()) {
    priv->timestamp = timestamp;
    priv->pts = GST_BUFFER_PTS (rtp->buffer);
  }
  handle_units (self, {static_cast<const guint8 *> (gst_rtp_buffer_get_payload (rtp)),
                          gst_rtp_buffer_get_payload_len (rtp)});
  return gst_rtp_buffer_get_marker (rtp) ? finish_access_unit (self, true) : nullptr;
}

/* No GAP for a lost packet: the rest of its frame set is pushed. */
static gboolean
gst_rtp_neighbour_code_depay_packet_lost (GstRTPBaseDepayload *, GstEvent *)
{
  return TRUE;
}

static gboolean
gst_rtp_neighbour_code_depay_handle_event (GstRTPBaseDepayload *base, GstEvent *event)
{
  auto self = GST_RTP_NEIGHBOUR_CODE_DEPAY (base);
  if (GST_EVENT_TYPE (event) == GST_EVENT_FLUSH_STOP) {
    reset_access_unit (self->priv);
    self->priv->sequence.reset ();
  } else if (GST_EVENT_TYPE (event) == GST_EVENT_EOS) {
    push_unmarked (self);
    self->priv->reporter.finish ();
  }
  return GST_RTP_BASE_DEPAYLOAD_CLASS (gst_rtp_neighbour_code_depay_parent_class)
      ->handle_event (base, event);
}

/* ---- life ---- */

static std::vector<StatsRow>
collect_stats (GstElement *element)
{
  GstRtpNeighbourCodeDepayPrivate *priv = GST_RTP_NEIGHBOUR_CODE_DEPAY (element)->priv;
  std::lock_guard guard (priv->lock);
  const Counters &c = priv->counters;
  return {{.counters = {.frames = c.access_units,
               .bytes = c.bytes,
               .packets = c.packets,
               .lost = c.lost_packets}}};
}

static GstStateChangeReturn
gst_rtp_neighbour_code_depay_change_state (GstElement *element, GstStateChange transition)
{
  GstRtpNeighbourCodeDepayPrivate *priv = GST_RTP_NEIGHBOUR_CODE_DEPAY (element)->priv;
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED)
    priv->reporter.start (element, collect_stats);
  const GstStateChangeReturn result = GST_ELEMENT_CLASS (gst_rtp_neighbour_code_depay_parent_class)
                                          ->change_state (element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) {
    priv->reporter.stop ();
    reset_access_unit (priv);
    priv->writer.drop ();
    priv->collector.reset ();
    priv->used_generation = 0;
    priv->have_caps = priv->warned_of_size = false;
    priv->view_bits = 0;
    priv->sequence.reset ();
    priv->payload_type.reset ();
    std::lock_guard guard (priv->lock);
    priv->counters = {};
  }
  return result;
}

static GstStructure *
make_stats (const GstRtpNeighbourCodeDepayPrivate *priv)
{
  const Counters &c = priv->counters;
  return gst_structure_new ("application/x-rtpneighbourcodedepay-stats", "packets", G_TYPE_UINT64,
      c.packets, "units", G_TYPE_UINT64, c.units, "bad-units", G_TYPE_UINT64, c.bad_units,
      "access-units", G_TYPE_UINT64, c.access_units, "unmarked", G_TYPE_UINT64, c.unmarked,
      "without-rig", G_TYPE_UINT64, c.without_rig, "lost-packets", G_TYPE_UINT64, c.lost_packets,
      "bytes", G_TYPE_UINT64, c.bytes, nullptr);
}

static void
gst_rtp_neighbour_code_depay_init (GstRtpNeighbourCodeDepay *self)
{
  self->priv = new GstRtpNeighbourCodeDepayPrivate;
}

static void
gst_rtp_neighbour_code_depay_class_init (GstRtpNeighbourCodeDepayClass *klass)
{
  auto object_class = G_OBJECT_CLASS (klass);
  auto element_class = GST_ELEMENT_CLASS (klass);
  auto depayload_class = GST_RTP_BASE_DEPAYLOAD_CLASS (klass);

  object_class->finalize = delete_private<GstRtpNeighbourCodeDepay>;
  install_properties<GstRtpNeighbourCodeDepay, nullptr, make_stats> (object_class,
      "Counters since the element was started: packets, units, bad-units, access-units, "
      "unmarked, without-rig, lost-packets, bytes",
      "unit-stats");

  add_always_pads (element_class,
      "application/x-rtp, media = (string) video, "
      "clock-rate = (int) 90000, encoding-name = (string) X-NEIGHBOUR-CODE",
      GST_NEIGHBOUR_CODE_CAPS);
  gst_element_class_set_static_metadata (element_class, "RTP neighbour code depayloader",
      "Codec/Depayloader/Network/RTP", "Extracts neighbour-coded frame sets from RTP packets",
      "gst-rangecast");

  element_class->change_state = GST_DEBUG_FUNCPTR (gst_rtp_neighbour_code_depay_change_state);
  depayload_class->set_caps = GST_DEBUG_FUNCPTR (gst_rtp_neighbour_code_depay_set_caps);
  depayload_class->process_rtp_packet = GST_DEBUG_FUNCPTR (gst_rtp_neighbour_code_depay_process);
  depayload_class->packet_lost = GST_DEBUG_FUNCPTR (gst_rtp_neighbour_code_depay_packet_lost);
  depayload_class->handle_event = GST_DEBUG_FUNCPTR (gst_rtp_neighbour_code_depay_handle_event);

  GST_DEBUG_CATEGORY_INIT (gst_rtp_neighbour_code_depay_debug, "rtpneighbourcodedepay", 0,
      "RTP neighbour code depayloader");
}
