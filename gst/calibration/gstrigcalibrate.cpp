/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-rigcalibrate
 * @title: rigcalibrate
 *
 * Calibrates any number of cameras, stereo pairs and their poses from images of a chessboard or
 * ChArUco board. Selects frames automatically, reports in element messages which camera saw the
 * board and what is still missing, and writes the rig file at EOS or on the action signal
 * #GstRigCalibrate::calibrate.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 -m rigcalibrate name=c location=rig.yaml columns=9 rows=6 square-size=0.025
 * sink_0::view=0 sink_1::view=0 sink_1::role=right ! videoconvert ! autovideosink
 * multifilesrc location=left%02d.jpg index=1 caps=image/jpeg,framerate=1/1 ! jpegdec ! c.sink_0
 * multifilesrc location=right%02d.jpg index=1 caps=image/jpeg,framerate=1/1 ! jpegdec ! c.sink_1
 * ]|
 *
 * Since: 0.1
 */
#include "gstrigcalibrate.h"

#include "backgroundjobs.hpp"
#include "common/bufferpools.hpp"
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

enum : guint { PROP_STATS = 1, PROP_SETTINGS };
enum { SIGNAL_CALIBRATE, SIGNAL_RESET, LAST_SIGNAL };
static guint signals[LAST_SIGNAL];

/* Pictures that come faster are a film, not photographs; per second. */
static constexpr int kFastestPhotographs = 2;

struct GstRigCalibratePrivate {
  std::mutex lock; /* guards what follows; never held across a push, message or job */
  CalibrationProperties properties;
  CalibrationSources cameras;
  guint64 examined = 0, taken = 0, skipped = 0, dropped = 0;
  GstBuffer *still = nullptr; /* drawn and not pushed yet */
  TileLayout still_layout;
  GstClockTime still_capture = 0;
  Status failure;        /* of what a job did last */
  bool finished = false; /* calibrated, and nothing more is wanted */
  bool stale = true;     /* frames were taken since the last calibration */

  BackgroundJobs jobs; /* in which the board is looked for and all is calibrated */

  /* jobs only, and while there are none */
  rangecast::CalibrationSession session;
  RecycledBytes stills;

  /* streaming thread only */
  bool begin = true;
  guint64 sets = 0;
  TileLayout layout; /* of the caps */
};

struct _GstRigCalibrate {
  GstAggregator parent;
  GstRigCalibratePrivate *priv;
};

static GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE ("sink_%u", GST_PAD_SINK,
    GST_PAD_REQUEST, GST_STATIC_CAPS (GST_VIDEO_CAPS_MAKE (GST_VIDEO_FORMATS_ALL)));
static GstStaticPadTemplate src_template = GST_STATIC_PAD_TEMPLATE (
    "src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS (GST_VIDEO_CAPS_MAKE ("RGBx")));

static void gst_rig_calibrate_child_proxy_init (gpointer iface, gpointer data);

G_DEFINE_TYPE_WITH_CODE (GstRigCalibrate, gst_rig_calibrate, GST_TYPE_AGGREGATOR,
    G_IMPLEMENT_INTERFACE (GST_TYPE_CHILD_PROXY, gst_rig_calibrate_child_proxy_init))
GST_ELEMENT_REGISTER_DEFINE (rigcalibrate, "rigcalibrate", GST_RANK_NONE, GST_TYPE_RIG_CALIBRATE)

static CalibrationSources
current_cameras (GstRigCalibrate *self)
{
  std::lock_guard guard (self->priv->lock);
  return self->priv->cameras;
}

static CalibrationProperties
current_properties (GstRigCalibrate *self)
{
  std::lock_guard guard (self->priv->lock);
  return self->priv->properties;
}

/* ---- jobs ---- */

/* From frames to the rig file and the result message. */
static Status
calibrate (GstRigCalibrate *self, std::stop_token stop)
{
  GstRigCalibratePrivate *priv = self->priv;
  const std::string location = current_properties (self).location;
  rangecast::CalibrationResult result;
  Status status = {StatusCode::kNotFound, "there were no images to calibrate from"};
  if (!priv->session.cameras ().empty ())
    status = priv->session.calibrate (result, std::move (stop));
  if (status.ok ()) {
    if (!location.empty ())
      status = rangecast::save_rig (location, result.rig); /* the message has the rig anyway */
    for (const std::string &warning : result.warnings)
      gst_range_post_warning (GST_ELEMENT (self), {StatusCode::kBadValue, warning});
    post_result (GST_ELEMENT (self), priv->session, result,
        location.empty () || !status.ok () ? nullptr : location.c_str ());
  }
  std::lock_guard guard (priv->lock);
  priv->stale = !status.ok ();
  return status;
}

/* Nobody wants to hear of what was interrupted. */
static void
warn (GstRigCalibrate *self, const Status &status)
{
  if (status.code () != StatusCode::kInterrupted)
    gst_range_post_warning (GST_ELEMENT (self), status);
}

/* Draws what was found, for the streaming thread to push. */
static void
draw_still (GstRigCalibrate *self, const CalibrationPictures &set,
    const MappedCalibrationPictures &pictures)
{
  GstRigCalibratePrivate *priv = self->priv;
  const TileLayout layout = rangecast::lay_out (set.described, set.tile_width);
  const gsize size = gsize (layout.width ()) * layout.height () * 4;
  GstBuffer *still = priv->stills.acquire (GST_ELEMENT (self), size, "the still picture");
  GstMapInfo map;
  if (!still)
    return;
  if (gst_buffer_map (still, &map, GST_MAP_WRITE)) {
    priv->session.draw (
        pictures.views, {reinterpret_cast<rangecast::Rgbx *> (map.data), layout.width (),
                            layout.height (), layout.width () * 4});
    gst_buffer_unmap (still, &map);
  }
  std::lock_guard guard (priv->lock);
  gst_clear_buffer (&priv->still);
  priv->still = still;
  priv->still_layout = layout;
  priv->still_capture = set.capture;
}

/* @param[out] taken  whether the pictures were kept */
static Status
examine (GstRigCalibrate *self, CalibrationPictures &set, bool &taken)
{
  GstRigCalibratePrivate *priv = self->priv;
  if (set.begin)
    if (Status s = priv->session.set (*set.begin); !s.ok ())
      return s;
  const MappedCalibrationPictures pictures (set);
  if (!pictures.status.ok ())
    return pictures.status;
  if (Status s = priv->session.examine (set.described, pictures.views, set.capture, set.number);
      !s.ok ())
    return s;
  taken = priv->session.verdict () == rangecast::FrameVerdict::kTaken;
  {
    std::lock_guard guard (priv->lock);
    priv->examined++;
    priv->taken += taken;
    priv->stale |= taken;
  }
  draw_still (self, set, pictures);
  for (std::size_t i = 0; i < set.buffers.size (); i++)
    if (set.buffers[i])
      post_board (GST_ELEMENT (self), priv->session, int (i), set.number, set.running);
  if (taken)
    post_coverage (GST_ELEMENT (self), priv->session);
  return {};
}

/* Coverage that is complete ends the stream: with the rig, or with the error that says why not. */
static void
examine_job (GstRigCalibrate *self, CalibrationPictures &set, std::stop_token stop)
{
  GstRigCalibratePrivate *priv = self->priv;
  bool taken = false, finished = false;
  Status status = examine (self, set, taken);
  if (status.ok () && taken && set.auto_finish && priv->session.complete ()) {
    status = calibrate (self, std::move (stop));
    finished = status.ok ();
  }
  std::lock_guard guard (priv->lock);
  if (priv->failure.ok () && status.code () != StatusCode::kInterrupted) /* the first one counts */
    priv->failure = std::move (status);
  priv->finished |= finished;
}

/* ---- action signals, from any thread ---- */

static void
gst_rig_calibrate_calibrate (GstRigCalibrate *self)
{
  self->priv->jobs.post (
      [self] (std::stop_token stop) { warn (self, calibrate (self, std::move (stop))); });
}

static void
gst_rig_calibrate_reset (GstRigCalibrate *self)
{
  self->priv->jobs.post ([self] (const std::stop_token &) {
    self->priv->session.clear ();
    std::lock_guard guard (self->priv->lock);
    self->priv->examined = self->priv->taken = 0;
    self->priv->stale = true;
  });
}

/* ---- output ---- */

static GstFlowReturn
gst_rig_calibrate_update_src_caps (GstAggregator *, GstCaps *, GstCaps **)
{
  return GST_AGGREGATOR_FLOW_NEED_DATA; /* caps are set with each picture, see push_still() */
}

/* Pushes what was drawn last, with the time at which it goes: live, it was drawn of older pictures.
 */
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
  if (!gst_pad_is_linked (aggregator->srcpad)) { /* nobody looks */
    gst_buffer_unref (still);
    return GST_FLOW_OK;
  }
  if (layout.width () != priv->layout.width () || layout.height () != priv->layout.height ()) {
    GstVideoInfo info;
    gst_video_info_set_format (
        &info, GST_VIDEO_FORMAT_RGBx, guint (layout.width ()), guint (layout.height ()));
    GstCaps *caps = gst_video_info_to_caps (&info);
    gst_aggregator_set_src_caps (aggregator, caps);
    gst_caps_unref (caps);
    priv->layout = layout;
  }
  gstrange::stamp (aggregator, still, running, GST_CLOCK_TIME_NONE, capture);
  return gst_aggregator_finish_buffer (aggregator, still);
}

/* ---- streaming ---- */

/* What the first pictures say: whether the cameras make up views, and what to keep. */
static Status
begin (GstRigCalibrate *self, CalibrationPictures &set, const CalibrationProperties &p, bool live)
{
  if (Status s = rangecast::check_cameras (set.described, p.core.board); !s.ok ())
    return s;
  bool film = live;
  for (const GstVideoInfo &info : set.infos)
    film |= info.fps_n > kFastestPhotographs * std::max (info.fps_d, 1);
  rangecast::SessionSettings settings;
  settings.calibration = p.core;
  settings.selection.max_frames = p.max_frames;
  settings.selection.all = p.selection == CalibrationSelection::kAll ||
                           (p.selection == CalibrationSelection::kAuto && !film);
  settings.thorough = !film;
  set.begin = settings;
  self->priv->begin = false;
  return {};
}

/* Live, pictures that come while the last ones are looked at go unseen; else they wait. */
static GstFlowReturn
hand_over (GstRigCalibrate *self, std::shared_ptr<CalibrationPictures> set, bool live)
{
  GstRigCalibratePrivate *priv = self->priv;
  const CalibrationProperties p = current_properties (self);
  const GstClockTime running = set->running;
  if (live && !priv->jobs.idle ()) {
    std::lock_guard guard (priv->lock);
    priv->skipped++;
    return GST_FLOW_OK;
  }
  if (priv->begin)
    if (Status s = begin (self, *set, p, live); !s.ok ())
      return gst_range_flow_return (GST_ELEMENT (self), s);
  set->tile_width = p.tile_width;
  set->auto_finish = p.auto_finish;
  priv->jobs.post (
      [self, set] (std::stop_token stop) { examine_job (self, *set, std::move (stop)); });
  set.reset ();
  if (!live && !priv->jobs.wait_until_idle ())
    return GST_FLOW_OK; /* flushing or stopping: not for us to say, the base class knows */
  Status failure;
  {
    std::lock_guard guard (priv->lock);
    failure = priv->failure;
  }
  const GstFlowReturn flow = gst_range_flow_return (GST_ELEMENT (self), failure);
  return flow == GST_FLOW_OK ? push_still (self, running) : flow;
}

/* A camera of which nothing is known yet, or null. */
static const CalibrationSource *
without_caps (const CalibrationSources &cameras)
{
  const auto found = std::ranges::find_if (cameras, [] (const auto &c) { return !c->has_info; });
  return found == cameras.end () ? nullptr : found->get ();
}

/* Why there is nothing to calibrate from, if so. */
static Status
nothing_came (GstRigCalibrate *self, const CalibrationSources &cameras)
{
  if (self->priv->sets > 0)
    return {};
  if (const CalibrationSource *camera = without_caps (cameras))
    return {StatusCode::kNotFound, "pad " + calibration_camera (camera->pad).name +
                                       ": no images arrived; expected some on every pad"};
  return {StatusCode::kNotFound,
      "no images with matching times arrived on all pads; expected capture "
      "times that differ by less than half a frame, or by max-skew"};
}

/* All pads have ended: calibrates, unless that was done already. */
static GstFlowReturn
finish (GstRigCalibrate *self, const CalibrationSources &cameras)
{
  GstRigCalibratePrivate *priv = self->priv;
  if (!priv->jobs.wait_until_idle ())
    return GST_AGGREGATOR_FLOW_NEED_DATA;
  Status status;
  bool stale;
  {
    std::lock_guard guard (priv->lock);
    status = priv->failure;
    stale = priv->stale;
  }
  if (status.ok ())
    status = nothing_came (self, cameras);
  if (status.ok () && stale) {
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
  const CalibrationSources cameras = current_cameras (self);
  if (std::ranges::any_of (cameras, [] (const auto &camera) { return camera->refused; }))
    return GST_FLOW_ERROR;
  const bool live = gst_aggregator_get_latency (aggregator) != GST_CLOCK_TIME_NONE;
  const CalibrationFronts fronts (cameras, live);
  if (fronts.list.empty () && fronts.missing == 0 && fronts.ended > 0)
    return finish (self, cameras);
  if (fronts.list.empty () || (fronts.missing > 0 && !timeout))
    return GST_AGGREGATOR_FLOW_NEED_DATA;
  const GstClockTime tolerance =
      calibration_tolerance (cameras, current_properties (self).max_skew);
  guint64 dropped = 0;
  if (drop_unmatched (cameras, fronts, tolerance, dropped)) {
    std::lock_guard guard (priv->lock);
    priv->dropped += dropped;
    return GST_AGGREGATOR_FLOW_NEED_DATA; /* come again with what is behind them */
  }
  return hand_over (self, take_pictures (cameras, fronts, priv->sets++), live);
}

/* The deadline for a camera that is late counts from the oldest picture that waits. */
static GstClockTime
gst_rig_calibrate_get_next_time (GstAggregator *aggregator)
{
  GstClockTime oldest = GST_CLOCK_TIME_NONE;
  const CalibrationFronts fronts (current_cameras (GST_RIG_CALIBRATE (aggregator)), true);
  for (const CalibrationFronts::Front &front : fronts.list)
    oldest = std::min (oldest, front.running);
  return oldest;
}

/* Corners of two sizes do not make one camera. */
static Status
take_caps (GstRigCalibrate *self, CalibrationSource &camera, GstCaps *caps)
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
  if (begun && camera.has_info &&
      (info.width != camera.info.width || info.height != camera.info.height))
    return {StatusCode::kBadSize, "pad " + name + ": images changed from " +
                                      size_text (camera.info.width, camera.info.height) + " to " +
                                      size_text (info.width, info.height) +
                                      "; expected one size throughout a calibration"};
  camera.info = info;
  camera.has_info = true;
  return {};
}

/* What waits for a job must not hold up a flush. */
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
                            GST_ELEMENT (self), take_caps (self, *camera, caps)) != GST_FLOW_OK;
      if (camera->refused) {
        gst_event_unref (event);
        return FALSE;
      }
    }
  }
  return GST_AGGREGATOR_CLASS (gst_rig_calibrate_parent_class)->sink_event (aggregator, pad, event);
}

/* ---- request pads ---- */

static GstPad *
gst_rig_calibrate_request_new_pad (
    GstElement *element, GstPadTemplate *pad_template, const gchar *name, const GstCaps *caps)
{
  auto self = GST_RIG_CALIBRATE (element);
  GstPad *pad = GST_ELEMENT_CLASS (gst_rig_calibrate_parent_class)
                    ->request_new_pad (element, pad_template, name, caps);
  if (!pad)
    return nullptr;
  unsigned number = 0;
  if (sscanf (GST_PAD_NAME (pad), "sink_%u", &number) == 1)
    set_default_view (
        GST_RIG_CALIBRATE_PAD (pad), int (std::min<unsigned> (number, rangecast::kMaxViews - 1)));
  {
    std::lock_guard guard (self->priv->lock);
    self->priv->cameras.push_back (
        std::make_shared<CalibrationSource> (GST_RIG_CALIBRATE_PAD (pad)));
  }
  gst_child_proxy_child_added (GST_CHILD_PROXY (element), G_OBJECT (pad), GST_PAD_NAME (pad));
  return pad;
}

/* A camera that goes takes all frames with it: their numbers of cameras would be wrong. */
static void
gst_rig_calibrate_release_pad (GstElement *element, GstPad *pad)
{
  auto self = GST_RIG_CALIBRATE (element);
  {
    std::lock_guard guard (self->priv->lock);
    std::erase_if (self->priv->cameras,
        [&] (const auto &camera) { return GST_PAD (camera->aggregator_pad ()) == pad; });
  }
  gst_rig_calibrate_reset (self);
  gst_child_proxy_child_removed (GST_CHILD_PROXY (element), G_OBJECT (pad), GST_PAD_NAME (pad));
  GST_ELEMENT_CLASS (gst_rig_calibrate_parent_class)->release_pad (element, pad);
}

static GObject *
gst_rig_calibrate_get_child_by_index (GstChildProxy *proxy, guint index)
{
  const CalibrationSources cameras = current_cameras (GST_RIG_CALIBRATE (proxy));
  return index < cameras.size () ? G_OBJECT (gst_object_ref (cameras[index]->pad)) : nullptr;
}

static guint
gst_rig_calibrate_get_children_count (GstChildProxy *proxy)
{
  return guint (current_cameras (GST_RIG_CALIBRATE (proxy)).size ());
}

static void
gst_rig_calibrate_child_proxy_init (gpointer iface, gpointer)
{
  auto proxy = static_cast<GstChildProxyInterface *> (iface);
  proxy->get_child_by_index = gst_rig_calibrate_get_child_by_index;
  proxy->get_children_count = gst_rig_calibrate_get_children_count;
}

/* ---- life ---- */

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
  const CalibrationProperties p = current_properties (self);
  rangecast::SessionSettings settings;
  settings.calibration = p.core;
  settings.selection.max_frames = p.max_frames;
  Status status;
  if (!p.location.empty ()) /* before minutes of work are lost */
    status = rangecast::check_output_path (p.location, rangecast::kRigExtensions);
  if (status.ok ())
    status = priv->session.set (settings);
  if (gst_range_flow_return (GST_ELEMENT (self), status) != GST_FLOW_OK)
    return FALSE;
  priv->begin = true;
  priv->sets = 0;
  priv->layout = {};
  {
    std::lock_guard guard (priv->lock);
    priv->examined = priv->taken = priv->skipped = priv->dropped = 0;
    priv->failure = {};
    priv->finished = false;
    priv->stale = true;
    for (const auto &camera : priv->cameras)
      camera->has_info = camera->refused = false;
  }
  priv->jobs.start ();
  return TRUE;
}

static gboolean
gst_rig_calibrate_stop (GstAggregator *aggregator)
{
  GstRigCalibratePrivate *priv = GST_RIG_CALIBRATE (aggregator)->priv;
  priv->jobs.stop ();
  priv->session.clear ();
  for (const auto &camera : current_cameras (GST_RIG_CALIBRATE (aggregator))) {
    camera->reader.reset ();
    camera->reader_set = false;
  }
  GstBuffer *still;
  {
    std::lock_guard guard (priv->lock);
    still = priv->still;
    priv->still = nullptr;
  }
  gst_clear_buffer (&still);
  priv->stills.drop ();
  return TRUE;
}

/* A calibration can take long; its thread must end before the pads can. */
static GstStateChangeReturn
gst_rig_calibrate_change_state (GstElement *element, GstStateChange transition)
{
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY)
    GST_RIG_CALIBRATE (element)->priv->jobs.interrupt ();
  return GST_ELEMENT_CLASS (gst_rig_calibrate_parent_class)->change_state (element, transition);
}

static void
gst_rig_calibrate_set_property (GObject *object, guint id, const GValue *value, GParamSpec *pspec)
{
  GstRigCalibratePrivate *priv = GST_RIG_CALIBRATE (object)->priv;
  std::lock_guard guard (priv->lock);
  if (!calibration_properties ().set (priv->properties, id, value))
    G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
}

static void
gst_rig_calibrate_get_property (GObject *object, guint id, GValue *value, GParamSpec *pspec)
{
  GstRigCalibratePrivate *priv = GST_RIG_CALIBRATE (object)->priv;
  std::lock_guard guard (priv->lock);
  if (id == PROP_STATS)
    g_value_take_boxed (
        value, gst_structure_new ("application/x-rigcalibrate-stats", "examined", G_TYPE_UINT64,
                   priv->examined, "taken", G_TYPE_UINT64, priv->taken, "skipped", G_TYPE_UINT64,
                   priv->skipped, "dropped", G_TYPE_UINT64, priv->dropped, nullptr));
  else if (!calibration_properties ().get (priv->properties, id, value))
    G_OBJECT_WARN_INVALID_PROPERTY_ID (object, id, pspec);
}

static void
gst_rig_calibrate_finalize (GObject *object)
{
  delete GST_RIG_CALIBRATE (object)->priv;
  G_OBJECT_CLASS (gst_rig_calibrate_parent_class)->finalize (object);
}

static void
gst_rig_calibrate_init (GstRigCalibrate *self)
{
  self->priv = new GstRigCalibratePrivate;
}

static void
install_signals (GstRigCalibrateClass *klass)
{
  /**
   * GstRigCalibrate::calibrate:
   *
   * Calibrates from the frames so far, in the background; ends in a rigcalibrate-result message or
   * a warning. The stream goes on.
   */
  signals[SIGNAL_CALIBRATE] = g_signal_new_class_handler ("calibrate", G_TYPE_FROM_CLASS (klass),
      GSignalFlags (G_SIGNAL_RUN_LAST | G_SIGNAL_ACTION), G_CALLBACK (gst_rig_calibrate_calibrate),
      nullptr, nullptr, nullptr, G_TYPE_NONE, 0);
  /**
   * GstRigCalibrate::reset:
   *
   * Forgets all frames.
   */
  signals[SIGNAL_RESET] = g_signal_new_class_handler ("reset", G_TYPE_FROM_CLASS (klass),
      GSignalFlags (G_SIGNAL_RUN_LAST | G_SIGNAL_ACTION), G_CALLBACK (gst_rig_calibrate_reset),
      nullptr, nullptr, nullptr, G_TYPE_NONE, 0);
}

static void
gst_rig_calibrate_class_init (GstRigCalibrateClass *klass)
{
  auto object_class = G_OBJECT_CLASS (klass);
  auto element_class = GST_ELEMENT_CLASS (klass);
  auto aggregator_class = GST_AGGREGATOR_CLASS (klass);

  object_class->set_property = gst_rig_calibrate_set_property;
  object_class->get_property = gst_rig_calibrate_get_property;
  object_class->finalize = gst_rig_calibrate_finalize;
  calibration_properties ().install (object_class, PROP_SETTINGS);
  install_stats (object_class, PROP_STATS,
      "Counters since the element was started: examined, taken, skipped, dropped");
  install_signals (klass);

  gst_element_class_add_static_pad_template_with_gtype (
      element_class, &sink_template, GST_TYPE_RIG_CALIBRATE_PAD);
  gst_element_class_add_static_pad_template_with_gtype (
      element_class, &src_template, GST_TYPE_AGGREGATOR_PAD);
  gst_element_class_set_static_metadata (element_class, "Rig calibration", "Analyzer/Video",
      "Calibrates cameras, stereo pairs and their poses from images of a calibration board",
      "gst-rangecast");
  gst_type_mark_as_plugin_api (GST_TYPE_RIG_CALIBRATE_PAD, GstPluginAPIFlags (0));

  element_class->change_state = gst_rig_calibrate_change_state;
  element_class->request_new_pad = gst_rig_calibrate_request_new_pad;
  element_class->release_pad = gst_rig_calibrate_release_pad;

  aggregator_class->start = gst_rig_calibrate_start;
  aggregator_class->flush = gst_rig_calibrate_flush;
  aggregator_class->propose_allocation = propose_video_meta;
  aggregator_class->stop = gst_rig_calibrate_stop;
  aggregator_class->sink_event = gst_rig_calibrate_sink_event;
  aggregator_class->update_src_caps = gst_rig_calibrate_update_src_caps;
  aggregator_class->get_next_time = gst_rig_calibrate_get_next_time;
  aggregator_class->clip = gstrange::clip_to_segment;
  aggregator_class->aggregate = gst_rig_calibrate_aggregate;

  GST_DEBUG_CATEGORY_INIT (gst_rig_calibrate_debug, "rigcalibrate", 0, "Rig calibration");
}
