/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include <algorithm>

#include "striprenderstate.hpp"

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
    drawn = priv->stats.frames;
    earliest = priv->earliest;
  }
  const GstClockTime stream =
      gst_segment_to_stream_time (&GST_BASE_TRANSFORM (self)->segment, GST_FORMAT_TIME, pts);
  GstMessage *message =
      gst_message_new_qos (GST_OBJECT (self), priv->live, running, stream, pts, duration);
  if (GST_CLOCK_TIME_IS_VALID (earliest))
    gst_message_set_qos_values (message, GST_CLOCK_DIFF (running, earliest), 1.0, 1000000);
  gst_message_set_qos_stats (message, GST_FORMAT_BUFFERS, drawn, dropped);
  gst_element_post_message (GST_ELEMENT (self), message);
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
    end = priv->grid.end ();
  }
  if (strip_has_own_rate (self))
    drain (self, end);
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
    slack = std::max (priv->pipeline_latency, own) - priv->latency - priv->grid.tolerance ();
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
  if (out) {
    base->segment.position = GST_BUFFER_PTS (out);
    flow = gst_pad_push (base->srcpad, out);
  }
  {
    std::lock_guard guard (priv->lock);
    priv->flow = flow;
  }
  return flow == GST_FLOW_OK ? next_due (self) : GST_CLOCK_TIME_NONE;
}

static GstClockTime
tick (GstElement *element)
{
  auto self = GST_STRIP_RENDER (element);
  GstBaseTransform *base = GST_BASE_TRANSFORM (self);
  StreamLocks locks (base);
  if (!thread_draws (self) || GST_PAD_IS_FLUSHING (base->srcpad))
    return GST_CLOCK_TIME_NONE;
  strip_apply_rate (self);
  if (!gst_base_transform_reconfigure (base)) {
    std::lock_guard guard (self->priv->lock);
    self->priv->flow =
        GST_PAD_IS_FLUSHING (base->srcpad) ? GST_FLOW_FLUSHING : GST_FLOW_NOT_NEGOTIATED;
  }
  locks.give_up_sink ();
  return thread_draws (self) ? draw_due (self) : GST_CLOCK_TIME_NONE;
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
  priv->live = live;
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
    priv->live = false; /* then pictures come with the frame sets */
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

/* The grid fills gaps itself. @return whether that is all that is to be done */
bool
strip_take_gap (GstStripRender *self, GstEvent *event)
{
  GstStripRenderPrivate *priv = self->priv;
  GstClockTime begin, duration;
  gst_event_parse_gap (event, &begin, &duration);
  {
    std::lock_guard guard (priv->lock);
    if (!priv->grid.holds_any ())
      return false;
  }
  if (!strip_has_own_rate (self))
    return false;
  if (!priv->live)
    drain (self, GST_CLOCK_TIME_IS_VALID (duration) && duration < G_MAXUINT64 - begin
                     ? begin + duration
                     : begin);
  return true;
}

void
strip_reset_rate (GstStripRender *self)
{
  GstStripRenderPrivate *priv = self->priv;
  priv->live_known = false;
  gst_clear_buffer (&priv->drawn);
  std::lock_guard guard (priv->lock);
  priv->grid.reset ();
  priv->earliest = GST_CLOCK_TIME_NONE;
  priv->flow = GST_FLOW_OK;
}

/* A live picture is begun when its frame set is sure, a quarter of a period after its time, and has
 * the rest of the period to be drawn in. */
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
  const GstClockTime own = live ? priv->grid.period () : 0;
  gst_query_set_latency (
      query, live, least + own, GST_CLOCK_TIME_IS_VALID (most) ? most + own : most);
  return TRUE;
}
