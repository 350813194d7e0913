/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include <algorithm>
#include <gstrange/gstrangeframe.hpp>
#include <gstrange/gstrangestatus.hpp>
#include <rangecast/base/guarded.hpp>
#include <string>
#include <utility>

#include "common/elementproperties.hpp"
#include "striprenderprivate.hpp"

using rangecast::RangeImage;
using rangecast::Status;

namespace {

/* Views have to be in the rig, and their ROIs in the view's image and no larger than kMaxStripSide.
 */
Status
check_images (const rangecast::Rig &rig, std::span<const RangeImage> images)
{
  for (const RangeImage &image : images) {
    const std::string name = "range buffer: view " + std::to_string (image.view_id);
    const rangecast::View *view = rig.find (image.view_id);
    const rangecast::Roi &roi = image.roi;
    if (!view)
      return {rangecast::StatusCode::kNotFound, name + " is not in the rig of the caps"};
    if (roi.x + roi.width > view->width || roi.y + roi.height > view->height)
      return {rangecast::StatusCode::kBadSize, name + ": its ROI does not lie in the view's image"};
    if (std::max (roi.width, roi.height) > rangecast::kMaxStripSide)
      return {rangecast::StatusCode::kBadSize,
          name + " has an ROI of " + std::to_string (roi.width) + "x" +
              std::to_string (roi.height) + " pixels; striprender draws at most " +
              std::to_string (rangecast::kMaxStripSide) + " each way"};
  }
  return {};
}

/* Sets the counters of the last frame set. */
void
count_into (const rangecast::SurfaceScene &scene, RenderStats &stats)
{
  stats.points = stats.strips = stats.isolated = stats.triangles = stats.vertices = 0;
  for (std::size_t i = 0; i < scene.layers ().size (); i++) {
    stats.points += scene.result (i).points;
    stats.strips += scene.result (i).strips;
    stats.isolated += scene.result (i).isolated;
    stats.triangles += scene.result (i).triangles;
    stats.vertices += scene.layers ()[i].vertices.size ();
  }
}

/* Controlled properties take their values of the picture's time. The first frame set after a seek
 * to between two of them has none: values stay. */
void
sync_values (GstStripRender *self, GstClockTime pts)
{
  const GstClockTime time = strip_stream_time (self, pts);
  if (GST_CLOCK_TIME_IS_VALID (time))
    gst_object_sync_values (GST_OBJECT (self), time);
}

/* Time since the first picture, for auto-orbit; starts again after a flush. */
guint64
orbit_time (GstStripRenderPrivate *priv, GstClockTime running)
{
  if (!GST_CLOCK_TIME_IS_VALID (running))
    return 0;
  if (!GST_CLOCK_TIME_IS_VALID (priv->first_running) || running < priv->first_running)
    priv->first_running = running;
  return running - priv->first_running;
}

/* The images that view-mask selects. */
std::span<const RangeImage>
visible_images (GstStripRender *self, std::span<const RangeImage> images, guint64 view_mask)
{
  GstStripRenderPrivate *priv = self->priv;
  const auto end = std::ranges::copy_if (images, priv->visible.begin (),
      [view_mask] (const RangeImage &image) { return view_mask >> image.view_id & 1; });
  if (end.out == priv->visible.begin ())
    GST_DEBUG_OBJECT (
        self, "nothing to draw: view-mask selects none of %u views", guint (images.size ()));
  return {priv->visible.begin (), end.out};
}

/* The camera's default position. */
const rangecast::SceneFrame &
home_frame (GstStripRenderPrivate *priv, const StripRenderSettings &settings,
    const rangecast::Orbit &orbit, GstClockTime pts)
{
  if (!settings.fit) {
    priv->fit.reset ();
    return priv->scene.frame ();
  }
  const MultiviewLayout layout (priv->out);
  return priv->fit.update (
      priv->scene, {orbit, layout.eyes ().front ().aspect, pts, settings.camera.home_requests});
}

/* Makes a scene of the frame set and draws it. May throw.
 * @param repeated  the last picture showed the same frame set */
Status
draw (
    GstStripRender *self, GstBuffer *frame_set, GstBuffer *out, bool repeated, RenderResult &result)
{
  GstStripRenderPrivate *priv = self->priv;
  const gstrange::RangeFrameMap frame (frame_set, GST_MAP_READ);
  if (Status status = frame.status (); !status.ok ())
    return status;
  if (Status status = check_images (priv->info.rig, frame.views ()); !status.ok ())
    return status;
  const StripRenderSettings settings = settings_of (priv);
  const GstClockTime running = strip_running_time (self, GST_BUFFER_PTS (out));
  const auto orbit = settings.camera.at (orbit_time (priv, running));
  priv->scene.build (visible_images (self, frame.views (), settings.view_mask),
      {settings.strips, settings.tint_views}, orbit, repeated);
  const auto &home = home_frame (priv, settings, orbit, GST_BUFFER_PTS (frame_set));
  result = priv->backend->draw ({&priv->scene, &settings, &home, orbit}, out);
  if (!result.failure) {
    std::lock_guard guard (priv->lock);
    priv->settings.camera.set_shown (result.matrices, home, result.width, result.height);
  }
  return {};
}

} // namespace

GstFlowReturn
strip_draw_frame (GstStripRender *self, GstBuffer *frame_set, GstBuffer *out, bool repeated)
{
  GstStripRenderPrivate *priv = self->priv;
  sync_values (self, GST_BUFFER_PTS (out));
  RenderResult result;
  const Status status = rangecast::guarded (
      "striprender", [&] { return draw (self, frame_set, out, repeated, result); });
  if (!status.ok ())
    return gst_range_flow_return (GST_ELEMENT (self), status);
  if (result.failure) {
    const bool may_go_on = priv->is_gl && settings_of (priv).backend == RenderBackendChoice::kAuto;
    if (!may_go_on || std::exchange (priv->lost_opengl, true)) {
      GST_ELEMENT_ERROR (
          self, RESOURCE, WRITE, ("Could not draw into the output: %s", result.failure), (nullptr));
      return GST_FLOW_ERROR;
    }
    GST_ELEMENT_WARNING (self, RESOURCE, FAILED,
        ("Continuing with backend=software: %s", result.failure), (nullptr));
    gst_pad_mark_reconfigure (GST_AGGREGATOR_SRC_PAD (self));
    priv->discont = true;
    return GST_AGGREGATOR_FLOW_NEED_DATA;
  }

  if (!repeated)
    priv->reporter.passed (GST_ELEMENT (self), frame_set);
  std::lock_guard guard (priv->lock);
  RenderStats &stats = priv->stats;
  count_into (priv->scene, stats);
  stats.uploaded_bytes = result.uploaded;
  stats.uploaded_total += result.uploaded;
  stats.points_total += stats.points;
  stats.frames++;
  stats.repeated += repeated;
  return GST_FLOW_OK;
}
