/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-roiextract
 * @title: roiextract
 *
 * Removes the background of range images by depth and colour and crops them to the foreground. The
 * background of each view is learnt from the first frames or on #GstRoiExtract::capture-background,
 * or loaded from a file. While learning, views have an empty ROI.
 *
 * ## Element messages
 * - `roiextract-learning` (`view-id`: int; `frames`, `of`: int, learnt so far and needed): when a
 *   view begins to learn its background, after each tenth of it, and when it has learnt it.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 avatartestsrc empty-frames=30 num-buffers=100 ! roiextract \
 *   background-frames=30 ! rangesplit name=s depth-map=turbo s.depth ! videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
#include "common/basetransform.hpp"
#include "common/elementproperties.hpp"

#include <array>
#include <atomic>
#include <gstrange/gstrangeframe.hpp>
#include <gstrange/gstrangeinfo.hpp>
#include <gstrange/gstrangestatus.hpp>
#include <memory>
#include <mutex>
#include <rangecast/base/output_path.hpp>
#include <rangecast/geometry/point_cloud.hpp>
#include <rangecast/geometry/size_text.hpp>
#include <rangecast/opencv/threads.hpp>
#include <rangecast/roi/background.hpp>
#include <rangecast/roi/bounding_box.hpp>
#include <rangecast/roi/segmentation.hpp>
#include <string>

using rangecast::BackgroundModel;
using rangecast::Cue;
using rangecast::RangeImage;
using rangecast::Roi;
using rangecast::Status;
using rangecast::StatusCode;
using rangecast::View;

#define GST_TYPE_ROI_EXTRACT (gst_roi_extract_get_type ())
G_DECLARE_FINAL_TYPE (GstRoiExtract, gst_roi_extract, GST, ROI_EXTRACT, GstBaseTransform)

GST_DEBUG_CATEGORY_STATIC (gst_roi_extract_debug);
#define GST_CAT_DEFAULT gst_roi_extract_debug

/* Data flow, in the order of this file: set_caps prepares a state for each view; transform_ip
 * segments all views in parallel and crops them, then, view by view, requests the region from
 * upstream and finishes learning. The background is learnt from the first frames, on
 * capture-background, or loaded in set_caps; it is saved when all views have learnt theirs, and
 * again at EOS. */

enum { SIGNAL_CAPTURE_BACKGROUND, N_SIGNALS };
static guint signals[N_SIGNALS];

namespace {

/* Minimum time between adaptations of the background, seconds; more often would make no visible
 * difference. */
constexpr double kMinAdaptInterval = 0.2;
/* Margin of the region requested from upstream around the foreground's bounding box, pixels. */
constexpr int kRequestMargin = 16;
/* Frames since learning that are nearly all foreground: nobody fills the picture from the start. */
constexpr int kSuspectFrames = 60;
/* Shares of the picture, and of its pixels with depth. Both must be exceeded: before a background
 * without texture, all pixels with depth may be those of the person. */
constexpr double kSuspectShare = 0.65, kSuspectShareOfDepth = 0.9;
/* Within a minute, people move the edges of the foreground, or its area. */
constexpr guint64 kStillNs = 60 * GST_SECOND;
constexpr double kStillPixels = 2, kStillShare = 0.02;

/** roiextract's properties. Guarded by the element's lock. */
struct RoiSettings {
  int background_frames = 30; ///< frames of the empty scene to learn the background from
  int settle_frames = 0;      ///< frames to skip before learning
  std::string background_file, save_background; ///< empty: none
  rangecast::SegmentationSettings segmentation;
  int margin = 0;           ///< around the foreground, pixels
  int n_threads = 0;        ///< 0 = one per core
  double adapt_time_s = 30; ///< seconds; 0 = never
};

/* One view of the stream. */
struct ViewState {
  BackgroundModel background;
  rangecast::Segmenter segmenter;
  bool learnt = false;
  int learning_target = 0; /* frames */
  int settled = 0;         /* frames skipped before learning */
  int reported = -1;       /* frames learnt when progress was last reported */
  int suspect = 0;         /* frames since learning, all foreground; < 0: there was another */
  bool warned = false;     /* of foreground that may be the room */
  Roi still;               /* the foreground's box at still_ns, about the same since */
  guint64 still_ns = 0;
  double still_points = 0;
  guint64 adapted_ns = 0; /* capture time of the frame of the last adaptation */
  int adapted_area = 0;   /* pixels of its ROI */
  Roi requested;          /* from upstream; empty: everything */

  /* results of the current frame */
  guint64 points_in = 0, points_out = 0;
  Roi box;
  Status status;
};

} // namespace

struct GstRoiExtractPrivate {
  std::mutex lock; /* guards settings up to last_roi; never held across a push, event or message */
  RoiSettings settings;
  guint64 frames = 0, points_in = 0, points_out = 0;
  Roi last_roi;

  StatsReporter reporter;           /* thread-safe */
  std::atomic<bool> relearn{false}; /* set by capture-background */

  /* streaming thread */
  gstrange::RangeInfo info;
  std::array<std::unique_ptr<ViewState>, rangecast::kMaxViews> views;
};

struct _GstRoiExtract {
  GstBaseTransform parent;
  GstRoiExtractPrivate *priv;
};

G_DEFINE_TYPE (GstRoiExtract, gst_roi_extract, GST_TYPE_BASE_TRANSFORM)
GST_ELEMENT_REGISTER_DEFINE (roiextract, "roiextract", GST_RANK_NONE, GST_TYPE_ROI_EXTRACT)

static void
begin_learning (ViewState &state, const View &view, int frames)
{
  state.background.reset (view.width, view.height);
  state.segmenter = {}; /* its estimate of the light refers to the old background */
  state.adapted_ns = 0;
  state.adapted_area = 0;
  state.learning_target = frames;
  state.learnt = false;
  state.reported = -1;
  state.suspect = 0;
  state.warned = false;
}

/* ---- caps ---- */

/* Creates a state for each view of the caps; views that keep their size keep their background.
 * Upstream drops region requests with new caps. */
static void
prepare_views (GstRoiExtractPrivate *priv, int background_frames)
{
  for (int id = 0; id < rangecast::kMaxViews; id++) {
    const View *view = priv->info.rig.find (id);
    auto &state = priv->views[id];
    if (!view) {
      state.reset ();
      continue;
    }
    if (!state)
      state = std::make_unique<ViewState> ();
    if (state->background.width () != view->width || state->background.height () != view->height)
      begin_learning (*state, *view, background_frames);
    state->requested = {};
  }
}

static bool
all_learnt (GstRoiExtractPrivate *priv)
{
  return std::ranges::all_of (
      priv->info.rig.views, [priv] (const View &view) { return priv->views[view.id]->learnt; });
}

static Status
load_background_file (GstRoiExtractPrivate *priv, const std::string &path)
{
  std::vector<std::pair<int, BackgroundModel>> loaded;
  if (Status s = rangecast::load_backgrounds (path, loaded); !s.ok ())
    return s;
  for (const View &view : priv->info.rig.views) {
    const auto found = std::ranges::find (loaded, view.id, &decltype (loaded)::value_type::first);
    if (found == loaded.end ())
      return {
          StatusCode::kNotFound, path + ": has no background of view " + std::to_string (view.id)};
    const BackgroundModel &model = found->second;
    if (model.width () != view.width || model.height () != view.height)
      return {StatusCode::kBadSize,
          path + ": the background of view " + std::to_string (view.id) + " is " +
              rangecast::size_text (model.width (), model.height ()) + ", but the caps say " +
              rangecast::size_text (view.width, view.height)};
    ViewState &state = *priv->views[view.id];
    state.background = std::move (found->second);
    state.learnt = true;
    state.suspect = 0;
  }
  return {};
}

static gboolean
gst_roi_extract_set_caps (GstBaseTransform *base, GstCaps *caps, GstCaps *)
{
  auto self = GST_ROI_EXTRACT (base);
  GstRoiExtractPrivate *priv = self->priv;
  const RoiSettings settings = settings_of (priv);
  Status status = gstrange::parse_caps (caps, priv->info);
  if (status.ok ()) {
    GST_INFO_OBJECT (self, "caps %" GST_PTR_FORMAT, caps);
    priv->reporter.set_views (priv->info.rig);
    prepare_views (priv, settings.background_frames);
    if (!settings.background_file.empty () && !all_learnt (priv))
      status = load_background_file (priv, settings.background_file);
    GST_DEBUG_OBJECT (
        self, "%s", all_learnt (priv) ? "background is known" : "learning background");
  }
  return gst_range_flow_return (GST_ELEMENT (self), status) == GST_FLOW_OK;
}

/* ---- segmentation ---- */

/* Adapts the background to slow changes outside of the foreground: at intervals, and to every frame
 * with a larger ROI than the last one, because stereodepth matches full images only now and then.
 */
static void
adapt_background (ViewState &state, const RangeImage &image, double adapt_time_s)
{
  const guint64 now = image.capture_time_ns;
  if (state.adapted_ns == 0 || now < state.adapted_ns)
    state.adapted_ns = now;
  const double passed = double (now - state.adapted_ns) * 1e-9;
  const int area = image.roi.width * image.roi.height;
  if (adapt_time_s <= 0 || area == 0 || (passed < kMinAdaptInterval && area <= state.adapted_area))
    return;
  state.adapted_ns = now;
  state.adapted_area = area;
  const cv::Mat &quiet = state.segmenter.quiet ();
  state.background.adapt (image,
      {quiet.data, quiet.cols, quiet.rows, static_cast<std::ptrdiff_t> (quiet.step)},
      state.segmenter.light (), adapt_time_s);
}

static void
process_view (
    ViewState &state, const View &view, const RangeImage &image, const RoiSettings &settings)
{
  state.points_in = rangecast::count_points (image);
  state.points_out = 0;
  state.box = {};
  if (!state.learnt) {
    state.status = {};
    if (state.settled < settings.settle_frames)
      state.settled++;
    else
      state.status = state.background.learn (image);
    return;
  }
  state.status =
      state.segmenter.decide (image, state.background, view.depth_unit_m, settings.segmentation);
  if (!state.status.ok ())
    return;
  adapt_background (state, image, settings.adapt_time_s);
  state.status =
      state.segmenter.clear (image, state.background, view.depth_unit_m, settings.segmentation);
  if (!state.status.ok ())
    return;
  state.points_out = rangecast::count_points (image);
  state.box = rangecast::bounding_box (image, settings.margin);
}

/* Segments and crops all views of a frame set. */
static Status
process_frame (GstRoiExtract *self, gstrange::RangeFrameMap &frame, const RoiSettings &settings)
{
  GstRoiExtractPrivate *priv = self->priv;
  const auto images = frame.views ();
  if (Status s = frame.status (); !s.ok ())
    return s;
  for (const RangeImage &image : images)
    if (!priv->views[image.view_id])
      return {StatusCode::kNotFound, "range buffer: view " + std::to_string (image.view_id) +
                                         " is not in the rig of the caps"};
  rangecast::in_parallel_with_opencv (images.size (), settings.n_threads, [&] (std::size_t i) {
    process_view (*priv->views[images[i].view_id], *priv->info.rig.find (images[i].view_id),
        images[i], settings);
  });
  for (std::size_t i = 0; i < images.size (); i++) {
    const ViewState &state = *priv->views[images[i].view_id];
    if (!state.status.ok ())
      return state.status;
    frame.crop (i, state.box);
  }
  return {};
}

/* ---- requests to upstream ---- */

/* An empty ROI requests the full image. */
static void
push_roi_event (GstRoiExtract *self, int view_id, const Roi &roi)
{
  GstStructure *structure = gst_structure_new ("GstRangeRoi", "view-id", G_TYPE_UINT,
      guint (view_id), "x", G_TYPE_UINT, guint (roi.x), "y", G_TYPE_UINT, guint (roi.y), "width",
      G_TYPE_UINT, guint (roi.width), "height", G_TYPE_UINT, guint (roi.height), nullptr);
  GST_DEBUG_OBJECT (
      self, "view %d: requesting %dx%d at (%d, %d)", view_id, roi.width, roi.height, roi.x, roi.y);
  gst_pad_push_event (GST_BASE_TRANSFORM_SINK_PAD (self),
      gst_event_new_custom (GST_EVENT_CUSTOM_UPSTREAM, structure));
}

/* Requests the foreground's bounding box with a margin from upstream (stereodepth), if it does not
 * fit the region requested before. Upstream gives nothing outside of that region, so a growing box
 * is requested before it reaches an edge that is not the image's. */
static void
request_roi (GstRoiExtract *self, ViewState &state, int view_id)
{
  const Roi &box = state.box, &now = state.requested;
  const View *full = self->priv->info.rig.find (view_id);
  constexpr int kNear = kRequestMargin / 2;
  const int right = now.x + now.width, bottom = now.y + now.height;
  const bool inside = !now.empty () && (now.x == 0 || box.x >= now.x + kNear) &&
                      (now.y == 0 || box.y >= now.y + kNear) &&
                      (right >= full->width || box.x + box.width <= right - kNear) &&
                      (bottom >= full->height || box.y + box.height <= bottom - kNear);
  const bool fits =
      now.width <= box.width + 3 * kRequestMargin && now.height <= box.height + 3 * kRequestMargin;
  if (box.empty () ? now.empty () : inside && fits)
    return;
  Roi roi;
  if (!box.empty ()) {
    roi.x = std::max (0, box.x - kRequestMargin);
    roi.y = std::max (0, box.y - kRequestMargin);
    roi.width = std::min (full->width, box.x + box.width + kRequestMargin) - roi.x;
    roi.height = std::min (full->height, box.y + box.height + kRequestMargin) - roi.y;
  }
  state.requested = roi;
  push_roi_event (self, view_id, roi);
}

/* ---- after each frame set ---- */

static Status
check_save_path (const std::string &path)
{
  static constexpr std::string_view kExtensions[] = {".yml", ".yaml"};
  return path.empty () ? Status () : rangecast::check_output_path (path, kExtensions);
}

static void
save_when_all_learnt (GstRoiExtract *self, const std::string &path)
{
  if (path.empty () || !all_learnt (self->priv))
    return;
  std::vector<std::pair<int, const BackgroundModel *>> models;
  for (const View &view : self->priv->info.rig.views)
    models.emplace_back (view.id, &self->priv->views[view.id]->background);
  Status status = check_save_path (path);
  if (status.ok ())
    status = rangecast::save_backgrounds (path, models);
  if (status.ok ())
    GST_DEBUG_OBJECT (self, "saved the background to %s", path.c_str ());
  gst_range_post_warning (GST_ELEMENT (self), status);
}

/* Of a view whose stream was too short to learn a background, so that only empty ROIs of it were
 * output. A camera that sent nothing matters only for the file. */
static void
warn_if_not_learnt (GstRoiExtract *self, const RoiSettings &settings)
{
  const std::string &file = settings.save_background;
  for (const View &view : self->priv->info.rig.views) {
    const ViewState &state = *self->priv->views[view.id];
    const int frames = state.background.frames ();
    if (state.learnt || (frames + state.settled == 0 && file.empty ()))
      continue;
    gst_range_post_warning (GST_ELEMENT (self),
        {StatusCode::kNotFound, (file.empty () ? "" : file + ": not written: ") + "view " +
                                    std::to_string (view.id) + " ended after " +
                                    std::to_string (frames) +
                                    " frames of the background, but background-frames is " +
                                    std::to_string (settings.background_frames)});
    return;
  }
}

static void
relearn_all (GstRoiExtract *self, int frames)
{
  GST_DEBUG_OBJECT (self, "learning background");
  for (const View &view : self->priv->info.rig.views) {
    ViewState &state = *self->priv->views[view.id];
    begin_learning (state, view, frames);
    if (!state.requested.empty ())
      push_roi_event (self, view.id, {}); /* to see the whole background */
    state.requested = {};
  }
}

static void
report_learning (GstRoiExtract *self, ViewState &state, int view_id)
{
  const int frames = state.background.frames (), step = std::max (state.learning_target / 10, 1);
  if (state.reported >= 0 && frames < state.reported + step && frames < state.learning_target)
    return;
  state.reported = frames;
  gst_element_post_message (GST_ELEMENT (self),
      gst_message_new_element (GST_OBJECT (self),
          gst_structure_new ("roiextract-learning", "view-id", G_TYPE_INT, view_id, "frames",
              G_TYPE_INT, frames, "of", G_TYPE_INT, state.learning_target, nullptr)));
}

/* Warns once of foreground that may be the room: nearly all since learning, or what never moves. */
static void
check_foreground (GstRoiExtract *self, ViewState &state, int view_id, guint64 now_ns)
{
  const Roi &box = state.box, &was = state.still;
  const double pixels = double (state.background.width ()) * double (state.background.height ()),
               points = double (state.points_out);
  const int moved = std::abs (box.x - was.x) + std::abs (box.y - was.y) +
                    std::abs (box.width - was.width) + std::abs (box.height - was.height);
  if (box.empty () || now_ns < state.still_ns || moved > kStillPixels ||
      std::abs (points - state.still_points) > kStillShare * points) {
    state.still = box;
    state.still_ns = now_ns;
    state.still_points = points;
  }
  if (points < kSuspectShare * pixels || points < kSuspectShareOfDepth * double (state.points_in))
    state.suspect = G_MININT;
  state.suspect++;
  if (state.warned || (state.suspect < kSuspectFrames && now_ns - state.still_ns < kStillNs))
    return;
  state.warned = true;
  gst_range_post_warning (GST_ELEMENT (self),
      {StatusCode::kBadData,
          "view " + std::to_string (view_id) + ": " + rangecast::size_text (box.width, box.height) +
              " pixels at " + std::to_string (box.x) + ", " + std::to_string (box.y) +
              " are foreground all the time; if nobody is there, learn the background again with "
              "capture-background"});
}

static void
after_frame (GstRoiExtract *self, const gstrange::RangeFrameMap &frame, const RoiSettings &settings)
{
  GstRoiExtractPrivate *priv = self->priv;
  bool learnt_now = false;
  guint64 points_in = 0, points_out = 0;
  for (const RangeImage &image : frame.views ()) {
    ViewState &state = *priv->views[image.view_id];
    points_in += state.points_in;
    points_out += state.points_out;
    GST_LOG_OBJECT (self,
        "view %d: %" G_GUINT64_FORMAT " of %" G_GUINT64_FORMAT " points are foreground, ROI %dx%d",
        image.view_id, state.points_out, state.points_in, state.box.width, state.box.height);
    if (state.learnt) {
      request_roi (self, state, image.view_id);
      check_foreground (self, state, image.view_id, image.capture_time_ns);
      continue;
    }
    report_learning (self, state, image.view_id);
    if (state.background.frames () >= state.learning_target) {
      state.background.finish ();
      state.learnt = learnt_now = true;
      GST_DEBUG_OBJECT (self, "view %d: background learnt from %d frames", image.view_id,
          state.background.frames ());
    }
  }
  if (learnt_now)
    save_when_all_learnt (self, settings.save_background);
  std::lock_guard guard (priv->lock);
  priv->frames++;
  priv->points_in += points_in;
  priv->points_out += points_out;
  if (!frame.views ().empty ())
    priv->last_roi = frame.views ()[0].roi;
}

static GstFlowReturn
gst_roi_extract_transform_ip (GstBaseTransform *base, GstBuffer *buffer)
{
  auto self = GST_ROI_EXTRACT (base);
  sync_controlled_values (base, buffer);
  const RoiSettings settings = settings_of (self->priv);
  if (self->priv->relearn.exchange (false))
    relearn_all (self, settings.background_frames);
  gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
  const Status status = process_frame (self, frame, settings);
  if (status.ok ())
    after_frame (self, frame, settings);
  self->priv->reporter.passed (GST_ELEMENT (self), buffer);
  return gst_range_flow_return (GST_ELEMENT (self), status);
}

/* At EOS, the adapted background is saved again. */
static gboolean
gst_roi_extract_sink_event (GstBaseTransform *base, GstEvent *event)
{
  auto self = GST_ROI_EXTRACT (base);
  if (GST_EVENT_TYPE (event) == GST_EVENT_EOS && !self->priv->info.rig.views.empty ()) {
    const RoiSettings settings = settings_of (self->priv);
    warn_if_not_learnt (self, settings);
    if (settings.adapt_time_s > 0)
      save_when_all_learnt (self, settings.save_background);
  }
  if (GST_EVENT_TYPE (event) == GST_EVENT_EOS)
    self->priv->reporter.finish ();
  return GST_BASE_TRANSFORM_CLASS (gst_roi_extract_parent_class)->sink_event (base, event);
}

/* ---- lifecycle ---- */

static std::vector<StatsRow>
collect_stats (GstElement *element)
{
  GstRoiExtractPrivate *priv = GST_ROI_EXTRACT (element)->priv;
  std::lock_guard guard (priv->lock);
  return {{.counters = {.frames = priv->frames, .points = priv->points_out}}};
}

static gboolean
gst_roi_extract_start (GstBaseTransform *base)
{
  GstRoiExtractPrivate *priv = GST_ROI_EXTRACT (base)->priv;
  const Status status = check_save_path (settings_of (priv).save_background);
  if (gst_range_flow_return (GST_ELEMENT (base), status) != GST_FLOW_OK)
    return FALSE;
  priv->reporter.start (GST_ELEMENT (base), collect_stats);
  std::lock_guard guard (priv->lock);
  priv->frames = priv->points_in = priv->points_out = 0;
  priv->last_roi = {};
  return TRUE;
}

static gboolean
gst_roi_extract_stop (GstBaseTransform *base)
{
  GstRoiExtractPrivate *priv = GST_ROI_EXTRACT (base)->priv;
  priv->reporter.stop ();
  g_autoptr (GRecMutexLocker) lock = lock_stream (base);
  priv->info = {};
  priv->relearn = false;
  for (auto &state : priv->views)
    state.reset ();
  return TRUE;
}

static void
gst_roi_extract_capture_background (GstRoiExtract *self)
{
  self->priv->relearn = true;
}

/* ---- properties ---- */

static const GEnumValue kCues[] = {{int (Cue::kBoth), "Depth and colour", "both"},
    {int (Cue::kColour), "Colour only", "colour"}, {int (Cue::kDepth), "Depth only", "depth"}, {}};

static PropertyTable<RoiSettings> &
roi_properties ()
{
  using S = RoiSettings;
  using Segmentation = rangecast::SegmentationSettings;
  using P = PropertyTable<S>;
  static P table = {
      P::number<&S::segmentation, &Segmentation::depth_threshold_m> ("depth-threshold",
          "Depth threshold",
          "Minimum distance in front of the background in metres at which depth marks a pixel as "
          "foreground",
          0, 10, kControllable),
      P::number<&S::segmentation, &Segmentation::colour_threshold> ("colour-threshold",
          "Colour threshold",
          "Minimum chromatic distortion in grey levels at which colour marks a pixel as foreground",
          0, 255, kControllable),
      P::number<&S::segmentation, &Segmentation::shadow> ("shadow", "Shadow limit",
          "Ratio to the background's brightness down to which a pixel may be a shadow", 0, 1,
          kControllable),
      P::number<&S::segmentation, &Segmentation::highlight> ("highlight", "Highlight limit",
          "Ratio to the background's brightness up to which a pixel may be a change of light", 1,
          10, kControllable),
      P::number<&S::adapt_time_s> ("adapt-time", "Adaptation time",
          "Time constant in seconds with which the background follows slow changes (0 = never)", 0,
          100000, kControllable),
      P::number<&S::segmentation, &Segmentation::min_area> ("min-area", "Minimum area",
          "Minimum area of a foreground region in pixels; smaller regions are cleared", 0, 1000000,
          kControllable),
      P::number<&S::segmentation, &Segmentation::max_hole> ("max-hole", "Maximum hole area",
          "Maximum area of a hole in pixels that is closed", 0, 1000000, kControllable),
      P::number<&S::segmentation, &Segmentation::max_people> ("max-people", "Maximum people",
          "Number of largest foreground regions to keep (0 = all)", 0, 1000, kControllable),
      P::number<&S::segmentation, &Segmentation::fill> ("fill", "Depth extrapolation",
          "Distance in pixels to which depth is extrapolated into foreground without depth; up to "
          "five times as far where the hue differs from the background (0 = off)",
          0, 1000, kControllable),
      P::number<&S::segmentation, &Segmentation::fringe> ("fringe", "Fringe width",
          "Minimum width in pixels of a region that is nearer than the background but looks like "
          "it (0 = trust depth at silhouettes, for cameras with exact depth edges)",
          0, 99, kControllable),
      P::number<&S::margin> ("margin", "Margin", "Margin added to each side of the ROI in pixels",
          0, 1000, kControllable),
      P::number<&S::n_threads> ("n-threads", "Threads",
          "Number of threads that process views (0 = one per CPU core)", 0, 64, kControllable),
      P::number<&S::background_frames> ("background-frames", "Background frames",
          "Number of frames of the empty scene from which to learn the background", 1, 10000,
          kMutablePlaying),
      P::number<&S::settle_frames> ("settle-frames", "Settle frames",
          "Number of frames to skip before learning, while automatic exposure settles", 0, 100000,
          kMutableReady),
      P::text<&S::background_file> ("background-file", "Background file",
          "Background file to load instead of learning (unset = learn)", kMutableReady),
      P::text<&S::save_background> ("save-background", "Save background",
          "Background file to write after learning and at EOS (.yml or .yaml)", kMutablePlaying),
      P::enumeration<&S::segmentation, &Segmentation::cue> ("cue", "Segmentation cue",
          "What distinguishes foreground from background", "GstRoiExtractCue", kCues,
          kControllable),
      P::boolean<&S::segmentation, &Segmentation::follow_light> ("follow-light", "Follow light",
          "Compensate brightness and white balance changes of the whole image", kControllable),
  };
  return table;
}

static GstStructure *
make_stats (const GstRoiExtractPrivate *priv)
{
  const Roi &roi = priv->last_roi;
  return gst_structure_new ("application/x-roiextract-stats", "frames", G_TYPE_UINT64, priv->frames,
      "points-in", G_TYPE_UINT64, priv->points_in, "points-out", G_TYPE_UINT64, priv->points_out,
      "roi-x", G_TYPE_INT, roi.x, "roi-y", G_TYPE_INT, roi.y, "roi-width", G_TYPE_INT, roi.width,
      "roi-height", G_TYPE_INT, roi.height, nullptr);
}

static void
gst_roi_extract_init (GstRoiExtract *self)
{
  self->priv = new GstRoiExtractPrivate;
  gst_base_transform_set_in_place (GST_BASE_TRANSFORM (self), TRUE);
}

static void
gst_roi_extract_class_init (GstRoiExtractClass *klass)
{
  auto object_class = G_OBJECT_CLASS (klass);
  auto element_class = GST_ELEMENT_CLASS (klass);
  auto transform_class = GST_BASE_TRANSFORM_CLASS (klass);

  GST_DEBUG_CATEGORY_INIT (gst_roi_extract_debug, "roiextract", 0, "Region of interest extractor");

  object_class->finalize = delete_private<GstRoiExtract>;
  install_properties<GstRoiExtract, roi_properties, make_stats> (object_class,
      "Counters since the element was started: frames, points-in, points-out; and the last ROI "
      "of the first view");

  /**
   * GstRoiExtract::capture-background:
   *
   * Discards the background and learns it again from the next frames, in which the scene should be
   * empty.
   */
  signals[SIGNAL_CAPTURE_BACKGROUND] = g_signal_new_class_handler ("capture-background",
      G_TYPE_FROM_CLASS (klass), GSignalFlags (G_SIGNAL_RUN_LAST | G_SIGNAL_ACTION),
      G_CALLBACK (gst_roi_extract_capture_background), nullptr, nullptr, nullptr, G_TYPE_NONE, 0);

  add_always_pads (element_class, GST_RANGE_CAPS, GST_RANGE_CAPS);
  gst_element_class_set_static_metadata (element_class, "Region of interest extractor",
      "Filter/Effect/Video",
      "Removes the background of range images by depth and colour and crops them to the rest",
      "gst-rangecast");

  transform_class->start = GST_DEBUG_FUNCPTR (gst_roi_extract_start);
  transform_class->stop = GST_DEBUG_FUNCPTR (gst_roi_extract_stop);
  transform_class->sink_event = GST_DEBUG_FUNCPTR (gst_roi_extract_sink_event);
  transform_class->set_caps = GST_DEBUG_FUNCPTR (gst_roi_extract_set_caps);
  transform_class->transform_ip = GST_DEBUG_FUNCPTR (gst_roi_extract_transform_ip);
}
