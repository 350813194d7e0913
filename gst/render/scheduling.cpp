/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* When striprender draws. GstAggregator waits for frame sets, live also for the clock, and calls
 * aggregate() on the source pad's thread; all functions here run on it. There are two modes:
 *
 * One picture per frame set, if the output has the input's frame rate or none: a picture has the
 * times of its frame set. Live, one that is late is skipped if the next frame set is there.
 *
 * A frame rate of its own, if downstream requested another one than the input's, or keep-rate is
 * set: pictures are at whole multiples of the period, counted from stream position 0. A picture
 * shows the newest frame set that is no more than a quarter of a period after it, so that slightly
 * uneven times neither repeat a frame set nor skip one. Live, if no later frame set has
 * arrived, a picture is drawn a quarter of a period (and upstream's latency) after its time: the
 * stream may stall. The rest of the period, and the property latency, is time to draw in. */
#include <algorithm>
#include <gstrange/gstrangemeta.h>
#include <gstrange/gstrangepairing.hpp>
#include <utility>

#include "striprenderprivate.hpp"

namespace {

/* Longer durations and gaps are errors of the stream, and not filled with pictures. */
constexpr GstClockTime kMaxGap = 60 * GST_SECOND;

/* ns from one picture to the next; 0: one per frame set. */
GstClockTime
own_period (const GstStripRenderPrivate *priv)
{
  const GstSegment &segment = priv->sink->segment;
  return segment.format == GST_FORMAT_TIME && segment.rate > 0 ? priv->period : 0;
}

/* The first picture at a stream position or after it. */
GstClockTime
first_picture (const GstVideoInfo &out, GstClockTime from)
{
  const guint64 second = guint64 (out.fps_d) * GST_SECOND, n = guint64 (out.fps_n);
  return gst_util_uint64_scale (gst_util_uint64_scale_ceil (from, n, second), second, n);
}

/* ---- late pictures ---- */

bool
is_late (GstStripRender *self, GstClockTime running)
{
  const GstClockTime earliest = self->priv->earliest;
  return GST_CLOCK_TIME_IS_VALID (earliest) && GST_CLOCK_TIME_IS_VALID (running) &&
         running <= earliest;
}

/* ns by which a live picture misses its time and the latency; 0 if it does not. */
GstClockTime
lateness_at (GstStripRender *self, GstClockTime running)
{
  const GstClockTime now = gst_element_get_current_running_time (GST_ELEMENT (self)),
                     latency = gst_aggregator_get_latency (GST_AGGREGATOR (self));
  if (!GST_CLOCK_TIME_IS_VALID (running) || !GST_CLOCK_TIME_IS_VALID (now) ||
      !GST_CLOCK_TIME_IS_VALID (latency))
    return 0;
  /* A sink without a queue before it blocks this thread for the pipeline's latency. */
  return now - std::min (now, running + std::max (latency, self->priv->pipeline_latency.load ()));
}

/* Counts pictures that are not drawn because they would be late, and posts a QOS message with the
 * times of the first one. */
void
drop_pictures (GstStripRender *self, guint64 count, GstClockTime pts, GstClockTime duration)
{
  GstStripRenderPrivate *priv = self->priv;
  const GstClockTime running = strip_running_time (self, pts), earliest = priv->earliest;
  const bool live = GST_CLOCK_TIME_IS_VALID (gst_aggregator_get_latency (GST_AGGREGATOR (self)));
  guint64 drawn, dropped;
  {
    std::lock_guard guard (priv->lock);
    dropped = priv->stats.dropped += count;
    drawn = priv->stats.frames;
  }
  priv->discont = true;
  GST_DEBUG_OBJECT (self,
      "dropping %" G_GUINT64_FORMAT " late frame(s) from running time %" GST_TIME_FORMAT, count,
      GST_TIME_ARGS (running));
  GstMessage *message = gst_message_new_qos (
      GST_OBJECT (self), live, running, strip_stream_time (self, pts), pts, duration);
  if (GST_CLOCK_TIME_IS_VALID (earliest))
    gst_message_set_qos_values (message, GST_CLOCK_DIFF (running, earliest), 1.0, 1000000);
  gst_message_set_qos_stats (message, GST_FORMAT_BUFFERS, drawn, dropped);
  gst_element_post_message (GST_ELEMENT (self), message);
}

/* ---- drawing ---- */

/* Draws a picture of a frame set and pushes it.
 * @param repeated  the last one showed the same frame set */
GstFlowReturn
draw (GstStripRender *self, GstBuffer *frame_set, GstClockTime pts, GstClockTime duration,
    bool repeated)
{
  GstStripRenderPrivate *priv = self->priv;
  GstBuffer *out = nullptr;
  GstBufferPool *pool = gst_aggregator_get_buffer_pool (GST_AGGREGATOR (self));
  GstFlowReturn flow = pool && priv->backend && gst_buffer_pool_set_active (pool, TRUE)
                           ? gst_buffer_pool_acquire_buffer (pool, &out, nullptr)
                           : GST_FLOW_NOT_NEGOTIATED;
  gst_clear_object (&pool);
  if (flow != GST_FLOW_OK)
    return flow;
  GST_BUFFER_PTS (out) = pts;
  GST_BUFFER_DURATION (out) = duration;
  const GstClockTime capture = gst_range_buffer_get_capture_time (frame_set);
  if (GST_CLOCK_TIME_IS_VALID (capture))
    gst_range_buffer_set_capture_time (out, capture);
  if (std::exchange (priv->discont, false))
    GST_BUFFER_FLAG_SET (out, GST_BUFFER_FLAG_DISCONT);
  flow = strip_draw_frame (self, frame_set, out, repeated);
  if (flow != GST_FLOW_OK) {
    gst_buffer_unref (out);
    return flow;
  }
  priv->segment_sent = true; /* with the picture */
  return gst_aggregator_finish_buffer (GST_AGGREGATOR (self), out);
}

/* Forwards a gap. */
void
push_gap (GstStripRender *self, GstBuffer *gap)
{
  GstStripRenderPrivate *priv = self->priv;
  GstPad *src = GST_AGGREGATOR_SRC_PAD (self);
  if (!GST_CLOCK_TIME_IS_VALID (GST_BUFFER_PTS (gap)) || !gst_pad_has_current_caps (src))
    return;
  if (!std::exchange (priv->segment_sent, true)) { /* GstAggregator sends it with buffers only */
    GstEvent *segment = gst_pad_get_sticky_event (GST_PAD (priv->sink), GST_EVENT_SEGMENT, 0);
    if (segment)
      gst_pad_push_event (src, segment);
  }
  gst_pad_push_event (src, gst_event_new_gap (GST_BUFFER_PTS (gap), GST_BUFFER_DURATION (gap)));
}

void
count_frame_set (GstStripRenderPrivate *priv)
{
  std::lock_guard guard (priv->lock);
  priv->stats.frame_sets++;
}

/* Draws the picture of one frame set, or forwards a gap. */
GstFlowReturn
draw_each (GstStripRender *self)
{
  GstStripRenderPrivate *priv = self->priv;
  gst_clear_buffer (&priv->frame_set);
  priv->next = GST_CLOCK_TIME_NONE;
  GstBuffer *in = gst_aggregator_pad_pop_buffer (priv->sink);
  if (!in)
    return gst_aggregator_pad_is_eos (priv->sink) ? GST_FLOW_EOS : GST_AGGREGATOR_FLOW_NEED_DATA;
  const GstClockTime pts = GST_BUFFER_PTS (in), duration = GST_BUFFER_DURATION (in),
                     running = strip_running_time (self, pts);
  GstFlowReturn flow = GST_AGGREGATOR_FLOW_NEED_DATA;
  if (gstrange::is_gap (in)) {
    push_gap (self, in);
  } else if (count_frame_set (priv);
             is_late (self, running) ||
             (gst_aggregator_pad_has_buffer (priv->sink) && lateness_at (self, running) > 0)) {
    drop_pictures (self, 1, pts, duration);
  } else {
    priv->discont |= bool (GST_BUFFER_IS_DISCONT (in));
    flow = draw (self, in, pts, duration, false);
  }
  gst_buffer_unref (in);
  return flow;
}

/* Draws the next picture if it is in time. */
GstFlowReturn
draw_next (GstStripRender *self)
{
  GstStripRenderPrivate *priv = self->priv;
  const GstClockTime pts = priv->next, running = strip_running_time (self, pts);
  priv->next = first_picture (priv->out, pts + 1);
  if (!GST_CLOCK_TIME_IS_VALID (running))
    return GST_AGGREGATOR_FLOW_NEED_DATA;
  const GstClockTime lateness = lateness_at (self, running);
  if (lateness > 0 || is_late (self, running)) {
    const guint64 more = lateness / priv->period;
    drop_pictures (self, more + 1, pts, priv->period);
    priv->next = first_picture (priv->out, priv->next + more * priv->period);
    return GST_AGGREGATOR_FLOW_NEED_DATA;
  }
  return draw (self, priv->frame_set, pts, priv->period, std::exchange (priv->is_built, true));
}

/* ---- output frame rate ---- */

/* Whether the next picture, or that after a gap, is to show a frame set. One without a time follows
 * the one before. */
bool
is_due (const GstStripRenderPrivate *priv, GstBuffer *frame_set)
{
  if (!priv->frame_set || gstrange::is_gap (frame_set))
    return true;
  const bool timed = GST_BUFFER_PTS_IS_VALID (frame_set);
  const GstClockTime pts = timed ? GST_BUFFER_PTS (frame_set) : priv->end, next = priv->next;
  return pts <= next + priv->period / 4 || (pts - next > kMaxGap && next >= priv->end);
}

/* @param frame_set  transfer full */
void
take (GstStripRender *self, GstBuffer *frame_set)
{
  GstStripRenderPrivate *priv = self->priv;
  const GstClockTime pts = GST_BUFFER_PTS (frame_set), start = priv->sink->segment.start,
                     begin = GST_CLOCK_TIME_IS_VALID (pts) ? pts
                             : priv->frame_set             ? priv->end
                                                           : start;
  if (gstrange::is_gap (frame_set) || begin >= G_MAXINT64) {
    if (!priv->frame_set) /* a sink may wait for data */
      push_gap (self, frame_set);
    gst_buffer_unref (frame_set);
    return;
  }
  count_frame_set (priv);
  GstClockTime duration = GST_BUFFER_DURATION (frame_set);
  if (!GST_CLOCK_TIME_IS_VALID (duration) || duration == 0)
    duration = priv->info.frame_duration ();
  if (!GST_CLOCK_TIME_IS_VALID (duration) || duration == 0)
    duration = priv->period;
  duration = std::min (duration, kMaxGap);
  gst_clear_buffer (&priv->frame_set);
  priv->frame_set = frame_set;
  priv->is_built = false;
  priv->end = begin + duration;
  priv->slack = std::min (priv->period, duration) / 4;
  if (!GST_CLOCK_TIME_IS_VALID (priv->next) || begin > priv->next + kMaxGap ||
      begin + kMaxGap < priv->next)
    priv->next =
        first_picture (priv->out, std::max (begin - std::min (begin, priv->period / 4), start));
}

/* Whether the newest frame set is to be shown once more if no other follows. */
bool
has_more (const GstStripRenderPrivate *priv)
{
  return priv->frame_set && priv->next + priv->slack < priv->end;
}

GstFlowReturn
draw_by_rate (GstStripRender *self, bool timeout)
{
  GstStripRenderPrivate *priv = self->priv;
  while (GstBuffer *head = gst_aggregator_pad_peek_buffer (priv->sink)) {
    const bool due = is_due (priv, head);
    gst_buffer_unref (head);
    if (!due)
      return draw_next (self);
    if (GstBuffer *popped = gst_aggregator_pad_pop_buffer (priv->sink))
      take (self, popped);
  }
  if (gst_aggregator_pad_is_eos (priv->sink))
    return has_more (priv) ? draw_next (self) : GST_FLOW_EOS;
  return timeout && priv->frame_set ? draw_next (self) : GST_AGGREGATOR_FLOW_NEED_DATA;
}

} // namespace

GstFlowReturn
gst_strip_render_aggregate (GstAggregator *aggregator, gboolean timeout)
{
  auto self = GST_STRIP_RENDER (aggregator);
  const GstFlowReturn flow =
      own_period (self->priv) > 0 ? draw_by_rate (self, timeout) : draw_each (self);
  if (flow == GST_FLOW_EOS)
    self->priv->reporter.finish ();
  return flow;
}

GstClockTime
gst_strip_render_get_next_time (GstAggregator *aggregator)
{
  auto self = GST_STRIP_RENDER (aggregator);
  GstStripRenderPrivate *priv = self->priv;
  const GstClockTime period = own_period (priv);
  if (period == 0 || !priv->frame_set)
    return GST_CLOCK_TIME_NONE;
  const GstClockTime running = strip_running_time (self, priv->next);
  if (!GST_CLOCK_TIME_IS_VALID (running))
    return GST_CLOCK_TIME_NONE;
  guint64 more = 0;
  g_object_get (self, "latency", &more, nullptr);
  /* GstAggregator adds the whole latency, which includes a period and `more`. */
  const GstClockTime due = running + period / 4;
  return due - std::min (due, period + more);
}

void
strip_drain (GstStripRender *self)
{
  GstStripRenderPrivate *priv = self->priv;
  while (own_period (priv) > 0 && has_more (priv))
    if (const GstFlowReturn flow = draw_next (self);
        flow != GST_FLOW_OK && flow != GST_AGGREGATOR_FLOW_NEED_DATA)
      break;
  gst_clear_buffer (&priv->frame_set);
}

void
strip_reset_stream (GstStripRender *self)
{
  GstStripRenderPrivate *priv = self->priv;
  gst_clear_buffer (&priv->frame_set);
  priv->next = GST_CLOCK_TIME_NONE;
  priv->segment_sent = false;
  priv->discont = true;
  priv->earliest = GST_CLOCK_TIME_NONE;
}

/* ---- times ---- */

GstClockTime
strip_running_time (GstStripRender *self, GstClockTime pts)
{
  return gst_segment_to_running_time (&self->priv->sink->segment, GST_FORMAT_TIME, pts);
}

GstClockTime
strip_stream_time (GstStripRender *self, GstClockTime pts)
{
  return gst_segment_to_stream_time (&self->priv->sink->segment, GST_FORMAT_TIME, pts);
}
