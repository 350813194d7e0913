/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-rigcalibrate
 * @title: rigcalibrate
 *
 * Calibrates any number of cameras, stereo pairs and their poses from images of a chessboard or
 * ChArUco board. Selects frames automatically, reports in element messages which camera saw the
 * board and what is still missing, and writes the rig file at EOS.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 -m rigcalibrate name=c location=rig.yaml columns=9 rows=6 square-size=0.025 \
 *   sink_0::view=0 sink_1::view=0 sink_1::role=right ! videoconvert ! autovideosink \
 *   multifilesrc location=left%02d.jpg index=1 caps=image/jpeg,framerate=1/1 ! jpegdec ! c.sink_0 \
 *   multifilesrc location=right%02d.jpg index=1 caps=image/jpeg,framerate=1/1 ! jpegdec ! c.sink_1
 * ]|
 *
 * Since: 0.1
 */
#include <gst/base/gstaggregator.h>

#include "common/backgroundjobs.hpp"
#include "common/capsadvice.hpp"
#include "common/elementproperties.hpp"
#include "common/matcher.hpp"
#include "frames.hpp"
#include "messages.hpp"
#include "settings.hpp"

#include <algorithm>
#include <gstrange/gstrangepairing.hpp>
#include <gstrange/gstrangestatus.hpp>
#include <mutex>
#include <rangecast/geometry/size_text.hpp>
#include <rangecast/rigfile/rig_file.hpp>

using rangecast::CalibrationCamera;
using rangecast::size_text;
using rangecast::Status;
using rangecast::StatusCode;
using rangecast::TileLayout;

GST_DEBUG_CATEGORY_STATIC (gst_rig_calibrate_debug);
#define GST_CAT_DEFAULT gst_rig_calibrate_debug

/* aggregate waits for one image of each camera, drops those whose capture times do not match, and
 * posts the set as a job. Jobs look for the board, keep useful sets, draw a preview and, at EOS or
 * with auto-finish, calibrate. If live, sets that arrive while a job runs are
 * skipped; otherwise the streaming thread waits for each job. It pushes the previews. */

/* Maximum frame rate of what is taken for single photographs instead of video, Hz. */
static constexpr int kMaxPhotoRate = 2;

/* Of these, the most redundant one is replaced by a better one. */
static constexpr int kMaxFrames = 100;

/* Width of each camera's image in the output, pixels. */
static constexpr int kTileWidth = 480;

/* Default of `latency`, ns: the time for which a late camera is waited for. Only the preview is
 * delayed by it, and only while a camera is late. */
static constexpr GstClockTime kLatency = 200 * GST_MSECOND;

/* Beyond this lateness on arrival, images are no longer waited for, ns: so that a camera that sends
 * nothing does not make a backlog of the others' images. */
static constexpr GstClockTime kMaxLateness = GST_SECOND;

struct GstRigCalibratePrivate {
  /* Guards the members up to finished; never held across a push, message or job. */
  std::mutex lock;
  RigCalibrateSettings settings;
  CameraInputs cameras;
  guint64 examined = 0, taken = 0, skipped = 0, dropped = 0;
  GstBuffer *still = nullptr; /* preview that was not pushed yet */
  TileLayout still_layout;
  GstClockTime still_capture = 0;
  Status failure;        /* of the first job that failed */
  bool finished = false; /* auto-finish has calibrated: EOS */

  BackgroundJobs jobs; /* thread-safe */

  /* jobs, and the streaming thread while there are none */
  rangecast::CalibrationSession session;

  /* streaming thread */
  bool begin = true; /* no set was examined yet */
  guint64 sets = 0;
  /* The oldest image that waits for those of other cameras, and since when; running times. */
  GstClockTime waiting = GST_CLOCK_TIME_NONE, waiting_since = GST_CLOCK_TIME_NONE;
  TileLayout layout; /* of the output caps */
};

DECLARE_ELEMENT (GstRigCalibrate, gst_rig_calibrate, RIG_CALIBRATE, GstAggregator)

static GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE ("sink_%u", GST_PAD_SINK,
    GST_PAD_REQUEST, GST_STATIC_CAPS (GST_VIDEO_CAPS_MAKE (GST_VIDEO_FORMATS_ALL)));
static GstStaticPadTemplate src_template = GST_STATIC_PAD_TEMPLATE (
    "src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS (GST_VIDEO_CAPS_MAKE ("RGBx")));

G_DEFINE_TYPE_WITH_CODE (GstRigCalibrate, gst_rig_calibrate, GST_TYPE_AGGREGATOR,
    G_IMPLEMENT_INTERFACE (GST_TYPE_CHILD_PROXY, init_pad_proxy))
GST_ELEMENT_REGISTER_DEFINE (
    rigcalibrate, "rigcalibrate", GST_RANK_NONE, gst_rig_calibrate_get_type ())

static CameraInputs
current_cameras (GstRigCalibrate *self)
{
  std::lock_guard guard (self->priv->lock);
  return self->priv->cameras;
}

/* ---- sink caps ---- */

static Status
handle_caps (GstRigCalibrate *self, CameraInput &camera, GstCaps *caps)
{
  const std::string name = calibration_camera (camera.pad).name;
  GstVideoInfo info;
  if (!gst_video_info_from_caps (&info, caps))
    return {StatusCode::kUnsupported, "pad " + name + ": not the caps of raw video"};
  bool begun;
  {
    std::lock_guard guard (self->priv->lock);
    begun = self->priv->examined > 0;
  }
  if (begun && camera.info &&
      (info.width != camera.info->width || info.height != camera.info->height))
    return {StatusCode::kBadSize, "pad " + name + ": images changed from " +
                                      size_text (camera.info->width, camera.info->height) + " to " +
                                      size_text (info.width, info.height) +
                                      ", but a calibration needs one size"};
  GST_INFO_OBJECT (camera.pad, "caps %" GST_PTR_FORMAT, caps);
  camera.info = info;
  return {};
}

/* Ends waits for jobs on a flush. */
static gboolean
gst_rig_calibrate_sink_event (GstAggregator *aggregator, GstAggregatorPad *pad, GstEvent *event)
{
  auto self = GST_RIG_CALIBRATE (aggregator);
  if (GST_EVENT_TYPE (event) == GST_EVENT_FLUSH_START)
    self->priv->jobs.set_flushing (true);
  else if (GST_EVENT_TYPE (event) == GST_EVENT_FLUSH_STOP)
    self->priv->jobs.set_flushing (false);
  else if (GST_EVENT_TYPE (event) == GST_EVENT_CAPS) {
    GstCaps *caps;
    gst_event_parse_caps (event, &caps);
    for (const auto &camera : current_cameras (self)) {
      if (camera->aggregator_pad () != pad)
        continue;
      camera->refused = gst_range_flow_return (
                            GST_ELEMENT (self), handle_caps (self, *camera, caps)) != GST_FLOW_OK;
      if (camera->refused) {
        gst_event_unref (event);
        return FALSE;
      }
    }
  }
  return GST_AGGREGATOR_CLASS (gst_rig_calibrate_parent_class)->sink_event (aggregator, pad, event);
}

/* ---- jobs ---- */

/* Calibrates from the frames taken so far, writes the rig file and posts the result. */
static Status
calibrate (GstRigCalibrate *self, std::stop_token stop)
{
  GstRigCalibratePrivate *priv = self->priv;
  const std::string location = settings_of (priv).location;
  rangecast::CalibrationResult result;
  Status status = {StatusCode::kNotFound, "there were no images to calibrate from"};
  if (!priv->session.cameras ().empty ())
    status = priv->session.calibrate (result, std::move (stop));
  if (status.ok ()) {
    if (!location.empty ())
      status = rangecast::save_rig (location, result.rig); /* the message has it, too */
    for (const std::string &warning : result.warnings)
      gst_range_post_warning (GST_ELEMENT (self), {StatusCode::kBadValue, warning});
    post_result (GST_ELEMENT (self), priv->session, result,
        location.empty () || !status.ok () ? nullptr : location.c_str ());
  }
  return status;
}

/* Draws the images with the corners found, for the streaming thread to push. */
static void
draw_still (GstRigCalibrate *self, const CalibrationImages &set, const MappedImages &images)
{
  GstRigCalibratePrivate *priv = self->priv;
  const TileLayout layout = rangecast::lay_out (set.described, kTileWidth);
  GstBuffer *still = gst_buffer_new_and_alloc (layout.width () * layout.height () * 4);
  GstMapInfo map;
  if (gst_buffer_map (still, &map, GST_MAP_WRITE)) {
    priv->session.draw (images.views, {reinterpret_cast<rangecast::Rgbx *> (map.data),
                                          layout.width (), layout.height (), layout.width () * 4});
    gst_buffer_unmap (still, &map);
  }
  std::lock_guard guard (priv->lock);
  gst_clear_buffer (&priv->still);
  priv->still = still;
  priv->still_layout = layout;
  priv->still_capture = set.capture;
}

/* Looks for the board. @param[out] taken  whether the set was kept */
static Status
examine (GstRigCalibrate *self, CalibrationImages &set, bool &taken)
{
  GstRigCalibratePrivate *priv = self->priv;
  if (set.begin)
    if (Status s = priv->session.set (*set.begin); !s.ok ())
      return s;
  const MappedImages images (set);
  if (!images.status.ok ())
    return images.status;
  if (Status s = priv->session.examine (set.described, images.views, set.capture, set.number);
      !s.ok ())
    return s;
  taken = priv->session.verdict () == rangecast::FrameVerdict::kTaken;
  GST_DEBUG_OBJECT (self, "set %" G_GUINT64_FORMAT ": %s", set.number,
      std::string (rangecast::verdict_name (priv->session.verdict ())).c_str ());
  {
    std::lock_guard guard (priv->lock);
    priv->examined++;
    priv->taken += taken;
  }
  draw_still (self, set, images);
  for (std::size_t i = 0; i < set.buffers.size (); i++)
    if (set.buffers[i])
      post_board (GST_ELEMENT (self), priv->session, int (i), set.number, set.running);
  if (taken)
    post_coverage (GST_ELEMENT (self), priv->session);
  return {};
}

/* With auto-finish, complete coverage ends the stream: after calibration, or with its error. */
static void
examine_job (GstRigCalibrate *self, CalibrationImages &set, std::stop_token stop)
{
  GstRigCalibratePrivate *priv = self->priv;
  bool taken = false, finished = false;
  Status status = examine (self, set, taken);
  if (status.ok () && taken && set.auto_finish && priv->session.complete ()) {
    status = calibrate (self, std::move (stop));
    finished = status.ok ();
  }
  std::lock_guard guard (priv->lock);
  if (priv->failure.ok () && status.code () != StatusCode::kInterrupted)
    priv->failure = std::move (status);
  priv->finished |= finished;
}

/* ---- output ---- */

/* Pushes the latest preview with the running time of the current set; if live, it shows an older
 * one. */
static GstFlowReturn
push_still (GstRigCalibrate *self, GstClockTime running)
{
  GstRigCalibratePrivate *priv = self->priv;
  auto aggregator = GST_AGGREGATOR (self);
  GstBuffer *still;
  TileLayout layout;
  GstClockTime capture;
  {
    std::lock_guard guard (priv->lock);
    still = priv->still;
    priv->still = nullptr;
    layout = priv->still_layout;
    capture = priv->still_capture;
  }
  if (!still)
    return GST_FLOW_OK;
  if (!gst_pad_is_linked (aggregator->srcpad)) {
    gst_buffer_unref (still);
    return GST_FLOW_OK;
  }
  if (layout.width () != priv->layout.width () || layout.height () != priv->layout.height ()) {
    GstVideoInfo info;
    gst_video_info_set_format (
        &info, GST_VIDEO_FORMAT_RGBx, guint (layout.width ()), guint (layout.height ()));
    GstCaps *caps = gst_video_info_to_caps (&info);
    GST_INFO_OBJECT (self, "output caps %" GST_PTR_FORMAT, caps);
    gst_aggregator_set_src_caps (aggregator, caps);
    gst_caps_unref (caps);
    priv->layout = layout;
  }
  gstrange::stamp (aggregator, still, running, GST_CLOCK_TIME_NONE, capture);
  return gst_aggregator_finish_buffer (aggregator, still);
}

/* ---- streaming ---- */

/* Checks the cameras of the first set and decides how to select frames. */
static Status
begin_session (
    GstRigCalibrate *self, CalibrationImages &set, const RigCalibrateSettings &p, bool live)
{
  if (Status s = rangecast::check_cameras (set.described, p.core.board); !s.ok ())
    return s;
  bool video = live;
  for (const GstVideoInfo &info : set.infos)
    video |= info.fps_n > kMaxPhotoRate * std::max (info.fps_d, 1);
  rangecast::SessionSettings settings;
  settings.calibration = p.core;
  settings.selection.max_frames = kMaxFrames;
  settings.selection.all = !video; /* of photographs, each was taken for its place */
  settings.thorough = !video;
  set.begin = settings;
  self->priv->begin = false;
  return {};
}

/* Posts a set as a job, waits for it unless live, and pushes the preview. */
static GstFlowReturn
examine_set (GstRigCalibrate *self, std::shared_ptr<CalibrationImages> set, bool live)
{
  GstRigCalibratePrivate *priv = self->priv;
  const RigCalibrateSettings p = settings_of (priv);
  const GstClockTime running = set->running;
  if (live && !priv->jobs.idle ()) {
    GST_DEBUG_OBJECT (
        self, "skipping set %" G_GUINT64_FORMAT ": an earlier one is being examined", set->number);
    std::lock_guard guard (priv->lock);
    priv->skipped++;
    return GST_FLOW_OK;
  }
  if (priv->begin)
    if (Status s = begin_session (self, *set, p, live); !s.ok ())
      return gst_range_flow_return (GST_ELEMENT (self), s);
  set->auto_finish = p.auto_finish;
  priv->jobs.post (
      [self, set] (std::stop_token stop) { examine_job (self, *set, std::move (stop)); });
  set.reset ();
  if (!live && !priv->jobs.wait_until_idle ())
    return GST_FLOW_OK; /* flushing or stopping, which the base class handles */
  Status failure;
  {
    std::lock_guard guard (priv->lock);
    failure = priv->failure;
  }
  const GstFlowReturn flow = gst_range_flow_return (GST_ELEMENT (self), failure);
  return flow == GST_FLOW_OK ? push_still (self, running) : flow;
}

/* The reason why no set was examined. */
static Status
explain_no_images (const CameraInputs &cameras)
{
  for (const auto &camera : cameras)
    if (!camera->info || cameras.size () == 1) /* one camera has nothing to match with */
      return {StatusCode::kNotFound,
          "pad " + calibration_camera (camera->pad).name + ": no images arrived"};
  return {StatusCode::kNotFound, "no images with matching times arrived on all pads: capture times "
                                 "of a set differ by less than "
                                 "half a frame"};
}

/* All pads are at EOS: calibrates. */
static GstFlowReturn
finish (GstRigCalibrate *self, const CameraInputs &cameras)
{
  GstRigCalibratePrivate *priv = self->priv;
  if (!priv->jobs.wait_until_idle ())
    return GST_AGGREGATOR_FLOW_NEED_DATA;
  Status status;
  {
    std::lock_guard guard (priv->lock);
    status = priv->failure;
  }
  if (status.ok () && priv->sets == 0)
    status = explain_no_images (cameras);
  if (status.ok ()) {
    const auto outcome = std::make_shared<Status> ();
    priv->jobs.post (
        [self, outcome] (std::stop_token stop) { *outcome = calibrate (self, std::move (stop)); });
    if (!priv->jobs.wait_until_idle ())
      return GST_AGGREGATOR_FLOW_NEED_DATA;
    status = *outcome;
  }
  const GstFlowReturn flow = gst_range_flow_return (GST_ELEMENT (self), status);
  return flow == GST_FLOW_OK ? GST_FLOW_EOS : flow;
}

static GstFlowReturn
gst_rig_calibrate_aggregate (GstAggregator *aggregator, gboolean timeout)
{
  auto self = GST_RIG_CALIBRATE (aggregator);
  GstRigCalibratePrivate *priv = self->priv;
  {
    std::lock_guard guard (priv->lock);
    if (priv->finished)
      return GST_FLOW_EOS;
  }
  const CameraInputs cameras = current_cameras (self);
  if (std::ranges::any_of (cameras, [] (const auto &camera) { return camera->refused; }))
    return GST_FLOW_ERROR;
  const bool live = gst_aggregator_get_latency (aggregator) != GST_CLOCK_TIME_NONE;
  const GstClockTime tolerance = max_capture_skew (cameras);
  CameraHeads heads (cameras, tolerance, live);
  MatchStream *unmatched = nullptr;
  const MatchStep step = match_streams (heads.order, tolerance, timeout, unmatched);
  if (step == MatchStep::kWait || cameras.empty ())
    return GST_AGGREGATOR_FLOW_NEED_DATA;
  if (step == MatchStep::kEnd)
    return finish (self, cameras);
  const bool starting =
      std::ranges::any_of (cameras, [] (const auto &camera) { return !camera->info; });
  if (step == MatchStep::kSet && !starting)
    return examine_set (self, pop_images (cameras, heads, priv->sets++), live);
  for (const PadStream &head : heads.list)
    if (step == MatchStep::kSet ? head.in_set : &head == unmatched) {
      GST_DEBUG_OBJECT (head.pad, "dropping %" GST_PTR_FORMAT ": %s", head.buffer,
          starting        ? "another camera has no caps yet"
          : head.required ? "it matches no image of another camera"
                          : "its time has passed");
      gst_aggregator_pad_drop_buffer (head.pad);
      std::lock_guard guard (priv->lock);
      priv->dropped += head.required;
    }
  return GST_AGGREGATOR_FLOW_NEED_DATA; /* aggregate is called again with the next buffers */
}

/* A late camera is waited for until `latency` after the oldest image that waits arrived, not after
 * it was due: decoders on a busy machine are late, and the images of one moment with them. */
static GstClockTime
gst_rig_calibrate_get_next_time (GstAggregator *aggregator)
{
  GstRigCalibratePrivate *priv = GST_RIG_CALIBRATE (aggregator)->priv;
  GstClockTime oldest = GST_CLOCK_TIME_NONE;
  const CameraInputs cameras = current_cameras (GST_RIG_CALIBRATE (aggregator));
  for (const auto &camera : cameras) {
    GstBuffer *buffer = gst_aggregator_pad_peek_buffer (camera->aggregator_pad ());
    if (buffer)
      oldest = std::min (oldest, gstrange::running_time_of (camera->aggregator_pad (), buffer));
    else
      GST_LOG_OBJECT (camera->pad, "waiting for %s",
          gst_pad_has_current_caps (GST_PAD (camera->pad)) ? "an image" : "caps and an image");
    gst_clear_buffer (&buffer);
  }
  if (oldest != priv->waiting) {
    priv->waiting = oldest;
    priv->waiting_since = gst_element_get_current_running_time (GST_ELEMENT (aggregator));
  }
  if (!GST_CLOCK_TIME_IS_VALID (oldest) || !GST_CLOCK_TIME_IS_VALID (priv->waiting_since))
    return oldest;
  return std::clamp (priv->waiting_since, oldest, oldest + kMaxLateness);
}

/* ---- request pads ---- */

static GstAggregatorPad *
gst_rig_calibrate_create_new_pad (
    GstAggregator *aggregator, GstPadTemplate *pad_template, const gchar *name, const GstCaps *caps)
{
  GstRigCalibratePrivate *priv = GST_RIG_CALIBRATE (aggregator)->priv;
  GstAggregatorPad *pad = GST_AGGREGATOR_CLASS (gst_rig_calibrate_parent_class)
                              ->create_new_pad (aggregator, pad_template, name, caps);
  unsigned number = 0;
  if (pad && sscanf (GST_PAD_NAME (pad), "sink_%u", &number) == 1)
    g_object_set (
        pad, "view", int (std::min<unsigned> (number, rangecast::kMaxViews - 1)), nullptr);
  if (pad) {
    std::lock_guard guard (priv->lock);
    priv->cameras.push_back (std::make_shared<CameraInput> (GST_RIG_CALIBRATE_PAD (pad)));
  }
  return pad;
}

/* Discards all frames: they have another number of cameras. */
static void
gst_rig_calibrate_release_pad (GstElement *element, GstPad *pad)
{
  auto self = GST_RIG_CALIBRATE (element);
  {
    std::lock_guard guard (self->priv->lock);
    std::erase_if (self->priv->cameras,
        [&] (const auto &camera) { return GST_PAD (camera->aggregator_pad ()) == pad; });
  }
  self->priv->jobs.post ([self] (const std::stop_token &) {
    self->priv->session.clear ();
    std::lock_guard guard (self->priv->lock);
    self->priv->examined = self->priv->taken = 0;
  });
  GST_ELEMENT_CLASS (gst_rig_calibrate_parent_class)->release_pad (element, pad);
}

/* ---- lifecycle ---- */

static GstFlowReturn
gst_rig_calibrate_flush (GstAggregator *aggregator)
{
  GstRigCalibratePrivate *priv = GST_RIG_CALIBRATE (aggregator)->priv;
  std::lock_guard guard (priv->lock);
  priv->finished = false;
  return GST_FLOW_OK;
}

static gboolean
gst_rig_calibrate_start (GstAggregator *aggregator)
{
  auto self = GST_RIG_CALIBRATE (aggregator);
  GstRigCalibratePrivate *priv = self->priv;
  const RigCalibrateSettings p = settings_of (priv);
  rangecast::SessionSettings settings;
  settings.calibration = p.core;
  settings.selection.max_frames = kMaxFrames;
  Status status;
  if (!p.location.empty ()) /* now, not after minutes of work */
    status = rangecast::check_output_path (p.location, rangecast::kRigExtensions);
  if (status.ok ())
    status = priv->session.set (settings);
  if (gst_range_flow_return (GST_ELEMENT (self), status) != GST_FLOW_OK)
    return FALSE;
  priv->begin = true;
  priv->sets = 0;
  priv->waiting = priv->waiting_since = GST_CLOCK_TIME_NONE;
  priv->layout = {};
  {
    std::lock_guard guard (priv->lock);
    priv->examined = priv->taken = priv->skipped = priv->dropped = 0;
    priv->failure = {};
    priv->finished = false;
    for (const auto &camera : priv->cameras) {
      camera->info.reset ();
      camera->refused = false;
    }
  }
  if (priv->jobs.start ())
    return TRUE;
  GST_ELEMENT_ERROR (self, RESOURCE, FAILED, ("Could not start a thread"), (nullptr));
  return FALSE;
}

static gboolean
gst_rig_calibrate_stop (GstAggregator *aggregator)
{
  GstRigCalibratePrivate *priv = GST_RIG_CALIBRATE (aggregator)->priv;
  priv->jobs.stop ();
  priv->session.clear ();
  for (const auto &camera : current_cameras (GST_RIG_CALIBRATE (aggregator))) {
    camera->reader.reset ();
    camera->reader_info.reset ();
  }
  GstBuffer *still;
  {
    std::lock_guard guard (priv->lock);
    still = priv->still;
    priv->still = nullptr;
  }
  gst_clear_buffer (&still);
  return TRUE;
}

/* Ends a calibration, which can take long, before the base class waits for the streaming thread. */
static GstStateChangeReturn
gst_rig_calibrate_change_state (GstElement *element, GstStateChange transition)
{
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY)
    GST_RIG_CALIBRATE (element)->priv->jobs.interrupt ();
  return GST_ELEMENT_CLASS (gst_rig_calibrate_parent_class)->change_state (element, transition);
}

static GstStructure *
make_stats (const GstRigCalibratePrivate *priv)
{
  return gst_structure_new ("application/x-rigcalibrate-stats", "examined", G_TYPE_UINT64,
      priv->examined, "taken", G_TYPE_UINT64, priv->taken, "skipped", G_TYPE_UINT64, priv->skipped,
      "dropped", G_TYPE_UINT64, priv->dropped, nullptr);
}

static void
gst_rig_calibrate_init (GstRigCalibrate *self)
{
  self->priv = new GstRigCalibratePrivate;
  g_object_set (self, "latency", kLatency, nullptr);
}

static void
gst_rig_calibrate_class_init (GstRigCalibrateClass *klass)
{
  auto object_class = G_OBJECT_CLASS (klass);
  auto element_class = GST_ELEMENT_CLASS (klass);
  auto aggregator_class = GST_AGGREGATOR_CLASS (klass);

  GST_DEBUG_CATEGORY_INIT (gst_rig_calibrate_debug, "rigcalibrate", 0, "Rig calibration");

  object_class->finalize = delete_private<GstRigCalibrate>;
  install_properties<GstRigCalibrate, rig_calibrate_properties, make_stats> (
      object_class, "Counters since the element was started: examined, taken, skipped, dropped");

  gst_element_class_add_static_pad_template_with_gtype (
      element_class, &sink_template, GST_TYPE_RIG_CALIBRATE_PAD);
  gst_element_class_add_static_pad_template_with_gtype (
      element_class, &src_template, GST_TYPE_AGGREGATOR_PAD);
  gst_element_class_set_static_metadata (element_class, "Rig calibration", "Analyzer/Video",
      "Calibrates cameras, stereo pairs and their poses from images of a calibration board",
      "gst-rangecast");
  gst_type_mark_as_plugin_api (GST_TYPE_RIG_CALIBRATE_PAD, GstPluginAPIFlags (0));

  element_class->change_state = GST_DEBUG_FUNCPTR (gst_rig_calibrate_change_state);
  announce_pads (element_class);
  element_class->release_pad = GST_DEBUG_FUNCPTR (gst_rig_calibrate_release_pad);

  aggregator_class->create_new_pad = GST_DEBUG_FUNCPTR (gst_rig_calibrate_create_new_pad);
  aggregator_class->start = GST_DEBUG_FUNCPTR (gst_rig_calibrate_start);
  aggregator_class->flush = GST_DEBUG_FUNCPTR (gst_rig_calibrate_flush);
  aggregator_class->propose_allocation = GST_DEBUG_FUNCPTR (propose_video_meta);
  aggregator_class->stop = GST_DEBUG_FUNCPTR (gst_rig_calibrate_stop);
  aggregator_class->sink_event = GST_DEBUG_FUNCPTR (gst_rig_calibrate_sink_event);
  aggregator_class->update_src_caps = GST_DEBUG_FUNCPTR (keep_src_caps);
  aggregator_class->get_next_time = GST_DEBUG_FUNCPTR (gst_rig_calibrate_get_next_time);
  aggregator_class->clip = GST_DEBUG_FUNCPTR (gstrange::clip_to_segment);
  aggregator_class->aggregate = aggregate_to_the_end<gst_rig_calibrate_aggregate>;
}
