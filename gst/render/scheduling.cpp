/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* When striprender draws. GstAggregator waits for frame sets, live also for the clock, and calls
 * aggregate() on the source pad's thread. There are two modes:
 *
 * One picture per frame set, if the output has the input's frame rate or none: a picture has the
 * times of its frame set; a late one is skipped.
 *
 * A frame rate of its own, if downstream requested another one than the input's, or keep-rate is
 * set: pictures are at whole multiples of the period, counted from stream position 0. A picture
 * shows the newest frame set that is no more than a quarter of a period after it, so that slightly
 * uneven times neither repeat a frame set nor skip one. Live, a picture whose frame set no later
 * one has followed is drawn a quarter of a period (and upstream's latency) after its time, and has
 * the rest of the period to be drawn in: the stream may stall. */
#include <algorithm>
#include <gstrange/gstrangemeta.h>
#include <gstrange/gstrangepairing.hpp>
#include <utility>

#include "striprenderprivate.hpp"

namespace {

/* Longer durations and gaps are errors of the stream, and not filled with pictures. */
constexpr GstClockTime kMaxGap = 60 * GST_SECOND;

/* The streaming thread needs it, too. */
GstSegment
segment_of (GstStripRender *self)
{
  GstAggregatorPad *sink = self->priv->sink;
  GST_OBJECT_LOCK (sink);
  const GstSegment segment = sink->segment;
  GST_OBJECT_UNLOCK (sink);
  return segment;
}

/* ns from one picture to the next; 0: one per frame set. With the lock. */
GstClockTime
period_of (const GstStripRenderPrivate *priv)
{
  const FrameRate &rate = priv->rate;
  const bool own = rate.n > 0 && (!rate.is_inputs || priv->settings.keep_rate) &&
                   gst_util_fraction_compare (rate.n, rate.d, kMaxFrameRate, 1) <= 0;
  return own ? gst_util_uint64_scale (GST_SECOND, guint64 (rate.d), guint64 (rate.n)) : 0;
}

/* The same; 0 for reverse segments and those not in time, too. */
GstClockTime
own_period (GstStripRender *self)
{
  const GstSegment segment = segment_of (self);
  if (segment.format != GST_FORMAT_TIME || segment.rate <= 0)
    return 0;
  std::lock_guard guard (self->priv->lock);
  return period_of (self->priv);
}

/* The first picture at a stream position or after it. */
GstClockTime
first_picture (const FrameRate &rate, GstClockTime from)
{
  const guint64 second = guint64 (rate.d) * GST_SECOND, n = guint64 (rate.n);
  return gst_util_uint64_scale (gst_util_uint64_scale_ceil (from, n, second), second, n);
}

GstClockTime
running_now (GstStripRender *self)
{
  return gst_element_get_current_running_time (GST_ELEMENT (self));
}

bool
is_live (GstStripRender *self)
{
  return GST_CLOCK_TIME_IS_VALID (gst_aggregator_get_latency (GST_AGGREGATOR (self)));
}

/* ---- late pictures ---- */

bool
is_late (GstStripRender *self, GstClockTime running)
{
  std::lock_guard guard (self->priv->lock);
  const GstClockTime earliest = self->priv->earliest;
  return GST_CLOCK_TIME_IS_VALID (earliest) && GST_CLOCK_TIME_IS_VALID (running) &&
         running <= earliest;
}

/* ns by which a live picture misses its time and the latency; 0 if it does not. */
GstClockTime
lateness_at (GstStripRender *self, GstClockTime running, GstClockTime now)
{
  const GstClockTime latency = gst_aggregator_get_latency (GST_AGGREGATOR (self));
  if (!GST_CLOCK_TIME_IS_VALID (running) || !GST_CLOCK_TIME_IS_VALID (now) ||
      !GST_CLOCK_TIME_IS_VALID (latency))
    return 0;
  /* A sink without a queue before it blocks this thread for the pipeline's latency. */
  std::lock_guard guard (self->priv->lock);
  const GstClockTime last = running + std::max (latency, self->priv->pipeline_latency);
  return now - std::min (now, last);
}

/* Counts pictures that are not drawn because they would be late, and posts a QOS message with the
 * times of the first one. */
void
drop_pictures (GstStripRender *self, guint64 count, GstClockTime pts, GstClockTime duration)
{
  GstStripRenderPrivate *priv = self->priv;
  const GstClockTime running = strip_running_time (self, pts);
  GstClockTime earliest;
  guint64 drawn, dropped;
  {
    std::lock_guard guard (priv->lock);
    dropped = priv->stats.dropped += count;
    drawn = priv->stats.frames;
    earliest = priv->earliest;
  }
  priv->discont = true;
  GST_DEBUG_OBJECT (self,
      "dropping %" G_GUINT64_FORMAT " late frame(s) from running time %" GST_TIME_FORMAT, count,
      GST_TIME_ARGS (running));
  GstMessage *message = gst_message_new_qos (
      GST_OBJECT (self), is_live (self), running, strip_stream_time (self, pts), pts, duration);
  if (GST_CLOCK_TIME_IS_VALID (earliest))
    gst_message_set_qos_values (message, GST_CLOCK_DIFF (running, earliest), 1.0, 1000000);
  gst_message_set_qos_stats (message, GST_FORMAT_BUFFERS, drawn, dropped);
  gst_element_post_message (GST_ELEMENT (self), message);
}

/* Pictures that take longer to draw than is left of their period would all be late, so the latency
 * grows. A few slow pictures do not count (shaders are compiled, the machine is busy); latency
 * never shrinks again, because each change interrupts playback. */
void
adapt_latency (GstStripRender *self, GstClockTime period, GstClockTime took)
{
  constexpr int kMinSlowPictures = 5;
  GstStripRenderPrivate *priv = self->priv;
  const GstClockTime rest = period - period / 4;
  priv->slow_pictures = took > rest + priv->overrun ? priv->slow_pictures + 1 : 0;
  if (priv->slow_pictures < kMinSlowPictures)
    return;
  priv->slow_pictures = 0;
  {
    std::lock_guard guard (priv->lock);
    priv->overrun = std::min<GstClockTime> (took + took / 8 - rest, GST_SECOND);
  }
  strip_update_latency (self);
}

/* ---- drawing ---- */

struct Picture {
  GstBuffer *frame_set;
  GstClockTime pts, duration;
  bool repeated; /* the last one showed the same frame set */
};

GstFlowReturn
draw (GstStripRender *self, const Picture &picture, GstBuffer *&out)
{
  GstStripRenderPrivate *priv = self->priv;
  GstBufferPool *pool = gst_aggregator_get_buffer_pool (GST_AGGREGATOR (self));
  GstFlowReturn flow = pool && priv->backend && gst_buffer_pool_set_active (pool, TRUE)
                           ? gst_buffer_pool_acquire_buffer (pool, &out, nullptr)
                           : GST_FLOW_NOT_NEGOTIATED;
  gst_clear_object (&pool);
  if (flow != GST_FLOW_OK)
    return flow;
  GST_BUFFER_PTS (out) = picture.pts;
  GST_BUFFER_DURATION (out) = picture.duration;
  const GstClockTime capture = gst_range_buffer_get_capture_time (picture.frame_set);
  if (GST_CLOCK_TIME_IS_VALID (capture))
    gst_range_buffer_set_capture_time (out, capture);
  if (priv->discont.exchange (false))
    GST_BUFFER_FLAG_SET (out, GST_BUFFER_FLAG_DISCONT);
  flow = strip_draw_frame (self, picture.frame_set, out, picture.repeated);
  if (flow != GST_FLOW_OK)
    gst_clear_buffer (&out);
  else
    priv->segment_sent = true; /* with the picture */
  return flow;
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
    GstEvent *event = gst_event_new_segment (&priv->sink->segment);
    if (GstEvent *cause = gst_pad_get_sticky_event (GST_PAD (priv->sink), GST_EVENT_SEGMENT, 0)) {
      gst_event_set_seqnum (event, gst_event_get_seqnum (cause));
      gst_event_unref (cause);
    }
    gst_pad_push_event (src, event);
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
  GstBuffer *in = gst_aggregator_pad_pop_buffer (priv->sink);
  if (!in)
    return gst_aggregator_pad_is_eos (priv->sink) ? GST_FLOW_EOS : GST_AGGREGATOR_FLOW_NEED_DATA;
  const GstClockTime pts = GST_BUFFER_PTS (in), duration = GST_BUFFER_DURATION (in);
  GstFlowReturn flow = GST_AGGREGATOR_FLOW_NEED_DATA;
  if (gstrange::is_gap (in)) {
    push_gap (self, in);
  } else if (count_frame_set (priv); is_late (self, strip_running_time (self, pts))) {
    drop_pictures (self, 1, pts, duration);
  } else {
    if (GST_BUFFER_IS_DISCONT (in))
      priv->discont = true;
    GstBuffer *out = nullptr;
    flow = draw (self, {in, pts, duration, false}, out);
    if (flow == GST_FLOW_OK)
      flow = gst_aggregator_finish_buffer (GST_AGGREGATOR (self), out);
    if (GST_CLOCK_TIME_IS_VALID (pts)) /* for the case that downstream requests a rate */
      priv->next = pts + 1;
  }
  gst_buffer_unref (in);
  return flow;
}

/* Draws the next picture if it is in time. */
GstFlowReturn
draw_next (GstStripRender *self, GstClockTime period)
{
  GstStripRenderPrivate *priv = self->priv;
  const GstClockTime pts = priv->next, running = strip_running_time (self, pts);
  priv->next = first_picture (priv->rate, pts + 1);
  if (!GST_CLOCK_TIME_IS_VALID (running))
    return GST_AGGREGATOR_FLOW_NEED_DATA;
  const GstClockTime now = running_now (self), lateness = lateness_at (self, running, now);
  if (lateness > 0) {
    const guint64 more = lateness / period;
    drop_pictures (self, more + 1, pts, period);
    priv->next = first_picture (priv->rate, priv->next + more * period);
    return GST_AGGREGATOR_FLOW_NEED_DATA;
  }
  if (is_late (self, running)) {
    drop_pictures (self, 1, pts, period);
    return GST_AGGREGATOR_FLOW_NEED_DATA;
  }
  GstBuffer *out = nullptr;
  const GstFlowReturn flow =
      draw (self, {priv->frame_set, pts, period, std::exchange (priv->is_built, true)}, out);
  if (flow != GST_FLOW_OK)
    return flow;
  if (is_live (self) && GST_CLOCK_TIME_IS_VALID (now))
    adapt_latency (self, period, running_now (self) - now);
  return gst_aggregator_finish_buffer (GST_AGGREGATOR (self), out);
}

/* ---- output frame rate ---- */

/* Whether the next picture, or that after a gap, is to show a frame set. */
bool
is_due (const GstStripRenderPrivate *priv, GstBuffer *frame_set, GstClockTime period)
{
  const bool timed = GST_BUFFER_PTS_IS_VALID (frame_set);
  const GstClockTime pts = timed ? GST_BUFFER_PTS (frame_set) : priv->follows, next = priv->next;
  return !priv->frame_set || gstrange::is_gap (frame_set) || pts <= next + period / 4 ||
         (pts - next > kMaxGap && next >= priv->end);
}

/* @param frame_set  transfer full */
void
take (GstStripRender *self, GstBuffer *frame_set, GstClockTime period)
{
  GstStripRenderPrivate *priv = self->priv;
  const GstSegment &segment = priv->sink->segment;
  GstClockTime begin = GST_BUFFER_PTS (frame_set), duration = GST_BUFFER_DURATION (frame_set);
  if (!GST_CLOCK_TIME_IS_VALID (begin))
    begin = priv->frame_set ? priv->follows : segment.start;
  const GstClockTime running = strip_running_time (self, begin), now = running_now (self);
  const bool is_ahead = GST_CLOCK_TIME_IS_VALID (running) && GST_CLOCK_TIME_IS_VALID (now) &&
                        is_live (self) && running > now + kMaxGap;
  if (gstrange::is_gap (frame_set) || is_ahead || begin >= G_MAXINT64) {
    if (is_ahead)
      GST_WARNING_OBJECT (self, "dropping a frame set whose time is far ahead of the clock");
    else if (gstrange::is_gap (frame_set) && !priv->frame_set) /* a sink may wait for data */
      push_gap (self, frame_set);
    gst_buffer_unref (frame_set);
    return;
  }
  count_frame_set (priv);
  if (!GST_CLOCK_TIME_IS_VALID (duration) || duration == 0)
    duration = priv->info.frame_duration ();
  if (!GST_CLOCK_TIME_IS_VALID (duration) || duration == 0)
    duration = period;
  gst_buffer_replace (&priv->frame_set, frame_set);
  gst_buffer_unref (frame_set);
  priv->is_built = false;
  duration = std::min (duration, kMaxGap);
  priv->follows = begin + duration;
  priv->end = priv->follows - std::min (period, duration) / 4; /* ends are not exact */
  if (!GST_CLOCK_TIME_IS_VALID (priv->next) || begin > priv->next + kMaxGap ||
      (begin + kMaxGap < priv->next && !is_live (self)))
    priv->next = first_picture (
        priv->rate, std::max<GstClockTime> (begin - std::min (begin, period / 4), segment.start));
}

/* Whether the newest frame set is to be shown once more if no other follows. */
bool
has_more (const GstStripRenderPrivate *priv)
{
  return priv->frame_set && priv->next < priv->end;
}

GstFlowReturn
draw_by_rate (GstStripRender *self, GstClockTime period, bool timeout)
{
  GstStripRenderPrivate *priv = self->priv;
  if (GST_CLOCK_TIME_IS_VALID (priv->next)) /* the rate may be another */
    priv->next = first_picture (priv->rate, priv->next);
  while (GstBuffer *head = gst_aggregator_pad_peek_buffer (priv->sink)) {
    const bool due = is_due (priv, head, period);
    gst_buffer_unref (head);
    if (!due)
      return draw_next (self, period);
    if (GstBuffer *popped = gst_aggregator_pad_pop_buffer (priv->sink))
      take (self, popped, period);
  }
  if (gst_aggregator_pad_is_eos (priv->sink))
    return has_more (priv) ? draw_next (self, period) : GST_FLOW_EOS;
  return timeout && priv->frame_set ? draw_next (self, period) : GST_AGGREGATOR_FLOW_NEED_DATA;
}

} // namespace

GstFlowReturn
gst_strip_render_aggregate (GstAggregator *aggregator, gboolean timeout)
{
  auto self = GST_STRIP_RENDER (aggregator);
  const GstClockTime period = own_period (self);
  const GstFlowReturn flow = period > 0 ? draw_by_rate (self, period, timeout) : draw_each (self);
  if (flow == GST_FLOW_EOS)
    self->priv->reporter.finish ();
  return flow;
}

GstClockTime
gst_strip_render_get_next_time (GstAggregator *aggregator)
{
  auto self = GST_STRIP_RENDER (aggregator);
  GstStripRenderPrivate *priv = self->priv;
  const GstClockTime period = own_period (self);
  if (period == 0 || !priv->frame_set)
    return GST_CLOCK_TIME_NONE;
  const GstClockTime running = strip_running_time (self, priv->next);
  if (!GST_CLOCK_TIME_IS_VALID (running))
    return GST_CLOCK_TIME_NONE;
  /* GstAggregator adds the latency, which includes a period. */
  const GstClockTime due = running + period / 4, own = period + priv->overrun;
  return due - std::min (due, own);
}

void
strip_drain (GstStripRender *self)
{
  GstStripRenderPrivate *priv = self->priv;
  const GstClockTime period = own_period (self);
  while (period > 0 && has_more (priv))
    if (const GstFlowReturn flow = draw_next (self, period);
        flow != GST_FLOW_OK && flow != GST_AGGREGATOR_FLOW_NEED_DATA)
      break;
  gst_clear_buffer (&priv->frame_set);
}

void
strip_drop_late (GstStripRender *self)
{
  GstStripRenderPrivate *priv = self->priv;
  GstBuffer *waiting =
      own_period (self) == 0 ? gst_aggregator_pad_peek_buffer (priv->sink) : nullptr;
  if (!waiting)
    return;
  const GstClockTime running = strip_running_time (self, GST_BUFFER_PTS (waiting));
  const bool late =
      !gstrange::is_gap (waiting) && lateness_at (self, running, running_now (self)) > 0;
  gst_buffer_unref (waiting);
  if (GstBuffer *dropped = late ? gst_aggregator_pad_pop_buffer (priv->sink) : nullptr) {
    count_frame_set (priv);
    drop_pictures (self, 1, GST_BUFFER_PTS (dropped), GST_BUFFER_DURATION (dropped));
    gst_buffer_unref (dropped);
  }
}

void
strip_reset_stream (GstStripRender *self)
{
  GstStripRenderPrivate *priv = self->priv;
  gst_clear_buffer (&priv->frame_set);
  priv->next = GST_CLOCK_TIME_NONE;
  priv->slow_pictures = 0;
  priv->segment_sent = false;
  priv->discont = true;
  std::lock_guard guard (priv->lock);
  priv->earliest = GST_CLOCK_TIME_NONE;
}

/* ---- QoS and latency ---- */

void
strip_update_latency (GstStripRender *self)
{
  GstClockTime own;
  {
    std::lock_guard guard (self->priv->lock);
    const GstClockTime period = period_of (self->priv);
    own = period > 0 ? period + self->priv->overrun : 0;
  }
  gst_aggregator_set_latency (GST_AGGREGATOR (self), own, own);
}

void
strip_handle_timing_event (GstStripRender *self, GstEvent *event)
{
  GstStripRenderPrivate *priv = self->priv;
  if (GST_EVENT_TYPE (event) == GST_EVENT_LATENCY) {
    GstClockTime latency;
    gst_event_parse_latency (event, &latency);
    std::lock_guard guard (priv->lock);
    priv->pipeline_latency = GST_CLOCK_TIME_IS_VALID (latency) ? latency : 0;
    return;
  }
  GstQOSType type;
  GstClockTimeDiff diff;
  GstClockTime time;
  gst_event_parse_qos (event, &type, nullptr, &diff, &time);
  if (!GST_CLOCK_TIME_IS_VALID (time))
    return;
  if (diff > 0 && type != GST_QOS_TYPE_THROTTLE)
    diff *= 2; /* to catch up, instead of being just as late again; as GstVideoDecoder */
  std::lock_guard guard (priv->lock);
  priv->earliest = diff < 0 && GstClockTime (-diff) > time ? 0 : time + GstClockTime (diff);
}

/* ---- times ---- */

GstClockTime
strip_running_time (GstStripRender *self, GstClockTime pts)
{
  const GstSegment segment = segment_of (self);
  if (segment.format != GST_FORMAT_TIME) /* then nothing has a time */
    return GST_CLOCK_TIME_NONE;
  return gst_segment_to_running_time (&segment, GST_FORMAT_TIME, pts);
}

GstClockTime
strip_stream_time (GstStripRender *self, GstClockTime pts)
{
  const GstSegment segment = segment_of (self);
  if (segment.format != GST_FORMAT_TIME)
    return GST_CLOCK_TIME_NONE;
  return gst_segment_to_stream_time (&segment, GST_FORMAT_TIME, pts);
}
