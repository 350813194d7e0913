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

#include "common/bufferpools.hpp"
#include "common/statsreporter.hpp"
#include "common/videoframereader.hpp"
#include "roischedule.hpp"
#include "stereosettings.hpp"

#include <gst/video/video.h>

#include <algorithm>
#include <atomic>
#include <gstrange/gstrange.h>
#include <gstrange/gstrangeframe.hpp>
#include <gstrange/gstrangeinfo.hpp>
#include <gstrange/gstrangepairing.hpp>
#include <gstrange/gstrangestatus.hpp>
#include <memory>
#include <mutex>
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

GST_DEBUG_CATEGORY_STATIC (gst_stereo_depth_debug);
#define GST_CAT_DEFAULT gst_stereo_depth_debug

enum : guint { PROP_STATS = 1, PROP_STATS_INTERVAL, PROP_SETTINGS };

/* Pictures without a partner, one after the other, that are worth a warning: two seconds. */
static constexpr guint64 kManyWithoutPartner = 100;

/* Left and right of one moment. Both times are by the segment they came in. */
struct WaitingPair {
  gstrange::PairMatcher::Pair buffers; /* null: none waits */
  GstClockTime running = GST_CLOCK_TIME_NONE, capture = 0;
};

struct GstStereoDepthPrivate {
  std::mutex lock; /* guards what follows; never held across a push, event or message */
  StereoDepthSettings settings;
  guint64 frames = 0, restricted_frames = 0, third_frames = 0, dropped_third = 0, dropped_late = 0;
  GstClockTime match_time = 0;
  GstClockTime earliest = GST_CLOCK_TIME_NONE; /* running time; what is older comes too late */
  double proportion = 1;                       /* of the last QOS event */

  StatsReporter reporter;                   /* has locks of its own */
  RoiSchedule rois;                         /* so has this */
  std::atomic<bool> third_released = false; /* by any thread; the streaming thread clears it */

  /* streaming thread only */
  GstAggregatorPad *pads[2] = {nullptr, nullptr}; /* left, right; owned by the element */
  std::unique_ptr<gstrange::PairMatcher> matcher;
  WaitingPair pair;     /* for the third camera's picture */
  GstVideoInfo info[3]; /* left, right, third */
  bool have_info[3] = {false, false, false};
  GstVideoInfo next_info[2]; /* left, right: of what comes after the pair that waits */
  bool have_next_info[2] = {false, false};
  bool negotiate = true;      /* left or right have changed */
  bool third_changed = false; /* matters with its next picture */
  bool said_mirrored = false, said_unpaired = false;
  bool discont = false;
  guint64 dropped_before = 0; /* by the matcher, up to the last pair */
  gstrange::GapSender gaps;
  GstClockTime head_start = 0; /* live: of the element's own latency, what matching takes */
  VideoFrameReader readers[3];
  rangecast::StereoDepth core;
  GstClockTime frame_duration = GST_CLOCK_TIME_NONE;
  GstBufferPool *pool = nullptr;
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

static bool
same_size (const GstVideoInfo &a, const GstVideoInfo &b)
{
  return a.width == b.width && a.height == b.height;
}

/* The third camera may change its size a little before or after the others; that matters where its
 * picture is to be matched. */
static Status
check_sizes (GstStereoDepthPrivate *priv, bool third_is_there)
{
  static constexpr const char *kNames[] = {"left", "right", "third"};
  const GstVideoInfo &left = priv->info[0];
  for (int i = 1; i < (third_is_there ? 3 : 2); i++)
    if (const GstVideoInfo &other = priv->info[i]; priv->have_info[i] && !same_size (left, other))
      return {StatusCode::kBadSize, std::string ("pad ") + kNames[i] + " is " +
                                        size_text (other.width, other.height) +
                                        " but pad left is " + size_text (left.width, left.height) +
                                        "; expected the same size"};
  return {};
}

/* Downstream does not see that caps are set anew where they are equal, and so would not ask for its
 * part of the picture again. */
static StereoDepthSettings
current_settings (GstStereoDepthPrivate *priv)
{
  const View &before = priv->core.range_view ();
  if (before.width != priv->info[0].width || before.height != priv->info[0].height)
    priv->rois.forget ();
  std::lock_guard guard (priv->lock);
  return priv->settings;
}

static Status
configure_core (GstStereoDepthPrivate *priv, bool third_is_there)
{
  const GstVideoInfo &left = priv->info[0];
  if (Status s = check_sizes (priv, third_is_there); !s.ok ())
    return s;
  const StereoDepthSettings settings = current_settings (priv);
  View view;
  if (Status s = make_stereo_view (settings, left.width, left.height, view); !s.ok ())
    return s;
  if (priv->have_info[2] && !view.third)
    return {StatusCode::kNotFound, "pad third: no calibration of a third camera; expected property "
                                   "rig with a file that has one in view " +
                                       std::to_string (view.id)};
  const bool with_third = priv->have_info[2] && same_size (left, priv->info[2]);
  if (Status s = priv->core.set (view, settings.core, with_third); !s.ok ())
    return s;
  priv->said_mirrored = false;
  priv->third_changed = priv->have_info[2] && !with_third;
  for (int i = 0; i < (with_third ? 3 : 2); i++)
    if (!priv->readers[i].set (priv->info[i]))
      return {StatusCode::kUnsupported, "cannot convert the images to RGBx"};
  return {};
}

static GstFlowReturn
negotiate (GstStereoDepth *self, bool third_is_there)
{
  GstStereoDepthPrivate *priv = self->priv;
  const GstFlowReturn flow =
      gst_range_flow_return (GST_ELEMENT (self), configure_core (priv, third_is_there));
  if (flow != GST_FLOW_OK)
    return flow;
  const auto info =
      gstrange::make_info ({{priv->core.range_view ()}}, priv->info[0].fps_n, priv->info[0].fps_d);
  GstCaps *caps = gstrange::make_range_caps (info);
  priv->frame_duration = info.frame_duration ();
  priv->rois.restart ();
  drop_pool (priv->pool);
  const Status pooled = gstrange::make_pool (caps, priv->pool);
  if (pooled.ok ())
    gst_aggregator_set_src_caps (GST_AGGREGATOR (self), caps);
  gst_caps_unref (caps);
  priv->negotiate = !pooled.ok ();
  priv->reporter.set_views (info.rig);
  return gst_range_flow_return (GST_ELEMENT (self), pooled);
}

static GstFlowReturn
gst_stereo_depth_update_src_caps (GstAggregator *, GstCaps *, GstCaps **)
{
  return GST_AGGREGATOR_FLOW_NEED_DATA; /* caps are set with the first pair, see negotiate() */
}

/* Streaming thread. */
static void
forget_released_third (GstStereoDepthPrivate *priv)
{
  if (priv->third_released.exchange (false))
    priv->have_info[2] = priv->third_changed = false;
}

static gboolean
take_caps (GstStereoDepthPrivate *priv, int side, GstCaps *caps)
{
  GstVideoInfo info;
  if (!gst_video_info_from_caps (&info, caps))
    return FALSE;
  forget_released_third (priv);
  if (side < 2 && priv->pair.buffers.first) {
    priv->next_info[side] = info;
    priv->have_next_info[side] = true;
    return TRUE;
  }
  priv->info[side] = info;
  priv->have_info[side] = true;
  (side < 2 ? priv->negotiate : priv->third_changed) = true;
  return TRUE;
}

static gboolean
gst_stereo_depth_sink_event (GstAggregator *aggregator, GstAggregatorPad *pad, GstEvent *event)
{
  GstStereoDepthPrivate *priv = GST_STEREO_DEPTH (aggregator)->priv;
  if (GST_EVENT_TYPE (event) == GST_EVENT_CAPS) {
    const int side = pad == priv->pads[0] ? 0 : pad == priv->pads[1] ? 1 : 2;
    GstCaps *caps;
    gst_event_parse_caps (event, &caps);
    if (!take_caps (priv, side, caps)) {
      gst_event_unref (event);
      return FALSE;
    }
  }
  return GST_AGGREGATOR_CLASS (gst_stereo_depth_parent_class)->sink_event (aggregator, pad, event);
}

/* GstRangeRoi comes from whatever thread pushes it downstream. */
static bool
take_roi_event (GstStereoDepthPrivate *priv, const GstStructure *s)
{
  std::unique_lock guard (priv->lock);
  const int view_id = priv->settings.view_id;
  guard.unlock ();
  return priv->rois.take_event (s, view_id);
}

/* From the sink's thread. Not live, more than is late already is given up, or the next frame would
 * be late again. */
static void
take_qos_event (GstStereoDepth *self, GstEvent *event)
{
  double proportion;
  GstClockTimeDiff late;
  GstClockTime time;
  gst_event_parse_qos (event, nullptr, &proportion, &late, &time);
  const bool live = gst_aggregator_get_latency (GST_AGGREGATOR (self)) != GST_CLOCK_TIME_NONE;
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
  if (GST_EVENT_TYPE (event) == GST_EVENT_QOS)
    take_qos_event (GST_STEREO_DEPTH (aggregator), event);
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
  std::unique_lock guard (priv->lock);
  const int interval = priv->settings.refresh_interval;
  guard.unlock ();
  bool restricted = false;
  const Roi roi = priv->rois.next (priv->core, interval, restricted);
  guard.lock ();
  priv->restricted_frames += restricted;
  return roi;
}

static Status
match_pictures (
    GstStereoDepthPrivate *priv, bool with_third, GstBuffer *output, GstClockTime capture)
{
  const GstClockTime begin = gst_util_get_timestamp ();
  if (Status s = priv->core.rectify (priv->readers[0].view (), priv->readers[1].view (),
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
match_pair (GstStereoDepthPrivate *priv, GstBuffer *third, GstBuffer *output)
{
  static constexpr const char *kNames[] = {"left", "right", "third"};
  GstBuffer *buffers[] = {priv->pair.buffers.first, priv->pair.buffers.second, third};
  Status status;
  int n = 0;
  for (; n < 3 && buffers[n] && status.ok (); n++)
    if (!priv->readers[n].open (buffers[n])) {
      status = {StatusCode::kBadData,
          std::string ("pad ") + kNames[n] + ": a buffer is smaller than its caps require"};
      break;
    }
  if (status.ok ())
    status = match_pictures (priv, third != nullptr, output, priv->pair.capture);
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
      ("hardly anything matches; with the images exchanged, much does"));
}

static GstFlowReturn
push_pair (GstStereoDepth *self, GstBuffer *third)
{
  GstStereoDepthPrivate *priv = self->priv;
  const WaitingPair &pair = priv->pair;
  GstBuffer *left = pair.buffers.first;
  auto aggregator = GST_AGGREGATOR (self);
  GstBuffer *output = nullptr;
  GstFlowReturn flow = gstrange::acquire (GST_ELEMENT (self), priv->pool, &output);
  if (flow != GST_FLOW_OK)
    return flow;
  flow = gst_range_flow_return (GST_ELEMENT (self), match_pair (priv, third, output));
  if (flow != GST_FLOW_OK) {
    gst_buffer_unref (output);
    return flow;
  }
  warn_if_mirrored (self);
  const GstClockTime duration =
      GST_BUFFER_DURATION_IS_VALID (left) ? GST_BUFFER_DURATION (left) : priv->frame_duration;
  gstrange::stamp (aggregator, output, pair.running, duration, pair.capture);
  if (GST_BUFFER_IS_DISCONT (left) || priv->discont)
    GST_BUFFER_FLAG_SET (output, GST_BUFFER_FLAG_DISCONT);
  priv->discont = false;
  priv->gaps.note_buffer (pair.running, duration);
  priv->reporter.passed (GST_ELEMENT (self), output);
  return gst_aggregator_finish_buffer (aggregator, output);
}

/* Tells downstream of a time of which there will be nothing, so that it does not wait for it. */
static GstFlowReturn
push_gap (GstStereoDepth *self)
{
  GstStereoDepthPrivate *priv = self->priv;
  GstClockTime begin, end;
  if (!priv->matcher->take_gap (begin, end))
    return GST_FLOW_OK;
  end = std::min (end, priv->pair.running); /* NONE is the greatest number */
  const bool begun = priv->pool != nullptr;
  if (!priv->gaps.cut (begin, end) || (!begun && (!priv->have_info[0] || !priv->have_info[1])))
    return GST_FLOW_OK;
  if (!begun)
    if (const GstFlowReturn flow = negotiate (self, false); flow != GST_FLOW_OK)
      return flow;
  priv->gaps.push (GST_AGGREGATOR (self), priv->pads[0], begin, end);
  return GST_FLOW_OK;
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
  guint64 dropped = 0;
  const GstFlowReturn flow = gstrange::take_companion (GST_AGGREGATOR_PAD (pad), priv->pair.running,
      gstrange::pairing_tolerance (frame_duration), timeout, dropped, third);
  gst_object_unref (pad);
  if (*third && !priv->have_info[2]) /* of a pad that was released just now */
    gst_clear_buffer (third);
  std::lock_guard guard (priv->lock);
  priv->dropped_third += dropped;
  return flow;
}

static void
forget_pair (GstStereoDepthPrivate *priv)
{
  gst_clear_buffer (&priv->pair.buffers.first);
  gst_clear_buffer (&priv->pair.buffers.second);
  priv->pair = {};
  for (int i = 0; i < 2; i++)
    if (priv->have_next_info[i]) {
      priv->info[i] = priv->next_info[i];
      priv->have_next_info[i] = false;
      priv->negotiate = true;
    }
}

/* Two cameras whose clocks have nothing to do with each other may never take a picture at once. */
static void
warn_if_nothing_pairs (GstStereoDepth *self, bool paired)
{
  GstStereoDepthPrivate *priv = self->priv;
  const guint64 dropped = priv->matcher->dropped_first () + priv->matcher->dropped_second ();
  if (paired)
    priv->dropped_before = dropped;
  if (priv->said_unpaired || dropped - priv->dropped_before < kManyWithoutPartner)
    return;
  priv->said_unpaired = true;
  GST_ELEMENT_WARNING (self, STREAM, FAILED,
      ("Left and right images do not pair up: expected times that differ by at most half a frame, "
       "or 5 ms if the caps have no framerate"),
      ("the last %" G_GUINT64_FORMAT " images found no partner", dropped - priv->dropped_before));
}

static GstFlowReturn
take_pair (GstStereoDepth *self, GstClockTime frame_duration)
{
  GstStereoDepthPrivate *priv = self->priv;
  WaitingPair &pair = priv->pair;
  const GstFlowReturn flow = priv->matcher->take (frame_duration, pair.buffers);
  warn_if_nothing_pairs (self, flow == GST_FLOW_OK);
  if (flow == GST_FLOW_OK) {
    const bool live = gst_aggregator_get_latency (GST_AGGREGATOR (self)) != GST_CLOCK_TIME_NONE;
    pair.running = gstrange::running_time_of (priv->pads[0], pair.buffers.first);
    pair.capture = gstrange::capture_time_of (priv->pads[0], pair.buffers.first, live);
  }
  const GstFlowReturn pushed = push_gap (self);
  return pushed == GST_FLOW_OK ? flow : pushed;
}

/* Gives up the pair that waits if the sink would throw its depth away. */
static bool
drop_if_late (GstStereoDepth *self)
{
  GstStereoDepthPrivate *priv = self->priv;
  const GstClockTime running = priv->pair.running;
  GstClockTime earliest;
  guint64 frames, dropped;
  double proportion;
  {
    std::lock_guard guard (priv->lock);
    earliest = priv->earliest;
    if (!priv->settings.qos || !GST_CLOCK_TIME_IS_VALID (earliest) ||
        !GST_CLOCK_TIME_IS_VALID (running) || running > earliest)
      return false;
    dropped = ++priv->dropped_late;
    frames = priv->frames;
    proportion = priv->proportion;
  }
  GstBuffer *left = priv->pair.buffers.first;
  const bool live = gst_aggregator_get_latency (GST_AGGREGATOR (self)) != GST_CLOCK_TIME_NONE;
  GST_OBJECT_LOCK (priv->pads[0]);
  const GstClockTime stream_time =
      gst_segment_to_stream_time (&priv->pads[0]->segment, GST_FORMAT_TIME, GST_BUFFER_PTS (left));
  GST_OBJECT_UNLOCK (priv->pads[0]);
  GstMessage *message = gst_message_new_qos (GST_OBJECT (self), live, running, stream_time,
      GST_BUFFER_PTS (left), GST_BUFFER_DURATION (left));
  gst_message_set_qos_values (message, GST_CLOCK_DIFF (running, earliest), proportion, 1000000);
  gst_message_set_qos_stats (message, GST_FORMAT_BUFFERS, frames, dropped);
  gst_element_post_message (GST_ELEMENT (self), message);
  priv->discont = true;
  forget_pair (priv);
  return true;
}

/* Live, the element's own latency is for the third camera to be late and for matching. */
static void
learn_head_start (GstStereoDepth *self)
{
  GstStereoDepthPrivate *priv = self->priv;
  guint64 latency = 0;
  g_object_get (self, "latency", &latency, nullptr);
  std::lock_guard guard (priv->lock);
  if (priv->frames > 0)
    priv->head_start = std::min<GstClockTime> (latency, priv->match_time / priv->frames);
}

static GstFlowReturn
gst_stereo_depth_aggregate (GstAggregator *aggregator, gboolean timeout)
{
  auto self = GST_STEREO_DEPTH (aggregator);
  GstStereoDepthPrivate *priv = self->priv;
  forget_released_third (priv);
  GstClockTime duration = GST_CLOCK_TIME_NONE;
  if (priv->have_info[0] && priv->info[0].fps_n > 0)
    duration = gst_util_uint64_scale_int (GST_SECOND, priv->info[0].fps_d, priv->info[0].fps_n);
  if (!priv->pair.buffers.first)
    if (const GstFlowReturn flow = take_pair (self, duration); flow != GST_FLOW_OK) {
      if (flow == GST_FLOW_EOS)
        priv->reporter.finish ();
      return flow;
    }
  if (drop_if_late (self))
    return GST_FLOW_OK;
  GstBuffer *third = nullptr;
  if (const GstFlowReturn flow = take_third (self, duration, timeout, &third); flow != GST_FLOW_OK)
    return flow;
  GstFlowReturn flow = GST_FLOW_OK;
  if (priv->negotiate || (priv->third_changed && third))
    flow = negotiate (self, third != nullptr);
  if (flow == GST_FLOW_OK)
    flow = push_pair (self, third);
  gst_clear_buffer (&third);
  forget_pair (priv);
  learn_head_start (self);
  return flow;
}

/* Live, the third camera is waited for until the latency is over. Without left or right there is
 * nothing to put out, and so no deadline. Called by the streaming thread. */
static GstClockTime
gst_stereo_depth_get_next_time (GstAggregator *aggregator)
{
  GstStereoDepthPrivate *priv = GST_STEREO_DEPTH (aggregator)->priv;
  GstClockTime time = priv->pair.running;
  if (!priv->pair.buffers.first) {
    int n = 0;
    for (GstAggregatorPad *pad : priv->pads)
      if (gst_aggregator_pad_is_eos (pad))
        return 0; /* the end, whatever the third camera does */
      else if (GstBuffer *buffer = gst_aggregator_pad_peek_buffer (pad)) {
        time = std::min (time, gstrange::running_time_of (pad, buffer)); /* NONE is greatest */
        gst_buffer_unref (buffer);
        n++;
      }
    if (n < 2)
      return GST_CLOCK_TIME_NONE;
  }
  return GST_CLOCK_TIME_IS_VALID (time) ? time - std::min (time, priv->head_start) : time;
}

/* Strides and offsets are taken as they are. */
static gboolean
gst_stereo_depth_propose_allocation (
    GstAggregator *, GstAggregatorPad *, GstQuery *, GstQuery *query)
{
  gst_query_add_allocation_meta (query, GST_VIDEO_META_API_TYPE, nullptr);
  return TRUE;
}

static GstFlowReturn
gst_stereo_depth_flush (GstAggregator *aggregator)
{
  GstStereoDepthPrivate *priv = GST_STEREO_DEPTH (aggregator)->priv;
  priv->rois.restart ();
  priv->core.reset ();
  forget_pair (priv);
  priv->gaps.reset ();
  priv->discont = false;
  GstClockTime begin, end;
  priv->matcher->take_gap (begin, end);
  std::lock_guard guard (priv->lock);
  priv->earliest = GST_CLOCK_TIME_NONE;
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

static void
gst_stereo_depth_release_pad (GstElement *element, GstPad *pad)
{
  GST_ELEMENT_CLASS (gst_stereo_depth_parent_class)->release_pad (element, pad);
  GST_STEREO_DEPTH (element)->priv->third_released = true;
}

/* ---- life ---- */

static std::vector<StatsRow>
collect_stats (GstElement *element)
{
  GstStereoDepthPrivate *priv = GST_STEREO_DEPTH (element)->priv;
  std::lock_guard guard (priv->lock);
  const guint64 lost = priv->matcher->dropped_first () + priv->matcher->dropped_second ();
  return {{.counters = {.frames = priv->frames,
               .lost = lost + priv->dropped_third,
               .late = priv->dropped_late}}};
}

static gboolean
gst_stereo_depth_start (GstAggregator *aggregator)
{
  GstStereoDepthPrivate *priv = GST_STEREO_DEPTH (aggregator)->priv;
  for (bool &have : priv->have_info)
    have = false;
  priv->negotiate = true;
  priv->third_changed = priv->third_released = false;
  priv->said_unpaired = priv->discont = false;
  priv->dropped_before = priv->head_start = 0;
  priv->gaps.reset ();
  priv->matcher->reset ();
  priv->rois.forget ();
  priv->reporter.start (GST_ELEMENT (aggregator), collect_stats);
  std::lock_guard guard (priv->lock);
  priv->frames = priv->restricted_frames = priv->third_frames = priv->dropped_third = 0;
  priv->dropped_late = priv->match_time = 0;
  priv->earliest = GST_CLOCK_TIME_NONE;
  return TRUE;
}

static gboolean
gst_stereo_depth_stop (GstAggregator *aggregator)
{
  GstStereoDepthPrivate *priv = GST_STEREO_DEPTH (aggregator)->priv;
  priv->reporter.stop ();
  drop_pool (priv->pool);
  forget_pair (priv);
  for (VideoFrameReader &reader : priv->readers)
    reader.reset ();
  return TRUE;
}

static void
gst_stereo_depth_set_property (GObject *object, guint id, const GValue *value, GParamSpec *pspec)
{
  GstStereoDepthPrivate *priv = GST_STEREO_DEPTH (object)->priv;
  if (id == PROP_STATS_INTERVAL) {
    priv->reporter.set_interval (g_value_get_uint (value));
    return;
  }
  std::lock_guard guard (priv->lock);
  if (!stereo_properties ().set (priv->settings, id, value))
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
      "dropped-late", G_TYPE_UINT64, priv->dropped_late,                //
      "match-time", G_TYPE_UINT64, priv->match_time, nullptr);
}

static void
gst_stereo_depth_get_property (GObject *object, guint id, GValue *value, GParamSpec *pspec)
{
  GstStereoDepthPrivate *priv = GST_STEREO_DEPTH (object)->priv;
  std::lock_guard guard (priv->lock);
  if (id == PROP_STATS)
    g_value_take_boxed (value, make_stats (priv));
  else if (id == PROP_STATS_INTERVAL)
    g_value_set_uint (value, priv->reporter.interval ());
  else if (!stereo_properties ().get (priv->settings, id, value))
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
  stereo_properties ().install (object_class, PROP_SETTINGS);
  install_stats (object_class, PROP_STATS,
      "Counters since the element was started: frames, restricted-frames, third-frames, "
      "dropped-left, dropped-right, dropped-third, dropped-late, match-time (ns)");
  StatsReporter::install (object_class, PROP_STATS_INTERVAL);

  for (GstStaticPadTemplate *pad_template :
      {&left_template, &right_template, &third_template, &src_template})
    gst_element_class_add_static_pad_template_with_gtype (
        element_class, pad_template, GST_TYPE_AGGREGATOR_PAD);
  gst_element_class_set_static_metadata (element_class, "Stereo depth", "Filter/Video",
      "Computes range images from a stereo pair of cameras, or from three cameras",
      "gst-rangecast");

  element_class->release_pad = gst_stereo_depth_release_pad;
  aggregator_class->start = gst_stereo_depth_start;
  aggregator_class->stop = gst_stereo_depth_stop;
  aggregator_class->flush = gst_stereo_depth_flush;
  aggregator_class->sink_event = gst_stereo_depth_sink_event;
  aggregator_class->src_event = gst_stereo_depth_src_event;
  aggregator_class->update_src_caps = gst_stereo_depth_update_src_caps;
  aggregator_class->create_new_pad = gst_stereo_depth_create_new_pad;
  aggregator_class->clip = gstrange::clip_to_segment;
  aggregator_class->aggregate = gst_stereo_depth_aggregate;
  aggregator_class->get_next_time = gst_stereo_depth_get_next_time;
  aggregator_class->propose_allocation = gst_stereo_depth_propose_allocation;

  GST_DEBUG_CATEGORY_INIT (gst_stereo_depth_debug, "stereodepth", 0, "Stereo depth");
}
