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
#include "stereosettings.hpp"

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
using rangecast::Rgbx;
using rangecast::Roi;
using rangecast::Status;
using rangecast::StatusCode;
using rangecast::View;

GST_DEBUG_CATEGORY_STATIC (gst_stereo_depth_debug);
#define GST_CAT_DEFAULT gst_stereo_depth_debug

static guint prop_stats; /* number of that property, after the settings */

struct GstStereoDepthPrivate {
  std::mutex lock; /* guards what follows; never held across a push, event or message */
  StereoDepthSettings settings;
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
  StereoDepthSettings settings;
  {
    std::lock_guard guard (priv->lock);
    settings = priv->settings;
    priv->wanted = {};
  }
  View view;
  if (Status s = make_stereo_view (settings, left.width, left.height, view); !s.ok ())
    return s;
  if (priv->have_info[2] && !view.third)
    return {StatusCode::kNotFound, "pad third: no calibration of a third camera; expected property "
                                   "rig with a file that has one in view " +
                                       std::to_string (view.id)};
  if (Status s = priv->core.set (view, settings.core, priv->have_info[2]); !s.ok ())
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
  if (int (view_id) != priv->settings.view_id || x > most || y > most || width > most ||
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
    interval = priv->settings.refresh_interval;
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
  if (!set_stereo_setting (priv->settings, id, value))
    G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
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
  if (id == prop_stats)
    g_value_take_boxed (value, make_stats (priv));
  else if (!get_stereo_setting (priv->settings, id, value))
    G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
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

static void
gst_stereo_depth_class_init (GstStereoDepthClass *klass)
{
  auto object_class = G_OBJECT_CLASS (klass);
  auto element_class = GST_ELEMENT_CLASS (klass);
  auto aggregator_class = GST_AGGREGATOR_CLASS (klass);

  object_class->set_property = gst_stereo_depth_set_property;
  object_class->get_property = gst_stereo_depth_get_property;
  object_class->finalize = gst_stereo_depth_finalize;
  prop_stats = install_stereo_settings (object_class) + 1;
  g_object_class_install_property (object_class, prop_stats,
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
