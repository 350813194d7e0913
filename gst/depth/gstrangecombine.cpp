/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-rangecombine
 * @title: rangecombine
 *
 * Combines the colour and depth images of any depth camera into range images of one view. They may
 * be registered pixel to pixel, of different size, or of two cameras side by side (see
 * #GstRangeCombine:colour-view-id and #GstRangeCombine:into). Depth is GRAY16_LE in any unit
 * (default: millimetres).
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 rangecombine name=c focal-length=525 ! plyenc ! filesink location=cloud.ply
 * filesrc location=colour.jpg ! jpegdec ! videoconvert ! c.colour filesrc location=depth.png !
 * pngdec ! videoconvert ! c.depth
 * ]|
 *
 * Since: 0.1
 */
#include "gstrangecombine.h"

#include <gst/video/video.h>

#include <algorithm>
#include <cmath>
#include <gstrange/gstrange.h>
#include <gstrange/gstrangeframe.hpp>
#include <gstrange/gstrangeinfo.hpp>
#include <gstrange/gstrangepairing.hpp>
#include <gstrange/gstrangestatus.hpp>
#include <mutex>
#include <rangecast/geometry/point_cloud.hpp>
#include <rangecast/geometry/size_text.hpp>
#include <rangecast/registration/registration.hpp>
#include <rangecast/rigfile/rig_file.hpp>
#include <string>

#include "common/bufferpools.hpp"
#include "common/properties.hpp"

using rangecast::RangeImage;
using rangecast::RegisterInto;
using rangecast::size_text;
using rangecast::Status;
using rangecast::StatusCode;
using rangecast::View;

GST_DEBUG_CATEGORY_STATIC (gst_range_combine_debug);
#define GST_CAT_DEFAULT gst_range_combine_debug

enum : guint { PROP_STATS = 1, PROP_SETTINGS };

static constexpr double kDefaultDepthScale = 0.001;
static constexpr double kDefaultDepthUnit = 0.0001;
/* Of an ordinary RGB-D camera, whose horizontal field of view is about 63 degrees. */
static constexpr double kDefaultFocalOfWidth = 0.82;

struct CombineSettings {
  std::string rig;
  int view_id = 0;
  int colour_view_id = -1; /* -1: the depth camera gives the colour, too */
  RegisterInto into = RegisterInto::kDepth;
  double focal_length = 0; /* pixels; 0: kDefaultFocalOfWidth of the width */
  double principal_x = -1; /* pixels; -1: the centre */
  double principal_y = -1;
  double depth_scale = kDefaultDepthScale; /* metres per unit of the input */
  double depth_unit = 0;                   /* metres; 0: the rig's, or kDefaultDepthUnit */
  double near = 0, far = 0;                /* metres; 0: the rig's */
};

struct GstRangeCombinePrivate {
  std::mutex lock; /* guards settings and the counter; never held across a push or message */
  CombineSettings settings;
  guint64 frames = 0;

  /* streaming thread only */
  GstAggregatorPad *colour_pad = nullptr, *depth_pad = nullptr; /* owned by the element */
  gstrange::PairMatcher *matcher = nullptr;
  gstrange::GapSender gaps;
  GstVideoInfo colour, depth;
  bool have_colour = false, have_depth = false;
  bool negotiate = true;
  View view;              /* what the output's caps say */
  bool registered = true; /* pixel to pixel already: nothing to register */
  rangecast::Registration registration;
  GstBuffer *straight = nullptr; /* RGBx, the colour picture before it is registered */
  double depth_scale = kDefaultDepthScale;
  GstClockTime frame_duration = GST_CLOCK_TIME_NONE;
  GstBufferPool *pool = nullptr;
  GstVideoConverter *converter = nullptr;
  GstVideoInfo rgbx; /* what the converter writes */
};

struct _GstRangeCombine {
  GstAggregator parent;
  GstRangeCombinePrivate *priv;
};

static GstStaticPadTemplate colour_template = GST_STATIC_PAD_TEMPLATE ("colour", GST_PAD_SINK,
    GST_PAD_ALWAYS, GST_STATIC_CAPS (GST_VIDEO_CAPS_MAKE (GST_VIDEO_FORMATS_ALL)));
static GstStaticPadTemplate depth_template = GST_STATIC_PAD_TEMPLATE (
    "depth", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS (GST_VIDEO_CAPS_MAKE ("GRAY16_LE")));
static GstStaticPadTemplate src_template =
    GST_STATIC_PAD_TEMPLATE ("src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS (GST_RANGE_CAPS));

G_DEFINE_TYPE (GstRangeCombine, gst_range_combine, GST_TYPE_AGGREGATOR)
GST_ELEMENT_REGISTER_DEFINE (rangecombine, "rangecombine", GST_RANK_NONE, GST_TYPE_RANGE_COMBINE)

#define GST_TYPE_RANGE_COMBINE_INTO (gst_range_combine_into_get_type ())
static GType
gst_range_combine_into_get_type (void)
{
  static const GType type = [] {
    static const GEnumValue values[] = {
        {int (RegisterInto::kDepth), "View of the depth camera: depth stays as measured", "depth"},
        {int (RegisterInto::kColour), "View of the colour camera: colour stays as captured",
            "colour"},
        {}};
    return g_enum_register_static ("GstRangeCombineInto", values);
  }();
  return type;
}

/* ---- the view ---- */

/* A view of the rig at the size of the pictures. */
static Status
view_from_rig (
    const std::string &path, int id, const char *property, int width, int height, View &view)
{
  rangecast::Rig rig;
  if (Status s = rangecast::load_rig (path, rig); !s.ok ())
    return s;
  const View *found = rig.find (id);
  if (!found)
    return {StatusCode::kNotFound, path + ": has no view-id " + std::to_string (id) +
                                       ", which property " + property + " names"};
  view = *found;
  view.right.reset ();
  view.third.reset ();
  const Status scaled = rangecast::scale_view (view, width, height);
  return scaled.ok () ? scaled : Status{scaled.code (), path + ": " + scaled.message ()};
}

static View
view_from_settings (const CombineSettings &settings, int width, int height)
{
  View view;
  view.id = settings.view_id;
  view.width = width;
  view.height = height;
  const double f = settings.focal_length > 0 ? settings.focal_length : kDefaultFocalOfWidth * width;
  view.intrinsics = {f, f, settings.principal_x >= 0 ? settings.principal_x : (width - 1) / 2.0,
      settings.principal_y >= 0 ? settings.principal_y : (height - 1) / 2.0};
  view.world_from_view.rotation = {1, 0, 0, 0, -1, 0, 0, 0, -1}; /* level, looking along -z */
  view.depth_unit_m = kDefaultDepthUnit;
  view.near_m = 0.3;
  view.far_m = 6.0;
  return view;
}

/* The camera that took the depth. */
static Status
make_depth_view (const CombineSettings &settings, int width, int height, View &view)
{
  if (settings.rig.empty ())
    view = view_from_settings (settings, width, height);
  else if (Status s =
               view_from_rig (settings.rig, settings.view_id, "view-id", width, height, view);
           !s.ok ())
    return s;
  if (settings.depth_unit > 0)
    view.depth_unit_m = settings.depth_unit;
  if (settings.near > 0)
    view.near_m = settings.near;
  if (settings.far > 0)
    view.far_m = settings.far;
  return rangecast::validate ({{view}});
}

/* The camera that took the colour: one of the rig's own, or the depth camera at another size. */
static Status
make_colour_view (
    const CombineSettings &settings, const View &depth, int width, int height, View &view)
{
  if (settings.colour_view_id >= 0 && settings.rig.empty ())
    return {StatusCode::kBadValue, "property colour-view-id: expected property rig, too: a file "
                                   "with the poses of both cameras"};
  if (settings.colour_view_id >= 0)
    return view_from_rig (
        settings.rig, settings.colour_view_id, "colour-view-id", width, height, view);
  view = depth;
  const Status scaled = rangecast::scale_view (view, width, height);
  if (scaled.ok ())
    return scaled;
  return {scaled.code (), "pad depth is " + size_text (depth.width, depth.height) +
                              " but pad colour is " + size_text (width, height) +
                              "; expected the same shape, or property colour-view-id for a colour "
                              "camera of its own"};
}

/* Both cameras, and what comes out of them. */
static Status
make_views (GstRangeCombinePrivate *priv, const CombineSettings &settings)
{
  View depth, colour;
  if (Status s = make_depth_view (settings, GST_VIDEO_INFO_WIDTH (&priv->depth),
          GST_VIDEO_INFO_HEIGHT (&priv->depth), depth);
      !s.ok ())
    return s;
  if (Status s = make_colour_view (settings, depth, GST_VIDEO_INFO_WIDTH (&priv->colour),
          GST_VIDEO_INFO_HEIGHT (&priv->colour), colour);
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

/* ---- negotiation ---- */

static void
drop_pool_and_converter (GstRangeCombinePrivate *priv)
{
  drop_pool (priv->pool);
  gst_clear_buffer (&priv->straight);
  if (priv->converter)
    gst_video_converter_free (priv->converter);
  priv->converter = nullptr;
}

static bool
make_converter (GstRangeCombinePrivate *priv)
{
  gst_video_info_set_format (&priv->rgbx, GST_VIDEO_FORMAT_RGBx,
      guint (GST_VIDEO_INFO_WIDTH (&priv->colour)), guint (GST_VIDEO_INFO_HEIGHT (&priv->colour)));
  priv->rgbx.fps_n = priv->colour.fps_n;
  priv->rgbx.fps_d = priv->colour.fps_d;
  priv->rgbx.interlace_mode = priv->colour.interlace_mode;
  if (GST_VIDEO_INFO_FORMAT (&priv->colour) == GST_VIDEO_FORMAT_RGBx)
    priv->rgbx.colorimetry = priv->colour.colorimetry;
  priv->converter = gst_video_converter_new (&priv->colour, &priv->rgbx, nullptr);
  if (!priv->registered)
    priv->straight = gst_buffer_new_allocate (nullptr, GST_VIDEO_INFO_SIZE (&priv->rgbx), nullptr);
  return priv->converter;
}

/* How long a frame is: that of the slower stream, for so many pairs there are; how far two may be
 * apart is half a frame of the faster one, so that each of the slower finds its nearest. */
static GstClockTime
frame_duration_of (const GstVideoInfo &info)
{
  return info.fps_n > 0 ? gst_util_uint64_scale_int (GST_SECOND, info.fps_d, info.fps_n)
                        : GST_CLOCK_TIME_NONE;
}

static const GstVideoInfo &
slower (const GstRangeCombinePrivate *priv)
{
  const GstClockTime colour = frame_duration_of (priv->colour),
                     depth = frame_duration_of (priv->depth);
  const bool depth_is =
      GST_CLOCK_TIME_IS_VALID (depth) && (!GST_CLOCK_TIME_IS_VALID (colour) || depth > colour);
  return depth_is ? priv->depth : priv->colour;
}

static GstFlowReturn
negotiate (GstRangeCombine *self)
{
  GstRangeCombinePrivate *priv = self->priv;
  CombineSettings settings;
  {
    std::lock_guard guard (priv->lock);
    settings = priv->settings;
  }
  const GstFlowReturn flow =
      gst_range_flow_return (GST_ELEMENT (self), make_views (priv, settings));
  if (flow != GST_FLOW_OK)
    return flow;
  priv->depth_scale = settings.depth_scale;

  const auto info = gstrange::make_info ({{priv->view}}, slower (priv).fps_n, slower (priv).fps_d);
  priv->frame_duration = info.frame_duration ();
  GstCaps *caps = gstrange::make_range_caps (info);
  drop_pool_and_converter (priv);
  const Status pooled = gstrange::make_pool (caps, priv->pool);
  if (pooled.ok ())
    gst_aggregator_set_src_caps (GST_AGGREGATOR (self), caps);
  gst_caps_unref (caps);
  if (!pooled.ok ())
    return gst_range_flow_return (GST_ELEMENT (self), pooled);
  if (!make_converter (priv)) {
    GST_ELEMENT_ERROR (self, CORE, NEGOTIATION,
        ("pad colour: cannot convert %s to RGBx",
            gst_video_format_to_string (GST_VIDEO_INFO_FORMAT (&priv->colour))),
        (nullptr));
    return GST_FLOW_ERROR;
  }
  priv->negotiate = false;
  return GST_FLOW_OK;
}

static GstFlowReturn
gst_range_combine_update_src_caps (GstAggregator *, GstCaps *, GstCaps **)
{
  return GST_AGGREGATOR_FLOW_NEED_DATA; /* caps are set with the first pair, see negotiate() */
}

static gboolean
gst_range_combine_sink_event (GstAggregator *aggregator, GstAggregatorPad *pad, GstEvent *event)
{
  GstRangeCombinePrivate *priv = GST_RANGE_COMBINE (aggregator)->priv;
  if (GST_EVENT_TYPE (event) == GST_EVENT_CAPS) {
    GstCaps *caps;
    GstVideoInfo info;
    gst_event_parse_caps (event, &caps);
    if (!gst_video_info_from_caps (&info, caps)) {
      gst_event_unref (event);
      return FALSE;
    }
    (pad == priv->colour_pad ? priv->colour : priv->depth) = info;
    (pad == priv->colour_pad ? priv->have_colour : priv->have_depth) = true;
    priv->negotiate = true;
  }
  return GST_AGGREGATOR_CLASS (gst_range_combine_parent_class)->sink_event (aggregator, pad, event);
}

/* ---- data ---- */

static bool
convert_colour (
    GstRangeCombinePrivate *priv, GstBuffer *colour, rangecast::ImageView<rangecast::Rgbx> out)
{
  GstVideoFrame from, to = {};
  if (!gst_video_frame_map (&from, &priv->colour, colour, GST_MAP_READ))
    return false;
  to.info = priv->rgbx;
  to.info.stride[0] = static_cast<gint> (out.stride);
  to.data[0] = out.data;
  gst_video_converter_frame (priv->converter, &from, &to);
  gst_video_frame_unmap (&from);
  return true;
}

/* Depth and colour of one camera, pixel to pixel: straight into the planes of the output. */
static Status
combine_registered (GstRangeCombinePrivate *priv, GstBuffer *colour,
    rangecast::ImageView<const std::uint16_t> depth, const RangeImage &image)
{
  if (!convert_colour (priv, colour, image.colour))
    return {StatusCode::kBadData, "pad colour: a buffer is smaller than its caps require"};
  const double unit = priv->view.depth_unit_m;
  return rangecast::rescale_depth (depth, priv->depth_scale / unit,
      rangecast::depth_units (priv->view.near_m, unit),
      rangecast::depth_units (priv->view.far_m, unit), image.depth);
}

static Status
combine_cameras (GstRangeCombinePrivate *priv, GstBuffer *colour,
    rangecast::ImageView<const std::uint16_t> depth, const RangeImage &image)
{
  GstMapInfo map;
  if (!gst_buffer_map (priv->straight, &map, GST_MAP_READWRITE))
    return {StatusCode::kNoSpace, "pad colour: out of memory"};
  const rangecast::ImageView<rangecast::Rgbx> straight = {
      reinterpret_cast<rangecast::Rgbx *> (map.data), GST_VIDEO_INFO_WIDTH (&priv->rgbx),
      GST_VIDEO_INFO_HEIGHT (&priv->rgbx), GST_VIDEO_INFO_PLANE_STRIDE (&priv->rgbx, 0)};
  Status status{StatusCode::kBadData, "pad colour: a buffer is smaller than its caps require"};
  if (convert_colour (priv, colour, straight))
    status = priv->registration.process (depth, priv->depth_scale, straight, image);
  gst_buffer_unmap (priv->straight, &map);
  return status;
}

static Status
combine (GstRangeCombinePrivate *priv, GstBuffer *colour, GstBuffer *depth, GstBuffer *output)
{
  gstrange::RangeFrameMap frame (output, GST_MAP_WRITE);
  if (!frame.status ().ok ())
    return frame.status ();
  GstVideoFrame from;
  if (!gst_video_frame_map (&from, &priv->depth, depth, GST_MAP_READ))
    return {StatusCode::kBadData, "pad depth: a buffer is smaller than its caps require"};
  const rangecast::ImageView<const std::uint16_t> picture = {
      static_cast<const std::uint16_t *> (GST_VIDEO_FRAME_PLANE_DATA (&from, 0)),
      GST_VIDEO_FRAME_WIDTH (&from), GST_VIDEO_FRAME_HEIGHT (&from),
      GST_VIDEO_FRAME_PLANE_STRIDE (&from, 0)};
  const auto work = priv->registered ? combine_registered : combine_cameras;
  const Status status = work (priv, colour, picture, frame.views ()[0]);
  gst_video_frame_unmap (&from);
  return status;
}

static GstFlowReturn
push_pair (GstRangeCombine *self, const gstrange::PairMatcher::Pair &pair)
{
  GstRangeCombinePrivate *priv = self->priv;
  auto aggregator = GST_AGGREGATOR (self);
  GstBuffer *output = nullptr;
  GstFlowReturn flow = gstrange::acquire (GST_ELEMENT (self), priv->pool, &output);
  if (flow != GST_FLOW_OK)
    return flow;
  const bool live = gst_aggregator_get_latency (aggregator) != GST_CLOCK_TIME_NONE;
  const GstClockTime capture = gstrange::capture_time_of (priv->colour_pad, pair.first, live);
  const View &view = priv->view;
  Status status = gstrange::add_view (output, view.id, {0, 0, view.width, view.height}, capture);
  if (status.ok ())
    status = combine (priv, pair.first, pair.second, output);
  flow = gst_range_flow_return (GST_ELEMENT (self), status);
  if (flow != GST_FLOW_OK) {
    gst_buffer_unref (output);
    return flow;
  }
  const GstClockTime duration = GST_CLOCK_TIME_IS_VALID (priv->frame_duration)
                                    ? priv->frame_duration
                                    : GST_BUFFER_DURATION (pair.first);
  const GstClockTime running = gstrange::running_time_of (priv->colour_pad, pair.first);
  gstrange::stamp (aggregator, output, running, duration, capture);
  priv->gaps.note_buffer (running, duration);
  if (GST_BUFFER_IS_DISCONT (pair.first))
    GST_BUFFER_FLAG_SET (output, GST_BUFFER_FLAG_DISCONT);
  {
    std::lock_guard guard (priv->lock);
    priv->frames++;
  }
  return gst_aggregator_finish_buffer (aggregator, output);
}

/* Tells downstream of a time of which there will be nothing, up to the pair that waits. */
static GstFlowReturn
push_gap (GstRangeCombine *self, GstBuffer *waiting)
{
  GstRangeCombinePrivate *priv = self->priv;
  GstClockTime begin, end;
  if (!priv->matcher->take_gap (begin, end))
    return GST_FLOW_OK;
  if (waiting) /* NONE is the greatest number */
    end = std::min (end, gstrange::running_time_of (priv->colour_pad, waiting));
  if (!priv->gaps.cut (begin, end) || !priv->have_colour || !priv->have_depth)
    return GST_FLOW_OK;
  if (priv->negotiate)
    if (const GstFlowReturn flow = negotiate (self); flow != GST_FLOW_OK)
      return flow;
  priv->gaps.push (GST_AGGREGATOR (self), priv->colour_pad, begin, end);
  return GST_FLOW_OK;
}

static GstFlowReturn
gst_range_combine_aggregate (GstAggregator *aggregator, gboolean)
{
  auto self = GST_RANGE_COMBINE (aggregator);
  GstRangeCombinePrivate *priv = self->priv;
  GstClockTime duration = GST_CLOCK_TIME_NONE; /* of the faster stream */
  if (priv->have_colour)
    duration = frame_duration_of (priv->colour);
  if (priv->have_depth)
    duration = std::min (duration, frame_duration_of (priv->depth));

  gstrange::PairMatcher::Pair pair;
  const GstFlowReturn taken = priv->matcher->take (duration, pair);
  GstFlowReturn flow = push_gap (self, pair.first);
  if (taken != GST_FLOW_OK)
    return flow == GST_FLOW_OK ? taken : flow;
  if (flow == GST_FLOW_OK && priv->negotiate)
    flow = negotiate (self);
  if (flow == GST_FLOW_OK)
    flow = push_pair (self, pair);
  gst_buffer_unref (pair.first);
  gst_buffer_unref (pair.second);
  return flow;
}

static GstFlowReturn
gst_range_combine_flush (GstAggregator *aggregator)
{
  GstRangeCombinePrivate *priv = GST_RANGE_COMBINE (aggregator)->priv;
  GstClockTime begin, end;
  priv->matcher->take_gap (begin, end);
  priv->gaps.reset ();
  return GST_FLOW_OK;
}

/* ---- life ---- */

static gboolean
gst_range_combine_start (GstAggregator *aggregator)
{
  GstRangeCombinePrivate *priv = GST_RANGE_COMBINE (aggregator)->priv;
  priv->have_colour = priv->have_depth = false;
  priv->negotiate = true;
  priv->matcher->reset ();
  priv->gaps.reset ();
  std::lock_guard guard (priv->lock);
  priv->frames = 0;
  return TRUE;
}

static gboolean
gst_range_combine_stop (GstAggregator *aggregator)
{
  drop_pool_and_converter (GST_RANGE_COMBINE (aggregator)->priv);
  return TRUE;
}

static PropertyTable<CombineSettings> &
combine_properties ()
{
  using S = CombineSettings;
  using P = PropertyTable<S>;
  static P table = {
      P::text<&S::rig> ("rig", "Rig",
          "Rig file with the calibration of the view (unset = a pinhole camera at the origin with "
          "focal-length)",
          kMutableReady),
      P::number<&S::view_id> ("view-id", "View ID",
          "view-id of the depth camera, and of the output unless into=colour", 0,
          rangecast::kMaxViews - 1, kMutableReady),
      P::number<&S::colour_view_id> ("colour-view-id", "Colour view ID",
          "view-id of the colour camera in the rig (-1 = colour and depth are registered)", -1,
          rangecast::kMaxViews - 1, kMutableReady),
      P::enumeration<&S::into> ("into", "Output view",
          "Output view if colour and depth come from different cameras",
          GST_TYPE_RANGE_COMBINE_INTO, kMutableReady),
      P::number<&S::focal_length> ("focal-length", "Focal length",
          "Focal length in pixels, without a rig (0 = 0.82 of the width)", 0, 1e6, kMutableReady),
      P::number<&S::principal_x> ("principal-x", "Principal point x",
          "Horizontal principal point in pixels, without a rig (-1 = centre)", -1, 1e6,
          kMutableReady),
      P::number<&S::principal_y> ("principal-y", "Principal point y",
          "Vertical principal point in pixels, without a rig (-1 = centre)", -1, 1e6,
          kMutableReady),
      P::number<&S::depth_scale> ("depth-scale", "Depth scale",
          "Metres per unit of the input depth", 1e-7, 1, kMutableReady),
      P::number<&S::depth_unit> ("depth-unit", "Depth unit",
          "Metres per depth unit of the output (0 = from the rig, or 0.0001)", 0, 1, kMutableReady),
      P::number<&S::near> ("near", "Near",
          "Nearest valid depth in metres (0 = from the rig, or 0.3)", 0, 1e4, kMutableReady),
      P::number<&S::far> ("far", "Far", "Farthest valid depth in metres (0 = from the rig, or 6)",
          0, 1e4, kMutableReady),
  };
  return table;
}

static void
gst_range_combine_set_property (GObject *object, guint id, const GValue *value, GParamSpec *pspec)
{
  GstRangeCombinePrivate *priv = GST_RANGE_COMBINE (object)->priv;
  std::lock_guard guard (priv->lock);
  if (!combine_properties ().set (priv->settings, id, value))
    G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
}

static void
gst_range_combine_get_property (GObject *object, guint id, GValue *value, GParamSpec *pspec)
{
  GstRangeCombinePrivate *priv = GST_RANGE_COMBINE (object)->priv;
  std::lock_guard guard (priv->lock);
  if (id == PROP_STATS)
    g_value_take_boxed (
        value, gst_structure_new ("application/x-rangecombine-stats", "frames", G_TYPE_UINT64,
                   priv->frames, "dropped-colour", G_TYPE_UINT64, priv->matcher->dropped_first (),
                   "dropped-depth", G_TYPE_UINT64, priv->matcher->dropped_second (), nullptr));
  else if (!combine_properties ().get (priv->settings, id, value))
    G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
}

static void
gst_range_combine_finalize (GObject *object)
{
  GstRangeCombinePrivate *priv = GST_RANGE_COMBINE (object)->priv;
  drop_pool_and_converter (priv);
  delete priv->matcher;
  delete priv;
  G_OBJECT_CLASS (gst_range_combine_parent_class)->finalize (object);
}

static void
gst_range_combine_init (GstRangeCombine *self)
{
  self->priv = new GstRangeCombinePrivate;
  self->priv->colour_pad = gstrange::add_sink_pad (GST_ELEMENT (self), "colour");
  self->priv->depth_pad = gstrange::add_sink_pad (GST_ELEMENT (self), "depth");
  self->priv->matcher = new gstrange::PairMatcher (self->priv->colour_pad, self->priv->depth_pad);
}

static void
gst_range_combine_class_init (GstRangeCombineClass *klass)
{
  auto object_class = G_OBJECT_CLASS (klass);
  auto element_class = GST_ELEMENT_CLASS (klass);
  auto aggregator_class = GST_AGGREGATOR_CLASS (klass);

  object_class->set_property = gst_range_combine_set_property;
  object_class->get_property = gst_range_combine_get_property;
  object_class->finalize = gst_range_combine_finalize;
  combine_properties ().install (object_class, PROP_SETTINGS);
  install_stats (object_class, PROP_STATS,
      "Counters since the element was started: frames, dropped-colour, dropped-depth");

  gst_element_class_add_static_pad_template_with_gtype (
      element_class, &colour_template, GST_TYPE_AGGREGATOR_PAD);
  gst_element_class_add_static_pad_template_with_gtype (
      element_class, &depth_template, GST_TYPE_AGGREGATOR_PAD);
  gst_element_class_add_static_pad_template_with_gtype (
      element_class, &src_template, GST_TYPE_AGGREGATOR_PAD);
  gst_element_class_set_static_metadata (element_class, "Range image combiner", "Filter/Video",
      "Combines the colour and depth images of a depth camera into range images", "gst-rangecast");

  aggregator_class->start = gst_range_combine_start;
  aggregator_class->stop = gst_range_combine_stop;
  aggregator_class->flush = gst_range_combine_flush;
  aggregator_class->sink_event = gst_range_combine_sink_event;
  aggregator_class->update_src_caps = gst_range_combine_update_src_caps;
  aggregator_class->clip = gstrange::clip_to_segment;
  aggregator_class->aggregate = gst_range_combine_aggregate;

  GST_DEBUG_CATEGORY_INIT (gst_range_combine_debug, "rangecombine", 0, "Range image combiner");
}
