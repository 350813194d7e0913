/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include <algorithm>
#include <utility>

#include "striprenderprivate.hpp"

/* ---- late pictures ---- */

void
strip_take_qos (GstStripRender *self, GstEvent *event)
{
  GstStripRenderPrivate *priv = self->priv;
  GstQOSType type;
  gdouble proportion;
  GstClockTimeDiff diff;
  GstClockTime time;
  gst_event_parse_qos (event, &type, &proportion, &diff, &time);
  if (!GST_CLOCK_TIME_IS_VALID (time))
    return;
  if (diff > 0 && type != GST_QOS_TYPE_THROTTLE)
    diff *= 2; /* catches up, instead of being just as late again */
  std::lock_guard guard (priv->lock);
  priv->earliest = diff < 0 && GstClockTime (-diff) > time ? 0 : time + GstClockTime (diff);
}

/* Counts a picture that is not drawn because it would be late, and tells the application. */
void
strip_drop_pictures (GstStripRender *self, guint64 count, GstClockTime pts, GstClockTime duration,
    GstClockTime running)
{
  GstStripRenderPrivate *priv = self->priv;
  GstClockTime earliest;
  guint64 drawn, dropped;
  {
    std::lock_guard guard (priv->lock);
    dropped = priv->stats.dropped += count;
    priv->discont = true;
    drawn = priv->stats.frames;
    earliest = priv->earliest;
  }
  const GstClockTime stream = strip_stream_time (self, pts);
  GstMessage *message =
      gst_message_new_qos (GST_OBJECT (self), priv->live, running, stream, pts, duration);
  if (GST_CLOCK_TIME_IS_VALID (earliest))
    gst_message_set_qos_values (message, GST_CLOCK_DIFF (running, earliest), 1.0, 1000000);
  gst_message_set_qos_stats (message, GST_FORMAT_BUFFERS, drawn, dropped);
  gst_element_post_message (GST_ELEMENT (self), message);
}

void
strip_mark_discont (GstStripRender *self, GstBuffer *out)
{
  std::lock_guard guard (self->priv->lock);
  if (std::exchange (self->priv->discont, false))
    GST_BUFFER_FLAG_SET (out, GST_BUFFER_FLAG_DISCONT);
}

bool
strip_is_late (GstStripRender *self, GstClockTime running)
{
  GstStripRenderPrivate *priv = self->priv;
  if (!gst_base_transform_is_qos_enabled (GST_BASE_TRANSFORM (self)))
    return false;
  std::lock_guard guard (priv->lock);
  return GST_CLOCK_TIME_IS_VALID (priv->earliest) && GST_CLOCK_TIME_IS_VALID (running) &&
         running <= priv->earliest;
}

/* ---- an output with a frame rate of its own ---- */

/* Times that go backwards, or are no times, have no grid. */
bool
strip_has_own_rate (GstStripRender *self)
{
  const GstSegment &segment = GST_BASE_TRANSFORM (self)->segment;
  if (segment.format != GST_FORMAT_TIME || segment.rate <= 0)
    return false;
  std::lock_guard guard (self->priv->lock);
  return self->priv->grid.active ();
}

/* Has go downstream what pictures do not fill of a gap before the one at `next`, stream position,
 * or GST_CLOCK_TIME_NONE if there is none to come. With the source pad's stream lock. */
static void
pass_gap (GstStripRender *self, GstClockTime next)
{
  GstStripRenderPrivate *priv = self->priv;
  StreamGap &gap = priv->gap;
  GstClockTime covered, tolerance;
  {
    std::lock_guard guard (priv->lock);
    covered = priv->grid.covered ();
    tolerance = covered > gap.begin ? priv->grid.tolerance () : 0; /* times are not quite even */
  }
  const GstClockTime begin = std::max (gap.begin, covered), end = std::min (gap.end, next);
  if (begin >= gap.end) /* it is filled, or there is none */
    gap = {};
  if (begin + tolerance >= end)
    return;
  GstEvent *event = gst_event_new_gap (begin, end - begin);
  gst_event_set_gap_flags (event, gap.flags);
  gap.begin = end;
  gst_pad_push_event (GST_BASE_TRANSFORM (self)->srcpad, event);
}

void
strip_apply_rate (GstStripRender *self)
{
  GstStripRenderPrivate *priv = self->priv;
  bool changed;
  {
    std::lock_guard guard (priv->lock);
    const GstClockTime before = priv->grid.period ();
    const bool own = !priv->rate.is_inputs || priv->settings.keep_rate;
    priv->grid.set_rate (own ? priv->rate.n : 0, priv->rate.d);
    changed = priv->grid.period () != before;
    if (!priv->grid.active ())
      priv->grid.drop_frame_sets ();
  }
  if (!changed)
    return;
  if (!strip_has_own_rate (self))
    pass_gap (self, GST_CLOCK_TIME_NONE);
  gst_element_post_message (GST_ELEMENT (self), gst_message_new_latency (GST_OBJECT (self)));
  priv->thread.wake (); /* it may be waiting for a picture of the old rate */
}

/* The next picture, whose frame set is then the caller's. */
static bool
take_picture (GstStripRender *self, GstClockTime until, PictureGrid::Picture &picture)
{
  std::lock_guard guard (self->priv->lock);
  if (!self->priv->grid.take (until, picture))
    return false;
  gst_buffer_ref (picture.frame_set);
  return true;
}

/* A buffer for the picture, with its picture. */
static GstFlowReturn
draw_picture (GstStripRender *self, const PictureGrid::Picture &picture, GstBuffer **out)
{
  GstBaseTransform *base = GST_BASE_TRANSFORM (self);
  const GstFlowReturn flow =
      GST_BASE_TRANSFORM_GET_CLASS (base)->prepare_output_buffer (base, picture.frame_set, out);
  if (flow != GST_FLOW_OK)
    return flow;
  GST_BUFFER_PTS (*out) = picture.pts;
  GST_BUFFER_DTS (*out) = GST_CLOCK_TIME_NONE;
  GST_BUFFER_DURATION (*out) = picture.duration;
  if (picture.gap)
    GST_BUFFER_FLAG_SET (*out, GST_BUFFER_FLAG_DISCONT);
  else
    GST_BUFFER_FLAG_UNSET (*out, GST_BUFFER_FLAG_DISCONT);
  strip_mark_discont (self, *out);
  strip_sync_values (self, picture.pts);
  const GstFlowReturn drawn = strip_draw_frame (
      self, picture.frame_set, *out, strip_running_time (self, picture.pts), true);
  if (drawn != GST_FLOW_OK)
    gst_clear_buffer (out);
  return drawn;
}

/* Draws the next picture before `until` that is in time. @return GST_FLOW_OK without a buffer if
 * there is none. */
GstFlowReturn
strip_draw_next (GstStripRender *self, GstClockTime until, GstBuffer **out)
{
  GstFlowReturn flow = GST_FLOW_OK;
  PictureGrid::Picture picture;
  *out = nullptr;
  while (flow == GST_FLOW_OK && !*out && take_picture (self, until, picture)) {
    const GstClockTime running = strip_running_time (self, picture.pts);
    if (strip_is_late (self, running))
      strip_drop_pictures (self, 1, picture.pts, picture.duration, running);
    else if (GST_CLOCK_TIME_IS_VALID (running)) /* else nobody would see it */
      flow = draw_picture (self, picture, out);
    gst_buffer_unref (picture.frame_set);
  }
  return flow;
}

/* Draws and pushes, with the source pad's stream lock, all pictures before `until`. */
static void
drain (GstStripRender *self, GstClockTime until)
{
  GstBuffer *out = nullptr;
  while (strip_draw_next (self, until, &out) == GST_FLOW_OK && out)
    if (gst_pad_push (GST_BASE_TRANSFORM (self)->srcpad, out) != GST_FLOW_OK)
      break;
}

/* Draws what is still to come of all frame sets. */
static void
drain_all (GstStripRender *self)
{
  GstStripRenderPrivate *priv = self->priv;
  GstClockTime end;
  {
    std::lock_guard guard (priv->lock);
    end = priv->grid.until_the_end ();
  }
  if (strip_has_own_rate (self))
    drain (self, end);
  pass_gap (self, GST_CLOCK_TIME_NONE);
  gst_clear_buffer (&priv->drawn);
}

void
strip_drain (GstStripRender *self)
{
  drain_all (self);
  std::lock_guard guard (self->priv->lock);
  self->priv->grid.drop_frame_sets ();
}

void
strip_drain_and_reset (GstStripRender *self)
{
  drain_all (self);
  std::lock_guard guard (self->priv->lock);
  self->priv->grid.reset ();
  self->priv->flow = GST_FLOW_OK; /* what comes is another stream: it may be let in */
}

void
strip_take_latency (GstStripRender *self, GstEvent *event)
{
  GstClockTime latency;
  gst_event_parse_latency (event, &latency);
  std::lock_guard guard (self->priv->lock);
  self->priv->pipeline_latency = GST_CLOCK_TIME_IS_VALID (latency) ? latency : 0;
}

static bool
learn_latency (GstStripRender *self)
{
  GstStripRenderPrivate *priv = self->priv;
  gboolean live = FALSE;
  GstClockTime latency = 0;
  GstQuery *query = gst_query_new_latency ();
  if (gst_pad_peer_query (GST_BASE_TRANSFORM (self)->sinkpad, query))
    gst_query_parse_latency (query, &live, &latency, nullptr);
  gst_query_unref (query);
  std::lock_guard guard (priv->lock);
  priv->latency = latency;
  return live;
}

/* The thread draws on if the last push went well, and frame sets are to be held. */
static bool
thread_draws (GstStripRender *self)
{
  GstStripRenderPrivate *priv = self->priv;
  if (!priv->live || !strip_has_own_rate (self))
    return false;
  std::lock_guard guard (priv->lock);
  return priv->flow == GST_FLOW_OK;
}

/* Stream position of the next picture, or GST_CLOCK_TIME_NONE. */
static GstClockTime
next_pts (GstStripRender *self)
{
  std::lock_guard guard (self->priv->lock);
  return self->priv->grid.next_pts ();
}

/* When the next picture is to be begun: as soon as its frame set is sure. Running time. */
static GstClockTime
next_due (GstStripRender *self)
{
  GstStripRenderPrivate *priv = self->priv;
  GstClockTime pts, wait;
  {
    std::lock_guard guard (priv->lock);
    pts = priv->grid.next_pts ();
    wait = priv->latency + priv->grid.tolerance ();
  }
  const GstSegment &segment = GST_BASE_TRANSFORM (self)->segment;
  if (!GST_CLOCK_TIME_IS_VALID (pts))
    return GST_CLOCK_TIME_NONE;
  if (pts < segment.start) /* begins before the segment */
    return 0;
  const GstClockTime running = strip_running_time (self, pts);
  return GST_CLOCK_TIME_IS_VALID (running) ? running + wait : GST_CLOCK_TIME_NONE;
}

/* Leaves out what could not be in time any more. A sink without a queue before it holds the thread
 * until a picture's time: what comes later than the pipeline's latency is late, not what comes
 * later than its turn. */
static void
catch_up (GstStripRender *self, GstClockTime now)
{
  GstStripRenderPrivate *priv = self->priv;
  GstClockTime slack;
  {
    std::lock_guard guard (priv->lock);
    const GstClockTime own = priv->latency + priv->grid.period ();
    /* What drawing takes beyond a period is no time in which it may begin. */
    slack = std::max (priv->pipeline_latency, own + priv->overdraw) - priv->overdraw -
            priv->latency - priv->grid.tolerance ();
  }
  guint64 late = 0;
  PictureGrid::Picture picture;
  for (GstClockTime due = next_due (self); GST_CLOCK_TIME_IS_VALID (due) && due + slack < now;
       due = next_due (self)) {
    if (!take_picture (self, GST_CLOCK_TIME_NONE, picture))
      break;
    late += GST_CLOCK_TIME_IS_VALID (strip_running_time (self, picture.pts));
    gst_buffer_unref (picture.frame_set);
  }
  if (late > 0)
    strip_drop_pictures (
        self, late, picture.pts, picture.duration, strip_running_time (self, picture.pts));
}

static void
set_flow (GstStripRender *self, GstFlowReturn flow)
{
  std::lock_guard guard (self->priv->lock);
  self->priv->flow = flow;
}

/* Of the drawing thread, which ends its work, as a source does: upstream hears of it with its next
 * frame set, which a stream that stalls does not have. */
static void
tell_flow (GstStripRender *self, GstFlowReturn flow)
{
  if (flow != GST_FLOW_NOT_LINKED && flow >= GST_FLOW_EOS) /* FLUSHING is no failure either */
    return;
  GST_ELEMENT_FLOW_ERROR (self, flow);
  gst_pad_push_event (GST_BASE_TRANSFORM (self)->srcpad, gst_event_new_eos ());
}

/* Pictures that take longer to draw than is left of their period would all be late, so the pipeline
 * is told of more latency. One slow picture is none (shaders are made, the machine has other work);
 * less again is never told, for each change is a jolt. */
static void
adapt_latency (GstStripRender *self, GstClockTime took)
{
  constexpr int kManySlow = 5;
  GstStripRenderPrivate *priv = self->priv;
  {
    std::lock_guard guard (priv->lock);
    const GstClockTime period = priv->grid.period ();
    const GstClockTime rest = period - std::min (period, priv->grid.tolerance ());
    const bool slow = period > 0 && took > rest + priv->overdraw;
    priv->slow_pictures = slow ? priv->slow_pictures + 1 : 0;
    if (priv->slow_pictures < kManySlow)
      return;
    priv->slow_pictures = 0;
    priv->overdraw = std::min<GstClockTime> (took + took / 8 - rest, GST_SECOND);
  }
  gst_element_post_message (GST_ELEMENT (self), gst_message_new_latency (GST_OBJECT (self)));
}

/* Draws what is due now, one picture at most. @return when to call again, running time */
static GstClockTime
draw_due (GstStripRender *self)
{
  GstStripRenderPrivate *priv = self->priv;
  GstBaseTransform *base = GST_BASE_TRANSFORM (self);
  const GstClockTime now = strip_running_now (self);
  if (!GST_CLOCK_TIME_IS_VALID (now))
    return GST_CLOCK_TIME_NONE;
  catch_up (self, now);
  pass_gap (self, next_pts (self));
  const GstClockTime due = next_due (self);
  if (!GST_CLOCK_TIME_IS_VALID (due) || due > now)
    return due;
  GstClockTime after_it;
  {
    std::lock_guard guard (priv->lock);
    after_it = priv->grid.next_pts () + priv->grid.tolerance () + 1;
  }
  GstBuffer *out = nullptr;
  GstFlowReturn flow = strip_draw_next (self, after_it, &out);
  const bool pushed = out;
  if (out) {
    const GstClockTime drawn = strip_running_now (self);
    if (GST_CLOCK_TIME_IS_VALID (drawn) && drawn > now)
      adapt_latency (self, drawn - now);
    base->segment.position = GST_BUFFER_PTS (out);
    flow = gst_pad_push (base->srcpad, out);
  }
  set_flow (self, flow);
  if (pushed)
    tell_flow (self, flow);
  if (flow != GST_FLOW_OK)
    return GST_CLOCK_TIME_NONE;
  pass_gap (self, next_pts (self)); /* if this was the last picture before it */
  return next_due (self);
}

/* Negotiates anew where downstream wants that. @return whether there are pictures to draw */
static bool
renegotiate (GstStripRender *self)
{
  GstBaseTransform *base = GST_BASE_TRANSFORM (self);
  strip_apply_rate (self);
  if (gst_base_transform_reconfigure (base))
    return thread_draws (self);
  const bool flushing = GST_PAD_IS_FLUSHING (base->srcpad);
  const bool told = self->priv->no_context || self->priv->gl_error_posted;
  set_flow (self, flushing ? GST_FLOW_FLUSHING : GST_FLOW_NOT_NEGOTIATED);
  if (!flushing && !told)
    tell_flow (self, GST_FLOW_NOT_NEGOTIATED);
  return false;
}

static GstClockTime
tick (GstElement *element)
{
  auto self = GST_STRIP_RENDER (element);
  GstBaseTransform *base = GST_BASE_TRANSFORM (self);
  StreamLocks locks (base);
  if (!thread_draws (self) || GST_PAD_IS_FLUSHING (base->srcpad))
    return GST_CLOCK_TIME_NONE;
  const bool draws = renegotiate (self);
  locks.give_up_sink ();
  return draws ? draw_due (self) : GST_CLOCK_TIME_NONE;
}

/* With both stream locks. */
static void
set_live (GstStripRender *self, bool live)
{
  GstStripRenderPrivate *priv = self->priv;
  std::lock_guard guard (priv->lock);
  priv->live = live;
  priv->grid.set_live (live);
}

/* On the streaming thread. Live without a clock, there is nothing to draw by. */
void
strip_learn_whether_live (GstStripRender *self)
{
  GstStripRenderPrivate *priv = self->priv;
  if (priv->live_known)
    return;
  const bool live = learn_latency (self) && GST_CLOCK_TIME_IS_VALID (strip_running_now (self));
  StreamLocks locks (GST_BASE_TRANSFORM (self));
  set_live (self, live);
  priv->live_known = true;
}

bool
strip_follows_grid (GstStripRender *self, GstClockTime pts)
{
  std::lock_guard guard (self->priv->lock);
  PictureGrid &grid = self->priv->grid;
  if (!GST_CLOCK_TIME_IS_VALID (pts))
    return true;
  if (GST_CLOCK_TIME_IS_VALID (grid.last ()) && pts < grid.last ())
    return false;
  grid.begin_after (pts);
  return true;
}

/* For the grid, which takes the frame set. */
GstFlowReturn
strip_hand_to_grid (GstStripRender *self, GstBuffer *in)
{
  GstStripRenderPrivate *priv = self->priv;
  GstClockTime duration = GST_BUFFER_DURATION (in);
  if (!GST_CLOCK_TIME_IS_VALID (duration) || duration == 0)
    duration = priv->info.frame_duration ();
  if (priv->live && !priv->thread.start (GST_ELEMENT (self), tick)) {
    StreamLocks locks (GST_BASE_TRANSFORM (self));
    set_live (self, false); /* then pictures come with the frame sets */
  }
  bool idle;
  {
    std::lock_guard guard (priv->lock);
    if (priv->live && priv->flow != GST_FLOW_OK) {
      gst_buffer_unref (in);
      return priv->flow;
    }
    idle = !GST_CLOCK_TIME_IS_VALID (priv->grid.next_pts ());
    priv->grid.add (in, duration);
  }
  if (priv->live && idle)
    priv->thread.wake ();
  return GST_FLOW_OK;
}

bool
strip_take_gap (GstStripRender *self, GstEvent *event)
{
  GstStripRenderPrivate *priv = self->priv;
  StreamGap gap;
  GstClockTime duration;
  gst_event_parse_gap (event, &gap.begin, &duration);
  gst_event_parse_gap_flags (event, &gap.flags);
  if (gap.begin >= G_MAXINT64) /* there are no pictures so late */
    return false;
  const bool endless = !GST_CLOCK_TIME_IS_VALID (duration); /* nobody knows how long */
  gap.end = gap.begin + (endless ? 0 : std::min<GstClockTime> (duration, G_MAXINT64));
  bool held;
  {
    std::lock_guard guard (priv->lock);
    held = priv->grid.holds_any ();
  }
  if (!held || !strip_has_own_rate (self))
    return false;
  if (!priv->live)
    drain (self, gap.end);
  const GstClockTime next = next_pts (self);
  if (endless)
    return GST_CLOCK_TIME_IS_VALID (next);
  if (priv->gap.end > priv->gap.begin) /* the one before waits for pictures before it */
    gap.begin = priv->gap.begin;
  priv->gap = gap;
  pass_gap (self, next);
  if (priv->live)
    priv->thread.wake ();
  return true;
}

void
strip_give_back (GstStripRender *self)
{
  GstStripRenderPrivate *priv = self->priv;
  bool drawn_is_held = false;
  const auto frame_set = [&] (std::size_t i) -> GstBuffer * {
    std::lock_guard guard (priv->lock);
    return i < priv->grid.frame_sets () ? priv->grid.frame_set (i) : nullptr;
  };
  std::size_t i = 0;
  while (GstBuffer *theirs = frame_set (i)) { /* which nobody changes while we have both locks */
    GstBuffer *copy = gst_buffer_copy_deep (theirs);
    if (theirs == priv->drawn) {
      gst_buffer_replace (&priv->drawn, copy);
      drawn_is_held = true;
    }
    {
      std::lock_guard guard (priv->lock);
      priv->grid.exchange_frame_set (i++, copy);
    }
    gst_buffer_unref (theirs);
  }
  if (!drawn_is_held)
    gst_clear_buffer (&priv->drawn);
}

void
strip_reset_rate (GstStripRender *self)
{
  GstStripRenderPrivate *priv = self->priv;
  priv->live_known = false;
  priv->gap = {};
  gst_clear_buffer (&priv->drawn);
  std::lock_guard guard (priv->lock);
  priv->grid.reset ();
  priv->earliest = GST_CLOCK_TIME_NONE;
  priv->overdraw = 0;
  priv->slow_pictures = 0;
  priv->flow = GST_FLOW_OK;
  priv->discont = false;
}

/* A live picture is begun when its frame set is sure, a quarter of a period after its time, and has
 * the rest of the period to be drawn in, and longer where that has turned out to be too short. */
gboolean
strip_answer_latency (GstStripRender *self, GstQuery *query)
{
  GstStripRenderPrivate *priv = self->priv;
  if (!gst_pad_peer_query (GST_BASE_TRANSFORM (self)->sinkpad, query))
    return FALSE;
  gboolean live;
  GstClockTime least, most;
  gst_query_parse_latency (query, &live, &least, &most);
  std::lock_guard guard (priv->lock);
  priv->latency = least;
  const GstClockTime period = priv->grid.period ();
  const GstClockTime own = live && period > 0 ? period + priv->overdraw : 0;
  gst_query_set_latency (
      query, live, least + own, GST_CLOCK_TIME_IS_VALID (most) ? most + own : most);
  return TRUE;
}
