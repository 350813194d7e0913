/* SPDX-License-Identifier: LGPL-2.1-or-later */
/**
 * SECTION:element-cylinderfilter
 * @title: cylinderfilter
 *
 * Removes redundant points: where several views of a frame set see the same surface, the points of
 * the view that faces it most directly stay and the others are cleared.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 avatartestsrc views=4 num-buffers=30 ! rangealign ! cylinderfilter ! plyenc ! \
 *   multifilesink location=cloud-%05d.ply
 * ]|
 *
 * Since: 0.1
 */
#include <gst/base/gstbasetransform.h>

#include <gstrange/gstrangeframe.hpp>
#include <gstrange/gstrangeinfo.hpp>
#include <gstrange/gstrangestatus.hpp>
#include <mutex>
#include <rangecast/overlap/cylinder_filter.hpp>

#include "common/basetransform.hpp"
#include "common/elementproperties.hpp"

using rangecast::AxisMode;
using rangecast::Status;

GST_DEBUG_CATEGORY_STATIC (gst_cylinder_filter_debug);
#define GST_CAT_DEFAULT gst_cylinder_filter_debug

namespace {

struct CylinderFilterSettings : rangecast::CylinderSettings {
  CylinderFilterSettings () { threads = 0; }
};

const GEnumValue kAxes[] = {
    {int (AxisMode::kPrincipal), "Principal axis of the points of all views", "principal"},
    {int (AxisMode::kVertical), "World y axis through the centroid of the points", "vertical"},
    {int (AxisMode::kWorld), "World y axis", "world"}, {0, nullptr, nullptr}};

PropertyTable<CylinderFilterSettings> &
cylinder_properties ()
{
  using S = CylinderFilterSettings;
  using P = PropertyTable<S>;
  static P table = {
      P::enumeration<&S::axis> ("axis", "Axis", "How to choose the axis of the cylinder",
          "GstCylinderFilterAxis", kAxes, kMutablePlaying),
      P::number<&S::slice_height_m> ("slice-height", "Slice height",
          "Height of a slice of the cylinder in metres", 0.0002, 10., kMutablePlaying),
      P::number<&S::columns> (
          "columns", "Cells per slice", "Number of cells around a slice", 8, 3600, kMutablePlaying),
      P::number<&S::overlap> ("overlap", "Overlap",
          "Distance in pixels to which the winning view's surface must extend around a point "
          "before the point is cleared (1 or more = no holes open, larger = wider overlap for "
          "blending)",
          0, rangecast::kMaxOverlap, kMutablePlaying),
      P::number<&S::threads> ("n-threads", "Threads",
          "Number of threads that process views and slices (0 = one per CPU core)", 0, 64,
          kMutablePlaying),
  };
  return table;
}

} // namespace

/* Locks, in the order in which they are taken: the sink pad's stream lock, which the streaming
 * thread holds; GstCylinderFilterPrivate::lock. */
struct GstCylinderFilterPrivate {
  std::mutex lock; /* guards what follows; never held while working, pushing or posting */
  CylinderFilterSettings settings;
  guint64 frames = 0, points_in = 0, points_out = 0, cells = 0, cells_shared = 0;
  StatsReporter reporter; /* has locks of its own */

  /* With the sink pad's stream lock. */
  rangecast::CylinderFilter core;
  rangecast::Rig rig; /* of core; no views: none */
};

DECLARE_ELEMENT (GstCylinderFilter, gst_cylinder_filter, CYLINDER_FILTER, GstBaseTransform)

G_DEFINE_TYPE (GstCylinderFilter, gst_cylinder_filter, GST_TYPE_BASE_TRANSFORM)
GST_ELEMENT_REGISTER_DEFINE (
    cylinderfilter, "cylinderfilter", GST_RANK_NONE, gst_cylinder_filter_get_type ())

namespace {

std::vector<StatsRow>
collect_stats (GstElement *element)
{
  auto priv = GST_CYLINDER_FILTER (element)->priv;
  const std::lock_guard guard (priv->lock);
  return {{.counters = {.frames = priv->frames, .points = priv->points_out}}};
}

GstStructure *
make_stats (const GstCylinderFilterPrivate *priv)
{
  return gst_structure_new ("application/x-cylinderfilter-stats", "frames", G_TYPE_UINT64,
      priv->frames, "points-in", G_TYPE_UINT64, priv->points_in, "points-out", G_TYPE_UINT64,
      priv->points_out, "cells", G_TYPE_UINT64, priv->cells, "cells-shared", G_TYPE_UINT64,
      priv->cells_shared, nullptr);
}

} // namespace

static gboolean
gst_cylinder_filter_set_caps (GstBaseTransform *base, GstCaps *in, GstCaps *)
{
  auto self = GST_CYLINDER_FILTER (base);
  auto priv = self->priv;
  GST_INFO_OBJECT (self, "%" GST_PTR_FORMAT, in);
  gstrange::RangeInfo info;
  Status status = gstrange::parse_caps (in, info);
  if (status.ok () && encode_rig (info.rig) == encode_rig (priv->rig))
    return TRUE; /* keeps the winners of the frame before */
  priv->rig = {};
  priv->reporter.set_views (info.rig);
  if (status.ok ())
    status = priv->core.set_rig (info.rig);
  if (status.ok ())
    priv->rig = info.rig;
  return gst_range_flow_return (GST_ELEMENT (self), status) == GST_FLOW_OK;
}

static gboolean
gst_cylinder_filter_sink_event (GstBaseTransform *base, GstEvent *event)
{
  auto priv = GST_CYLINDER_FILTER (base)->priv;
  if (GST_EVENT_TYPE (event) == GST_EVENT_FLUSH_STOP)
    priv->core.reset ();
  else if (GST_EVENT_TYPE (event) == GST_EVENT_EOS)
    priv->reporter.finish ();
  return GST_BASE_TRANSFORM_CLASS (gst_cylinder_filter_parent_class)->sink_event (base, event);
}

static GstFlowReturn
gst_cylinder_filter_transform_ip (GstBaseTransform *base, GstBuffer *buffer)
{
  auto self = GST_CYLINDER_FILTER (base);
  auto priv = self->priv;
  const CylinderFilterSettings settings = settings_of (priv);
  rangecast::CylinderResult result;
  Status status;
  {
    const gstrange::RangeFrameMap frame (buffer, GST_MAP_READWRITE);
    status = frame.status ();
    if (status.ok ())
      status = priv->core.process (frame.views (), settings, result);
  }
  if (status.ok ()) {
    GST_LOG_OBJECT (self,
        "frame set of %" GST_TIME_FORMAT ": %" G_GUINT64_FORMAT " of %" G_GUINT64_FORMAT
        " points stay",
        GST_TIME_ARGS (GST_BUFFER_PTS (buffer)), result.points_out, result.points_in);
    const std::lock_guard guard (priv->lock);
    priv->frames++;
    priv->points_in += result.points_in;
    priv->points_out += result.points_out;
    priv->cells += result.cells.cells;
    priv->cells_shared += result.cells.shared;
  }
  priv->reporter.passed (GST_ELEMENT (self), buffer);
  return gst_range_flow_return (GST_ELEMENT (self), status);
}

static gboolean
gst_cylinder_filter_start (GstBaseTransform *base)
{
  auto priv = GST_CYLINDER_FILTER (base)->priv;
  priv->reporter.start (GST_ELEMENT (base), collect_stats);
  const std::lock_guard guard (priv->lock);
  priv->frames = priv->points_in = priv->points_out = priv->cells = priv->cells_shared = 0;
  return TRUE;
}

/* Frees the memory that the stream needed. */
static gboolean
gst_cylinder_filter_stop (GstBaseTransform *base)
{
  auto priv = GST_CYLINDER_FILTER (base)->priv;
  priv->reporter.stop ();
  g_autoptr (GRecMutexLocker) lock = lock_stream (base);
  priv->rig = {};
  priv->core = {};
  return TRUE;
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

  object_class->finalize = delete_private<GstCylinderFilter>;
  install_properties<GstCylinderFilter, cylinder_properties, make_stats> (
      object_class, "Counters since READY: frames, points-in, points-out, cells, cells-shared");

  add_always_pads (element_class, GST_RANGE_CAPS, GST_RANGE_CAPS);
  gst_element_class_set_static_metadata (element_class, "Cylinder filter", "Filter/Effect/Video",
      "Removes redundant points of overlapping views", "gst-rangecast");

  transform_class->start = GST_DEBUG_FUNCPTR (gst_cylinder_filter_start);
  transform_class->stop = GST_DEBUG_FUNCPTR (gst_cylinder_filter_stop);
  transform_class->set_caps = GST_DEBUG_FUNCPTR (gst_cylinder_filter_set_caps);
  transform_class->sink_event = GST_DEBUG_FUNCPTR (gst_cylinder_filter_sink_event);
  transform_class->transform_ip = GST_DEBUG_FUNCPTR (gst_cylinder_filter_transform_ip);
}
