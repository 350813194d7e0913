/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-neighbourcodedec
 * @title: neighbourcodedec
 *
 * Decodes neighbour-coded range images. Lost or damaged slices leave invalid pixels (or repeat the
 * last ones, see #GstNeighbourCodeDec:conceal) and are never an error.
 *
 * Frame sets may refer to earlier ones (neighbourcodeenc temporal=true). Pixels that refer to lost
 * data are treated as lost, and the decoder requests a key frame set from upstream
 * (GstForceKeyUnit; RTP: PLI) unless #GstNeighbourCodeDec:request-key-units is false.
 *
 * With alignment=slice a frame set ends with a buffer that has the MARKER flag, before one of
 * another capture time, or at the end of the stream.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 avatartestsrc num-buffers=30 ! neighbourcodeenc ! neighbourcodedec ! plyenc !
 * multifilesink location=cloud-%05d.ply
 * ]|
 *
 * Since: 0.1
 */
#include "gstneighbourcodedec.h"

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

#include "common/bufferpools.hpp"
#include "common/properties.hpp"
#include "common/statsreporter.hpp"
#include "common/streamlock.hpp"
#include "concealment.hpp"

using rangecast::DecoderResult;
using rangecast::Status;

GST_DEBUG_CATEGORY_STATIC (gst_neighbour_code_dec_debug);
#define GST_CAT_DEFAULT gst_neighbour_code_dec_debug

enum : guint { PROP_STATS = 1, PROP_STATS_INTERVAL, PROP_SETTINGS };

/* Upstream is asked for a key frame set no more often. */
static constexpr GstClockTime kRequestInterval = 250 * GST_MSECOND;

enum GstNeighbourCodeConceal { CONCEAL_INVALID, CONCEAL_LAST };

namespace {
struct Settings {
  GstNeighbourCodeConceal conceal = CONCEAL_INVALID;
  bool request_key_units = true;
  int n_threads = 0;
};
} // namespace

struct GstNeighbourCodeDecPrivate {
  std::mutex lock; /* guards what follows; never held across a push or message */
  Settings settings;
  guint64 frames = 0, coded_bytes = 0;
  DecoderResult totals;

  StatsReporter reporter; /* has locks of its own */

  /* streaming thread only */
  rangecast::AccessUnitDecoder decoder;
  GstBufferPool *pool = nullptr;
  Concealment shown;                    /* what conceal=last takes pixels from */
  std::atomic<bool> by_slices{false};   /* alignment of the input */
  std::atomic<bool> is_temporal{false}; /* the latest frame set is a reference of later ones */
  GstClockTime last_request = GST_CLOCK_TIME_NONE; /* PTS of the frame set that made us ask */
  std::vector<guint8> slices;
  GstBuffer *first = nullptr; /* of slices: gives times and flags */
  bool complete = false;      /* nothing more comes to slices */
};

struct _GstNeighbourCodeDec {
  GstBaseTransform parent;
  GstNeighbourCodeDecPrivate *priv;
};

static GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE (
    "sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS (GST_NEIGHBOUR_CODE_CAPS));
static GstStaticPadTemplate src_template =
    GST_STATIC_PAD_TEMPLATE ("src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS (GST_RANGE_CAPS));

G_DEFINE_TYPE (GstNeighbourCodeDec, gst_neighbour_code_dec, GST_TYPE_BASE_TRANSFORM)
GST_ELEMENT_REGISTER_DEFINE (
    neighbourcodedec, "neighbourcodedec", GST_RANK_PRIMARY, GST_TYPE_NEIGHBOUR_CODE_DEC)

#define GST_TYPE_NEIGHBOUR_CODE_CONCEAL (gst_neighbour_code_conceal_get_type ())
static GType
gst_neighbour_code_conceal_get_type (void)
{
  static const GType type = [] {
    static const GEnumValue values[] = {
        {CONCEAL_INVALID, "Leave pixels of lost or damaged slices invalid", "invalid"},
        {CONCEAL_LAST, "Repeat the pixels of the last frame set", "last"}, {}};
    return g_enum_register_static ("GstNeighbourCodeConceal", values);
  }();
  return type;
}

/* ---- caps ---- */

static GstCaps *
gst_neighbour_code_dec_transform_caps (
    GstBaseTransform *, GstPadDirection direction, GstCaps *caps, GstCaps *filter)
{
  return gstrange::recode_caps (caps, direction == GST_PAD_SRC, filter);
}

static void
forget_slices (GstNeighbourCodeDecPrivate *priv)
{
  priv->slices.clear ();
  gst_clear_buffer (&priv->first);
  priv->complete = false;
}

static void
forget_references (GstNeighbourCodeDecPrivate *priv)
{
  priv->decoder.reset_references ();
  priv->is_temporal = false;
  priv->last_request = GST_CLOCK_TIME_NONE;
}

static void
forget_stream (GstNeighbourCodeDecPrivate *priv)
{
  forget_slices (priv);
  forget_references (priv);
  priv->shown.forget ();
}

static gboolean
gst_neighbour_code_dec_set_caps (GstBaseTransform *base, GstCaps *in, GstCaps *out)
{
  auto self = GST_NEIGHBOUR_CODE_DEC (base);
  GstNeighbourCodeDecPrivate *priv = self->priv;
  gstrange::RangeInfo info;
  Status status = gstrange::parse_caps (in, info);
  if (status.ok ())
    priv->shown.change_rig (priv->decoder.rig (), info.rig);
  if (status.ok ())
    status = priv->decoder.set_rig (info.rig);
  priv->reporter.set_views (info.rig);
  if (gst_range_flow_return (GST_ELEMENT (self), status) != GST_FLOW_OK)
    return FALSE;
  forget_slices (priv);
  forget_references (priv);
  const GstStructure *structure = gst_caps_get_structure (in, 0);
  priv->by_slices = g_strcmp0 (gst_structure_get_string (structure, "alignment"), "slice") == 0;
  drop_pool (priv->pool);
  status = gstrange::make_pool (out, priv->pool);
  return gst_range_flow_return (GST_ELEMENT (self), status) == GST_FLOW_OK;
}

/* The base class does not learn of late frames where it would drop single slices (alignment=slice),
 * or what later frame sets refer to. */
static gboolean
gst_neighbour_code_dec_src_event (GstBaseTransform *base, GstEvent *event)
{
  GstNeighbourCodeDecPrivate *priv = GST_NEIGHBOUR_CODE_DEC (base)->priv;
  if (GST_EVENT_TYPE (event) == GST_EVENT_QOS && (priv->by_slices || priv->is_temporal))
    return gst_pad_push_event (GST_BASE_TRANSFORM_SINK_PAD (base), event);
  return GST_BASE_TRANSFORM_CLASS (gst_neighbour_code_dec_parent_class)->src_event (base, event);
}

/* ---- data ---- */

/* Makes room for views and decodes them; those of the rig that did not come are left out, or shown
 * as they were. `older` may be nullptr. */
static Status
decode_into (GstNeighbourCodeDecPrivate *priv, GstBuffer *output, GstBuffer *older, int n_threads,
    DecoderResult &result)
{
  std::optional<gstrange::RangeFrameMap> shown;
  std::span<const rangecast::RangeImage> older_views;
  if (older)
    older_views = shown.emplace (older, GST_MAP_READ).views ();
  if (Status s = priv->shown.lay_out (priv->decoder, older_views, output); !s.ok ())
    return s;
  gstrange::RangeFrameMap frame (output, GST_MAP_WRITE);
  if (!frame.status ().ok ())
    return frame.status ();
  return Concealment::decode (priv->decoder, frame.views (), older_views, n_threads, result);
}

static void
count_frame (GstNeighbourCodeDecPrivate *priv, const DecoderResult &result, gsize size)
{
  std::lock_guard guard (priv->lock);
  priv->frames++;
  priv->coded_bytes += size;
  priv->totals += result;
}

/* Losses linger where frame sets refer to one another, so upstream is asked for a new beginning. */
static void
request_key_unit (GstNeighbourCodeDec *self, GstBuffer *input, const DecoderResult &result)
{
  GstNeighbourCodeDecPrivate *priv = self->priv;
  const GstClockTime now = GST_BUFFER_PTS (input), then = priv->last_request;
  const bool is_lossy = result.unknown_pixels + result.missing_pixels > 0;
  if (!priv->is_temporal || !is_lossy)
    return;
  if (GST_CLOCK_TIME_IS_VALID (now) && GST_CLOCK_TIME_IS_VALID (then) && now >= then &&
      now - then < kRequestInterval)
    return;
  {
    std::lock_guard guard (priv->lock);
    if (!priv->settings.request_key_units)
      return;
  }
  priv->last_request = now;
  GST_DEBUG_OBJECT (self, "asking for a key frame set");
  gst_pad_push_event (GST_BASE_TRANSFORM_SINK_PAD (self),
      gst_video_event_new_upstream_force_key_unit (GST_CLOCK_TIME_NONE, FALSE, 0));
}

/* A view without pixels says nothing of it. */
static void
note_references (GstNeighbourCodeDecPrivate *priv)
{
  const auto views = priv->decoder.views ();
  const auto refers = [] (const auto &view) { return view.reference.reference; };
  const auto has_pixels = [] (const auto &view) { return view.coded_pixels > 0; };
  if (std::ranges::any_of (views, has_pixels))
    priv->is_temporal = std::ranges::any_of (views, refers);
}

/* Settings of one frame set. */
struct FrameSettings {
  bool conceal;
  int n_threads;
};

static GstFlowReturn
decode_bytes (GstNeighbourCodeDec *self, GstBuffer *input, std::span<const guint8> bytes,
    const FrameSettings &settings, GstBuffer **output)
{
  GstNeighbourCodeDecPrivate *priv = self->priv;
  GstBuffer *older = priv->shown.begin (input);
  if (!settings.conceal)
    older = nullptr;
  DecoderResult result;
  priv->decoder.plan (bytes, result, older);
  GstBuffer *buffer = nullptr;
  const GstFlowReturn flow = gstrange::acquire (GST_ELEMENT (self), priv->pool, &buffer);
  if (flow != GST_FLOW_OK)
    return flow;
  const Status status = decode_into (priv, buffer, older, settings.n_threads, result);
  count_frame (priv, result, bytes.size ());
  note_references (priv);
  request_key_unit (self, input, result);
  if (result.bad_slices)
    GST_WARNING_OBJECT (self, "%" G_GUINT64_FORMAT " damaged slices", guint64{result.bad_slices});
  if (!status.ok ()) {
    gst_buffer_unref (buffer);
    return gst_range_flow_return (GST_ELEMENT (self), status);
  }
  *output = buffer;
  return GST_FLOW_OK;
}

/* `input` gives times and flags; bytes are its own, or also those of slices that came later. */
static GstFlowReturn
decode_frame_set (
    GstNeighbourCodeDec *self, GstBuffer *input, std::span<const guint8> bytes, GstBuffer **output)
{
  GstNeighbourCodeDecPrivate *priv = self->priv;
  FrameSettings settings;
  {
    std::lock_guard guard (priv->lock);
    settings = {priv->settings.conceal == CONCEAL_LAST, priv->settings.n_threads};
  }
  const GstFlowReturn flow = decode_bytes (self, input, bytes, settings, output);
  if (flow != GST_FLOW_OK)
    return flow;
  GST_BASE_TRANSFORM_GET_CLASS (self)->copy_metadata (GST_BASE_TRANSFORM (self), input, *output);
  GstClockTime capture = gst_range_buffer_get_capture_time (input);
  if (!GST_CLOCK_TIME_IS_VALID (capture) && !priv->decoder.views ().empty ())
    capture = priv->decoder.views ()[0].capture_time_ns;
  if (GST_CLOCK_TIME_IS_VALID (capture))
    gst_range_buffer_set_capture_time (*output, capture);
  GST_BUFFER_FLAG_UNSET (*output, GST_BUFFER_FLAG_DELTA_UNIT | GST_BUFFER_FLAG_MARKER);
  if (settings.conceal)
    priv->shown.keep (*output);
  else
    priv->shown.forget ();
  priv->reporter.passed (GST_ELEMENT (self), *output);
  return GST_FLOW_OK;
}

static GstFlowReturn
decode_slices (GstNeighbourCodeDec *self, GstBuffer **output)
{
  GstNeighbourCodeDecPrivate *priv = self->priv;
  const GstFlowReturn flow = decode_frame_set (self, priv->first, priv->slices, output);
  forget_slices (priv);
  return flow;
}

static bool
same_frame_set (GstBuffer *a, GstBuffer *b)
{
  const GstClockTime time_a = gst_range_buffer_get_capture_time (a);
  const GstClockTime time_b = gst_range_buffer_get_capture_time (b);
  if (GST_CLOCK_TIME_IS_VALID (time_a) && GST_CLOCK_TIME_IS_VALID (time_b))
    return time_a == time_b;
  return GST_BUFFER_PTS (a) == GST_BUFFER_PTS (b);
}

/* What would make an access unit too long is lost. */
static void
append_slice (GstNeighbourCodeDecPrivate *priv, GstBuffer *input, std::span<const guint8> bytes)
{
  if (!priv->first)
    priv->first = gst_buffer_ref (input);
  if (priv->slices.size () + bytes.size () <= rangecast::kMaxAccessUnitSize)
    priv->slices.insert (priv->slices.end (), bytes.begin (), bytes.end ());
  priv->complete = GST_BUFFER_FLAG_IS_SET (input, GST_BUFFER_FLAG_MARKER);
}

static GstFlowReturn
take_input (GstNeighbourCodeDec *self, GstBuffer *input, GstBuffer **output)
{
  GstNeighbourCodeDecPrivate *priv = self->priv;
  GstMapInfo map;
  if (!gst_buffer_map (input, &map, GST_MAP_READ)) {
    GST_ELEMENT_ERROR (self, RESOURCE, READ, (nullptr), ("cannot map an input buffer"));
    return GST_FLOW_ERROR;
  }
  GstFlowReturn flow = GST_FLOW_OK;
  if (priv->by_slices) {
    if (priv->first && !same_frame_set (priv->first, input))
      flow = decode_slices (self, output);
    append_slice (priv, input, {map.data, map.size});
  } else {
    flow = decode_frame_set (self, input, {map.data, map.size}, output);
  }
  gst_buffer_unmap (input, &map);
  return flow;
}

/* Called until it has no more to give: one slice may end two frame sets, the one before and its
 * own. */
static GstFlowReturn
gst_neighbour_code_dec_generate_output (GstBaseTransform *base, GstBuffer **output)
{
  auto self = GST_NEIGHBOUR_CODE_DEC (base);
  GstNeighbourCodeDecPrivate *priv = self->priv;
  if (!priv->pool) {
    GST_ELEMENT_ERROR (self, CORE, NEGOTIATION, (nullptr), ("no caps before the first buffer"));
    return GST_FLOW_NOT_NEGOTIATED;
  }
  if (GstBuffer *input = g_steal_pointer (&base->queued_buf)) {
    const GstFlowReturn flow = take_input (self, input, output);
    gst_buffer_unref (input);
    if (flow != GST_FLOW_OK || *output)
      return flow;
  }
  return priv->complete ? decode_slices (self, output) : GST_FLOW_OK;
}

/* Never called, but without it GstBaseTransform would be passthrough. */
static GstFlowReturn
gst_neighbour_code_dec_transform (GstBaseTransform *, GstBuffer *, GstBuffer *)
{
  return GST_FLOW_ERROR;
}

static gboolean
gst_neighbour_code_dec_transform_meta (GstBaseTransform *, GstBuffer *, GstMeta *meta, GstBuffer *)
{
  return meta->info->api == GST_REFERENCE_TIMESTAMP_META_API_TYPE;
}

/* Pushes the frame set whose end did not come. */
static void
drain (GstNeighbourCodeDec *self)
{
  GstBuffer *output = nullptr;
  if (self->priv->first && self->priv->pool && decode_slices (self, &output) == GST_FLOW_OK)
    gst_pad_push (GST_BASE_TRANSFORM_SRC_PAD (self), output);
}

static gboolean
gst_neighbour_code_dec_sink_event (GstBaseTransform *base, GstEvent *event)
{
  auto self = GST_NEIGHBOUR_CODE_DEC (base);
  switch (GST_EVENT_TYPE (event)) {
    case GST_EVENT_FLUSH_STOP:
      forget_stream (self->priv);
      break;
    case GST_EVENT_EOS:
    case GST_EVENT_CAPS:
    case GST_EVENT_SEGMENT:
    case GST_EVENT_GAP:
    case GST_EVENT_STREAM_START:
      drain (self);
      break;
    default:
      break;
  }
  if (GST_EVENT_TYPE (event) == GST_EVENT_EOS)
    self->priv->reporter.finish ();
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
  const StreamLock lock (base);
  forget_stream (priv);
  drop_pool (priv->pool);
  return TRUE;
}

static PropertyTable<Settings> &
decoder_properties ()
{
  using P = PropertyTable<Settings>;
  static P table = {
      P::enumeration<&Settings::conceal> ("conceal", "Concealment",
          "How to fill pixels whose slices are lost or damaged", GST_TYPE_NEIGHBOUR_CODE_CONCEAL,
          kMutablePlaying),
      P::boolean<&Settings::request_key_units> ("request-key-units", "Request key units",
          "Request a key frame set from upstream (GstForceKeyUnit) when data was lost that later "
          "frame sets refer to",
          kMutablePlaying),
      P::number<&Settings::n_threads> ("n-threads", "Threads",
          "Number of threads that decode slices (0 = one per CPU core)", 0, 64, kMutablePlaying),
  };
  return table;
}

static void
gst_neighbour_code_dec_set_property (
    GObject *object, guint id, const GValue *value, GParamSpec *pspec)
{
  GstNeighbourCodeDecPrivate *priv = GST_NEIGHBOUR_CODE_DEC (object)->priv;
  if (id == PROP_STATS_INTERVAL) /* it has locks of its own, and sets a timer */
    return priv->reporter.set_interval (g_value_get_uint (value));
  std::lock_guard guard (priv->lock);
  if (!decoder_properties ().set (priv->settings, id, value))
    G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
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
gst_neighbour_code_dec_get_property (GObject *object, guint id, GValue *value, GParamSpec *pspec)
{
  GstNeighbourCodeDecPrivate *priv = GST_NEIGHBOUR_CODE_DEC (object)->priv;
  std::lock_guard guard (priv->lock);
  if (id == PROP_STATS)
    g_value_take_boxed (value, make_stats (priv));
  else if (id == PROP_STATS_INTERVAL)
    g_value_set_uint (value, priv->reporter.interval ());
  else if (!decoder_properties ().get (priv->settings, id, value))
    G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
}

static void
gst_neighbour_code_dec_finalize (GObject *object)
{
  GstNeighbourCodeDecPrivate *priv = GST_NEIGHBOUR_CODE_DEC (object)->priv;
  forget_stream (priv);
  drop_pool (priv->pool);
  delete priv;
  G_OBJECT_CLASS (gst_neighbour_code_dec_parent_class)->finalize (object);
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

  object_class->set_property = gst_neighbour_code_dec_set_property;
  object_class->get_property = gst_neighbour_code_dec_get_property;
  object_class->finalize = gst_neighbour_code_dec_finalize;

  decoder_properties ().install (object_class, PROP_SETTINGS);
  install_stats (object_class, PROP_STATS,
      "Counters since the element was started: frames, points, slices, bad-slices, "
      "missing-pixels, unknown-pixels, raw-bytes, coded-bytes");
  StatsReporter::install (object_class, PROP_STATS_INTERVAL);

  gst_element_class_add_static_pad_template (element_class, &sink_template);
  gst_element_class_add_static_pad_template (element_class, &src_template);
  gst_element_class_set_static_metadata (element_class, "Neighbour code decoder", "Codec/Decoder",
      "Decodes neighbour-coded range images", "gst-rangecast");

  transform_class->src_event = gst_neighbour_code_dec_src_event;
  transform_class->start = gst_neighbour_code_dec_start;
  transform_class->stop = gst_neighbour_code_dec_stop;
  transform_class->transform_caps = gst_neighbour_code_dec_transform_caps;
  transform_class->set_caps = gst_neighbour_code_dec_set_caps;
  transform_class->sink_event = gst_neighbour_code_dec_sink_event;
  transform_class->generate_output = gst_neighbour_code_dec_generate_output;
  transform_class->transform = gst_neighbour_code_dec_transform;
  transform_class->transform_meta = gst_neighbour_code_dec_transform_meta;

  GST_DEBUG_CATEGORY_INIT (
      gst_neighbour_code_dec_debug, "neighbourcodedec", 0, "Neighbour code decoder");
}
