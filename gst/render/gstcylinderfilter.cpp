/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-cylinderfilter
 * @title: cylinderfilter
 *
 * Removes redundant points: where several views of a frame set see the same surface, the points of
 * the view that faces it most directly stay and the others are cleared. Before that, pose errors
 * are corrected, views and points that contradict others are left out
 * (#GstCylinderFilter:consistency), and colours are matched (#GstCylinderFilter:colour-balance).
 * Points move only with consistency=depth.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 avatartestsrc views=4 num-buffers=30 ! cylinderfilter ! plyenc ! multifilesink
 * location=cloud-%05d.ply
 * ]|
 *
 * Since: 0.1
 */
#include "gstcylinderfilter.h"

#include <cmath>
#include <gstrange/gstrangeframe.hpp>
#include <gstrange/gstrangeinfo.hpp>
#include <gstrange/gstrangestatus.hpp>
#include <mutex>
#include <optional>
#include <rangecast/base/guarded.hpp>

#include "common/controlledvalues.hpp"
#include "common/elementproperties.hpp"
#include "common/streamlock.hpp"
#include "cylindersettings.hpp"

using rangecast::RangeImage;
using rangecast::Status;

GST_DEBUG_CATEGORY (gst_cylinder_filter_debug);
#define GST_CAT_DEFAULT gst_cylinder_filter_debug

namespace {

struct CylinderCounts {
  guint64 frames = 0, points_contradicted = 0, points_in = 0, points_out = 0, units = 0,
          units_shared = 0, units_held = 0, units_changed = 0,
          untouched = 0; /* frame sets while the mode is off */
  int bodies = 0;
  rangecast::Axis axis;
};

} // namespace

/* Locks, in the order in which they are taken: the sink pad's stream lock, which the streaming
 * thread holds; GstCylinderFilterPrivate::lock. */
struct GstCylinderFilterPrivate {
  std::mutex lock; /* guards settings and counts; never held while working, pushing or posting */
  CylinderFilterSettings settings;
  CylinderCounts counts;
  std::vector<std::pair<int, rangecast::ViewConsistency>> views; /* by view-id; of the last frame
                                                                    set; written when streaming */
  StatsReporter reporter;                                        /* has locks of its own */

  /* With the sink pad's stream lock. */
  rangecast::ViewAgreement agreement;
  rangecast::ColourMatch colours;
  rangecast::CylinderFilter core;
  bool has_rig = false;     /* set_caps gave agreement, core and colours one */
  bool rig_pending = false; /* the source pad's caps may have another rig than agreement */
  GstClockTime last_pts = GST_CLOCK_TIME_NONE;
  bool was_off = false;
  guint64 left_out = 0; /* views that a warning was posted for, a bit each */
};

struct _GstCylinderFilter {
  GstBaseTransform parent;
  GstCylinderFilterPrivate *priv;
};

static GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE (
    "sink", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS (GST_RANGE_CAPS));
static GstStaticPadTemplate src_template =
    GST_STATIC_PAD_TEMPLATE ("src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS (GST_RANGE_CAPS));

G_DEFINE_TYPE (GstCylinderFilter, gst_cylinder_filter, GST_TYPE_BASE_TRANSFORM)
GST_ELEMENT_REGISTER_DEFINE (
    cylinderfilter, "cylinderfilter", GST_RANK_NONE, GST_TYPE_CYLINDER_FILTER)

/* ---- resets, corrections and statistics ---- */

namespace {

/* After a jump in time: people and light are different, the cameras stay where they are. */
void
reset_scene (GstCylinderFilterPrivate *priv)
{
  priv->core.reset ();
  priv->colours.reset ();
}

/* After the end of a stream. */
void
reset_stream (GstCylinderFilterPrivate *priv)
{
  reset_scene (priv);
  priv->agreement.reset ();
  priv->rig_pending = true;
}

Status
set_rig (GstCylinderFilterPrivate *priv, const rangecast::Rig &rig)
{
  if (Status status = priv->agreement.set_rig (rig); !status.ok ())
    return status;
  if (Status status = priv->core.set_rig (rig); !status.ok ())
    return status;
  return priv->colours.set_rig (rig);
}

/* Sets the corrected rig here, and downstream by caps. */
Status
send_rig (GstCylinderFilter *self)
{
  auto priv = self->priv;
  const Status valid = validate (priv->agreement.rig ());
  if (!valid.ok ())
    GST_WARNING_OBJECT (
        self, "keeping the original rig; the corrected one: %s", valid.message ().c_str ());
  const rangecast::Rig &rig = valid.ok () ? priv->agreement.rig () : priv->agreement.nominal_rig ();
  priv->rig_pending = false;
  if (Status status = priv->core.change_rig (rig); !status.ok ())
    return status;
  if (Status status = priv->colours.change_rig (rig); !status.ok ())
    return status;
  GstPad *pad = GST_BASE_TRANSFORM_SRC_PAD (self);
  GstCaps *present = gst_pad_get_current_caps (pad);
  if (!present)
    return {};
  GstCaps *caps = gstrange::with_rig (present, rig);
  if (!gst_caps_is_equal (caps, present)) {
    GST_DEBUG_OBJECT (self, "sending caps with other poses");
    if (!gst_pad_push_event (pad, gst_event_new_caps (caps)))
      GST_DEBUG_OBJECT (self, "downstream refused them"); /* pushing the buffer returns why */
  }
  gst_caps_unref (caps);
  gst_caps_unref (present);
  return {};
}

/* Corrects poses, depth and colours, and removes redundant points. */
Status
process (GstCylinderFilter *self, std::span<const RangeImage> views,
    const CylinderFilterSettings &settings, rangecast::CylinderResult &result)
{
  auto priv = self->priv;
  const rangecast::ColourSettings colours = settings.colours ();
  const rangecast::ColourBalance &balance = priv->colours.balance ();
  for (const RangeImage &view : views)
    priv->agreement.set_gains (view.view_id, colours.balance && balance.has_gains (view.view_id)
                                                 ? std::optional (balance.gains (view.view_id))
                                                 : std::nullopt);
  if (Status status = priv->agreement.process (views, settings.agreement ()); !status.ok ())
    return status;
  if (priv->rig_pending || priv->agreement.rig_changed ())
    if (Status status = send_rig (self); !status.ok ())
      return status;
  if (Status status = priv->colours.before (views, colours); !status.ok ())
    return status;
  if (Status status = priv->core.process (views, settings.core, result); !status.ok ())
    return status;
  return priv->colours.after (views, colours);
}

void
count (GstCylinderFilterPrivate *priv, const rangecast::CylinderResult &result)
{
  const std::lock_guard guard (priv->lock);
  CylinderCounts &counts = priv->counts;
  counts.frames++;
  counts.points_contradicted += priv->agreement.contradicted_points ();
  counts.points_in += result.points_in;
  counts.points_out += result.points_out;
  counts.units += result.cells;
  counts.units_shared += result.cells_shared;
  counts.units_held += result.cells_held;
  counts.units_changed += result.cells_changed;
  counts.bodies = result.clusters;
  counts.axis = result.axis;
  for (auto &[view_id, consistency] : priv->views)
    consistency = priv->agreement.view (view_id);
}

/* Posts one warning for each view that is left out from now on. */
void
warn_left_out (GstCylinderFilter *self)
{
  auto priv = self->priv;
  for (const auto &[view_id, view] : priv->views) {
    const guint64 bit = guint64{1} << view_id;
    if (view.left_out && !(priv->left_out & bit))
      GST_ELEMENT_WARNING (self, STREAM, FAILED,
          ("View %d contradicts the other views and is left out.", view_id),
          ("%.0f %% of its points agree with the other views; check its pose in the rig and its "
           "depth",
              100 * view.consistency));
    else if (!view.left_out && (priv->left_out & bit))
      GST_INFO_OBJECT (self, "view %d agrees again", view_id);
    priv->left_out = view.left_out ? priv->left_out | bit : priv->left_out & ~bit;
  }
}

std::vector<StatsRow>
collect_stats (GstElement *element)
{
  auto priv = GST_CYLINDER_FILTER (element)->priv;
  const std::lock_guard guard (priv->lock);
  return {{.counters = {.frames = priv->counts.frames + priv->counts.untouched,
               .points = priv->counts.points_out}}};
}

void
add_view_stats (GstStructure *stats, const GstCylinderFilterPrivate *priv)
{
  GValue array = G_VALUE_INIT;
  g_value_init (&array, GST_TYPE_ARRAY);
  for (const auto &[view_id, view] : priv->views) {
    GValue value = G_VALUE_INIT;
    g_value_init (&value, GST_TYPE_STRUCTURE);
    g_value_take_boxed (&value,
        gst_structure_new ("view", "view-id", G_TYPE_INT, view_id, "moved", G_TYPE_DOUBLE,
            1000 * norm (view.correction.translation), "turned", G_TYPE_DOUBLE,
            180 / M_PI * norm (view.correction.rotation), "consistency", G_TYPE_DOUBLE,
            view.consistency, "left-out", G_TYPE_BOOLEAN, gboolean (view.left_out), nullptr));
    gst_value_array_append_and_take_value (&array, &value);
  }
  gst_structure_take_value (stats, "views", &array);
}

GstStructure *
make_stats (const GstCylinderFilterPrivate *priv)
{
  const CylinderCounts &counts = priv->counts;
  GstStructure *stats =
      gst_structure_new ("application/x-cylinderfilter-stats", "frames", G_TYPE_UINT64,
          counts.frames, "points-contradicted", G_TYPE_UINT64, counts.points_contradicted,
          "points-in", G_TYPE_UINT64, counts.points_in, "points-out", G_TYPE_UINT64,
          counts.points_out, "units", G_TYPE_UINT64, counts.units, "units-shared", G_TYPE_UINT64,
          counts.units_shared, "units-held", G_TYPE_UINT64, counts.units_held, "units-changed",
          G_TYPE_UINT64, counts.units_changed, "bodies", G_TYPE_INT, counts.bodies, nullptr);
  const char *names[] = {"axis-position", "axis-direction"};
  const rangecast::Vec3 vectors[] = {counts.axis.position, counts.axis.direction};
  for (int i = 0; i < 2; i++) {
    GValue array = G_VALUE_INIT;
    g_value_init (&array, GST_TYPE_ARRAY);
    set_vector (&array, vectors[i]);
    gst_structure_take_value (stats, names[i], &array);
  }
  add_view_stats (stats, priv);
  return stats;
}

} // namespace

/* ---- caps and events: what resets the state ---- */

static gboolean
gst_cylinder_filter_set_caps (GstBaseTransform *base, GstCaps *in, GstCaps *)
{
  auto self = GST_CYLINDER_FILTER (base);
  auto priv = self->priv;
  GST_INFO_OBJECT (self, "%" GST_PTR_FORMAT, in);
  const Status status = rangecast::guarded ("cylinderfilter", [&] {
    gstrange::RangeInfo info;
    Status result = gstrange::parse_caps (in, info);
    /* The base class negotiates again on RECONFIGURE, too, and sends the caps as they came. */
    if (result.ok () && priv->has_rig &&
        encode_rig (info.rig) == encode_rig (priv->agreement.nominal_rig ())) {
      priv->rig_pending = true;
      return result;
    }
    priv->has_rig = false;
    reset_stream (priv);
    priv->reporter.set_views (info.rig);
    {
      const std::lock_guard guard (priv->lock);
      priv->views.clear ();
      for (const rangecast::View &view : info.rig.views)
        priv->views.emplace_back (view.id, rangecast::ViewConsistency{});
    }
    if (result.ok ())
      result = set_rig (priv, info.rig);
    priv->has_rig = result.ok ();
    return result;
  });
  return gst_range_flow_return (GST_ELEMENT (self), status) == GST_FLOW_OK;
}

static gboolean
gst_cylinder_filter_sink_event (GstBaseTransform *base, GstEvent *event)
{
  auto priv = GST_CYLINDER_FILTER (base)->priv;
  const gchar *stream_id = nullptr;
  switch (GST_EVENT_TYPE (event)) {
    case GST_EVENT_FLUSH_STOP: /* serialized with the buffers */
      reset_scene (priv);
      break;
    case GST_EVENT_STREAM_START: {
      gst_event_parse_stream_start (event, &stream_id);
      gchar *last = gst_pad_get_stream_id (base->sinkpad); /* the pad stores this event later */
      reset_scene (priv);
      if (g_strcmp0 (last, stream_id) != 0)
        reset_stream (priv);
      g_free (last);
      break;
    }
    case GST_EVENT_EOS:
      priv->reporter.finish ();
      break;
    default:
      break;
  }
  return GST_BASE_TRANSFORM_CLASS (gst_cylinder_filter_parent_class)->sink_event (base, event);
}

/* ---- a frame set, in the order in which these are called ---- */

/* Gets every buffer, also those that are late or passed through. DISCONT comes with every lost
 * packet, too: the scene is another one only if time jumps. */
static GstFlowReturn
gst_cylinder_filter_submit_input_buffer (
    GstBaseTransform *base, gboolean is_discont, GstBuffer *buffer)
{
  auto priv = GST_CYLINDER_FILTER (base)->priv;
  const GstClockTime last = priv->last_pts, now = priv->last_pts = GST_BUFFER_PTS (buffer);
  const bool known = GST_CLOCK_TIME_IS_VALID (last) && GST_CLOCK_TIME_IS_VALID (now);
  if (GST_BUFFER_IS_DISCONT (buffer) && (!known || now <= last || now - last > GST_SECOND / 2)) {
    GST_DEBUG_OBJECT (base, "time jumps from %" GST_TIME_FORMAT " to %" GST_TIME_FORMAT,
        GST_TIME_ARGS (last), GST_TIME_ARGS (now));
    reset_scene (priv);
  }
  return GST_BASE_TRANSFORM_CLASS (gst_cylinder_filter_parent_class)
      ->submit_input_buffer (base, is_discont, buffer);
}

/* Controlled properties take their values of this buffer's time; the mode may be one of them. */
static void
gst_cylinder_filter_before_transform (GstBaseTransform *base, GstBuffer *buffer)
{
  auto self = GST_CYLINDER_FILTER (base);
  auto priv = self->priv;
  sync_controlled_values (base, buffer);
  bool off;
  {
    const std::lock_guard guard (priv->lock);
    off = priv->settings.mode == GST_CYLINDER_FILTER_OFF;
    priv->counts.untouched += off;
  }
  if (off)
    priv->reporter.passed (GST_ELEMENT (self), buffer);
  if (off && !priv->was_off) { /* the scene changes unseen meanwhile */
    GST_DEBUG_OBJECT (self, "mode=off: passing frame sets through");
    reset_stream (priv);
    const Status status = rangecast::guarded ("cylinderfilter", [&] { return send_rig (self); });
    if (!status.ok ())
      GST_WARNING_OBJECT (self, "%s", status.message ().c_str ());
  }
  priv->was_off = off;
  gst_base_transform_set_passthrough (base, off);
}

static GstFlowReturn
gst_cylinder_filter_transform_ip (GstBaseTransform *base, GstBuffer *buffer)
{
  auto self = GST_CYLINDER_FILTER (base);
  auto priv = self->priv;
  CylinderFilterSettings settings;
  {
    const std::lock_guard guard (priv->lock);
    settings = priv->settings;
  }
  if (settings.mode == GST_CYLINDER_FILTER_OFF) /* since before_transform() */
    return GST_FLOW_OK;
  rangecast::CylinderResult result;
  const Status status = rangecast::guarded ("cylinderfilter", [&] {
    const gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
    return frame.status ().ok () ? process (self, frame.views (), settings, result)
                                 : frame.status ();
  });
  if (status.ok ()) {
    GST_LOG_OBJECT (self,
        "frame set of %" GST_TIME_FORMAT ": %" G_GUINT64_FORMAT " of %" G_GUINT64_FORMAT
        " points stay",
        GST_TIME_ARGS (GST_BUFFER_PTS (buffer)), result.points_out, result.points_in);
    count (priv, result);
    warn_left_out (self);
  }
  priv->reporter.passed (GST_ELEMENT (self), buffer);
  return gst_range_flow_return (GST_ELEMENT (self), status);
}

/* ---- states ---- */

static gboolean
gst_cylinder_filter_start (GstBaseTransform *base)
{
  auto priv = GST_CYLINDER_FILTER (base)->priv;
  reset_stream (priv);
  priv->last_pts = GST_CLOCK_TIME_NONE;
  priv->was_off = false;
  priv->left_out = 0;
  priv->reporter.start (GST_ELEMENT (base), collect_stats);
  const std::lock_guard guard (priv->lock);
  priv->counts = {};
  return TRUE;
}

/* Frees the memory that the stream needed. */
static gboolean
gst_cylinder_filter_stop (GstBaseTransform *base)
{
  auto priv = GST_CYLINDER_FILTER (base)->priv;
  priv->reporter.stop ();
  const StreamLock lock (base);
  priv->has_rig = false;
  priv->core = {};
  priv->agreement = {};
  priv->colours = {};
  return TRUE;
}

/* ---- properties ---- */

static void
gst_cylinder_filter_finalize (GObject *object)
{
  delete GST_CYLINDER_FILTER (object)->priv;
  G_OBJECT_CLASS (gst_cylinder_filter_parent_class)->finalize (object);
}

static void
gst_cylinder_filter_init (GstCylinderFilter *self)
{
  self->priv = new GstCylinderFilterPrivate;
  gst_base_transform_set_in_place (GST_BASE_TRANSFORM (self), TRUE);
}

static void
gst_cylinder_filter_class_init (GstCylinderFilterClass *klass)
{
  auto object_class = G_OBJECT_CLASS (klass);
  auto element_class = GST_ELEMENT_CLASS (klass);
  auto transform_class = GST_BASE_TRANSFORM_CLASS (klass);

  GST_DEBUG_CATEGORY_INIT (gst_cylinder_filter_debug, "cylinderfilter", 0, "Cylinder filter");

  object_class->finalize = gst_cylinder_filter_finalize;

  install_properties<GstCylinderFilter, cylinder_properties, make_stats> (object_class,
      "Counters since READY: frames, points-contradicted, points-in, points-out, units, "
      "units-shared, units-held, units-changed; of the last frame: bodies, axis-position, "
      "axis-direction, views");

  gst_element_class_add_static_pad_template (element_class, &sink_template);
  gst_element_class_add_static_pad_template (element_class, &src_template);
  gst_element_class_set_static_metadata (element_class, "Cylinder filter", "Filter/Effect/Video",
      "Removes redundant points of overlapping views and matches the views' poses and colours",
      "gst-rangecast");

  transform_class->start = GST_DEBUG_FUNCPTR (gst_cylinder_filter_start);
  transform_class->stop = GST_DEBUG_FUNCPTR (gst_cylinder_filter_stop);
  transform_class->set_caps = GST_DEBUG_FUNCPTR (gst_cylinder_filter_set_caps);
  transform_class->sink_event = GST_DEBUG_FUNCPTR (gst_cylinder_filter_sink_event);
  transform_class->submit_input_buffer =
      GST_DEBUG_FUNCPTR (gst_cylinder_filter_submit_input_buffer);
  transform_class->before_transform = GST_DEBUG_FUNCPTR (gst_cylinder_filter_before_transform);
  transform_class->transform_ip = GST_DEBUG_FUNCPTR (gst_cylinder_filter_transform_ip);
  transform_class->transform_ip_on_passthrough = FALSE;
}
