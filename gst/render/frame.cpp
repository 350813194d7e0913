/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include <algorithm>
#include <gstrange/gstrangeframe.hpp>
#include <gstrange/gstrangestatus.hpp>

#include "striprenderprivate.hpp"

using rangecast::Status;

/* Time since the first picture, where auto-orbit began; a flush begins it anew. */
static guint64
orbit_time (GstStripRenderPrivate *priv, GstClockTime running)
{
  if (!GST_CLOCK_TIME_IS_VALID (running))
    return 0;
  if (!GST_CLOCK_TIME_IS_VALID (priv->first_running) || running < priv->first_running)
    priv->first_running = running;
  return running - priv->first_running;
}

GstClockTime
strip_running_time (GstStripRender *self, GstClockTime pts)
{
  const GstSegment &segment = GST_BASE_TRANSFORM (self)->segment;
  if (segment.format != GST_FORMAT_TIME) /* then nothing has a time */
    return GST_CLOCK_TIME_NONE;
  return gst_segment_to_running_time (&segment, GST_FORMAT_TIME, pts);
}

GstClockTime
strip_stream_time (GstStripRender *self, GstClockTime pts)
{
  const GstSegment &segment = GST_BASE_TRANSFORM (self)->segment;
  if (segment.format != GST_FORMAT_TIME)
    return GST_CLOCK_TIME_NONE;
  return gst_segment_to_stream_time (&segment, GST_FORMAT_TIME, pts);
}

/* Running time of the clock, or GST_CLOCK_TIME_NONE. */
GstClockTime
strip_running_now (GstStripRender *self)
{
  GstClock *clock = gst_element_get_clock (GST_ELEMENT (self));
  if (!clock)
    return GST_CLOCK_TIME_NONE;
  const GstClockTime now = gst_clock_get_time (clock);
  const GstClockTime base_time = gst_element_get_base_time (GST_ELEMENT (self));
  gst_object_unref (clock);
  return now > base_time ? now - base_time : 0;
}

/* Has the statistics' panel ready. @return whether it is another one than before */
static bool
update_panel (GstStripRender *self, std::size_t views, GstClockTime frame_set_pts)
{
  GstStripRenderPrivate *priv = self->priv;
  GstClockTime latency = GST_CLOCK_TIME_NONE;
  const GstClockTime now = strip_running_now (self),
                     taken = strip_running_time (self, frame_set_pts);
  if (priv->live && GST_CLOCK_TIME_IS_VALID (now) && GST_CLOCK_TIME_IS_VALID (taken))
    latency = now > taken ? now - taken : 0;
  RenderStats stats;
  {
    std::lock_guard guard (priv->lock);
    stats = priv->stats;
  }
  priv->scene.count_into (stats);
  if (!priv->stats_text.update (stats, views, latency, g_get_monotonic_time ()))
    return false;
  priv->stats_panel.draw (priv->stats_text.lines ());
  return true;
}

/* The images of the views that are to be drawn. */
static std::span<const rangecast::RangeImage>
visible_images (
    GstStripRenderPrivate *priv, std::span<const rangecast::RangeImage> images, guint64 view_mask)
{
  const auto end = std::ranges::copy_if (images, priv->visible.begin (),
      [view_mask] (const rangecast::RangeImage &image) { return view_mask >> image.view_id & 1; });
  return {priv->visible.begin (), end.out};
}

/* Where the camera's home is. */
static const rangecast::SceneFrame &
home_frame (GstStripRenderPrivate *priv, const StripRenderSettings &settings,
    const rangecast::Orbit &orbit, GstClockTime pts)
{
  if (!settings.fit) {
    priv->fit.reset ();
    return priv->scene.frame ();
  }
  const EyePlaces eyes (priv->out);
  return priv->fit.update (
      priv->scene, {orbit, eyes.all ().front ().aspect, pts, settings.camera.home_requests});
}

/* May throw. */
static GstFlowReturn
draw_frame (
    GstStripRender *self, GstBuffer *frame_set, GstBuffer *out, GstClockTime running, bool keep)
{
  GstStripRenderPrivate *priv = self->priv;
  gstrange::RangeFrameMap frame (frame_set, GST_MAP_READ);
  Status status = frame.status ();
  if (status.ok ())
    status = priv->scene.check (frame.views ());
  if (const auto flow = gst_range_flow_return (GST_ELEMENT (self), status); flow != GST_FLOW_OK)
    return flow;
  StripRenderSettings settings;
  {
    std::lock_guard guard (priv->lock);
    settings = priv->settings;
  }
  if (!priv->drawing.can_blend () && settings.strips.mode == rangecast::StripMode::kBlend)
    settings.strips.mode = rangecast::StripMode::kStrips;
  const bool again = frame_set == priv->drawn;
  const auto orbit = settings.camera.at (orbit_time (priv, running));
  priv->scene.build (
      visible_images (priv, frame.views (), settings.view_mask), settings, orbit, again);
  gst_buffer_replace (&priv->drawn, keep ? frame_set : nullptr);
  const auto &home = home_frame (priv, settings, orbit, GST_BUFFER_PTS (frame_set));
  StripDrawingJob job = {&priv->scene, &settings, &home, orbit};
  if (settings.show_stats) {
    job.panel_changed =
        update_panel (self, priv->scene.layers ().size (), GST_BUFFER_PTS (frame_set));
    job.panel = priv->stats_panel.picture ();
  }
  const auto result = priv->drawing.draw (GST_GL_BASE_FILTER (self)->context, job, out);
  if (!result.drawn) {
    GST_ELEMENT_ERROR (self, RESOURCE, WRITE,
        ("OpenGL could not draw into the output: %s", result.reason), (nullptr));
    return GST_FLOW_ERROR;
  }
  if (!again)
    priv->reporter.passed (GST_ELEMENT (self), frame_set);
  std::lock_guard guard (priv->lock);
  priv->settings.camera.shown (result.matrices, home, result.width, result.height);
  priv->scene.count_into (priv->stats);
  priv->stats.uploaded_bytes = result.uploaded;
  priv->stats.uploaded_total += result.uploaded;
  priv->stats.points_total += priv->stats.points;
  priv->stats.frames++;
  priv->stats.repeated += again;
  return GST_FLOW_OK;
}

/* Draws a frame set as it is to be seen at `running`. */
GstFlowReturn
strip_draw_frame (
    GstStripRender *self, GstBuffer *frame_set, GstBuffer *out, GstClockTime running, bool keep)
{
  return strip_guarded (self, [&] { return draw_frame (self, frame_set, out, running, keep); });
}

/* Gives controlled properties their values of that time. A time outside the segment, as of the
 * first frame set after a seek to between two of them, is no stream time: values stay. */
void
strip_sync_values (GstStripRender *self, GstClockTime pts)
{
  const GstClockTime time = strip_stream_time (self, pts);
  if (GST_CLOCK_TIME_IS_VALID (time))
    gst_object_sync_values (GST_OBJECT (self), time);
}
