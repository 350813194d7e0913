/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-rangealign
 * @title: rangealign
 *
 * Makes the views of a frame set agree: corrects small errors of the camera poses in the rig of its
 * caps, clears a view and points that contradict other views, and matches colours. It moves no
 * point within its view. #GstRangeAlign:corrections chooses among these.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 avatartestsrc views=4 ! rangealign ! striprender ! glimagesink
 * ]|
 *
 * Since: 0.1
 */
#include <gst/base/gstbasetransform.h>

#include <cmath>
#include <gstrange/gstrangeframe.hpp>
#include <gstrange/gstrangeinfo.hpp>
#include <gstrange/gstrangestatus.hpp>
#include <mutex>
#include <rangecast/alignment/view_alignment.hpp>

#include "common/basetransform.hpp"
#include "common/elementproperties.hpp"

using rangecast::Status;

GST_DEBUG_CATEGORY_STATIC (gst_range_align_debug);
#define GST_CAT_DEFAULT gst_range_align_debug

namespace {

enum Corrections : guint { kPoses = 1, kViews = 2, kPoints = 4, kColours = 8 };

struct RangeAlignSettings {
  guint corrections = kPoses | kViews | kPoints | kColours;
  int threads = 0;
};

const GFlagsValue kCorrections[] = {{0, "Nothing", "none"},
    {kPoses, "Estimate and correct errors of the camera poses", "poses"},
    {kViews, "Clear a view that contradicts the others", "views"},
    {kPoints, "Clear points that another view sees through in a different colour", "points"},
    {kColours, "Match the colours of the views", "colours"}, {0, nullptr, nullptr}};

PropertyTable<RangeAlignSettings> &
align_properties ()
{
  using S = RangeAlignSettings;
  using P = PropertyTable<S>;
  static P table = {
      P::flags<&S::corrections> ("corrections", "Corrections",
          "What to correct (points needs colours)", "GstRangeAlignCorrections", kCorrections,
          kMutablePlaying),
      P::number<&S::threads> ("n-threads", "Threads",
          "Number of threads that process views (0 = one per CPU core)", 0, 64, kMutablePlaying),
  };
  return table;
}

} // namespace

/* Locks, in the order in which they are taken: the sink pad's stream lock, which the streaming
 * thread holds; GstRangeAlignPrivate::lock. */
struct GstRangeAlignPrivate {
  std::mutex lock; /* guards what follows; never held while working, pushing or posting */
  RangeAlignSettings settings;
  guint64 frames = 0, points_contradicted = 0;
  std::vector<std::pair<int, rangecast::ViewConsistency>> views; /* by view-id; of the last frame
                                                                    set; written when streaming */
  StatsReporter reporter;                                        /* has locks of its own */

  /* With the sink pad's stream lock. */
  rangecast::ViewAlignment alignment;
  bool has_rig = false;     /* set_caps gave alignment one */
  bool rig_pending = false; /* the source pad's caps may have another rig than alignment */
  guint64 skipped = 0;      /* views that a warning was posted for, a bit each */
};

DECLARE_ELEMENT (GstRangeAlign, gst_range_align, RANGE_ALIGN, GstBaseTransform)

G_DEFINE_TYPE (GstRangeAlign, gst_range_align, GST_TYPE_BASE_TRANSFORM)
GST_ELEMENT_REGISTER_DEFINE (rangealign, "rangealign", GST_RANK_NONE, gst_range_align_get_type ())

namespace {

/* Sends the corrected rig downstream, by caps. */
void
send_rig (GstRangeAlign *self)
{
  auto priv = self->priv;
  priv->rig_pending = false;
  GstPad *pad = GST_BASE_TRANSFORM_SRC_PAD (self);
  GstCaps *present = gst_pad_get_current_caps (pad);
  if (!present)
    return;
  GstCaps *caps = gstrange::with_rig (present, priv->alignment.rig ());
  if (!gst_caps_is_equal (caps, present)) {
    GST_DEBUG_OBJECT (self, "sending caps with other poses");
    if (!gst_pad_push_event (pad, gst_event_new_caps (caps)))
      GST_DEBUG_OBJECT (self, "downstream refused them"); /* pushing the buffer returns why */
  }
  gst_caps_unref (caps);
  gst_caps_unref (present);
}

void
count (GstRangeAlignPrivate *priv)
{
  const std::lock_guard guard (priv->lock);
  priv->frames++;
  priv->points_contradicted += priv->alignment.contradicted_points ();
  for (auto &[view_id, consistency] : priv->views)
    consistency = priv->alignment.view (view_id);
}

/* Posts one warning for each view that is skipped from now on. */
void
warn_skipped (GstRangeAlign *self)
{
  auto priv = self->priv;
  for (const auto &[view_id, view] : priv->views) {
    const guint64 bit = guint64{1} << view_id;
    if (view.skipped && !(priv->skipped & bit))
      GST_ELEMENT_WARNING (self, STREAM, FAILED,
          ("View %d contradicts the other views and is skipped.", view_id),
          ("%.0f %% of its points agree with the other views; check its pose in the rig and its "
           "depth",
              100 * view.consistency));
    else if (!view.skipped && (priv->skipped & bit))
      GST_INFO_OBJECT (self, "view %d agrees again", view_id);
    priv->skipped = view.skipped ? priv->skipped | bit : priv->skipped & ~bit;
  }
}

std::vector<StatsRow>
collect_stats (GstElement *element)
{
  auto priv = GST_RANGE_ALIGN (element)->priv;
  const std::lock_guard guard (priv->lock);
  return {{.counters = {.frames = priv->frames}}};
}

GstStructure *
make_stats (const GstRangeAlignPrivate *priv)
{
  GstStructure *stats =
      gst_structure_new ("application/x-rangealign-stats", "frames", G_TYPE_UINT64, priv->frames,
          "points-contradicted", G_TYPE_UINT64, priv->points_contradicted, nullptr);
  GValue array = G_VALUE_INIT;
  g_value_init (&array, GST_TYPE_ARRAY);
  for (const auto &[view_id, view] : priv->views) {
    GValue value = G_VALUE_INIT;
    g_value_init (&value, GST_TYPE_STRUCTURE);
    g_value_take_boxed (
        &value, gst_structure_new ("view", "view-id", G_TYPE_INT, view_id, "moved", G_TYPE_DOUBLE,
                    1000 * norm (view.correction.translation), "turned", G_TYPE_DOUBLE,
                    180 / M_PI * norm (view.correction.rotation), "consistency", G_TYPE_DOUBLE,
                    view.consistency, "skipped", G_TYPE_BOOLEAN, gboolean (view.skipped), nullptr));
    gst_value_array_append_and_take_value (&array, &value);
  }
  gst_structure_take_value (stats, "views", &array);
  return stats;
}

} // namespace

static gboolean
gst_range_align_set_caps (GstBaseTransform *base, GstCaps *in, GstCaps *)
{
  auto self = GST_RANGE_ALIGN (base);
  auto priv = self->priv;
  GST_INFO_OBJECT (self, "%" GST_PTR_FORMAT, in);
  gstrange::RangeInfo info;
  Status status = gstrange::parse_caps (in, info);
  priv->rig_pending = true;
  /* The base class negotiates again on RECONFIGURE, too, and sends the caps as they came. */
  if (status.ok () && priv->has_rig &&
      encode_rig (info.rig) == encode_rig (priv->alignment.nominal_rig ()))
    return TRUE;
  if (status.ok ())
    status = priv->alignment.set_rig (info.rig);
  priv->has_rig = status.ok ();
  priv->reporter.set_views (info.rig);
  {
    const std::lock_guard guard (priv->lock);
    priv->views.clear ();
    for (const rangecast::View &view : info.rig.views)
      priv->views.emplace_back (view.id, rangecast::ViewConsistency{});
  }
  return gst_range_flow_return (GST_ELEMENT (self), status) == GST_FLOW_OK;
}

/* After a seek people and light are different; another stream may be of other cameras. */
static gboolean
gst_range_align_sink_event (GstBaseTransform *base, GstEvent *event)
{
  auto priv = GST_RANGE_ALIGN (base)->priv;
  if (GST_EVENT_TYPE (event) == GST_EVENT_FLUSH_STOP) {
    priv->alignment.reset_colours ();
  } else if (GST_EVENT_TYPE (event) == GST_EVENT_STREAM_START) {
    const gchar *stream_id = nullptr;
    gst_event_parse_stream_start (event, &stream_id);
    gchar *last = gst_pad_get_stream_id (base->sinkpad); /* the pad stores this event later */
    if (g_strcmp0 (last, stream_id) != 0) {
      priv->alignment.reset ();
      priv->rig_pending = true;
    }
    g_free (last);
  } else if (GST_EVENT_TYPE (event) == GST_EVENT_EOS) {
    priv->reporter.finish ();
  }
  return GST_BASE_TRANSFORM_CLASS (gst_range_align_parent_class)->sink_event (base, event);
}

static GstFlowReturn
gst_range_align_transform_ip (GstBaseTransform *base, GstBuffer *buffer)
{
  auto self = GST_RANGE_ALIGN (base);
  auto priv = self->priv;
  rangecast::AlignmentSettings settings;
  {
    const std::lock_guard guard (priv->lock);
    const guint corrections = priv->settings.corrections;
    settings = {(corrections & kPoses) != 0, (corrections & kViews) != 0,
        (corrections & kPoints) != 0, (corrections & kColours) != 0, priv->settings.threads};
  }
  Status status;
  {
    const gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
    status = frame.status ();
    if (status.ok ())
      status = priv->alignment.process (frame.views (), settings);
    if (status.ok () && (priv->rig_pending || priv->alignment.rig_changed ()))
      send_rig (self);
  }
  if (status.ok ()) {
    GST_LOG_OBJECT (self, "frame set of %" GST_TIME_FORMAT ": cleared %zu contradicted points",
        GST_TIME_ARGS (GST_BUFFER_PTS (buffer)), priv->alignment.contradicted_points ());
    count (priv);
    warn_skipped (self);
  }
  priv->reporter.passed (GST_ELEMENT (self), buffer);
  return gst_range_flow_return (GST_ELEMENT (self), status);
}

static gboolean
gst_range_align_start (GstBaseTransform *base)
{
  auto priv = GST_RANGE_ALIGN (base)->priv;
  priv->skipped = 0;
  priv->reporter.start (GST_ELEMENT (base), collect_stats);
  const std::lock_guard guard (priv->lock);
  priv->frames = priv->points_contradicted = 0;
  return TRUE;
}

/* Frees the memory that the stream needed. */
static gboolean
gst_range_align_stop (GstBaseTransform *base)
{
  auto priv = GST_RANGE_ALIGN (base)->priv;
  priv->reporter.stop ();
  g_autoptr (GRecMutexLocker) lock = lock_stream (base);
  priv->has_rig = false;
  priv->alignment = {};
  return TRUE;
}

static void
gst_range_align_init (GstRangeAlign *self)
{
  self->priv = new GstRangeAlignPrivate;
  gst_base_transform_set_in_place (GST_BASE_TRANSFORM (self), TRUE);
}

static void
gst_range_align_class_init (GstRangeAlignClass *klass)
{
  auto object_class = G_OBJECT_CLASS (klass);
  auto element_class = GST_ELEMENT_CLASS (klass);
  auto transform_class = GST_BASE_TRANSFORM_CLASS (klass);

  GST_DEBUG_CATEGORY_INIT (gst_range_align_debug, "rangealign", 0, "Range image alignment");

  object_class->finalize = delete_private<GstRangeAlign>;
  install_properties<GstRangeAlign, align_properties, make_stats> (
      object_class, "Counters since READY: frames, points-contradicted; of the last frame: views");

  add_always_pads (element_class, GST_RANGE_CAPS, GST_RANGE_CAPS);
  gst_element_class_set_static_metadata (element_class, "Range image alignment",
      "Filter/Effect/Video", "Corrects the poses and colours of views so that they agree",
      "gst-rangecast");

  transform_class->start = GST_DEBUG_FUNCPTR (gst_range_align_start);
  transform_class->stop = GST_DEBUG_FUNCPTR (gst_range_align_stop);
  transform_class->set_caps = GST_DEBUG_FUNCPTR (gst_range_align_set_caps);
  transform_class->sink_event = GST_DEBUG_FUNCPTR (gst_range_align_sink_event);
  transform_class->transform_ip = GST_DEBUG_FUNCPTR (gst_range_align_transform_ip);
}
