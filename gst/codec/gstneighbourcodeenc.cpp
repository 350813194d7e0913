/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-neighbourcodeenc
 * @title: neighbourcodeenc
 *
 * Encodes depth and colour of range images jointly with the neighbour code, in slices that decode
 * independently. The format is specified in docs/formats/bitstream.md.
 *
 * With temporal=true pixels may be predicted from the previous frame set, which halves the bit rate
 * of a person moving before a still camera. Key frame sets come first, at least every key-interval,
 * and on GstForceKeyUnit from upstream or downstream (RTP: PLI, FIR); others have the DELTA_UNIT
 * flag. Damage from losses ends after refresh-period at the latest.
 *
 * Frame sets describe themselves, and key frame sets hold the rig: from one of these on, buffers
 * that are written one after another are a recording.
 *
 * ## Example launch lines
 * |[
 * gst-launch-1.0 avatartestsrc num-buffers=60 ! neighbourcodeenc ! filesink location=head.rcnc
 * ]|
 * |[
 * gst-launch-1.0 filesrc location=head.rcnc ! neighbourcodeparse ! neighbourcodedec ! \
 *   rangealign ! striprender ! glimagesink
 * ]|
 *
 * Since: 0.1
 */
#include <gst/base/gstbasetransform.h>

#include <gst/base/base.h>

#include <gstrange/gstrangeframe.hpp>
#include <gstrange/gstrangeinfo.hpp>
#include <gstrange/gstrangestatus.hpp>
#include <mutex>
#include <rangecast/neighbourcode/access_unit.hpp>
#include <span>

#include "bitrate.hpp"
#include "common/accessunitwriter.hpp"
#include "common/basetransform.hpp"
#include "common/elementproperties.hpp"
#include "encsettings.hpp"
#include "keyunitrequests.hpp"

using rangecast::EncoderResult;
using rangecast::EncoderSettings;
using rangecast::Status;

GST_DEBUG_CATEGORY_STATIC (gst_neighbour_code_enc_debug);
#define GST_CAT_DEFAULT gst_neighbour_code_enc_debug

struct GstNeighbourCodeEncPrivate {
  std::mutex lock; /* guards what follows; never held across a push or message */
  NeighbourCodeEncSettings settings;
  double max_depth_error_m = 0;
  guint64 frames = 0, coded_bytes = 0, skipped = 0;
  EncoderResult totals;
  EncoderSettings latest; /* of the latest frame set */
  double bits_per_s = 0;

  /* any thread; have locks of their own */
  KeyUnitRequests key_requests;
  StatsReporter reporter;

  /* streaming thread only */
  gstrange::RangeInfo info;
  NeighbourCodeRate rate; /* but for feedback of receivers: any thread */
  rangecast::AccessUnitEncoder encoder;
  EncoderSettings configured; /* of encoder */
  bool is_configured = false;
  std::uint32_t frame_number = 0;
  bool is_key = true;                          /* the frame set in encoder */
  GstClockTime last_key = GST_CLOCK_TIME_NONE; /* running time */
  AccessUnitWriter writer;
};

DECLARE_ELEMENT (GstNeighbourCodeEnc, gst_neighbour_code_enc, NEIGHBOUR_CODE_ENC, GstBaseTransform)

G_DEFINE_TYPE (GstNeighbourCodeEnc, gst_neighbour_code_enc, GST_TYPE_BASE_TRANSFORM)
GST_ELEMENT_REGISTER_DEFINE (
    neighbourcodeenc, "neighbourcodeenc", GST_RANK_PRIMARY, gst_neighbour_code_enc_get_type ())

/* ---- caps ---- */

static GstCaps *
gst_neighbour_code_enc_transform_caps (
    GstBaseTransform *, GstPadDirection direction, GstCaps *caps, GstCaps *filter)
{
  return gstrange::recode_caps (caps, direction == GST_PAD_SINK, filter);
}

static gboolean
gst_neighbour_code_enc_set_caps (GstBaseTransform *base, GstCaps *in, GstCaps *out)
{
  GstNeighbourCodeEncPrivate *priv = GST_NEIGHBOUR_CODE_ENC (base)->priv;
  const Status status = gstrange::parse_caps (in, priv->info);
  priv->is_configured = false;
  priv->reporter.set_views (priv->info.rig);
  priv->encoder.request_key (); /* decoders reset their references at new caps */
  priv->writer.set_rig (priv->info);
  GST_INFO_OBJECT (base, "%" GST_PTR_FORMAT " -> %" GST_PTR_FORMAT, in, out);
  return gst_range_flow_return (GST_ELEMENT (base), status) == GST_FLOW_OK;
}

/* ---- a frame set: rate, key frame sets, encoding ---- */

static GstClockTime
input_running_time (GstNeighbourCodeEnc *self, GstBuffer *input)
{
  return gst_segment_to_running_time (
      &GST_BASE_TRANSFORM (self)->segment, GST_FORMAT_TIME, GST_BUFFER_PTS (input));
}

/* A GAP tells downstream that this frame set is skipped. */
static void
skip_frame_set (GstNeighbourCodeEnc *self, GstBuffer *input)
{
  GST_DEBUG_OBJECT (self, "skipping a frame set for the bit rate: %" GST_PTR_FORMAT, input);
  {
    std::lock_guard guard (self->priv->lock);
    self->priv->skipped++;
  }
  if (GST_BUFFER_PTS_IS_VALID (input))
    gst_pad_push_event (GST_BASE_TRANSFORM_SRC_PAD (self),
        gst_event_new_gap (GST_BUFFER_PTS (input), GST_BUFFER_DURATION (input)));
}

/* Requests a key frame set from the encoder if one is due: key-interval would pass before the next
 * frame set, or someone has asked. */
static void
request_key_if_due (
    GstNeighbourCodeEnc *self, GstBuffer *input, const NeighbourCodeEncSettings &settings)
{
  GstNeighbourCodeEncPrivate *priv = self->priv;
  const GstClockTime now = input_running_time (self, input), last = priv->last_key;
  const GstClockTime next = now + settings.coding.frame_interval_ns;
  const bool interval_passed = settings.key_interval_ms > 0 && GST_CLOCK_TIME_IS_VALID (now) &&
                               GST_CLOCK_TIME_IS_VALID (last) &&
                               (now < last || next - last > settings.key_interval_ms * GST_MSECOND);
  if (!interval_passed && !priv->key_requests.is_due (now))
    return;
  GST_DEBUG_OBJECT (
      self, "key frame set: %s", interval_passed ? "key-interval has passed" : "requested");
  priv->encoder.request_key ();
}

/* Applies settings that changed. Thresholds may change with every frame set, at no cost. */
static Status
configure (GstNeighbourCodeEnc *self, const EncoderSettings &settings)
{
  GstNeighbourCodeEncPrivate *priv = self->priv;
  if (priv->is_configured && settings == priv->configured)
    return {};
  EncoderSettings same = priv->configured;
  same.depth_threshold = settings.depth_threshold;
  same.colour_threshold = settings.colour_threshold;
  if (priv->is_configured && settings == same)
    priv->encoder.set_thresholds (settings.depth_threshold, settings.colour_threshold);
  else if (Status s = priv->encoder.configure (priv->info.rig, settings); !s.ok ())
    return s;
  GST_DEBUG_OBJECT (self, "depth-threshold %d, colour-threshold %d", settings.depth_threshold,
      settings.colour_threshold);
  priv->configured = settings;
  priv->is_configured = true;
  std::lock_guard guard (priv->lock);
  priv->max_depth_error_m = priv->encoder.max_depth_error_m ();
  return {};
}

static Status
encode_frame (GstNeighbourCodeEnc *self, GstBuffer *input, const NeighbourCodeEncSettings &settings,
    EncoderResult &result)
{
  GstNeighbourCodeEncPrivate *priv = self->priv;
  gstrange::RangeFrameMap frame (input, GST_MAP_READ);
  if (!frame.status ().ok ())
    return frame.status ();
  guint64 pixels = 0;
  for (const rangecast::RangeImage &image : frame.views ())
    pixels += guint64 (image.roi.width) * guint64 (image.roi.height);
  /* Random, so that frame sets of two encoders, one after the other, are not taken for those of
   * one. */
  if (settings.coding.temporal && !(priv->is_configured && priv->configured.temporal))
    priv->frame_number = g_random_int ();
  if (Status s = configure (self, priv->rate.settings_for (settings.coding, pixels)); !s.ok ())
    return s;
  const Status status =
      priv->encoder.encode (frame.views (), priv->frame_number++, settings.n_threads, result);
  if (status.ok ())
    priv->rate.record (
        {priv->encoder.size (), result.points, pixels, result.delta_slices == 0 && !priv->is_key});
  return status;
}

/* A key frame set answers all requests that are due; the answer is an event downstream. */
static void
answer_key_requests (GstNeighbourCodeEnc *self, GstBuffer *input)
{
  GstNeighbourCodeEncPrivate *priv = self->priv;
  const GstClockTime pts = GST_BUFFER_PTS (input), running_time = input_running_time (self, input);
  const GstClockTime stream_time =
      gst_segment_to_stream_time (&GST_BASE_TRANSFORM (self)->segment, GST_FORMAT_TIME, pts);
  priv->last_key = running_time;
  if (GstEvent *answer = priv->key_requests.answer (pts, stream_time, running_time))
    gst_pad_push_event (GST_BASE_TRANSFORM_SRC_PAD (self), answer);
}

/* @param[out] skipped  the rate leaves the frame set out */
static GstFlowReturn
encode_input (GstNeighbourCodeEnc *self, GstBuffer *input, bool &skipped)
{
  GstNeighbourCodeEncPrivate *priv = self->priv;
  sync_controlled_values (GST_BASE_TRANSFORM (self), input);
  NeighbourCodeEncSettings settings = settings_of (priv);
  settings.coding.frame_interval_ns =
      priv->info.fps_n > 0 ? priv->info.frame_duration () : GST_SECOND / 30;
  skipped = !priv->rate.begin (settings.rate, input, settings.coding.frame_interval_ns);
  if (skipped) {
    skip_frame_set (self, input);
    return GST_FLOW_OK;
  }
  request_key_if_due (self, input, settings);
  EncoderResult result;
  const Status status = encode_frame (self, input, settings, result);
  if (!status.ok ())
    return gst_range_flow_return (GST_ELEMENT (self), status);
  priv->is_key = result.delta_slices == 0;
  if (priv->is_key)
    answer_key_requests (self, input);
  GST_LOG_OBJECT (self, "%s frame set: %zu bytes, %" G_GUINT64_FORMAT " points of %" GST_PTR_FORMAT,
      priv->is_key ? "key" : "delta", priv->encoder.size (), guint64{result.points}, input);
  {
    std::lock_guard guard (priv->lock);
    priv->latest = priv->configured;
    priv->bits_per_s = priv->rate.bits_per_s ();
    priv->frames++;
    priv->coded_bytes += priv->encoder.size ();
    priv->totals += result;
  }
  priv->reporter.passed (GST_ELEMENT (self), input);
  return GST_FLOW_OK;
}

/* The encoded frame set with the times and flags of the input; nullptr after an error. */
static GstBuffer *
make_output (GstNeighbourCodeEnc *self, GstBuffer *input)
{
  GstNeighbourCodeEncPrivate *priv = self->priv;
  const Status status = priv->writer.begin (priv->is_key, priv->encoder.size ());
  if (gst_range_flow_return (GST_ELEMENT (self), status) != GST_FLOW_OK)
    return nullptr;
  for (const auto part : priv->encoder.parts ())
    priv->writer.add (part);
  GstBuffer *buffer = priv->writer.finish (
      byte_stream_time (GST_BASE_TRANSFORM (self)->segment, GST_BUFFER_PTS (input)));
  GST_BASE_TRANSFORM_GET_CLASS (self)->copy_metadata (GST_BASE_TRANSFORM (self), input, buffer);
  const GstClockTime capture = gst_range_buffer_get_capture_time (input);
  if (GST_CLOCK_TIME_IS_VALID (capture))
    gst_range_buffer_set_capture_time (buffer, capture);
  set_key (buffer, priv->is_key);
  return buffer;
}

static GstFlowReturn
gst_neighbour_code_enc_generate_output (GstBaseTransform *base, GstBuffer **output)
{
  auto self = GST_NEIGHBOUR_CODE_ENC (base);
  GstBuffer *input = g_steal_pointer (&base->queued_buf);
  if (!input)
    return GST_FLOW_OK;
  bool skipped = false;
  GstFlowReturn flow = encode_input (self, input, skipped);
  if (flow == GST_FLOW_OK && !skipped && !(*output = make_output (self, input)))
    flow = GST_FLOW_ERROR;
  gst_buffer_unref (input);
  return flow;
}

/* ---- events ---- */

static gboolean
gst_neighbour_code_enc_sink_event (GstBaseTransform *base, GstEvent *event)
{
  GstNeighbourCodeEncPrivate *priv = GST_NEIGHBOUR_CODE_ENC (base)->priv;
  if (priv->key_requests.handle_event (event)) { /* the answer follows with the key frame set */
    gst_event_unref (event);
    return TRUE;
  }
  if (GST_EVENT_TYPE (event) == GST_EVENT_FLUSH_STOP) {
    priv->encoder.request_key ();
    priv->key_requests.reset ();
  } else if (GST_EVENT_TYPE (event) == GST_EVENT_EOS) {
    priv->reporter.finish ();
  }
  return GST_BASE_TRANSFORM_CLASS (gst_neighbour_code_enc_parent_class)->sink_event (base, event);
}

static gboolean
gst_neighbour_code_enc_src_event (GstBaseTransform *base, GstEvent *event)
{
  GstNeighbourCodeEncPrivate *priv = GST_NEIGHBOUR_CODE_ENC (base)->priv;
  if (priv->key_requests.handle_event (event) || priv->rate.handle_event (event)) {
    gst_event_unref (event);
    return TRUE;
  }
  return GST_BASE_TRANSFORM_CLASS (gst_neighbour_code_enc_parent_class)->src_event (base, event);
}

/* ---- states and properties ---- */

static std::vector<StatsRow>
collect_stats (GstElement *element)
{
  GstNeighbourCodeEncPrivate *priv = GST_NEIGHBOUR_CODE_ENC (element)->priv;
  std::lock_guard guard (priv->lock);
  return {{.counters = {
               .frames = priv->frames, .points = priv->totals.points, .bytes = priv->coded_bytes}}};
}

static gboolean
gst_neighbour_code_enc_start (GstBaseTransform *base)
{
  GstNeighbourCodeEncPrivate *priv = GST_NEIGHBOUR_CODE_ENC (base)->priv;
  priv->rate.reset ();
  priv->last_key = GST_CLOCK_TIME_NONE;
  priv->encoder.request_key ();
  priv->key_requests.reset ();
  priv->reporter.start (GST_ELEMENT (base), collect_stats);
  std::lock_guard guard (priv->lock);
  priv->frame_number = 0;
  priv->bits_per_s = 0;
  priv->frames = priv->coded_bytes = priv->skipped = 0;
  priv->totals = {};
  return TRUE;
}

static gboolean
gst_neighbour_code_enc_stop (GstBaseTransform *base)
{
  GstNeighbourCodeEncPrivate *priv = GST_NEIGHBOUR_CODE_ENC (base)->priv;
  priv->reporter.stop ();
  g_autoptr (GRecMutexLocker) lock = lock_stream (base);
  priv->is_configured = false;
  priv->writer.drop ();
  return TRUE;
}

static GstStructure *
make_stats (const GstNeighbourCodeEncPrivate *priv)
{
  GstStructure *stats = gst_structure_new ("application/x-neighbourcodeenc-stats", "frames",
      G_TYPE_UINT64, priv->frames, "skipped", G_TYPE_UINT64, priv->skipped, "points", G_TYPE_UINT64,
      guint64{priv->totals.points}, "full-pixels", G_TYPE_UINT64, guint64{priv->totals.full_pixels},
      "slices", G_TYPE_UINT64, guint64{priv->totals.slices}, "delta-slices", G_TYPE_UINT64,
      guint64{priv->totals.delta_slices}, "raw-bytes", G_TYPE_UINT64,
      guint64{priv->totals.raw_bits / 8}, "coded-bytes", G_TYPE_UINT64, priv->coded_bytes,
      "bitrate", G_TYPE_UINT64, guint64 (priv->bits_per_s + 0.5), "depth-threshold", G_TYPE_INT,
      priv->latest.depth_threshold, "colour-threshold", G_TYPE_INT, priv->latest.colour_threshold,
      "max-depth-error", G_TYPE_DOUBLE, priv->max_depth_error_m, nullptr);
  priv->rate.add_stats (stats);
  return stats;
}

static void
gst_neighbour_code_enc_init (GstNeighbourCodeEnc *self)
{
  self->priv = new GstNeighbourCodeEncPrivate;
}

static void
gst_neighbour_code_enc_class_init (GstNeighbourCodeEncClass *klass)
{
  auto object_class = G_OBJECT_CLASS (klass);
  auto element_class = GST_ELEMENT_CLASS (klass);
  auto transform_class = GST_BASE_TRANSFORM_CLASS (klass);

  object_class->finalize = delete_private<GstNeighbourCodeEnc>;
  install_properties<GstNeighbourCodeEnc, encoder_properties, make_stats> (object_class,
      "Counters since the element was started (frames, skipped, points, full-pixels, slices, "
      "delta-slices, raw-bytes, coded-bytes), the bitrate of the last 2 s, the thresholds and "
      "max-depth-error of the latest frame set and the state of adaptive-bitrate");

  add_always_pads (element_class, GST_RANGE_CAPS, GST_NEIGHBOUR_CODE_CAPS);
  gst_element_class_set_static_metadata (element_class, "Neighbour code encoder",
      "Codec/Encoder/Video",
      "Encodes depth and colour of range images jointly with the neighbour code", "gst-rangecast");

  transform_class->sink_event = GST_DEBUG_FUNCPTR (gst_neighbour_code_enc_sink_event);
  transform_class->src_event = GST_DEBUG_FUNCPTR (gst_neighbour_code_enc_src_event);
  transform_class->start = GST_DEBUG_FUNCPTR (gst_neighbour_code_enc_start);
  transform_class->stop = GST_DEBUG_FUNCPTR (gst_neighbour_code_enc_stop);
  transform_class->transform_caps = GST_DEBUG_FUNCPTR (gst_neighbour_code_enc_transform_caps);
  transform_class->set_caps = GST_DEBUG_FUNCPTR (gst_neighbour_code_enc_set_caps);
  transform_class->generate_output = GST_DEBUG_FUNCPTR (gst_neighbour_code_enc_generate_output);
  transform_class->transform = GST_DEBUG_FUNCPTR (transform_nothing);
  transform_class->transform_meta = GST_DEBUG_FUNCPTR (keep_capture_time);

  GST_DEBUG_CATEGORY_INIT (
      gst_neighbour_code_enc_debug, "neighbourcodeenc", 0, "Neighbour code encoder");
}
