/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-stereodepth
 * @title: stereodepth
 *
 * Makes range images of a stereo pair: rectifies both pictures with the calibration of a rig file,
 * matches them, checks left against right, filters, and converts disparity to depth. Pictures that
 * are rectified already need only #GstStereoDepth:focal-length and #GstStereoDepth:baseline.
 *
 * An element downstream can tell which part of the picture it wants with a custom upstream event
 * `GstRangeRoi` (view-id, x, y, width, height: uint); roiextract does. Then only that part is
 * matched, at the depths where its surfaces were, but for one full picture every
 * #GstStereoDepth:refresh-interval frames.
 *
 * A third camera on the request pad `third`, beside or above the left one, fills in what the right
 * one does not see. It needs a rig file that has it.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 avatartestsrc name=c num-buffers=50 c.left ! queue ! d.left c.right ! queue !
 * d.right stereodepth name=d focal-length=320 baseline=0.1 near=0.45 far=1.3 ! rangesplit name=s
 * s.depth ! videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
#include "gststereodepth.h"

#include "picturereader.hpp"
#include "recycledbuffers.hpp"

#include <gst/video/video.h>

#include <gstrange/gstrange.h>
#include <gstrange/gstrangeframe.hpp>
#include <gstrange/gstrangeinfo.hpp>
#include <gstrange/gstrangepairing.hpp>
#include <gstrange/gstrangestatus.hpp>
#include <memory>
#include <mutex>
#include <rangecast/stereo/stereo_depth.hpp>
#include <string>

using rangecast::ImageView;
using rangecast::MatchAlgorithm;
using rangecast::Rgbx;
using rangecast::Roi;
using rangecast::Status;
using rangecast::StatusCode;
using rangecast::View;

GST_DEBUG_CATEGORY_STATIC (gst_stereo_depth_debug);
#define GST_CAT_DEFAULT gst_stereo_depth_debug

enum {
  PROP_0,
  PROP_RIG,
  PROP_VIEW_ID,
  PROP_FOCAL_LENGTH,
  PROP_BASELINE,
  PROP_PRINCIPAL_X,
  PROP_PRINCIPAL_Y,
  PROP_PRINCIPAL_OFFSET,
  PROP_NEAR,
  PROP_FAR,
  PROP_DEPTH_UNIT,
  PROP_ALGORITHM,
  PROP_BLOCK_SIZE,
  PROP_UNIQUENESS_RATIO,
  PROP_SPECKLE_WINDOW_SIZE,
  PROP_SPECKLE_RANGE,
  PROP_LEFT_RIGHT_MAX_DIFFERENCE,
  PROP_PATCH_TOLERANCE,
  PROP_FLYING_PIXEL_STEP,
  PROP_SILHOUETTE_RADIUS,
  PROP_GAP_WIDTH,
  PROP_SEARCH_FAR,
  PROP_REFRESH_INTERVAL,
  PROP_STEADY,
  PROP_N_THREADS,
  PROP_STATS
};

static constexpr rangecast::StereoSettings kDefaults;
static constexpr int kDefaultRefreshInterval = 30;
static constexpr double kDefaultNear = 0.3, kDefaultFar = 3.0;

struct StereoProperties {
  std::string rig;
  int view_id = 0;
  double focal_length = 0, baseline = 0;
  double principal_x = -1, principal_y = -1, principal_offset = 0;
  double near = 0, far = 0, depth_unit = 0;
  rangecast::StereoSettings core;
  int refresh_interval = kDefaultRefreshInterval;
};

struct GstStereoDepthPrivate {
  std::mutex lock; /* guards what follows; never held across a push, event or message */
  StereoProperties properties;
  Roi wanted; /* of the last GstRangeRoi event; empty: everything */
  guint64 frames = 0, restricted_frames = 0, third_frames = 0, dropped_third = 0;
  GstClockTime match_time = 0;

  /* streaming thread only */
  GstAggregatorPad *pads[2] = {nullptr, nullptr}; /* left, right; owned by the element */
  std::unique_ptr<gstrange::PairMatcher> matcher;
  gstrange::PairMatcher::Pair pair; /* waits for the third camera's picture; may be empty */
  GstVideoInfo info[3];             /* left, right, third */
  bool have_info[3] = {false, false, false};
  bool negotiate = true, said_mirrored = false;
  PictureReader readers[3];
  rangecast::StereoDepth core;
  GstClockTime frame_duration = GST_CLOCK_TIME_NONE;
  GstBufferPool *pool = nullptr;
  int since_refresh = 0;
};

struct _GstStereoDepth {
  GstAggregator parent;
  GstStereoDepthPrivate *priv;
};

static GstStaticPadTemplate left_template = GST_STATIC_PAD_TEMPLATE ("left", GST_PAD_SINK,
    GST_PAD_ALWAYS, GST_STATIC_CAPS (GST_VIDEO_CAPS_MAKE (GST_VIDEO_FORMATS_ALL)));
static GstStaticPadTemplate right_template = GST_STATIC_PAD_TEMPLATE ("right", GST_PAD_SINK,
    GST_PAD_ALWAYS, GST_STATIC_CAPS (GST_VIDEO_CAPS_MAKE (GST_VIDEO_FORMATS_ALL)));
static GstStaticPadTemplate third_template = GST_STATIC_PAD_TEMPLATE ("third", GST_PAD_SINK,
    GST_PAD_REQUEST, GST_STATIC_CAPS (GST_VIDEO_CAPS_MAKE (GST_VIDEO_FORMATS_ALL)));
static GstStaticPadTemplate src_template =
    GST_STATIC_PAD_TEMPLATE ("src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS (GST_RANGE_CAPS));

G_DEFINE_TYPE (GstStereoDepth, gst_stereo_depth, GST_TYPE_AGGREGATOR)
GST_ELEMENT_REGISTER_DEFINE (stereodepth, "stereodepth", GST_RANK_NONE, GST_TYPE_STEREO_DEPTH)

#define GST_TYPE_STEREO_DEPTH_ALGORITHM (gst_stereo_depth_algorithm_get_type ())
static GType
gst_stereo_depth_algorithm_get_type (void)
{
  static const GType type = [] {
    static const GEnumValue values[] = {{int (MatchAlgorithm::kBm), "Block matching", "bm"},
        {int (MatchAlgorithm::kSgbm), "Semi-global matching, five directions", "sgbm"},
        {int (MatchAlgorithm::kSgbm3Way), "Semi-global matching, three directions", "sgbm-3way"},
        {}};
    return g_enum_register_static ("GstStereoDepthAlgorithm", values);
  }();
  return type;
}

/* ---- the view ---- */

static std::string
size_text (int width, int height)
{
  return std::to_string (width) + "x" + std::to_string (height);
}

static Status
view_from_rig (const StereoProperties &p, int width, int height, View &view)
{
  rangecast::Rig rig;
  if (Status s = rangecast::load_rig (p.rig, rig); !s.ok ())
    return s;
  const View *found = rig.find (p.view_id);
  if (!found)
    return {
        StatusCode::kNotFound, p.rig + ": has no view with view-id " + std::to_string (p.view_id)};
  if (found->width != width || found->height != height)
    return {StatusCode::kBadSize, p.rig + ": view " + std::to_string (found->id) + " is " +
                                      size_text (found->width, found->height) +
                                      ", the pictures are " + size_text (width, height)};
  view = *found;
  return {};
}

static Status
view_from_properties (const StereoProperties &p, int width, int height, View &view)
{
  if (p.focal_length <= 0 || p.baseline <= 0)
    return {StatusCode::kNotFound,
        "no calibration: expected property rig, or focal-length and baseline for rectified "
        "pictures"};
  view = {};
  view.id = p.view_id;
  view.width = width;
  view.height = height;
  view.world_from_view.rotation = {1, 0, 0, 0, -1, 0, 0, 0, -1}; /* level, looking along -z */
  view.near_m = kDefaultNear;
  view.far_m = kDefaultFar;
  view.intrinsics = {p.focal_length, p.focal_length,
      p.principal_x >= 0 ? p.principal_x : (width - 1) / 2.0,
      p.principal_y >= 0 ? p.principal_y : (height - 1) / 2.0};
  rangecast::PartnerCamera right;
  right.intrinsics = view.intrinsics;
  right.intrinsics.cx += p.principal_offset;
  right.partner_from_left.translation.x = -p.baseline;
  view.right = right;
  return {};
}

static Status
make_view (const StereoProperties &p, int width, int height, View &view)
{
  Status status = p.rig.empty () ? view_from_properties (p, width, height, view)
                                 : view_from_rig (p, width, height, view);
  if (!status.ok ())
    return status;
  if (p.depth_unit > 0)
    view.depth_unit_m = p.depth_unit;
  if (p.near > 0)
    view.near_m = p.near;
  if (p.far > 0)
    view.far_m = p.far;
  if (view.far_m >= 65535 * view.depth_unit_m && p.depth_unit <= 0)
    view.depth_unit_m = view.far_m / 65000; /* far scenes get a coarser unit by themselves */
  return rangecast::validate ({{view}});
}

/* ---- negotiation ---- */

static Status
configure_core (GstStereoDepthPrivate *priv)
{
  static constexpr const char *kNames[] = {"left", "right", "third"};
  const GstVideoInfo &left = priv->info[0];
  for (int i = 1; i < 3; i++)
    if (const GstVideoInfo &other = priv->info[i];
        priv->have_info[i] && (left.width != other.width || left.height != other.height))
      return {StatusCode::kBadSize, std::string ("pad ") + kNames[i] + " is " +
                                        size_text (other.width, other.height) +
                                        " but pad left is " + size_text (left.width, left.height) +
                                        "; expected the same size"};
  StereoProperties properties;
  {
    std::lock_guard guard (priv->lock);
    properties = priv->properties;
    priv->wanted = {};
  }
  View view;
  if (Status s = make_view (properties, left.width, left.height, view); !s.ok ())
    return s;
  if (priv->have_info[2] && !view.third)
    return {StatusCode::kNotFound, "pad third: no calibration of a third camera; expected property "
                                   "rig with a file that has one in view " +
                                       std::to_string (view.id)};
  if (Status s = priv->core.set (view, properties.core, priv->have_info[2]); !s.ok ())
    return s;
  priv->said_mirrored = false;
  for (int i = 0; i < 3; i++)
    if (priv->have_info[i] && !priv->readers[i].set (priv->info[i]))
      return {StatusCode::kUnsupported, "cannot convert the pictures to RGBx"};
  return {};
}

static GstFlowReturn
negotiate (GstStereoDepth *self)
{
  GstStereoDepthPrivate *priv = self->priv;
  const GstFlowReturn flow = gst_range_flow_return (GST_ELEMENT (self), configure_core (priv));
  if (flow != GST_FLOW_OK)
    return flow;
  const auto info =
      gstrange::make_info ({{priv->core.range_view ()}}, priv->info[0].fps_n, priv->info[0].fps_d);
  GstCaps *caps = gstrange::make_range_caps (info);
  priv->frame_duration = info.frame_duration ();
  priv->since_refresh = 0;
  drop_pool (priv->pool);
  const Status pooled = gstrange::make_pool (caps, priv->pool);
  if (pooled.ok ())
    gst_aggregator_set_src_caps (GST_AGGREGATOR (self), caps);
  gst_caps_unref (caps);
  priv->negotiate = !pooled.ok ();
  return gst_range_flow_return (GST_ELEMENT (self), pooled);
}

static GstFlowReturn
gst_stereo_depth_update_src_caps (GstAggregator *, GstCaps *, GstCaps **)
{
  return GST_AGGREGATOR_FLOW_NEED_DATA; /* caps are set with the first pair, see negotiate() */
}

static gboolean
gst_stereo_depth_sink_event (GstAggregator *aggregator, GstAggregatorPad *pad, GstEvent *event)
{
  GstStereoDepthPrivate *priv = GST_STEREO_DEPTH (aggregator)->priv;
  if (GST_EVENT_TYPE (event) == GST_EVENT_CAPS) {
    const int side = pad == priv->pads[0] ? 0 : pad == priv->pads[1] ? 1 : 2;
    GstCaps *caps;
    gst_event_parse_caps (event, &caps);
    if (!gst_video_info_from_caps (&priv->info[side], caps)) {
      gst_event_unref (event);
      return FALSE;
    }
    priv->have_info[side] = true;
    priv->negotiate = true;
  }
  return GST_AGGREGATOR_CLASS (gst_stereo_depth_parent_class)->sink_event (aggregator, pad, event);
}

/* GstRangeRoi comes from whatever thread pushes it downstream. */
static gboolean
take_roi_event (GstStereoDepthPrivate *priv, const GstStructure *s)
{
  guint view_id, x, y, width, height;
  if (!gst_structure_get (s, "view-id", G_TYPE_UINT, &view_id, "x", G_TYPE_UINT, &x, "y",
          G_TYPE_UINT, &y, "width", G_TYPE_UINT, &width, "height", G_TYPE_UINT, &height, nullptr))
    return FALSE;
  const guint most = rangecast::kMaxImageSide;
  std::lock_guard guard (priv->lock);
  if (int (view_id) != priv->properties.view_id || x > most || y > most || width > most ||
      height > most)
    return FALSE;
  priv->wanted = {int (x), int (y), int (width), int (height)};
  return TRUE;
}

static gboolean
gst_stereo_depth_src_event (GstAggregator *aggregator, GstEvent *event)
{
  const GstStructure *s = gst_event_get_structure (event);
  if (GST_EVENT_TYPE (event) == GST_EVENT_CUSTOM_UPSTREAM && s &&
      gst_structure_has_name (s, "GstRangeRoi")) {
    const gboolean taken = take_roi_event (GST_STEREO_DEPTH (aggregator)->priv, s);
    gst_event_unref (event);
    return taken;
  }
  return GST_AGGREGATOR_CLASS (gst_stereo_depth_parent_class)->src_event (aggregator, event);
}

/* ---- data ---- */

/* What to match of the pair that was taken. */
static Roi
next_roi (GstStereoDepthPrivate *priv)
{
  const View &view = priv->core.range_view ();
  const Roi full = {0, 0, view.width, view.height};
  Roi roi;
  int interval;
  {
    std::lock_guard guard (priv->lock);
    interval = priv->properties.refresh_interval;
    roi = priv->wanted;
  }
  roi.width = std::min (roi.width, full.width - roi.x);
  roi.height = std::min (roi.height, full.height - roi.y);
  if (interval == 0 || roi.empty () || ++priv->since_refresh >= interval ||
      priv->core.changed_outside (roi)) {
    priv->since_refresh = 0;
    return full;
  }
  std::lock_guard guard (priv->lock);
  priv->restricted_frames++;
  return roi;
}

static Status
match_pictures (
    GstStereoDepthPrivate *priv, bool with_third, GstBuffer *output, GstClockTime capture)
{
  const GstClockTime begin = gst_util_get_timestamp ();
  if (Status s = priv->core.take (priv->readers[0].view (), priv->readers[1].view (),
          with_third ? priv->readers[2].view () : ImageView<const Rgbx>{});
      !s.ok ())
    return s;
  const Roi roi = next_roi (priv);
  if (Status s = gstrange::add_view (output, priv->core.range_view ().id, roi, capture); !s.ok ())
    return s;
  gstrange::RangeFrameMap frame (output, GST_MAP_WRITE);
  if (!frame.status ().ok ())
    return frame.status ();
  const Status status = priv->core.match (frame.views ()[0]);
  std::lock_guard guard (priv->lock);
  priv->frames++;
  priv->third_frames += with_third;
  priv->match_time += gst_util_get_timestamp () - begin;
  return status;
}

/* @param third  may be null */
static Status
match_pair (GstStereoDepthPrivate *priv, GstBuffer *third, GstBuffer *output, GstClockTime capture)
{
  static constexpr const char *kNames[] = {"left", "right", "third"};
  GstBuffer *buffers[] = {priv->pair.first, priv->pair.second, third};
  Status status;
  int n = 0;
  for (; n < 3 && buffers[n] && status.ok (); n++)
    if (!priv->readers[n].open (buffers[n])) {
      status = {StatusCode::kBadData,
          std::string ("pad ") + kNames[n] + ": a buffer is smaller than its caps say"};
      break;
    }
  if (status.ok ())
    status = match_pictures (priv, third != nullptr, output, capture);
  while (n-- > 0)
    priv->readers[n].close ();
  return status;
}

/* One warning a stream: the depth of exchanged cameras is nonsense, but no frame is wrong. */
static void
warn_if_mirrored (GstStereoDepth *self)
{
  GstStereoDepthPrivate *priv = self->priv;
  if (priv->said_mirrored || !priv->core.looks_mirrored ())
    return;
  priv->said_mirrored = true;
  GST_ELEMENT_WARNING (self, STREAM, WRONG_TYPE,
      ("The left and right cameras seem to be exchanged: swap what is linked to pads left and "
       "right"),
      ("hardly anything matches; with the pictures exchanged, much does"));
}

static GstFlowReturn
push_pair (GstStereoDepth *self, GstBuffer *third)
{
  GstStereoDepthPrivate *priv = self->priv;
  const gstrange::PairMatcher::Pair &pair = priv->pair;
  auto aggregator = GST_AGGREGATOR (self);
  GstBuffer *output = nullptr;
  GstFlowReturn flow = gstrange::acquire (GST_ELEMENT (self), priv->pool, &output);
  if (flow != GST_FLOW_OK)
    return flow;
  const bool live = gst_aggregator_get_latency (aggregator) != GST_CLOCK_TIME_NONE;
  const GstClockTime capture = gstrange::capture_time_of (priv->pads[0], pair.first, live);
  flow = gst_range_flow_return (GST_ELEMENT (self), match_pair (priv, third, output, capture));
  if (flow != GST_FLOW_OK) {
    gst_buffer_unref (output);
    return flow;
  }
  warn_if_mirrored (self);
  const GstClockTime duration = GST_BUFFER_DURATION_IS_VALID (pair.first)
                                    ? GST_BUFFER_DURATION (pair.first)
                                    : priv->frame_duration;
  gstrange::stamp (
      aggregator, output, gstrange::running_time_of (priv->pads[0], pair.first), duration, capture);
  if (GST_BUFFER_IS_DISCONT (pair.first))
    GST_BUFFER_FLAG_SET (output, GST_BUFFER_FLAG_DISCONT);
  return gst_aggregator_finish_buffer (aggregator, output);
}

/* The third camera's picture for the pair that waits: none (null) if it is lost or its stream has
 * ended, for depth of two cameras is better than none.
 * @return GST_AGGREGATOR_FLOW_NEED_DATA while it may still come */
static GstFlowReturn
take_third (GstStereoDepth *self, GstClockTime frame_duration, bool timeout, GstBuffer **third)
{
  GstStereoDepthPrivate *priv = self->priv;
  GstPad *pad = gst_element_get_static_pad (GST_ELEMENT (self), "third");
  if (!pad)
    return GST_FLOW_OK;
  const auto sink = GST_AGGREGATOR_PAD (pad);
  const GstClockTime left = gstrange::running_time_of (priv->pads[0], priv->pair.first);
  const GstClockTime tolerance = GST_CLOCK_TIME_IS_VALID (frame_duration) ? frame_duration / 2 : 0;
  GstFlowReturn flow = GST_FLOW_OK;
  while (true) {
    GstBuffer *buffer = gst_aggregator_pad_peek_buffer (sink);
    if (!buffer) {
      flow =
          gst_aggregator_pad_is_eos (sink) || timeout ? GST_FLOW_OK : GST_AGGREGATOR_FLOW_NEED_DATA;
      break;
    }
    const GstClockTime time = gstrange::running_time_of (sink, buffer);
    const bool gap = gstrange::is_gap (buffer);
    const bool timed = GST_CLOCK_TIME_IS_VALID (time) && GST_CLOCK_TIME_IS_VALID (left);
    const GstClockTime last =
        timed && gap ? gstrange::gap_end (time, buffer, tolerance) : time + tolerance;
    gst_buffer_unref (buffer);
    if (timed && (time > left + tolerance || (gap && last >= left)))
      break;
    if (!gap && (!timed || last >= left)) {
      *third = gst_aggregator_pad_pop_buffer (sink);
      break;
    }
    gst_aggregator_pad_drop_buffer (sink);
    std::lock_guard guard (priv->lock);
    priv->dropped_third += !gap;
  }
  gst_object_unref (pad);
  return flow;
}

static void
forget_pair (GstStereoDepthPrivate *priv)
{
  gst_clear_buffer (&priv->pair.first);
  gst_clear_buffer (&priv->pair.second);
}

static GstFlowReturn
gst_stereo_depth_aggregate (GstAggregator *aggregator, gboolean timeout)
{
  auto self = GST_STEREO_DEPTH (aggregator);
  GstStereoDepthPrivate *priv = self->priv;
  GstClockTime duration = GST_CLOCK_TIME_NONE;
  if (priv->have_info[0] && priv->info[0].fps_n > 0)
    duration = gst_util_uint64_scale_int (GST_SECOND, priv->info[0].fps_d, priv->info[0].fps_n);
  if (!priv->pair.first)
    if (const GstFlowReturn flow = priv->matcher->take (duration, priv->pair); flow != GST_FLOW_OK)
      return flow;
  GstBuffer *third = nullptr;
  if (const GstFlowReturn flow = take_third (self, duration, timeout, &third); flow != GST_FLOW_OK)
    return flow;
  GstFlowReturn flow = priv->negotiate ? negotiate (self) : GST_FLOW_OK;
  if (flow == GST_FLOW_OK)
    flow = push_pair (self, third);
  gst_clear_buffer (&third);
  forget_pair (priv);
  return flow;
}

static GstFlowReturn
gst_stereo_depth_flush (GstAggregator *aggregator)
{
  GstStereoDepthPrivate *priv = GST_STEREO_DEPTH (aggregator)->priv;
  priv->since_refresh = 0;
  priv->core.forget ();
  forget_pair (priv);
  return GST_FLOW_OK;
}

static GstAggregatorPad *
gst_stereo_depth_create_new_pad (
    GstAggregator *aggregator, GstPadTemplate *pad_template, const gchar *, const GstCaps *)
{
  GstPad *there = gst_element_get_static_pad (GST_ELEMENT (aggregator), "third");
  if (there) {
    gst_object_unref (there);
    return nullptr;
  }
  return GST_AGGREGATOR_PAD (g_object_new (GST_TYPE_AGGREGATOR_PAD, "name", "third", "direction",
      GST_PAD_SINK, "template", pad_template, nullptr));
}

/* ---- life ---- */

static gboolean
gst_stereo_depth_start (GstAggregator *aggregator)
{
  GstStereoDepthPrivate *priv = GST_STEREO_DEPTH (aggregator)->priv;
  for (bool &have : priv->have_info)
    have = false;
  priv->negotiate = true;
  priv->matcher->reset ();
  std::lock_guard guard (priv->lock);
  priv->frames = priv->restricted_frames = priv->third_frames = priv->dropped_third = 0;
  priv->match_time = 0;
  priv->wanted = {};
  return TRUE;
}

static gboolean
gst_stereo_depth_stop (GstAggregator *aggregator)
{
  GstStereoDepthPrivate *priv = GST_STEREO_DEPTH (aggregator)->priv;
  drop_pool (priv->pool);
  forget_pair (priv);
  for (PictureReader &reader : priv->readers)
    reader.reset ();
  return TRUE;
}

static void
gst_stereo_depth_set_property (GObject *object, guint id, const GValue *value, GParamSpec *pspec)
{
  GstStereoDepthPrivate *priv = GST_STEREO_DEPTH (object)->priv;
  std::lock_guard guard (priv->lock);
  StereoProperties &p = priv->properties;
  switch (id) {
    case PROP_RIG:
      p.rig = g_value_get_string (value) ? g_value_get_string (value) : "";
      break;
    case PROP_VIEW_ID:
      p.view_id = g_value_get_int (value);
      break;
    case PROP_FOCAL_LENGTH:
      p.focal_length = g_value_get_double (value);
      break;
    case PROP_BASELINE:
      p.baseline = g_value_get_double (value);
      break;
    case PROP_PRINCIPAL_X:
      p.principal_x = g_value_get_double (value);
      break;
    case PROP_PRINCIPAL_Y:
      p.principal_y = g_value_get_double (value);
      break;
    case PROP_PRINCIPAL_OFFSET:
      p.principal_offset = g_value_get_double (value);
      break;
    case PROP_NEAR:
      p.near = g_value_get_double (value);
      break;
    case PROP_FAR:
      p.far = g_value_get_double (value);
      break;
    case PROP_DEPTH_UNIT:
      p.depth_unit = g_value_get_double (value);
      break;
    case PROP_ALGORITHM:
      p.core.match.algorithm = MatchAlgorithm (g_value_get_enum (value));
      break;
    case PROP_BLOCK_SIZE:
      p.core.match.block_size = g_value_get_int (value);
      break;
    case PROP_UNIQUENESS_RATIO:
      p.core.match.uniqueness_ratio = g_value_get_int (value);
      break;
    case PROP_SPECKLE_WINDOW_SIZE:
      p.core.match.speckle_window_size = g_value_get_int (value);
      break;
    case PROP_SPECKLE_RANGE:
      p.core.match.speckle_range = g_value_get_int (value);
      break;
    case PROP_LEFT_RIGHT_MAX_DIFFERENCE:
      p.core.match.left_right_max_difference = g_value_get_int (value);
      break;
    case PROP_FLYING_PIXEL_STEP:
      p.core.flying_pixel_step = g_value_get_double (value);
      break;
    case PROP_PATCH_TOLERANCE:
      p.core.patch_tolerance = g_value_get_double (value);
      break;
    case PROP_SILHOUETTE_RADIUS:
      p.core.silhouette_radius = g_value_get_int (value);
      break;
    case PROP_GAP_WIDTH:
      p.core.gap_width = g_value_get_int (value);
      break;
    case PROP_SEARCH_FAR:
      p.core.search_far_m = g_value_get_double (value);
      break;
    case PROP_REFRESH_INTERVAL:
      p.refresh_interval = g_value_get_int (value);
      break;
    case PROP_STEADY:
      p.core.steady = g_value_get_double (value);
      break;
    case PROP_N_THREADS:
      p.core.n_threads = g_value_get_int (value);
      break;
    default:
      G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
  }
}

static GstStructure *
make_stats (const GstStereoDepthPrivate *priv)
{
  return gst_structure_new ("application/x-stereodepth-stats",          //
      "frames", G_TYPE_UINT64, priv->frames,                            //
      "restricted-frames", G_TYPE_UINT64, priv->restricted_frames,      //
      "third-frames", G_TYPE_UINT64, priv->third_frames,                //
      "dropped-left", G_TYPE_UINT64, priv->matcher->dropped_first (),   //
      "dropped-right", G_TYPE_UINT64, priv->matcher->dropped_second (), //
      "dropped-third", G_TYPE_UINT64, priv->dropped_third,              //
      "match-time", G_TYPE_UINT64, priv->match_time, nullptr);
}

static void
gst_stereo_depth_get_property (GObject *object, guint id, GValue *value, GParamSpec *pspec)
{
  GstStereoDepthPrivate *priv = GST_STEREO_DEPTH (object)->priv;
  std::lock_guard guard (priv->lock);
  const StereoProperties &p = priv->properties;
  switch (id) {
    case PROP_RIG:
      g_value_set_string (value, p.rig.empty () ? nullptr : p.rig.c_str ());
      break;
    case PROP_VIEW_ID:
      g_value_set_int (value, p.view_id);
      break;
    case PROP_FOCAL_LENGTH:
      g_value_set_double (value, p.focal_length);
      break;
    case PROP_BASELINE:
      g_value_set_double (value, p.baseline);
      break;
    case PROP_PRINCIPAL_X:
      g_value_set_double (value, p.principal_x);
      break;
    case PROP_PRINCIPAL_Y:
      g_value_set_double (value, p.principal_y);
      break;
    case PROP_PRINCIPAL_OFFSET:
      g_value_set_double (value, p.principal_offset);
      break;
    case PROP_NEAR:
      g_value_set_double (value, p.near);
      break;
    case PROP_FAR:
      g_value_set_double (value, p.far);
      break;
    case PROP_DEPTH_UNIT:
      g_value_set_double (value, p.depth_unit);
      break;
    case PROP_ALGORITHM:
      g_value_set_enum (value, int (p.core.match.algorithm));
      break;
    case PROP_BLOCK_SIZE:
      g_value_set_int (value, p.core.match.block_size);
      break;
    case PROP_UNIQUENESS_RATIO:
      g_value_set_int (value, p.core.match.uniqueness_ratio);
      break;
    case PROP_SPECKLE_WINDOW_SIZE:
      g_value_set_int (value, p.core.match.speckle_window_size);
      break;
    case PROP_SPECKLE_RANGE:
      g_value_set_int (value, p.core.match.speckle_range);
      break;
    case PROP_LEFT_RIGHT_MAX_DIFFERENCE:
      g_value_set_int (value, p.core.match.left_right_max_difference);
      break;
    case PROP_FLYING_PIXEL_STEP:
      g_value_set_double (value, p.core.flying_pixel_step);
      break;
    case PROP_PATCH_TOLERANCE:
      g_value_set_double (value, p.core.patch_tolerance);
      break;
    case PROP_SILHOUETTE_RADIUS:
      g_value_set_int (value, p.core.silhouette_radius);
      break;
    case PROP_GAP_WIDTH:
      g_value_set_int (value, p.core.gap_width);
      break;
    case PROP_SEARCH_FAR:
      g_value_set_double (value, p.core.search_far_m);
      break;
    case PROP_REFRESH_INTERVAL:
      g_value_set_int (value, p.refresh_interval);
      break;
    case PROP_STEADY:
      g_value_set_double (value, p.core.steady);
      break;
    case PROP_N_THREADS:
      g_value_set_int (value, p.core.n_threads);
      break;
    case PROP_STATS:
      g_value_take_boxed (value, make_stats (priv));
      break;
    default:
      G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
  }
}

static void
gst_stereo_depth_finalize (GObject *object)
{
  GstStereoDepthPrivate *priv = GST_STEREO_DEPTH (object)->priv;
  drop_pool (priv->pool);
  delete priv;
  G_OBJECT_CLASS (gst_stereo_depth_parent_class)->finalize (object);
}

static void
gst_stereo_depth_init (GstStereoDepth *self)
{
  self->priv = new GstStereoDepthPrivate;
  self->priv->pads[0] = gstrange::add_sink_pad (GST_ELEMENT (self), "left");
  self->priv->pads[1] = gstrange::add_sink_pad (GST_ELEMENT (self), "right");
  self->priv->matcher =
      std::make_unique<gstrange::PairMatcher> (self->priv->pads[0], self->priv->pads[1]);
}

static constexpr auto kReady =
    GParamFlags (G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_READY);

static void
install_double (GObjectClass *object_class, guint id, const char *name, const char *nick,
    const char *blurb, double minimum, double maximum, double fallback)
{
  g_object_class_install_property (object_class, id,
      g_param_spec_double (name, nick, blurb, minimum, maximum, fallback, kReady));
}

static void
install_int (GObjectClass *object_class, guint id, const char *name, const char *nick,
    const char *blurb, int minimum, int maximum, int fallback)
{
  g_object_class_install_property (
      object_class, id, g_param_spec_int (name, nick, blurb, minimum, maximum, fallback, kReady));
}

static void
install_calibration_properties (GObjectClass *c)
{
  g_object_class_install_property (c, PROP_RIG,
      g_param_spec_string ("rig", "Rig",
          "Rig file with the stereo pair that view-id names (default: none, see focal-length)",
          nullptr, kReady));
  install_int (c, PROP_VIEW_ID, "view-id", "View id",
      "View of the rig, and view-id of the output (0 to 63, default 0)", 0,
      rangecast::kMaxViews - 1, 0);
  install_double (c, PROP_FOCAL_LENGTH, "focal-length", "Focal length",
      "Without a rig, for rectified pictures: pixels (default 0: not set)", 0, 1e6, 0);
  install_double (c, PROP_BASELINE, "baseline", "Baseline",
      "Without a rig: distance of the cameras in metres (default 0: not set)", 0, 1e4, 0);
  install_double (c, PROP_PRINCIPAL_X, "principal-x", "Principal point x",
      "Without a rig: of the left camera, pixels (default -1: the centre)", -1, 1e6, -1);
  install_double (c, PROP_PRINCIPAL_Y, "principal-y", "Principal point y",
      "Without a rig: of both cameras, pixels (default -1: the centre)", -1, 1e6, -1);
  install_double (c, PROP_PRINCIPAL_OFFSET, "principal-offset", "Principal point offset",
      "Without a rig: right minus left principal point x, pixels (Middlebury's doffs, default 0)",
      -1e5, 1e5, 0);
  install_double (c, PROP_NEAR, "near", "Near",
      "Nearest depth to look for, metres (default 0: the rig's, or 0.3)", 0, 1e4, 0);
  install_double (c, PROP_FAR, "far", "Far",
      "Farthest depth to look for, metres (default 0: the rig's, or 3)", 0, 1e4, 0);
  install_double (c, PROP_DEPTH_UNIT, "depth-unit", "Depth unit",
      "Metres per depth unit of the output (0 to 1, default 0: the rig's, or 0.0001, coarser if "
      "far asks for it)",
      0, 1, 0);
}

static void
install_matching_properties (GObjectClass *c)
{
  const rangecast::MatchSettings &m = kDefaults.match;
  g_object_class_install_property (c, PROP_ALGORITHM,
      g_param_spec_enum ("algorithm", "Algorithm", "How to match (default: sgbm-3way)",
          GST_TYPE_STEREO_DEPTH_ALGORITHM, int (m.algorithm), kReady));
  install_int (c, PROP_BLOCK_SIZE, "block-size", "Block size",
      "Width of a block, pixels, odd (0 to 51, default 0: 15 for bm, 3 for the others)", 0, 51,
      m.block_size);
  install_int (c, PROP_UNIQUENESS_RATIO, "uniqueness-ratio", "Uniqueness ratio",
      "Per cent by which the best match must beat the second (0 to 100, default 5)", 0, 100,
      m.uniqueness_ratio);
  install_int (c, PROP_SPECKLE_WINDOW_SIZE, "speckle-window-size", "Speckle window size",
      "Smaller patches of like disparity are cleared, pixels (0 = off, to 100000, default 100)", 0,
      100000, m.speckle_window_size);
  install_int (c, PROP_SPECKLE_RANGE, "speckle-range", "Speckle range",
      "Disparity step within a patch, pixels (0 to 1000, default 2)", 0, 1000, m.speckle_range);
  install_int (c, PROP_LEFT_RIGHT_MAX_DIFFERENCE, "left-right-max-difference",
      "Left-right maximum difference",
      "Disparities of both directions agree to so many pixels (-1 = no check, to 1000, default 1)",
      -1, 1000, m.left_right_max_difference);
  install_double (c, PROP_FLYING_PIXEL_STEP, "flying-pixel-step", "Flying pixel step",
      "Points that fewer than 4 of 8 neighbours follow within this share of their depth are "
      "cleared (0 = off, to 1, default 0.02)",
      0, 1, kDefaults.flying_pixel_step);
  install_double (c, PROP_PATCH_TOLERANCE, "patch-tolerance", "Patch tolerance",
      "Points around which both pictures differ by more than this share of the contrast are "
      "cleared "
      "(0 = off, to 10, default 1)",
      0, 10, kDefaults.patch_tolerance);
  install_int (c, PROP_SILHOUETTE_RADIUS, "silhouette-radius", "Silhouette radius",
      "Near a silhouette, points whose colour is that of the other side are cleared: pixels around "
      "that are looked at (0 = off, to 64, default 10)",
      0, 64, kDefaults.silhouette_radius);
  install_int (c, PROP_GAP_WIDTH, "gap-width", "Gap width",
      "Gaps in a surface of one colour up to so many pixels are filled (0 = off, to 1000, default "
      "12)",
      0, 1000, kDefaults.gap_width);
  install_double (c, PROP_SEARCH_FAR, "search-far", "Search far",
      "What lies beyond far is matched, too, so that it is not taken for something nearer, and "
      "cleared: up to so many metres (default 0: to infinity; as far: nothing is there)",
      0, 1e4, kDefaults.search_far_m);
  install_int (c, PROP_REFRESH_INTERVAL, "refresh-interval", "Refresh interval",
      "When downstream wants only a part, one full picture every so many frames (0: always all, to "
      "100000, default 30)",
      0, 100000, kDefaultRefreshInterval);
  install_double (c, PROP_STEADY, "steady", "Steady",
      "Hold depth still where nothing moves: each new depth counts 1 - 0.9 of this (0 = off, to 1, "
      "default 0)",
      0, 1, kDefaults.steady);
  install_int (c, PROP_N_THREADS, "n-threads", "Threads",
      "Threads that match one pair (0, the default: one a core; to 64)", 0, 64,
      kDefaults.n_threads);
}

static void
gst_stereo_depth_class_init (GstStereoDepthClass *klass)
{
  auto object_class = G_OBJECT_CLASS (klass);
  auto element_class = GST_ELEMENT_CLASS (klass);
  auto aggregator_class = GST_AGGREGATOR_CLASS (klass);

  object_class->set_property = gst_stereo_depth_set_property;
  object_class->get_property = gst_stereo_depth_get_property;
  object_class->finalize = gst_stereo_depth_finalize;
  install_calibration_properties (object_class);
  install_matching_properties (object_class);
  g_object_class_install_property (object_class, PROP_STATS,
      g_param_spec_boxed ("stats", "Statistics",
          "Counters since start: frames, restricted-frames, third-frames, dropped-left, "
          "dropped-right, dropped-third, match-time (ns)",
          GST_TYPE_STRUCTURE, GParamFlags (G_PARAM_READABLE | G_PARAM_STATIC_STRINGS)));

  for (GstStaticPadTemplate *pad_template :
      {&left_template, &right_template, &third_template, &src_template})
    gst_element_class_add_static_pad_template_with_gtype (
        element_class, pad_template, GST_TYPE_AGGREGATOR_PAD);
  gst_element_class_set_static_metadata (element_class, "Stereo depth", "Filter/Video",
      "Makes range images of a stereo pair of cameras, or of three cameras", "gst-rangecast");
  gst_type_mark_as_plugin_api (GST_TYPE_STEREO_DEPTH_ALGORITHM, GstPluginAPIFlags (0));

  aggregator_class->start = gst_stereo_depth_start;
  aggregator_class->stop = gst_stereo_depth_stop;
  aggregator_class->flush = gst_stereo_depth_flush;
  aggregator_class->sink_event = gst_stereo_depth_sink_event;
  aggregator_class->src_event = gst_stereo_depth_src_event;
  aggregator_class->update_src_caps = gst_stereo_depth_update_src_caps;
  aggregator_class->create_new_pad = gst_stereo_depth_create_new_pad;
  aggregator_class->clip = gstrange::clip_to_segment;
  aggregator_class->aggregate = gst_stereo_depth_aggregate;

  GST_DEBUG_CATEGORY_INIT (gst_stereo_depth_debug, "stereodepth", 0, "Stereo depth");
}
