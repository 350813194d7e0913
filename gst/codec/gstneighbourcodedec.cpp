/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-neighbourcodedec
 * @title: neighbourcodedec
 *
 * Decodes neighbour-coded range images. Lost or damaged slices leave invalid pixels and are
 * never an error. The first damaged slices of a stream are a warning message; lost ones are not.
 *
 * Frame sets may refer to earlier ones (neighbourcodeenc temporal=true). Pixels that refer to lost
 * data are treated as lost, and the decoder requests a key frame set from upstream
 * (GstForceKeyUnit; RTP: PLI) unless #GstNeighbourCodeDec:request-key-units is false.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 avatartestsrc num-buffers=30 ! neighbourcodeenc ! neighbourcodedec ! plyenc ! \
 *   multifilesink location=cloud-%05d.ply
 * ]|
 *
 * Since: 0.1
 */
#include <gst/base/gstbasetransform.h>

#include <gst/base/base.h>
#include <gst/video/video.h>

#include <algorithm>
#include <atomic>
#include <gstrange/gstrange.h>
#include <gstrange/gstrangeframe.hpp>
#include <gstrange/gstrangeinfo.hpp>
#include <gstrange/gstrangestatus.hpp>
#include <mutex>
#include <optional>
#include <rangecast/neighbourcode/access_unit.hpp>
#include <span>
#include <vector>

#include "common/basetransform.hpp"
#include "common/bufferpools.hpp"
#include "common/capsadvice.hpp"
#include "common/codedunits.hpp"
#include "common/elementproperties.hpp"

using rangecast::DecoderResult;
using rangecast::Status;

GST_DEBUG_CATEGORY_STATIC (gst_neighbour_code_dec_debug);
#define GST_CAT_DEFAULT gst_neighbour_code_dec_debug

namespace {

using Bytes = std::span<const guint8>;

/* Minimum time between two requests for key frame sets. */
constexpr GstClockTime kRequestInterval = 250 * GST_MSECOND;

struct Settings {
  bool request_key_units = true;
  int n_threads = 0;
};

} // namespace

struct GstNeighbourCodeDecPrivate {
  std::mutex lock; /* guards settings and counters; never held across a push or message */
  Settings settings;
  guint64 frames = 0, coded_bytes = 0;
  DecoderResult totals;

  StatsReporter reporter; /* any thread; has locks of its own */

  /* later frame sets refer to the latest; written by the streaming thread, read by src_event() */
  std::atomic<bool> is_temporal{false};

  /* streaming thread only */
  rangecast::AccessUnitDecoder decoder;
  GstBufferPool *pool = nullptr;
  GstClockTime last_request = GST_CLOCK_TIME_NONE; /* PTS of the frame set that caused it */
  bool warned_damage = false;                      /* of this stream */
};

DECLARE_ELEMENT (GstNeighbourCodeDec, gst_neighbour_code_dec, NEIGHBOUR_CODE_DEC, GstBaseTransform)

G_DEFINE_TYPE (GstNeighbourCodeDec, gst_neighbour_code_dec, GST_TYPE_BASE_TRANSFORM)
GST_ELEMENT_REGISTER_DEFINE (
    neighbourcodedec, "neighbourcodedec", GST_RANK_PRIMARY, gst_neighbour_code_dec_get_type ())

/* ---- caps ---- */

static GstCaps *
gst_neighbour_code_dec_transform_caps (
    GstBaseTransform *, GstPadDirection direction, GstCaps *caps, GstCaps *filter)
{
  return gstrange::recode_caps (caps, direction == GST_PAD_SRC, filter);
}

static void
reset_stream (GstNeighbourCodeDecPrivate *priv)
{
  priv->decoder.reset_references ();
  priv->is_temporal = false;
  priv->last_request = GST_CLOCK_TIME_NONE;
}

static gboolean
gst_neighbour_code_dec_set_caps (GstBaseTransform *base, GstCaps *in, GstCaps *out)
{
  auto self = GST_NEIGHBOUR_CODE_DEC (base);
  GstNeighbourCodeDecPrivate *priv = self->priv;
  gstrange::RangeInfo info;
  Status status = gstrange::parse_caps (in, info);
  if (status.ok ())
    status = priv->decoder.set_rig (info.rig);
  priv->reporter.set_views (info.rig);
  if (gst_range_flow_return (GST_ELEMENT (self), status) != GST_FLOW_OK)
    return FALSE;
  GST_INFO_OBJECT (self, "%" GST_PTR_FORMAT " -> %" GST_PTR_FORMAT, in, out);
  reset_stream (priv);
  drop_pool (priv->pool);
  status = gstrange::make_pool (out, priv->pool);
  return gst_range_flow_return (GST_ELEMENT (self), status) == GST_FLOW_OK;
}

/* Takes ownership of the CAPS event. */
static gboolean
take_caps (GstBaseTransform *base, GstEvent *event)
{
  if (GST_BASE_TRANSFORM_CLASS (gst_neighbour_code_dec_parent_class)->sink_event (base, event))
    return TRUE;
  require_downstream (GST_ELEMENT (base), GST_BASE_TRANSFORM_SRC_PAD (base));
  return FALSE;
}

/* QoS is hidden from the base class where it would drop frame sets that later ones refer to. */
static gboolean
gst_neighbour_code_dec_src_event (GstBaseTransform *base, GstEvent *event)
{
  if (GST_EVENT_TYPE (event) == GST_EVENT_QOS && GST_NEIGHBOUR_CODE_DEC (base)->priv->is_temporal)
    return gst_pad_push_event (GST_BASE_TRANSFORM_SINK_PAD (base), event);
  return GST_BASE_TRANSFORM_CLASS (gst_neighbour_code_dec_parent_class)->src_event (base, event);
}

/* ---- a frame set ---- */

/* Adds the views of `units` to `output` and decodes them. */
static Status
decode_into (GstNeighbourCodeDecPrivate *priv, Bytes units, GstBuffer *output, int n_threads,
    DecoderResult &result)
{
  priv->decoder.plan (units, result, false);
  for (const auto &view : priv->decoder.views ())
    if (Status s = gstrange::add_view (output, view.view_id, view.roi, view.capture_time_ns);
        !s.ok ())
      return s;
  gstrange::RangeFrameMap frame (output, GST_MAP_WRITE);
  return frame.status ().ok () ? priv->decoder.decode (frame.views (), n_threads, result)
                               : frame.status ();
}

/* Damage persists where frame sets refer to earlier ones, so a key frame set is requested. */
static void
request_key_unit (
    GstNeighbourCodeDec *self, GstBuffer *input, const DecoderResult &result, bool enabled)
{
  GstNeighbourCodeDecPrivate *priv = self->priv;
  const GstClockTime now = GST_BUFFER_PTS (input), last = priv->last_request;
  if (!enabled || !priv->is_temporal || result.unknown_pixels + result.missing_pixels == 0)
    return;
  if (GST_CLOCK_TIME_IS_VALID (now) && GST_CLOCK_TIME_IS_VALID (last) && now >= last &&
      now - last < kRequestInterval)
    return;
  priv->last_request = now;
  GST_DEBUG_OBJECT (self, "requesting a key frame set: %" G_GUINT64_FORMAT " pixels are missing",
      guint64{result.unknown_pixels + result.missing_pixels});
  gst_pad_push_event (GST_BASE_TRANSFORM_SINK_PAD (self),
      gst_video_event_new_upstream_force_key_unit (GST_CLOCK_TIME_NONE, FALSE, 0));
}

/* A frame set of views without pixels does not show whether later ones will refer to it. */
static void
update_is_temporal (GstNeighbourCodeDecPrivate *priv)
{
  const auto views = priv->decoder.views ();
  const auto is_reference = [] (const auto &view) { return view.reference.reference; };
  const auto has_pixels = [] (const auto &view) { return view.coded_pixels > 0; };
  if (std::ranges::any_of (views, has_pixels))
    priv->is_temporal = std::ranges::any_of (views, is_reference);
}

/* Posts the first damage of a stream only: a hostile sender could cause a message a packet. */
static void
warn_damage (GstNeighbourCodeDec *self, GstBuffer *input, const DecoderResult &result)
{
  GstNeighbourCodeDecPrivate *priv = self->priv;
  if (result.bad_slices == 0)
    return;
  GST_WARNING_OBJECT (
      self, "dropping %" G_GUINT64_FORMAT " damaged slices", guint64{result.bad_slices});
  if (priv->warned_damage)
    return;
  priv->warned_damage = true;
  GST_ELEMENT_WARNING (self, STREAM, DECODE,
      ("%" G_GUINT64_FORMAT " of %" G_GUINT64_FORMAT " slices of the frame set at %" GST_TIME_FORMAT
       " are damaged or do not belong to it; further ones are only counted (bad-slices of `stats`)",
          guint64{result.bad_slices}, guint64{result.bad_slices + result.slices},
          GST_TIME_ARGS (GST_BUFFER_PTS (input))),
      (nullptr));
}

/* Times, flags and capture time of the output. */
static void
copy_metadata (GstNeighbourCodeDec *self, GstBuffer *input, GstBuffer *output)
{
  const auto views = self->priv->decoder.views ();
  GST_BASE_TRANSFORM_GET_CLASS (self)->copy_metadata (GST_BASE_TRANSFORM (self), input, output);
  GstClockTime capture = gst_range_buffer_get_capture_time (input);
  if (!GST_CLOCK_TIME_IS_VALID (capture) && !views.empty ())
    capture = views[0].capture_time_ns;
  if (GST_CLOCK_TIME_IS_VALID (capture))
    gst_range_buffer_set_capture_time (output, capture);
  GST_BUFFER_FLAG_UNSET (output, GST_BUFFER_FLAG_DELTA_UNIT | GST_BUFFER_FLAG_MARKER);
}

static GstFlowReturn
decode_frame_set (GstNeighbourCodeDec *self, GstBuffer *input, GstBuffer **output)
{
  GstNeighbourCodeDecPrivate *priv = self->priv;
  const CodedUnitsMap map (input);
  if (!map) {
    GST_ELEMENT_ERROR (self, RESOURCE, READ, (nullptr), ("cannot map an input buffer"));
    return GST_FLOW_ERROR;
  }
  const Settings settings = settings_of (priv);
  GstBuffer *buffer = nullptr;
  if (const GstFlowReturn flow = gstrange::acquire (GST_ELEMENT (self), priv->pool, &buffer);
      flow != GST_FLOW_OK)
    return flow;
  DecoderResult result;
  const Status status = decode_into (priv, map.bytes (), buffer, settings.n_threads, result);
  if (!status.ok ()) {
    gst_buffer_unref (buffer);
    return gst_range_flow_return (GST_ELEMENT (self), status);
  }
  {
    std::lock_guard guard (priv->lock);
    priv->frames++;
    priv->coded_bytes += map.bytes ().size ();
    priv->totals += result;
  }
  update_is_temporal (priv);
  request_key_unit (self, input, result, settings.request_key_units);
  warn_damage (self, input, result);
  if (result.missing_pixels + result.unknown_pixels > 0)
    GST_DEBUG_OBJECT (self,
        "%" G_GUINT64_FORMAT " pixels were not received, %" G_GUINT64_FORMAT
        " refer to pixels that were not",
        guint64{result.missing_pixels}, guint64{result.unknown_pixels});
  GST_LOG_OBJECT (self, "decoded %" G_GUINT64_FORMAT " slices of %zu views to %" GST_PTR_FORMAT,
      guint64{result.slices}, priv->decoder.views ().size (), buffer);
  copy_metadata (self, input, buffer);
  priv->reporter.passed (GST_ELEMENT (self), buffer);
  *output = buffer;
  return GST_FLOW_OK;
}

static GstFlowReturn
gst_neighbour_code_dec_generate_output (GstBaseTransform *base, GstBuffer **output)
{
  auto self = GST_NEIGHBOUR_CODE_DEC (base);
  GstNeighbourCodeDecPrivate *priv = self->priv;
  if (!priv->pool) {
    GST_ELEMENT_ERROR (self, CORE, NEGOTIATION, (nullptr), ("no caps before the first buffer"));
    return GST_FLOW_NOT_NEGOTIATED;
  }
  GstBuffer *input = g_steal_pointer (&base->queued_buf);
  if (!input)
    return GST_FLOW_OK;
  const bool is_skipped = base->segment.flags & GST_SEGMENT_FLAG_TRICKMODE_KEY_UNITS &&
                          GST_BUFFER_FLAG_IS_SET (input, GST_BUFFER_FLAG_DELTA_UNIT);
  const GstFlowReturn flow = is_skipped ? GST_FLOW_OK : decode_frame_set (self, input, output);
  gst_buffer_unref (input);
  return flow;
}

static gboolean
gst_neighbour_code_dec_sink_event (GstBaseTransform *base, GstEvent *event)
{
  auto self = GST_NEIGHBOUR_CODE_DEC (base);
  if (GST_EVENT_TYPE (event) == GST_EVENT_FLUSH_STOP)
    reset_stream (self->priv);
  if (GST_EVENT_TYPE (event) == GST_EVENT_EOS)
    self->priv->reporter.finish ();
  if (GST_EVENT_TYPE (event) == GST_EVENT_STREAM_START)
    self->priv->warned_damage = false;
  if (GST_EVENT_TYPE (event) == GST_EVENT_CAPS)
    return take_caps (base, event);
  return GST_BASE_TRANSFORM_CLASS (gst_neighbour_code_dec_parent_class)->sink_event (base, event);
}

/* ---- life ---- */

static std::vector<StatsRow>
collect_stats (GstElement *element)
{
  GstNeighbourCodeDecPrivate *priv = GST_NEIGHBOUR_CODE_DEC (element)->priv;
  std::lock_guard guard (priv->lock);
  const DecoderResult &totals = priv->totals;
  return {{.counters = {.frames = priv->frames,
               .points = totals.points,
               .bytes = priv->coded_bytes,
               .lost = totals.missing_pixels + totals.unknown_pixels}}};
}

static gboolean
gst_neighbour_code_dec_start (GstBaseTransform *base)
{
  GstNeighbourCodeDecPrivate *priv = GST_NEIGHBOUR_CODE_DEC (base)->priv;
  priv->reporter.start (GST_ELEMENT (base), collect_stats);
  std::lock_guard guard (priv->lock);
  priv->frames = priv->coded_bytes = 0;
  priv->totals = {};
  return TRUE;
}

static gboolean
gst_neighbour_code_dec_stop (GstBaseTransform *base)
{
  GstNeighbourCodeDecPrivate *priv = GST_NEIGHBOUR_CODE_DEC (base)->priv;
  priv->reporter.stop ();
  g_autoptr (GRecMutexLocker) lock = lock_stream (base);
  reset_stream (priv);
  drop_pool (priv->pool);
  return TRUE;
}

static PropertyTable<Settings> &
decoder_properties ()
{
  using P = PropertyTable<Settings>;
  static P table = {
      P::boolean<&Settings::request_key_units> ("request-key-units", "Request key units",
          "Request a key frame set from upstream (GstForceKeyUnit) when data was lost that later "
          "frame sets refer to",
          kMutablePlaying),
      P::number<&Settings::n_threads> ("n-threads", "Threads",
          "Number of threads that decode slices (0 = one per CPU core)", 0, 64, kMutablePlaying),
  };
  return table;
}

static GstStructure *
make_stats (const GstNeighbourCodeDecPrivate *priv)
{
  const DecoderResult &totals = priv->totals;
  return gst_structure_new ("application/x-neighbourcodedec-stats", "frames", G_TYPE_UINT64,
      priv->frames, "points", G_TYPE_UINT64, guint64{totals.points}, "slices", G_TYPE_UINT64,
      guint64{totals.slices}, "bad-slices", G_TYPE_UINT64, guint64{totals.bad_slices},
      "missing-pixels", G_TYPE_UINT64, guint64{totals.missing_pixels}, "unknown-pixels",
      G_TYPE_UINT64, guint64{totals.unknown_pixels}, "raw-bytes", G_TYPE_UINT64,
      guint64{totals.raw_bits / 8}, "coded-bytes", G_TYPE_UINT64, priv->coded_bytes, nullptr);
}

static void
gst_neighbour_code_dec_init (GstNeighbourCodeDec *self)
{
  self->priv = new GstNeighbourCodeDecPrivate;
  gst_base_transform_set_qos_enabled (GST_BASE_TRANSFORM (self), TRUE);
}

static void
gst_neighbour_code_dec_class_init (GstNeighbourCodeDecClass *klass)
{
  auto object_class = G_OBJECT_CLASS (klass);
  auto element_class = GST_ELEMENT_CLASS (klass);
  auto transform_class = GST_BASE_TRANSFORM_CLASS (klass);

  object_class->finalize = delete_private<GstNeighbourCodeDec>;

  install_properties<GstNeighbourCodeDec, decoder_properties, make_stats> (object_class,
      "Counters since the element was started: frames, points, slices, bad-slices, "
      "missing-pixels, unknown-pixels, raw-bytes, coded-bytes");

  add_always_pads (element_class, GST_NEIGHBOUR_CODE_CAPS, GST_RANGE_CAPS);
  gst_element_class_set_static_metadata (element_class, "Neighbour code decoder", "Codec/Decoder",
      "Decodes neighbour-coded range images", "gst-rangecast");

  transform_class->src_event = GST_DEBUG_FUNCPTR (gst_neighbour_code_dec_src_event);
  transform_class->start = GST_DEBUG_FUNCPTR (gst_neighbour_code_dec_start);
  transform_class->stop = GST_DEBUG_FUNCPTR (gst_neighbour_code_dec_stop);
  transform_class->transform_caps = GST_DEBUG_FUNCPTR (gst_neighbour_code_dec_transform_caps);
  transform_class->set_caps = GST_DEBUG_FUNCPTR (gst_neighbour_code_dec_set_caps);
  transform_class->sink_event = GST_DEBUG_FUNCPTR (gst_neighbour_code_dec_sink_event);
  transform_class->generate_output = GST_DEBUG_FUNCPTR (gst_neighbour_code_dec_generate_output);
  transform_class->transform = GST_DEBUG_FUNCPTR (transform_nothing);
  transform_class->transform_meta = GST_DEBUG_FUNCPTR (keep_capture_time);

  GST_DEBUG_CATEGORY_INIT (
      gst_neighbour_code_dec_debug, "neighbourcodedec", 0, "Neighbour code decoder");
}
