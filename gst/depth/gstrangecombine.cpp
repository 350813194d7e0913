/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-rangecombine
 * @title: rangecombine
 *
 * Combines the colour and depth images of any depth camera into range images of one view. The two
 * may be registered pixel to pixel, differ in size, or come from separate cameras (see
 * #GstRangeCombine:colour-view-id and #GstRangeCombine:into). Depth is GRAY16 of either
 * byte order in any unit (default: millimetres).
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 rangecombine name=c focal-length=525 ! plyenc ! filesink location=cloud.ply \
 *   filesrc location=colour.jpg ! jpegdec ! videoconvert ! c.colour \
 *   filesrc location=depth.png ! pngdec ! c.depth
 * ]|
 *
 * Since: 0.1
 */
#include "common/bufferpools.hpp"
#include "common/capsadvice.hpp"
#include "common/elementproperties.hpp"
#include "common/matcher.hpp"
#include "common/videoframereader.hpp"
#include "viewsettings.hpp"

#include <gst/video/video.h>

#include <algorithm>
#include <gstrange/gstrange.h>
#include <gstrange/gstrangeframe.hpp>
#include <gstrange/gstrangeinfo.hpp>
#include <gstrange/gstrangepairing.hpp>
#include <gstrange/gstrangestatus.hpp>
#include <mutex>
#include <optional>
#include <rangecast/geometry/paste.hpp>
#include <rangecast/geometry/point_cloud.hpp>
#include <rangecast/geometry/size_text.hpp>
#include <rangecast/registration/registration.hpp>
#include <vector>

using rangecast::RangeImage;
using rangecast::RegisterInto;
using rangecast::size_text;
using rangecast::Status;
using rangecast::StatusCode;
using rangecast::View;

#define GST_TYPE_RANGE_COMBINE (gst_range_combine_get_type ())
G_DECLARE_FINAL_TYPE (GstRangeCombine, gst_range_combine, GST, RANGE_COMBINE, GstAggregator)

GST_DEBUG_CATEGORY_STATIC (gst_range_combine_debug);
#define GST_CAT_DEFAULT gst_range_combine_debug

/* Data flow, in the order of this file: sink_event records caps; aggregate takes a colour and a
 * depth image of one running time, negotiates after new caps, and pushes the range image. All of it
 * runs on GstAggregator's streaming thread. */

namespace {

constexpr const char *kPadNames[] = {"colour", "depth"};
constexpr double kDefaultDepthScale = 0.001;
/* Focal length by width of an ordinary RGB-D camera, with a horizontal field of view of 63 degrees
 */
constexpr double kDefaultFocalLength = 0.82;
constexpr double kDefaultFar = 6;
constexpr double kUsualShare = 0.01; /* of the pixels with depth lies between near and far */

struct CombineSettings {
  ViewSettings view;
  int colour_view_id = -1; /* -1: colour comes from the depth camera, too */
  RegisterInto into = RegisterInto::kDepth;
  double depth_scale = kDefaultDepthScale; /* metres per unit of the input */
  bool do_timestamp = false;
};

} // namespace

struct GstRangeCombinePrivate {
  std::mutex lock; /* guards settings and frames; never held across a push or message */
  CombineSettings settings;
  guint64 frames = 0;

  /* streaming thread */
  GstAggregatorPad *colour_pad, *depth_pad; /* owned by the element */
  std::optional<FrameMatcher> matcher;
  std::optional<GstVideoInfo> colour, depth; /* caps */
  std::optional<View> depth_view;            /* of the depth camera, from the caps */
  bool negotiate = true;                     /* there are new caps */
  View view;                                 /* of the output */
  bool registered = true;                    /* colour and depth are registered pixel to pixel */
  rangecast::Registration registration;      /* if not */
  std::vector<guint16> swapped;              /* depth of GRAY16_BE */
  bool range_checked = false;                /* a frame with depth has come */
  double depth_scale = kDefaultDepthScale;
  bool has_caps_scale = false;                       /* depth_scale is that of the caps */
  GstClockTime frame_duration = GST_CLOCK_TIME_NONE; /* of the output */
  GstBufferPool *pool = nullptr;
  VideoFrameReader reader; /* of colour */
};

struct _GstRangeCombine {
  GstAggregator parent;
  GstRangeCombinePrivate *priv;
};

static GstStaticPadTemplate colour_template = GST_STATIC_PAD_TEMPLATE ("colour", GST_PAD_SINK,
    GST_PAD_ALWAYS, GST_STATIC_CAPS (GST_VIDEO_CAPS_MAKE (GST_VIDEO_FORMATS_ALL)));
static GstStaticPadTemplate depth_template = GST_STATIC_PAD_TEMPLATE ("depth", GST_PAD_SINK,
    GST_PAD_ALWAYS, GST_STATIC_CAPS (GST_VIDEO_CAPS_MAKE ("{ GRAY16_LE, GRAY16_BE }")));
static GstStaticPadTemplate src_template =
    GST_STATIC_PAD_TEMPLATE ("src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS (GST_RANGE_CAPS));

G_DEFINE_TYPE (GstRangeCombine, gst_range_combine, GST_TYPE_AGGREGATOR)
GST_ELEMENT_REGISTER_DEFINE (rangecombine, "rangecombine", GST_RANK_NONE, GST_TYPE_RANGE_COMBINE)

/* ---- sink caps ---- */

/* Those of rangesplit have the calibration. @return false after an error */
static bool
read_depth_view (GstRangeCombine *self, GstEvent *event)
{
  GstCaps *caps = nullptr;
  gst_event_parse_caps (event, &caps);
  self->priv->depth_view.reset ();
  if (!gst_structure_has_field (gst_caps_get_structure (caps, 0), "rig"))
    return true;
  const Status status = gstrange::parse_view (caps, self->priv->depth_view.emplace ());
  return gst_range_flow_return (GST_ELEMENT (self), status) == GST_FLOW_OK;
}

static gboolean
gst_range_combine_sink_event (GstAggregator *aggregator, GstAggregatorPad *pad, GstEvent *event)
{
  GstRangeCombinePrivate *priv = GST_RANGE_COMBINE (aggregator)->priv;
  if (refuse_bytes (pad, event))
    return FALSE;
  if (GST_EVENT_TYPE (event) == GST_EVENT_CAPS) {
    const auto info = parse_caps_event (GST_CAT_DEFAULT, pad, event);
    if (!info) {
      gst_event_unref (event);
      return FALSE;
    }
    priv->matcher->watch_links ();
    (pad == priv->colour_pad ? priv->colour : priv->depth) = *info;
    if (pad == priv->depth_pad && !read_depth_view (GST_RANGE_COMBINE (aggregator), event)) {
      gst_event_unref (event);
      return FALSE;
    }
    priv->negotiate = true;
  }
  return GST_AGGREGATOR_CLASS (gst_range_combine_parent_class)->sink_event (aggregator, pad, event);
}

/* For do-timestamp. The running time is 0 until the element plays: its base time may be old. */
static GstPadProbeReturn
stamp_arrival (GstPad *pad, GstPadProbeInfo *info, gpointer data)
{
  auto self = GST_RANGE_COMBINE (data);
  {
    std::lock_guard guard (self->priv->lock);
    if (!self->priv->settings.do_timestamp)
      return GST_PAD_PROBE_OK;
  }
  const GstClockTime now = GST_STATE (self) == GST_STATE_PLAYING
                               ? gst_element_get_current_running_time (GST_ELEMENT (self))
                               : 0;
  GstBuffer *buffer = gst_buffer_make_writable (GST_PAD_PROBE_INFO_BUFFER (info));
  GST_PAD_PROBE_INFO_DATA (info) = buffer;
  GST_BUFFER_DTS (buffer) = GST_CLOCK_TIME_NONE;
  if (GstEvent *event = gst_pad_get_sticky_event (pad, GST_EVENT_SEGMENT, 0)) {
    const GstSegment *segment;
    gst_event_parse_segment (event, &segment);
    GST_BUFFER_PTS (buffer) =
        gst_segment_position_from_running_time (segment, GST_FORMAT_TIME, now);
    gst_event_unref (event);
  }
  return GST_PAD_PROBE_OK;
}

/* ---- negotiation ---- */

/* Whether the calibration, the depth scale and the view-id are those of the caps: properties rig
 * and focal-length replace them; near and far may still change the output. */
static bool
uses_caps_view (const GstRangeCombinePrivate *priv, const ViewSettings &settings)
{
  return priv->depth_view && settings.rig.empty () && settings.focal_length <= 0;
}

/* The view of the depth camera. */
static Status
make_depth_view (const GstRangeCombinePrivate *priv, const ViewSettings &settings, View &view)
{
  const int width = priv->depth->width, height = priv->depth->height;
  if (uses_caps_view (priv, settings)) {
    view = *priv->depth_view;
    if (view.width != width || view.height != height)
      return {StatusCode::kBadData,
          "pad depth is " + size_text (width, height) + " but the calibration in its caps is for " +
              size_text (view.width, view.height) + "; set property rig or focal-length"};
  } else if (settings.rig.empty ()) {
    const double focal_length =
        settings.focal_length > 0 ? settings.focal_length : kDefaultFocalLength * width;
    view = make_pinhole_view (settings, focal_length, width, height);
    view.far_m = kDefaultFar;
  } else {
    if (Status s = load_view (settings.rig, settings.view_id, "view-id", width, height, view);
        !s.ok ())
      return s;
    view.right.reset ();
    view.third.reset ();
  }
  set_depth_range (settings, view);
  return rangecast::validate ({{view}});
}

/* The view of the colour camera: one of the rig, or the depth camera at another size. */
static Status
make_colour_view (
    const CombineSettings &settings, const View &depth, int width, int height, View &view)
{
  if (settings.colour_view_id >= 0) {
    if (settings.view.rig.empty ())
      return {StatusCode::kBadValue, "property colour-view-id: set property rig, too, to a file "
                                     "with the poses of both cameras"};
    const Status status = load_view (
        settings.view.rig, settings.colour_view_id, "colour-view-id", width, height, view);
    view.right.reset ();
    view.third.reset ();
    return status;
  }
  view = depth;
  const Status scaled = rangecast::scale_view (view, width, height);
  if (scaled.ok ())
    return scaled;
  return {scaled.code (),
      "pad depth is " + size_text (depth.width, depth.height) + " but pad colour is " +
          size_text (width, height) +
          "; use images of one shape, or property colour-view-id for a separate camera"};
}

/* Sets up the views of both cameras and of the output, and the registration between them. */
static Status
configure_views (GstRangeCombinePrivate *priv, const CombineSettings &settings)
{
  View depth, colour;
  if (Status s = make_depth_view (priv, settings.view, depth); !s.ok ())
    return s;
  priv->has_caps_scale = uses_caps_view (priv, settings.view);
  priv->depth_scale = priv->has_caps_scale ? priv->depth_view->depth_unit_m : settings.depth_scale;
  if (Status s =
          make_colour_view (settings, depth, priv->colour->width, priv->colour->height, colour);
      !s.ok ())
    return s;
  priv->registered = settings.colour_view_id < 0 && depth.distortion.empty () &&
                     depth.width == colour.width && depth.height == colour.height;
  priv->view = depth;
  if (priv->registered)
    return {};
  const Status status = priv->registration.set (depth, colour, settings.into);
  priv->view = priv->registration.range_view ();
  return status.ok () ? rangecast::validate ({{priv->view}}) : status;
}

static GstFlowReturn
negotiate (GstRangeCombine *self)
{
  GstRangeCombinePrivate *priv = self->priv;
  if (!priv->colour || !priv->depth) {
    GST_WARNING_OBJECT (self, "pad %s: frames without caps", priv->colour ? "depth" : "colour");
    return GST_FLOW_NOT_NEGOTIATED;
  }
  const CombineSettings settings = settings_of (priv);
  if (const GstFlowReturn flow =
          gst_range_flow_return (GST_ELEMENT (self), configure_views (priv, settings));
      flow != GST_FLOW_OK)
    return flow;
  check_field_of_view (GST_ELEMENT (self), settings.view, "the depth images", priv->depth->width,
      priv->depth->height);

  /* There are as many pairs as the slower stream has frames. */
  const GstClockTime colour = frame_duration (priv->colour), depth = frame_duration (priv->depth);
  const bool depth_is_slower =
      GST_CLOCK_TIME_IS_VALID (depth) && (!GST_CLOCK_TIME_IS_VALID (colour) || depth > colour);
  const GstVideoInfo &slower = depth_is_slower ? *priv->depth : *priv->colour;
  const auto info = gstrange::make_info ({{priv->view}}, slower.fps_n, slower.fps_d);
  priv->frame_duration = info.frame_duration ();
  GstCaps *caps = gstrange::make_range_caps (info);
  GST_INFO_OBJECT (self, "output caps %" GST_PTR_FORMAT, caps);
  GST_DEBUG_OBJECT (self, "view %d, %g to %g m, %s", priv->view.id, priv->view.near_m,
      priv->view.far_m,
      priv->registered ? "colour and depth are registered" : "registering colour and depth");
  drop_pool (priv->pool);
  const Status pooled = gstrange::make_pool (caps, priv->pool);
  if (pooled.ok ())
    gst_aggregator_set_src_caps (GST_AGGREGATOR (self), caps);
  gst_caps_unref (caps);
  if (!pooled.ok ())
    return gst_range_flow_return (GST_ELEMENT (self), pooled);
  if (!priv->reader.set (*priv->colour)) {
    GST_ELEMENT_ERROR (self, CORE, NEGOTIATION,
        ("pad colour: cannot convert %s to RGBx",
            gst_video_format_to_string (GST_VIDEO_INFO_FORMAT (&*priv->colour))),
        (nullptr));
    return GST_FLOW_ERROR;
  }
  priv->negotiate = false;
  return GST_FLOW_OK;
}

/* ---- data ---- */

/* Warns once if the first frame with depth has hardly any between near and far: most likely
 * depth-scale is wrong, or the image has 8 bits.
 * @param depth  of the input */
static void
check_range (
    GstRangeCombine *self, rangecast::ImageView<const std::uint16_t> depth, const RangeImage &image)
{
  GstRangeCombinePrivate *priv = self->priv;
  const rangecast::DepthRange range = rangecast::find_depth_range (depth);
  if (range.count == 0)
    return;
  priv->range_checked = true;
  if (rangecast::count_points (image) >= kUsualShare * range.count)
    return;
  GST_ELEMENT_WARNING (self, STREAM, FORMAT,
      ("pad depth: hardly any pixel lies between near (%g m) and far (%g m); values are %d to %d, "
       "with depth-scale=%g %g to %g m; change %snear or far",
          priv->view.near_m, priv->view.far_m, range.min, range.max, priv->depth_scale,
          range.min * priv->depth_scale, range.max * priv->depth_scale,
          priv->has_caps_scale ? "" : "depth-scale, "),
      (nullptr));
}

/* The colour that the reader has open, and depth of either byte order made little-endian. */
static Status
combine_images (GstRangeCombinePrivate *priv, rangecast::ImageView<const std::uint16_t> depth,
    const RangeImage &image)
{
  const auto colour = priv->reader.view ();
  if (!priv->registered)
    return priv->registration.process (depth, priv->depth_scale, colour, image);
  for (int y = 0; y < colour.height; y++)
    std::copy_n (colour.row (y), colour.width, image.colour.row (y));
  const double unit = priv->view.depth_unit_m;
  return rangecast::rescale_depth (depth, priv->depth_scale / unit,
      rangecast::depth_units (priv->view.near_m, unit),
      rangecast::depth_units (priv->view.far_m, unit), image.depth);
}

static Status
combine (GstRangeCombine *self, GstBuffer *colour, GstBuffer *depth, GstBuffer *output)
{
  GstRangeCombinePrivate *priv = self->priv;
  gstrange::RangeFrameMap frame (output, GST_MAP_WRITE);
  if (!frame.status ().ok ())
    return frame.status ();
  GstVideoFrame from;
  if (!gst_video_frame_map (&from, &*priv->depth, depth, GST_MAP_READ))
    return {StatusCode::kBadData, "pad depth: a buffer is smaller than its caps require"};
  rangecast::ImageView<const std::uint16_t> picture = {
      static_cast<const std::uint16_t *> (GST_VIDEO_FRAME_PLANE_DATA (&from, 0)),
      GST_VIDEO_FRAME_WIDTH (&from), GST_VIDEO_FRAME_HEIGHT (&from),
      GST_VIDEO_FRAME_PLANE_STRIDE (&from, 0)};
  if (GST_VIDEO_FRAME_FORMAT (&from) == GST_VIDEO_FORMAT_GRAY16_BE) {
    priv->swapped.resize (std::size_t (picture.width) * std::size_t (picture.height));
    const rangecast::ImageView<std::uint16_t> little = {
        priv->swapped.data (), picture.width, picture.height, 2 * picture.width};
    rangecast::swap_bytes (picture, little);
    picture = {little.data, little.width, little.height, little.stride};
  }
  Status status{StatusCode::kBadData, "pad colour: a buffer is smaller than its caps require"};
  if (priv->reader.open (colour))
    status = combine_images (priv, picture, frame.views ()[0]);
  priv->reader.close ();
  if (status.ok () && !priv->range_checked)
    check_range (self, picture, frame.views ()[0]);
  gst_video_frame_unmap (&from);
  return status;
}

static GstFlowReturn
push_pair (GstRangeCombine *self)
{
  GstRangeCombinePrivate *priv = self->priv;
  auto aggregator = GST_AGGREGATOR (self);
  GstBuffer *output = nullptr;
  GstFlowReturn flow = gstrange::acquire (GST_ELEMENT (self), priv->pool, &output);
  if (flow != GST_FLOW_OK)
    return flow;
  const bool live = gst_aggregator_get_latency (aggregator) != GST_CLOCK_TIME_NONE;
  GstBuffer *colour = priv->matcher->buffer (0), *depth = priv->matcher->buffer (1);
  const GstClockTime capture = gstrange::capture_time_of (priv->colour_pad, colour, live);
  const View &view = priv->view;
  Status status = gstrange::add_view (output, view.id, {0, 0, view.width, view.height}, capture);
  if (status.ok ())
    status = combine (self, colour, depth, output);
  flow = gst_range_flow_return (GST_ELEMENT (self), status);
  if (flow != GST_FLOW_OK) {
    gst_buffer_unref (output);
    return flow;
  }
  const GstClockTime duration = GST_CLOCK_TIME_IS_VALID (priv->frame_duration)
                                    ? priv->frame_duration
                                    : GST_BUFFER_DURATION (colour);
  const GstClockTime running = priv->matcher->running ();
  gstrange::stamp (aggregator, output, running, duration, capture);
  GST_LOG_OBJECT (self, "pair at %" GST_TIME_FORMAT, GST_TIME_ARGS (running));
  if (priv->matcher->discont ())
    GST_BUFFER_FLAG_SET (output, GST_BUFFER_FLAG_DISCONT);
  {
    std::lock_guard guard (priv->lock);
    priv->frames++;
  }
  return gst_aggregator_finish_buffer (aggregator, output);
}

static GstFlowReturn
gst_range_combine_aggregate (GstAggregator *aggregator, gboolean timeout)
{
  auto self = GST_RANGE_COMBINE (aggregator);
  GstRangeCombinePrivate *priv = self->priv;
  /* Within half a frame of the faster stream, so that each frame of the slower one is paired with
   * the nearest. NONE is the maximum. */
  const GstClockTime duration =
      std::min (frame_duration (priv->colour), frame_duration (priv->depth));
  GstFlowReturn flow = priv->matcher->next (gstrange::pairing_tolerance (duration), timeout);
  if (flow != GST_FLOW_OK)
    return flow;
  if (priv->negotiate)
    flow = negotiate (self);
  if (flow == GST_FLOW_OK)
    flow = push_pair (self);
  priv->matcher->release ();
  return flow;
}

static GstClockTime
gst_range_combine_get_next_time (GstAggregator *aggregator)
{
  return GST_RANGE_COMBINE (aggregator)->priv->matcher->next_time ();
}

/* ---- lifecycle ---- */

static gboolean
gst_range_combine_start (GstAggregator *aggregator)
{
  GstRangeCombinePrivate *priv = GST_RANGE_COMBINE (aggregator)->priv;
  priv->colour.reset ();
  priv->depth.reset ();
  priv->depth_view.reset ();
  priv->negotiate = true;
  priv->range_checked = false;
  priv->matcher->start ();
  std::lock_guard guard (priv->lock);
  priv->frames = 0;
  return TRUE;
}

static GstFlowReturn
gst_range_combine_flush (GstAggregator *aggregator)
{
  GST_RANGE_COMBINE (aggregator)->priv->matcher->flush ();
  return GST_FLOW_OK;
}

static gboolean
gst_range_combine_stop (GstAggregator *aggregator)
{
  GstRangeCombinePrivate *priv = GST_RANGE_COMBINE (aggregator)->priv;
  priv->matcher->stop ();
  priv->reader.reset ();
  drop_pool (priv->pool);
  return TRUE;
}

/* ---- properties ---- */

static const GEnumValue kOutputViews[] = {
    {int (RegisterInto::kDepth), "View of the depth camera: depth stays as measured", "depth"},
    {int (RegisterInto::kColour), "View of the colour camera: colour stays as captured", "colour"},
    {}};

static PropertyTable<CombineSettings> &
combine_properties ()
{
  using S = CombineSettings;
  using V = ViewSettings;
  using P = PropertyTable<S>;
  static P table = {
      P::text<&S::view, &V::rig> ("rig", "Rig",
          "Rig file with the calibration of the view (unset = a pinhole camera at the origin with "
          "focal-length)",
          kMutableReady),
      P::number<&S::view, &V::view_id> ("view-id", "View ID",
          "view-id of the depth camera, and of the output unless into=colour", 0,
          rangecast::kMaxViews - 1, kMutableReady),
      P::number<&S::colour_view_id> ("colour-view-id", "Colour view ID",
          "view-id of the colour camera in the rig (-1 = colour and depth are registered)", -1,
          rangecast::kMaxViews - 1, kMutableReady),
      P::boolean<&S::do_timestamp> ("do-timestamp", "Do timestamp",
          "Pair live images by their time of arrival, for sources whose timestamps differ in "
          "origin",
          kMutableReady),
      P::enumeration<&S::into> ("into", "Output view",
          "Output view if colour and depth come from different cameras", "GstRangeCombineInto",
          kOutputViews, kMutableReady),
      P::number<&S::view, &V::focal_length> ("focal-length", "Focal length",
          "Focal length in pixels of the depth images, without a rig (0 = 0.82 of their width)", 0,
          1e6, kMutableReady),
      P::number<&S::depth_scale> ("depth-scale", "Depth scale",
          "Metres per unit of the input depth (ignored where the caps carry the calibration)", 1e-7,
          1, kMutableReady),
      P::number<&S::view, &V::near> ("near", "Near",
          "Nearest valid depth in metres (0 = from the rig, or 0.3)", 0, 1e4, kMutableReady),
      P::number<&S::view, &V::far> ("far", "Far",
          "Farthest valid depth in metres (0 = from the rig, or 6)", 0, 1e4, kMutableReady),
  };
  return table;
}

static GstStructure *
make_stats (const GstRangeCombinePrivate *priv)
{
  return gst_structure_new ("application/x-rangecombine-stats", "frames", G_TYPE_UINT64,
      priv->frames, "dropped-colour", G_TYPE_UINT64, priv->matcher->dropped (0), "dropped-depth",
      G_TYPE_UINT64, priv->matcher->dropped (1), nullptr);
}

static void
gst_range_combine_init (GstRangeCombine *self)
{
  auto priv = self->priv = new GstRangeCombinePrivate;
  priv->colour_pad = add_sink_pad (GST_ELEMENT (self), kPadNames[0]);
  priv->depth_pad = add_sink_pad (GST_ELEMENT (self), kPadNames[1]);
  for (GstAggregatorPad *pad : {priv->colour_pad, priv->depth_pad})
    gst_pad_add_probe (GST_PAD (pad), GST_PAD_PROBE_TYPE_BUFFER, stamp_arrival, self, nullptr);
  priv->matcher.emplace (GST_ELEMENT (self), GST_CAT_DEFAULT, kPadNames);
}

static void
gst_range_combine_class_init (GstRangeCombineClass *klass)
{
  auto object_class = G_OBJECT_CLASS (klass);
  auto element_class = GST_ELEMENT_CLASS (klass);
  auto aggregator_class = GST_AGGREGATOR_CLASS (klass);

  GST_DEBUG_CATEGORY_INIT (gst_range_combine_debug, "rangecombine", 0, "Range image combiner");

  object_class->finalize = delete_private<GstRangeCombine>;
  install_properties<GstRangeCombine, combine_properties, make_stats> (object_class,
      "Counters since the element was started: frames, dropped-colour, dropped-depth");

  for (GstStaticPadTemplate *pad_template : {&colour_template, &depth_template, &src_template})
    gst_element_class_add_static_pad_template_with_gtype (
        element_class, pad_template, GST_TYPE_AGGREGATOR_PAD);
  gst_element_class_set_static_metadata (element_class, "Range image combiner", "Filter/Video",
      "Combines the colour and depth images of a depth camera into range images", "gst-rangecast");

  aggregator_class->start = GST_DEBUG_FUNCPTR (gst_range_combine_start);
  aggregator_class->stop = GST_DEBUG_FUNCPTR (gst_range_combine_stop);
  aggregator_class->flush = GST_DEBUG_FUNCPTR (gst_range_combine_flush);
  aggregator_class->sink_event = GST_DEBUG_FUNCPTR (gst_range_combine_sink_event);
  aggregator_class->update_src_caps = GST_DEBUG_FUNCPTR (keep_src_caps);
  aggregator_class->negotiate = GST_DEBUG_FUNCPTR (negotiate_downstream);
  aggregator_class->clip = GST_DEBUG_FUNCPTR (gstrange::clip_to_segment);
  aggregator_class->aggregate = aggregate_to_the_end<gst_range_combine_aggregate>;
  aggregator_class->get_next_time = GST_DEBUG_FUNCPTR (gst_range_combine_get_next_time);
}
