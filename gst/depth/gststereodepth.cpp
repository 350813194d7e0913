/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-stereodepth
 * @title: stereodepth
 *
 * Computes range images from a stereo pair: rectifies both images with the calibration of a rig
 * file, matches them, filters the disparities and converts them to depth. Rectified input needs
 * only #GstStereoDepth:focal-length and #GstStereoDepth:baseline.
 *
 * Downstream can request a region with a custom upstream event `GstRangeRoi` (view-id, x, y, width,
 * height: uint), as roiextract does. Only that region is then matched, near its previous depths,
 * with a full image every #GstStereoDepth:refresh-interval frames.
 *
 * A third camera on the request pad `third`, beside or above the left one, adds depth that the
 * right camera cannot see. It needs a rig file that contains it.
 *
 * A stereo camera that packs both views into one image is linked to pad `left` alone, see
 * #GstStereoDepth:packing.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 avatartestsrc name=c num-buffers=50 c.left ! queue ! d.left \
 *   c.right ! queue ! d.right stereodepth name=d focal-length=320 baseline=0.1 near=0.45 far=1.3 \
 *   ! rangesplit name=s s.depth ! videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
#include "common/bufferpools.hpp"
#include "common/capsadvice.hpp"
#include "common/elementproperties.hpp"
#include "common/matcher.hpp"
#include "common/videoframereader.hpp"
#include "packedinput.hpp"
#include "roischedule.hpp"
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
#include <rangecast/base/guarded.hpp>
#include <rangecast/geometry/size_text.hpp>
#include <rangecast/stereo/stereo_depth.hpp>
#include <string>

using rangecast::ImageView;
using rangecast::Rgbx;
using rangecast::Roi;
using rangecast::size_text;
using rangecast::Status;
using rangecast::StatusCode;
using rangecast::View;

#define GST_TYPE_STEREO_DEPTH (gst_stereo_depth_get_type ())
G_DECLARE_FINAL_TYPE (GstStereoDepth, gst_stereo_depth, GST, STEREO_DEPTH, GstAggregator)

GST_DEBUG_CATEGORY_STATIC (gst_stereo_depth_debug);
#define GST_CAT_DEFAULT gst_stereo_depth_debug

/* Data flow, in the order of this file. PackedInput passes images at pad left that contain both
 * views on to pad right, in that pad's streaming thread. All else runs on GstAggregator's, the
 * source pad's task:
 *
 *   sink_event       records the caps of each pad
 *   aggregate
 *     next           takes a left and a right image of one running time off their pads, and the
 *                    third one of that time, if there is a pad for it
 *     drop_if_late   drops the pair if its depth would arrive too late (QoS)
 *     negotiate      after new caps: loads the view, configures the matcher, sets output caps
 *     push_pair      rectifies, matches and pushes */

namespace {

enum Side { kLeft, kRight, kThird };
constexpr const char *kPadNames[] = {"left", "right", "third"};

struct Input {
  std::optional<GstVideoInfo> info;
  VideoFrameReader reader;
};

struct Counters {
  guint64 frames = 0, restricted_frames = 0, third_frames = 0, dropped_late = 0;
  GstClockTime match_time = 0;
};

} // namespace

struct GstStereoDepthPrivate {
  /* Guards the members up to proportion. Never held across a push, event or message; no other lock
   * is taken under it. */
  std::mutex lock;
  StereoDepthSettings settings;
  Counters counters;
  GstClockTime earliest = GST_CLOCK_TIME_NONE; /* QoS: running time; older frames are too late */
  double proportion = 1;                       /* of the last QOS event */

  /* thread-safe */
  StatsReporter reporter;
  RoiSchedule rois;

  PackedInput packed; /* of pad left; its streaming thread, started and stopped in READY */

  /* streaming thread */
  GstAggregatorPad *left, *right; /* owned by the element */
  std::optional<FrameMatcher> matcher;
  GstClockTime capture = 0; /* of the pair: that of the left image */
  Input inputs[3];
  bool negotiate = true; /* a pad has new caps */
  rangecast::StereoDepth core;
  GstBufferPool *pool = nullptr;
  bool discont = false;                        /* images were dropped since the last pair */
  GstClockTime last_pts = GST_CLOCK_TIME_NONE; /* of the last left image that was matched */
  GstClockTime processing_time = 0;            /* mean time to match a pair, at most `latency` */
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

static bool
is_live (GstStereoDepth *self)
{
  return gst_aggregator_get_latency (GST_AGGREGATOR (self)) != GST_CLOCK_TIME_NONE;
}

/* ---- sink caps ---- */

static gboolean
gst_stereo_depth_sink_event (GstAggregator *aggregator, GstAggregatorPad *pad, GstEvent *event)
{
  GstStereoDepthPrivate *priv = GST_STEREO_DEPTH (aggregator)->priv;
  if (refuse_bytes (pad, event))
    return FALSE;
  if (GST_EVENT_TYPE (event) == GST_EVENT_CAPS) {
    const Side side = pad == priv->left ? kLeft : pad == priv->right ? kRight : kThird;
    const auto info = parse_caps_event (GST_CAT_DEFAULT, pad, event);
    if (!info) {
      gst_event_unref (event);
      return FALSE;
    }
    priv->matcher->watch_links ();
    priv->inputs[side].info = info;
    priv->negotiate = true;
  }
  return GST_AGGREGATOR_CLASS (gst_stereo_depth_parent_class)->sink_event (aggregator, pad, event);
}

/* ---- pairs of images ---- */

/* Drops the pair if a sink would discard its depth, and posts a QOS message. */
static bool
drop_if_late (GstStereoDepth *self)
{
  GstStereoDepthPrivate *priv = self->priv;
  const GstClockTime running = priv->matcher->running ();
  GstClockTime earliest;
  guint64 frames, dropped;
  double proportion;
  {
    std::lock_guard guard (priv->lock);
    earliest = priv->earliest;
    if (!priv->settings.qos || !GST_CLOCK_TIME_IS_VALID (earliest) ||
        !GST_CLOCK_TIME_IS_VALID (running) || running > earliest)
      return false;
    dropped = ++priv->counters.dropped_late;
    frames = priv->counters.frames;
    proportion = priv->proportion;
  }
  GST_DEBUG_OBJECT (self, "dropping pair at %" GST_TIME_FORMAT ": late by %.1f ms (QoS)",
      GST_TIME_ARGS (running), double (earliest - running) / GST_MSECOND);
  GstBuffer *left = priv->matcher->buffer (kLeft);
  GST_OBJECT_LOCK (priv->left);
  const GstClockTime stream_time =
      gst_segment_to_stream_time (&priv->left->segment, GST_FORMAT_TIME, GST_BUFFER_PTS (left));
  GST_OBJECT_UNLOCK (priv->left);
  GstMessage *message = gst_message_new_qos (GST_OBJECT (self), is_live (self), running,
      stream_time, GST_BUFFER_PTS (left), GST_BUFFER_DURATION (left));
  gst_message_set_qos_values (message, GST_CLOCK_DIFF (running, earliest), proportion, 1000000);
  gst_message_set_qos_stats (message, GST_FORMAT_BUFFERS, frames, dropped);
  gst_element_post_message (GST_ELEMENT (self), message);
  priv->discont = true;
  return true;
}

/* ---- negotiation ---- */

/* Configures matcher and readers for the caps of all inputs. */
static Status
configure_core (GstStereoDepthPrivate *priv, bool with_third)
{
  Input *inputs = priv->inputs;
  const GstVideoInfo &left = *inputs[kLeft].info;
  int width, height; /* of a view */
  if (!priv->packed.view_size (left, width, height))
    return {StatusCode::kBadSize, "pad left: images of " + size_text (left.width, left.height) +
                                      " do not divide into two views; use an even size"};
  for (int side = kRight; side <= (with_third ? kThird : kRight); side++)
    if (const GstVideoInfo &other = *inputs[side].info;
        other.width != (side == kThird ? width : left.width) ||
        other.height != (side == kThird ? height : left.height))
      return {StatusCode::kBadSize,
          std::string ("pad ") + kPadNames[side] + " is " + size_text (other.width, other.height) +
              " but pad left is " + size_text (width, height) + "; use images of one size"};
  const View &before = priv->core.range_view ();
  if (before.width != width || before.height != height)
    priv->rois.reset (); /* downstream requests a region again only if the output caps change */
  const StereoDepthSettings settings = settings_of (priv);
  View view;
  if (Status s = make_stereo_view (settings, width, height, view); !s.ok ())
    return s;
  if (with_third && !view.third)
    return {StatusCode::kNotFound, "pad third: set property rig to a file in which view " +
                                       std::to_string (view.id) + " has a third camera"};
  if (Status s = priv->core.set (view, settings.n_threads, with_third); !s.ok ())
    return s;
  for (int side = kLeft; side <= (with_third ? kThird : kRight); side++)
    if (!inputs[side].reader.set (*inputs[side].info))
      return {StatusCode::kUnsupported, "cannot convert the images to RGBx"};
  return {};
}

static GstFlowReturn
negotiate (GstStereoDepth *self)
{
  GstStereoDepthPrivate *priv = self->priv;
  GstPad *third = gst_element_get_static_pad (GST_ELEMENT (self), kPadNames[kThird]);
  if (!third)
    priv->inputs[kThird].info.reset (); /* released */
  gst_clear_object (&third);
  const bool with_third = priv->inputs[kThird].info.has_value ();
  for (const Side side : {kLeft, kRight})
    if (!priv->inputs[side].info) {
      GST_WARNING_OBJECT (self, "pad %s: frames without caps", kPadNames[side]);
      return GST_FLOW_NOT_NEGOTIATED;
    }
  gstrange::RangeInfo info;
  const Status configured = rangecast::guarded ("stereo", [&] {
    const Status status = configure_core (priv, with_third);
    const GstVideoInfo &left = *priv->inputs[kLeft].info;
    if (status.ok ())
      info = gstrange::make_info ({{priv->core.range_view ()}}, left.fps_n, left.fps_d);
    return status;
  });
  if (!configured.ok ())
    return gst_range_flow_return (GST_ELEMENT (self), configured);
  GstCaps *caps = gstrange::make_range_caps (info);
  GST_INFO_OBJECT (self, "output caps %" GST_PTR_FORMAT, caps);
  const View &view = info.rig.views.front ();
  GST_DEBUG_OBJECT (self, "view %d, %g to %g m, focal length %g pixels, %s third camera", view.id,
      view.near_m, view.far_m, view.intrinsics.fx, with_third ? "with" : "without");
  check_field_of_view (
      GST_ELEMENT (self), settings_of (priv).view, "the images", view.width, view.height);
  drop_pool (priv->pool);
  const Status status = gstrange::make_pool (caps, priv->pool);
  if (status.ok ())
    gst_aggregator_set_src_caps (GST_AGGREGATOR (self), caps);
  gst_caps_unref (caps);
  priv->rois.restart_interval ();
  priv->reporter.set_views (info.rig);
  priv->negotiate = !status.ok ();
  return gst_range_flow_return (GST_ELEMENT (self), status);
}

/* ---- output ---- */

/* Matches the images that the readers have open. */
static Status
match_images (GstStereoDepth *self, bool with_third, GstBuffer *output)
{
  GstStereoDepthPrivate *priv = self->priv;
  Input *inputs = priv->inputs;
  const GstClockTime begin = gst_util_get_timestamp ();
  const bool packed = priv->packed.is_packed ();
  if (Status s = priv->core.rectify (priv->packed.view (inputs[kLeft].reader.view (), false),
          priv->packed.view (inputs[packed ? kLeft : kRight].reader.view (), true),
          with_third ? inputs[kThird].reader.view () : ImageView<const Rgbx>{});
      !s.ok ())
    return s;
  int interval;
  {
    std::lock_guard guard (priv->lock);
    interval = priv->settings.refresh_interval;
  }
  bool restricted = false;
  const Roi roi = priv->rois.next (priv->core, interval, restricted);
  if (Status s = gstrange::add_view (output, priv->core.range_view ().id, roi, priv->capture);
      !s.ok ())
    return s;
  gstrange::RangeFrameMap frame (output, GST_MAP_WRITE);
  if (!frame.status ().ok ())
    return frame.status ();
  const Status status = priv->core.match (frame.views ()[0]);
  if (!status.ok ())
    return status;
  const GstClockTime elapsed = gst_util_get_timestamp () - begin;
  GST_LOG_OBJECT (self, "pair at %" GST_TIME_FORMAT ": matched %dx%d at (%d, %d)%s in %.1f ms",
      GST_TIME_ARGS (priv->matcher->running ()), roi.width, roi.height, roi.x, roi.y,
      with_third ? " with third image" : "", double (elapsed) / GST_MSECOND);
  std::lock_guard guard (priv->lock);
  priv->counters.frames++;
  priv->counters.restricted_frames += restricted;
  priv->counters.third_frames += with_third;
  priv->counters.match_time += elapsed;
  return {};
}

/* @param third  may be null */
static Status
match_pair (GstStereoDepth *self, GstBuffer *third, GstBuffer *output)
{
  GstStereoDepthPrivate *priv = self->priv;
  GstBuffer *buffers[] = {priv->matcher->buffer (kLeft), priv->matcher->buffer (kRight), third};
  for (int i = 0; i < 3 && buffers[i]; i++)
    if ((i != kRight || !priv->packed.is_packed ()) && !priv->inputs[i].reader.open (buffers[i]))
      return {StatusCode::kBadData,
          std::string ("pad ") + kPadNames[i] + ": a buffer is smaller than its caps require"};
  return match_images (self, third != nullptr, output);
}

/* Forgets earlier images where time goes back, or on by more than a second and two frames. Shorter
 * gaps keep the history: matching whole images again would make an overloaded host lose more
 * frames. */
static void
reset_after_break (GstStereoDepthPrivate *priv)
{
  const GstClockTime before = priv->last_pts, now = GST_BUFFER_PTS (priv->matcher->buffer (kLeft)),
                     duration = frame_duration (priv->inputs[kLeft].info);
  priv->last_pts = now;
  const GstClockTime limit = GST_SECOND + (GST_CLOCK_TIME_IS_VALID (duration) ? 2 * duration : 0);
  if (GST_CLOCK_TIME_IS_VALID (before) && GST_CLOCK_TIME_IS_VALID (now) &&
      (now < before || now - before > limit))
    priv->core.reset ();
}

static GstFlowReturn
push_pair (GstStereoDepth *self, GstBuffer *third)
{
  GstStereoDepthPrivate *priv = self->priv;
  GstBuffer *left = priv->matcher->buffer (kLeft);
  auto aggregator = GST_AGGREGATOR (self);
  GstBuffer *output = nullptr;
  GstFlowReturn flow = gstrange::acquire (GST_ELEMENT (self), priv->pool, &output);
  if (flow != GST_FLOW_OK)
    return flow;
  reset_after_break (priv);
  flow = gst_range_flow_return (GST_ELEMENT (self), match_pair (self, third, output));
  for (Input &input : priv->inputs)
    input.reader.close ();
  if (flow != GST_FLOW_OK) {
    gst_buffer_unref (output);
    return flow;
  }
  const GstClockTime duration = GST_BUFFER_DURATION_IS_VALID (left)
                                    ? GST_BUFFER_DURATION (left)
                                    : frame_duration (priv->inputs[kLeft].info);
  gstrange::stamp (aggregator, output, priv->matcher->running (), duration, priv->capture);
  if (priv->matcher->discont () || priv->discont)
    GST_BUFFER_FLAG_SET (output, GST_BUFFER_FLAG_DISCONT);
  priv->discont = false;
  priv->reporter.passed (GST_ELEMENT (self), output);
  return gst_aggregator_finish_buffer (aggregator, output);
}

/* Live, matching starts so early that it is done by the deadline, see get_next_time(). */
static void
update_processing_time (GstStereoDepth *self)
{
  GstStereoDepthPrivate *priv = self->priv;
  guint64 latency = 0;
  g_object_get (self, "latency", &latency, nullptr);
  std::lock_guard guard (priv->lock);
  const Counters &c = priv->counters;
  if (c.frames > 0)
    priv->processing_time = std::min<GstClockTime> (latency, c.match_time / c.frames);
}

static GstFlowReturn
gst_stereo_depth_aggregate (GstAggregator *aggregator, gboolean timeout)
{
  auto self = GST_STEREO_DEPTH (aggregator);
  GstStereoDepthPrivate *priv = self->priv;
  GstFlowReturn flow = priv->matcher->next (
      gstrange::pairing_tolerance (frame_duration (priv->inputs[kLeft].info)), timeout);
  if (flow == GST_FLOW_EOS)
    priv->reporter.finish ();
  if (flow != GST_FLOW_OK || drop_if_late (self))
    return flow;
  priv->capture =
      gstrange::capture_time_of (priv->left, priv->matcher->buffer (kLeft), is_live (self));
  GstBuffer *third = priv->inputs[kThird].info ? priv->matcher->buffer (kThird) : nullptr;
  if (priv->negotiate)
    flow = negotiate (self);
  if (flow == GST_FLOW_OK)
    flow = push_pair (self, third);
  priv->matcher->release ();
  update_processing_time (self);
  return flow;
}

static GstClockTime
gst_stereo_depth_get_next_time (GstAggregator *aggregator)
{
  GstStereoDepthPrivate *priv = GST_STEREO_DEPTH (aggregator)->priv;
  const GstClockTime time = priv->matcher->next_time ();
  return GST_CLOCK_TIME_IS_VALID (time) ? time - std::min (time, priv->processing_time) : time;
}

/* ---- events from downstream, on any thread ---- */

/* If not live, as many frames again as are late already are skipped, or the next one would be late,
 * too (as GstVideoDecoder does). */
static void
handle_qos (GstStereoDepth *self, GstEvent *event)
{
  double proportion;
  GstClockTimeDiff late;
  GstClockTime time;
  gst_event_parse_qos (event, nullptr, &proportion, &late, &time);
  const bool live = is_live (self);
  std::lock_guard guard (self->priv->lock);
  self->priv->proportion = proportion;
  self->priv->earliest = GST_CLOCK_TIME_NONE;
  if (!GST_CLOCK_TIME_IS_VALID (time) || (late < 0 && 0 - GstClockTime (late) > time))
    return;
  self->priv->earliest = time + GstClockTime (late) * (late > 0 && !live ? 2 : 1);
}

static gboolean
gst_stereo_depth_src_event (GstAggregator *aggregator, GstEvent *event)
{
  auto self = GST_STEREO_DEPTH (aggregator);
  GstStereoDepthPrivate *priv = self->priv;
  if (GST_EVENT_TYPE (event) == GST_EVENT_QOS)
    handle_qos (self, event);
  if (GST_EVENT_TYPE (event) == GST_EVENT_CUSTOM_UPSTREAM &&
      gst_event_has_name (event, "GstRangeRoi")) {
    int view_id;
    {
      std::lock_guard guard (priv->lock);
      view_id = priv->settings.view.view_id;
    }
    const bool handled = priv->rois.handle_event (gst_event_get_structure (event), view_id);
    GST_LOG_OBJECT (self, "%s %" GST_PTR_FORMAT, handled ? "request:" : "ignored request:", event);
    gst_event_unref (event);
    return handled;
  }
  return GST_AGGREGATOR_CLASS (gst_stereo_depth_parent_class)->src_event (aggregator, event);
}

/* ---- pad third ---- */

static GstAggregatorPad *
gst_stereo_depth_create_new_pad (
    GstAggregator *aggregator, GstPadTemplate *pad_template, const gchar *, const GstCaps *)
{
  if (GstPad *existing = gst_element_get_static_pad (GST_ELEMENT (aggregator), "third")) {
    gst_object_unref (existing);
    return nullptr;
  }
  return GST_AGGREGATOR_PAD (g_object_new (GST_TYPE_AGGREGATOR_PAD, "name", "third", "direction",
      GST_PAD_SINK, "template", pad_template, nullptr));
}

/* ---- lifecycle ---- */

static std::vector<StatsRow>
collect_stats (GstElement *element)
{
  GstStereoDepthPrivate *priv = GST_STEREO_DEPTH (element)->priv;
  std::lock_guard guard (priv->lock);
  const FrameMatcher &m = *priv->matcher;
  return {{.counters = {.frames = priv->counters.frames,
               .lost = m.dropped (kLeft) + m.dropped (kRight) + m.dropped (kThird),
               .late = priv->counters.dropped_late}}};
}

static gboolean
gst_stereo_depth_start (GstAggregator *aggregator)
{
  GstStereoDepthPrivate *priv = GST_STEREO_DEPTH (aggregator)->priv;
  for (Input &input : priv->inputs)
    input.info.reset ();
  priv->negotiate = true;
  priv->discont = false;
  priv->last_pts = GST_CLOCK_TIME_NONE;
  priv->processing_time = 0;
  priv->matcher->start ();
  priv->rois.reset ();
  priv->reporter.start (GST_ELEMENT (aggregator), collect_stats);
  std::lock_guard guard (priv->lock);
  priv->packed.start (priv->settings.packing);
  priv->counters = {};
  priv->earliest = GST_CLOCK_TIME_NONE;
  return TRUE;
}

static GstFlowReturn
gst_stereo_depth_flush (GstAggregator *aggregator)
{
  GstStereoDepthPrivate *priv = GST_STEREO_DEPTH (aggregator)->priv;
  priv->matcher->flush ();
  priv->rois.restart_interval ();
  priv->core.reset ();
  priv->discont = false;
  priv->last_pts = GST_CLOCK_TIME_NONE;
  std::lock_guard guard (priv->lock);
  priv->earliest = GST_CLOCK_TIME_NONE;
  return GST_FLOW_OK;
}

static gboolean
gst_stereo_depth_stop (GstAggregator *aggregator)
{
  GstStereoDepthPrivate *priv = GST_STEREO_DEPTH (aggregator)->priv;
  priv->reporter.stop ();
  drop_pool (priv->pool);
  priv->matcher->stop ();
  for (Input &input : priv->inputs)
    input.reader.reset ();
  return TRUE;
}

static GstStateChangeReturn
gst_stereo_depth_change_state (GstElement *element, GstStateChange transition)
{
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY)
    GST_STEREO_DEPTH (element)->priv->packed.stop ();
  return GST_ELEMENT_CLASS (gst_stereo_depth_parent_class)->change_state (element, transition);
}

static GstStructure *
make_stats (const GstStereoDepthPrivate *priv)
{
  const Counters &c = priv->counters;
  return gst_structure_new ("application/x-stereodepth-stats",         //
      "frames", G_TYPE_UINT64, c.frames,                               //
      "restricted-frames", G_TYPE_UINT64, c.restricted_frames,         //
      "third-frames", G_TYPE_UINT64, c.third_frames,                   //
      "dropped-left", G_TYPE_UINT64, priv->matcher->dropped (kLeft),   //
      "dropped-right", G_TYPE_UINT64, priv->matcher->dropped (kRight), //
      "dropped-third", G_TYPE_UINT64, priv->matcher->dropped (kThird), //
      "dropped-late", G_TYPE_UINT64, c.dropped_late,                   //
      "match-time", G_TYPE_UINT64, c.match_time, nullptr);
}

static void
gst_stereo_depth_init (GstStereoDepth *self)
{
  auto priv = self->priv = new GstStereoDepthPrivate;
  priv->left = add_sink_pad (GST_ELEMENT (self), kPadNames[kLeft]);
  priv->right = add_sink_pad (GST_ELEMENT (self), kPadNames[kRight]);
  priv->matcher.emplace (GST_ELEMENT (self), GST_CAT_DEFAULT, kPadNames);
  priv->packed.watch (GST_ELEMENT (self), GST_PAD (priv->left), GST_PAD (priv->right));
}

static void
gst_stereo_depth_class_init (GstStereoDepthClass *klass)
{
  auto object_class = G_OBJECT_CLASS (klass);
  auto element_class = GST_ELEMENT_CLASS (klass);
  auto aggregator_class = GST_AGGREGATOR_CLASS (klass);

  GST_DEBUG_CATEGORY_INIT (gst_stereo_depth_debug, "stereodepth", 0, "Stereo depth");

  object_class->finalize = delete_private<GstStereoDepth>;
  install_properties<GstStereoDepth, stereo_properties, make_stats> (object_class,
      "Counters since the element was started: frames, restricted-frames, third-frames, "
      "dropped-left, dropped-right, dropped-third, dropped-late, match-time (ns)");

  for (GstStaticPadTemplate *pad_template :
      {&left_template, &right_template, &third_template, &src_template})
    gst_element_class_add_static_pad_template_with_gtype (
        element_class, pad_template, GST_TYPE_AGGREGATOR_PAD);
  gst_element_class_set_static_metadata (element_class, "Stereo depth", "Filter/Video",
      "Computes range images from a stereo pair of cameras, or from three cameras",
      "gst-rangecast");

  element_class->change_state = GST_DEBUG_FUNCPTR (gst_stereo_depth_change_state);
  aggregator_class->start = GST_DEBUG_FUNCPTR (gst_stereo_depth_start);
  aggregator_class->stop = GST_DEBUG_FUNCPTR (gst_stereo_depth_stop);
  aggregator_class->flush = GST_DEBUG_FUNCPTR (gst_stereo_depth_flush);
  aggregator_class->sink_event = GST_DEBUG_FUNCPTR (gst_stereo_depth_sink_event);
  aggregator_class->src_event = GST_DEBUG_FUNCPTR (gst_stereo_depth_src_event);
  aggregator_class->update_src_caps = GST_DEBUG_FUNCPTR (keep_src_caps);
  aggregator_class->negotiate = GST_DEBUG_FUNCPTR (negotiate_downstream);
  aggregator_class->create_new_pad = GST_DEBUG_FUNCPTR (gst_stereo_depth_create_new_pad);
  aggregator_class->clip = GST_DEBUG_FUNCPTR (gstrange::clip_to_segment);
  aggregator_class->aggregate = aggregate_to_the_end<gst_stereo_depth_aggregate>;
  aggregator_class->get_next_time = GST_DEBUG_FUNCPTR (gst_stereo_depth_get_next_time);
  aggregator_class->propose_allocation = GST_DEBUG_FUNCPTR (propose_video_meta);
}
