/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* When striprender draws. There are two modes:
 *
 * One picture per frame set: the output has the input's frame rate, or none.
 *   chain -> submit_input_buffer() -> transform() -> push, all on the streaming thread. A picture
 *   has the times of its frame set; a late one is skipped.
 *
 * A frame rate of its own: downstream asked for another one than the input's, or keep-rate is set.
 *   chain -> submit_input_buffer() -> OutputSchedule, which says when there are pictures and which
 *   frame set each of them shows. They are drawn
 *   - not live: by generate_output() on the streaming thread, once no later frame set can replace
 *     theirs;
 *   - live: by the source pad's task, by the clock, also while the stream stalls.
 *   Serialized events go out after the pictures before them: drain() draws those on the streaming
 *   thread, live or not. The part of a GAP that pictures do not cover is kept in priv->gap until
 *   they are out.
 *
 * Locks, in the order in which they are taken:
 * 1. the sink pad's stream lock, which the streaming thread holds;
 * 2. the source pad's stream lock. The thread that draws and pushes holds it while both may:
 *    for serialized events and queries, and for each picture of the task. The task takes both to
 *    negotiate and releases the sink pad's before it draws, so that frame sets come in meanwhile;
 * 3. GstStripRenderPrivate::lock (settings, statistics, schedule), or OutputTask's own lock. No
 * other lock is taken while one of them is held, and nothing is pushed, posted or queried. */
#include <algorithm>
#include <utility>

#include "striprenderprivate.hpp"

namespace {

using Picture = OutputSchedule::Picture;

/* Both stream locks in their order. */
class StreamLocks {
public:
  explicit StreamLocks (GstBaseTransform *base) : base_ (base)
  {
    GST_PAD_STREAM_LOCK (base_->sinkpad);
    GST_PAD_STREAM_LOCK (base_->srcpad);
  }
  ~StreamLocks ()
  {
    GST_PAD_STREAM_UNLOCK (base_->srcpad);
    if (has_sink_)
      GST_PAD_STREAM_UNLOCK (base_->sinkpad);
  }
  StreamLocks (const StreamLocks &) = delete;
  StreamLocks &operator= (const StreamLocks &) = delete;
  void unlock_sink ()
  {
    GST_PAD_STREAM_UNLOCK (base_->sinkpad);
    has_sink_ = false;
  }

private:
  GstBaseTransform *base_;
  bool has_sink_ = true;
};

GstClockTime output_tick (GstElement *element);
void push_gap (GstStripRender *self, GstClockTime next);

GstBaseTransformClass *
parent_class ()
{
  return GST_BASE_TRANSFORM_CLASS (g_type_class_peek (GST_TYPE_GL_BASE_FILTER));
}

/* ---- mode ---- */

/* False for reverse segments and those not in time. With either stream lock. */
bool
has_own_rate (GstStripRender *self)
{
  const GstSegment &segment = GST_BASE_TRANSFORM (self)->segment;
  if (segment.format != GST_FORMAT_TIME || segment.rate <= 0)
    return false;
  std::lock_guard guard (self->priv->lock);
  return self->priv->schedule.active ();
}

/* With both stream locks. */
void
set_live (GstStripRender *self, bool live)
{
  GstStripRenderPrivate *priv = self->priv;
  std::lock_guard guard (priv->lock);
  priv->live = live;
  priv->schedule.set_live (live);
}

/* Once per stream, on the streaming thread. */
void
query_whether_live (GstStripRender *self)
{
  GstStripRenderPrivate *priv = self->priv;
  if (priv->live_known)
    return;
  gboolean live = FALSE;
  GstClockTime latency = 0;
  GstQuery *query = gst_query_new_latency ();
  if (gst_pad_peer_query (GST_BASE_TRANSFORM (self)->sinkpad, query))
    gst_query_parse_latency (query, &live, &latency, nullptr);
  gst_query_unref (query);
  const bool has_clock = GST_CLOCK_TIME_IS_VALID (strip_running_now (self));
  GST_DEBUG_OBJECT (self, "upstream is %slive%s, latency %" GST_TIME_FORMAT, live ? "" : "not ",
      live && !has_clock ? ", but there is no clock to draw by" : "", GST_TIME_ARGS (latency));
  {
    std::lock_guard guard (priv->lock);
    priv->upstream_latency = latency;
  }
  StreamLocks locks (GST_BASE_TRANSFORM (self));
  set_live (self, live && has_clock);
  priv->live_known = true;
}

/* ---- late pictures ---- */

const char *const kLateReason = "late according to QoS events";

bool
is_late (GstStripRender *self, GstClockTime running)
{
  GstStripRenderPrivate *priv = self->priv;
  if (!gst_base_transform_is_qos_enabled (GST_BASE_TRANSFORM (self)))
    return false;
  std::lock_guard guard (priv->lock);
  return GST_CLOCK_TIME_IS_VALID (priv->earliest) && GST_CLOCK_TIME_IS_VALID (running) &&
         running <= priv->earliest;
}

/* Counts pictures that are not drawn, because they would be late, and posts a QOS message with the
 * times of the last one. */
void
drop_pictures (GstStripRender *self, const char *reason, guint64 count, GstClockTime pts,
    GstClockTime duration)
{
  GstStripRenderPrivate *priv = self->priv;
  const GstClockTime running = strip_running_time (self, pts);
  GstClockTime earliest;
  guint64 drawn, dropped;
  {
    std::lock_guard guard (priv->lock);
    priv->stats.dropped += count;
    dropped = priv->stats.dropped;
    priv->discont = true;
    drawn = priv->stats.frames;
    earliest = priv->earliest;
  }
  GST_DEBUG_OBJECT (self,
      "dropping %" G_GUINT64_FORMAT " picture(s) up to running time %" GST_TIME_FORMAT ": %s",
      count, GST_TIME_ARGS (running), reason);
  GstMessage *message = gst_message_new_qos (
      GST_OBJECT (self), priv->live, running, strip_stream_time (self, pts), pts, duration);
  if (GST_CLOCK_TIME_IS_VALID (earliest))
    gst_message_set_qos_values (message, GST_CLOCK_DIFF (running, earliest), 1.0, 1000000);
  gst_message_set_qos_stats (message, GST_FORMAT_BUFFERS, drawn, dropped);
  gst_element_post_message (GST_ELEMENT (self), message);
}

/* ---- frame sets come in ---- */

bool
negotiate (GstStripRender *self)
{
  GstBaseTransform *base = GST_BASE_TRANSFORM (self);
  if (self->priv->live && has_own_rate (self))
    return true; /* the task negotiates */
  StreamLocks locks (base);
  strip_select_mode (self);
  return gst_base_transform_reconfigure (base) && gst_pad_has_current_caps (base->srcpad);
}

/* For a picture that is not in the schedule: it becomes the schedule's last one, for the case that
 * downstream asks for a rate.
 * @return false if it is before that, as when downstream has just given up a rate of its own */
bool
follows_schedule (GstStripRender *self, GstClockTime pts)
{
  std::lock_guard guard (self->priv->lock);
  OutputSchedule &schedule = self->priv->schedule;
  if (!GST_CLOCK_TIME_IS_VALID (pts))
    return true;
  if (GST_CLOCK_TIME_IS_VALID (schedule.last ()) && pts < schedule.last ())
    return false;
  schedule.begin_after (pts);
  return true;
}

/* @param in  transfer full */
GstFlowReturn
schedule_frame_set (GstStripRender *self, GstBuffer *in)
{
  GstStripRenderPrivate *priv = self->priv;
  GstBaseTransform *base = GST_BASE_TRANSFORM (self);
  GstClockTime duration = GST_BUFFER_DURATION (in);
  if (!GST_CLOCK_TIME_IS_VALID (duration) || duration == 0)
    duration = priv->info.frame_duration ();
  if (priv->live && !priv->task.start (base->srcpad, output_tick)) {
    GST_WARNING_OBJECT (self, "could not start the output task: drawing as if not live");
    StreamLocks locks (base);
    set_live (self, false);
  }
  guint removed;
  bool idle;
  {
    std::unique_lock guard (priv->lock);
    if (priv->live && priv->task_flow != GST_FLOW_OK) {
      const GstFlowReturn flow = priv->task_flow;
      guard.unlock ();
      GST_DEBUG_OBJECT (self, "dropping frame set: the output task's last push returned %s",
          gst_flow_get_name (flow));
      gst_buffer_unref (in);
      return flow;
    }
    idle = !GST_CLOCK_TIME_IS_VALID (priv->schedule.next_pts ());
    removed = priv->schedule.add (in, duration);
  }
  if (removed > 0)
    GST_DEBUG_OBJECT (
        self, "removed %u frame set(s) whose times are wrong, or which are too many", removed);
  if (priv->live && idle)
    priv->task.wake ();
  return GST_FLOW_OK;
}

} // namespace

/* Replaces GstBaseTransform's, which drops late buffers by their input times and sends QoS messages
 * of its own: pictures of the schedule have other times. It negotiates as that one does. */
GstFlowReturn
gst_strip_render_submit_input_buffer (GstBaseTransform *base, gboolean, GstBuffer *in)
{
  auto self = GST_STRIP_RENDER (base);
  GstStripRenderPrivate *priv = self->priv;
  const GstClockTime pts = GST_BUFFER_PTS (in), duration = GST_BUFFER_DURATION (in);
  GST_LOG_OBJECT (self, "%" GST_PTR_FORMAT, in);
  if (!gst_pad_has_current_caps (base->sinkpad) || !negotiate (self)) {
    const bool flushing = GST_PAD_IS_FLUSHING (base->srcpad);
    GST_DEBUG_OBJECT (self, "dropping frame set: %s", flushing ? "flushing" : "not negotiated");
    gst_buffer_unref (in);
    return flushing ? GST_FLOW_FLUSHING : GST_FLOW_NOT_NEGOTIATED;
  }
  {
    std::lock_guard guard (priv->lock);
    priv->stats.frame_sets++;
  }
  query_whether_live (self);
  if (has_own_rate (self))
    return schedule_frame_set (self, in);
  const bool late = is_late (self, strip_running_time (self, pts));
  if (late || !follows_schedule (self, pts)) {
    drop_pictures (self, late ? kLateReason : "before the last picture", 1, pts, duration);
    gst_buffer_unref (in);
    return GST_BASE_TRANSFORM_FLOW_DROPPED;
  }
  gst_clear_buffer (&base->queued_buf);
  base->queued_buf = in; /* for generate_output() of the base class, which calls transform() */
  return GST_FLOW_OK;
}

/* ---- pictures of the schedule ---- */

namespace {

/* The next picture, whose frame set is then the caller's. */
bool
next_picture (GstStripRender *self, GstClockTime limit, Picture &picture)
{
  std::lock_guard guard (self->priv->lock);
  if (!self->priv->schedule.next (limit, picture))
    return false;
  gst_buffer_ref (picture.frame_set);
  return true;
}

GstFlowReturn
draw_picture (GstStripRender *self, const Picture &picture, GstBuffer **out)
{
  GstBaseTransform *base = GST_BASE_TRANSFORM (self);
  GstFlowReturn flow =
      GST_BASE_TRANSFORM_GET_CLASS (base)->prepare_output_buffer (base, picture.frame_set, out);
  if (flow != GST_FLOW_OK) {
    GST_DEBUG_OBJECT (self, "no output buffer: %s", gst_flow_get_name (flow));
    return flow;
  }
  GST_BUFFER_PTS (*out) = picture.pts;
  GST_BUFFER_DTS (*out) = GST_CLOCK_TIME_NONE;
  GST_BUFFER_DURATION (*out) = picture.duration;
  if (picture.discont)
    GST_BUFFER_FLAG_SET (*out, GST_BUFFER_FLAG_DISCONT);
  else
    GST_BUFFER_FLAG_UNSET (*out, GST_BUFFER_FLAG_DISCONT);
  flow = strip_draw_frame (self, picture.frame_set, *out, true);
  if (flow != GST_FLOW_OK)
    gst_clear_buffer (out);
  return flow;
}

/* Draws the next picture that is in time and whose frame set is certain, given that none before
 * `limit` (stream position) follows. @return GST_FLOW_OK without a buffer if there is none */
GstFlowReturn
draw_next (GstStripRender *self, GstClockTime limit, GstBuffer **out)
{
  GstFlowReturn flow = GST_FLOW_OK;
  Picture picture;
  *out = nullptr;
  while (flow == GST_FLOW_OK && !*out && next_picture (self, limit, picture)) {
    const GstClockTime running = strip_running_time (self, picture.pts);
    if (is_late (self, running))
      drop_pictures (self, kLateReason, 1, picture.pts, picture.duration);
    else if (GST_CLOCK_TIME_IS_VALID (running))
      flow = draw_picture (self, picture, out);
    else
      GST_DEBUG_OBJECT (self, "skipping picture of %" GST_TIME_FORMAT ": outside the segment",
          GST_TIME_ARGS (picture.pts));
    gst_buffer_unref (picture.frame_set);
  }
  return flow;
}

} // namespace

/* On the streaming thread, again and again until there is no buffer. */
GstFlowReturn
gst_strip_render_generate_output (GstBaseTransform *base, GstBuffer **out)
{
  auto self = GST_STRIP_RENDER (base);
  GstStripRenderPrivate *priv = self->priv;
  if (!has_own_rate (self))
    return parent_class ()->generate_output (base, out);
  *out = nullptr;
  if (priv->live)
    return GST_FLOW_OK;
  GstClockTime limit;
  {
    std::lock_guard guard (priv->lock);
    limit = priv->schedule.known_until ();
  }
  return draw_next (self, limit, out);
}

/* ---- the output task: live pictures by the clock ---- */

namespace {

/* Stream position of the next picture, or GST_CLOCK_TIME_NONE. */
GstClockTime
next_pts (GstStripRender *self)
{
  std::lock_guard guard (self->priv->lock);
  return self->priv->schedule.next_pts ();
}

/* Running time at which the next picture is due: as soon as its frame set is certain. */
GstClockTime
next_due (GstStripRender *self)
{
  GstStripRenderPrivate *priv = self->priv;
  GstClockTime pts, wait;
  {
    std::lock_guard guard (priv->lock);
    pts = priv->schedule.next_pts ();
    wait = priv->upstream_latency + priv->schedule.tolerance ();
  }
  const GstSegment &segment = GST_BASE_TRANSFORM (self)->segment;
  if (!GST_CLOCK_TIME_IS_VALID (pts))
    return GST_CLOCK_TIME_NONE;
  if (pts < segment.start)
    return 0; /* to be skipped at once */
  const GstClockTime running = strip_running_time (self, pts);
  return GST_CLOCK_TIME_IS_VALID (running) ? running + wait : GST_CLOCK_TIME_NONE;
}

/* Drops what could not be in time any more. A sink without a queue before it blocks the task until
 * a picture's time: late is what comes later than the pipeline's latency, not what comes later than
 * its turn. */
void
drop_overdue (GstStripRender *self, GstClockTime now)
{
  GstStripRenderPrivate *priv = self->priv;
  GstClockTime slack;
  {
    std::lock_guard guard (priv->lock);
    const GstClockTime own = priv->upstream_latency + priv->schedule.period ();
    /* What drawing takes beyond a period is no time in which it may begin. */
    slack = std::max (priv->pipeline_latency, own + priv->overrun) - priv->overrun -
            priv->upstream_latency - priv->schedule.tolerance ();
  }
  guint64 late = 0;
  Picture picture;
  for (GstClockTime due = next_due (self); GST_CLOCK_TIME_IS_VALID (due) && due + slack < now;
       due = next_due (self)) {
    if (!next_picture (self, GST_CLOCK_TIME_NONE, picture))
      break;
    late += GST_CLOCK_TIME_IS_VALID (strip_running_time (self, picture.pts));
    gst_buffer_unref (picture.frame_set);
  }
  if (late > 0)
    drop_pictures (self, "overdue", late, picture.pts, picture.duration);
}

/* Pictures that take longer to draw than is left of their period would all be late, so the latency
 * grows. A few slow pictures do not count (shaders are compiled, the machine is busy); latency
 * never shrinks again, because each change interrupts playback. */
void
adapt_latency (GstStripRender *self, GstClockTime took)
{
  constexpr int kMinSlowPictures = 5;
  GstStripRenderPrivate *priv = self->priv;
  GstClockTime overrun;
  {
    std::lock_guard guard (priv->lock);
    const GstClockTime period = priv->schedule.period ();
    const GstClockTime rest = period - std::min (period, priv->schedule.tolerance ());
    const bool slow = period > 0 && took > rest + priv->overrun;
    priv->slow_pictures = slow ? priv->slow_pictures + 1 : 0;
    if (priv->slow_pictures < kMinSlowPictures)
      return;
    priv->slow_pictures = 0;
    overrun = priv->overrun = std::min<GstClockTime> (took + took / 8 - rest, GST_SECOND);
  }
  GST_DEBUG_OBJECT (self,
      "drawing takes %" GST_TIME_FORMAT ": %" GST_TIME_FORMAT " of latency beyond a period",
      GST_TIME_ARGS (took), GST_TIME_ARGS (overrun));
  gst_element_post_message (GST_ELEMENT (self), gst_message_new_latency (GST_OBJECT (self)));
}

/* A failure ends the task's work, as a source's: upstream gets it with its next frame set, which
 * does not come while the stream stalls. */
void
set_task_flow (GstStripRender *self, GstFlowReturn flow, bool posts_error)
{
  {
    std::lock_guard guard (self->priv->lock);
    self->priv->task_flow = flow;
  }
  if (flow == GST_FLOW_OK)
    return;
  GST_DEBUG_OBJECT (self, "the output task draws no more: %s", gst_flow_get_name (flow));
  if (!posts_error || (flow != GST_FLOW_NOT_LINKED && flow >= GST_FLOW_EOS)) /* or FLUSHING */
    return;
  GST_ELEMENT_FLOW_ERROR (self, flow);
  gst_pad_push_event (GST_BASE_TRANSFORM (self)->srcpad, gst_event_new_eos ());
}

/* Draws what is due now, one picture at most. @return when to call again, running time */
GstClockTime
draw_due (GstStripRender *self)
{
  GstStripRenderPrivate *priv = self->priv;
  GstBaseTransform *base = GST_BASE_TRANSFORM (self);
  const GstClockTime now = strip_running_now (self);
  if (!GST_CLOCK_TIME_IS_VALID (now))
    return GST_CLOCK_TIME_NONE;
  drop_overdue (self, now);
  push_gap (self, next_pts (self));
  const GstClockTime due = next_due (self);
  if (!GST_CLOCK_TIME_IS_VALID (due) || due > now) {
    GST_LOG_OBJECT (
        self, "next picture is due at running time %" GST_TIME_FORMAT, GST_TIME_ARGS (due));
    return due;
  }
  GstClockTime limit;
  {
    std::lock_guard guard (priv->lock);
    limit = priv->schedule.next_pts () + priv->schedule.tolerance () + 1;
  }
  GstBuffer *out = nullptr;
  GstFlowReturn flow = draw_next (self, limit, &out);
  const bool drawn = out;
  if (drawn) {
    const GstClockTime done = strip_running_now (self);
    if (GST_CLOCK_TIME_IS_VALID (done) && done > now)
      adapt_latency (self, done - now);
    base->segment.position = GST_BUFFER_PTS (out);
    flow = gst_pad_push (base->srcpad, out);
  }
  set_task_flow (self, flow, drawn); /* drawing has posted its own error */
  if (flow != GST_FLOW_OK)
    return GST_CLOCK_TIME_NONE;
  push_gap (self, next_pts (self)); /* if this was the last picture before it */
  return next_due (self);
}

/* With either stream lock. */
bool
task_draws (GstStripRender *self)
{
  GstStripRenderPrivate *priv = self->priv;
  if (!priv->live || !has_own_rate (self))
    return false;
  std::lock_guard guard (priv->lock);
  return priv->task_flow == GST_FLOW_OK;
}

GstClockTime
output_tick (GstElement *element)
{
  auto self = GST_STRIP_RENDER (element);
  GstStripRenderPrivate *priv = self->priv;
  GstBaseTransform *base = GST_BASE_TRANSFORM (self);
  StreamLocks locks (base);
  if (!task_draws (self) || GST_PAD_IS_FLUSHING (base->srcpad))
    return GST_CLOCK_TIME_NONE;
  strip_select_mode (self);
  if (!gst_base_transform_reconfigure (base)) {
    const bool flushing = GST_PAD_IS_FLUSHING (base->srcpad);
    const bool posted = priv->no_context || priv->gl_error_posted;
    set_task_flow (
        self, flushing ? GST_FLOW_FLUSHING : GST_FLOW_NOT_NEGOTIATED, !flushing && !posted);
    return GST_CLOCK_TIME_NONE;
  }
  if (!task_draws (self)) /* downstream has asked for another rate */
    return GST_CLOCK_TIME_NONE;
  locks.unlock_sink ();
  return draw_due (self);
}

/* ---- gaps ---- */

/* Sends the part of the gap that pictures before `next` do not cover. `next` is the position of the
 * next picture, or GST_CLOCK_TIME_NONE if there is none. With the source pad's stream lock. */
void
push_gap (GstStripRender *self, GstClockTime next)
{
  GstStripRenderPrivate *priv = self->priv;
  StreamGap &gap = priv->gap;
  GstClockTime covered, tolerance;
  {
    std::lock_guard guard (priv->lock);
    covered = priv->schedule.covered ();
    tolerance = covered > gap.begin ? priv->schedule.tolerance () : 0; /* for rounded times */
  }
  const GstClockTime begin = std::max (gap.begin, covered), end = std::min (gap.end, next);
  if (begin >= gap.end) /* it is filled, or there is none */
    gap = {};
  if (begin + tolerance >= end)
    return;
  GstEvent *event = gst_event_new_gap (begin, end - begin);
  gst_event_set_gap_flags (event, gap.flags);
  gap.begin = end;
  GST_DEBUG_OBJECT (self, "gap of %" GST_TIME_FORMAT " from %" GST_TIME_FORMAT,
      GST_TIME_ARGS (end - begin), GST_TIME_ARGS (begin));
  gst_pad_push_event (GST_BASE_TRANSFORM (self)->srcpad, event);
}

/* Draws and pushes, with both stream locks, all pictures before `limit`. */
void
drain_until (GstStripRender *self, GstClockTime limit)
{
  GstBuffer *out = nullptr;
  while (draw_next (self, limit, &out) == GST_FLOW_OK && out)
    if (gst_pad_push (GST_BASE_TRANSFORM (self)->srcpad, out) != GST_FLOW_OK)
      break;
}

/* Fills a gap with pictures of the frame sets that are held; the rest of it is sent in its turn.
 * With both stream locks.
 * @return false if there are none: the event is to be forwarded */
bool
handle_gap (GstStripRender *self, GstEvent *event)
{
  GstStripRenderPrivate *priv = self->priv;
  StreamGap gap;
  GstClockTime duration;
  gst_event_parse_gap (event, &gap.begin, &duration);
  gst_event_parse_gap_flags (event, &gap.flags);
  if (gap.begin >= G_MAXINT64) /* the schedule ends there */
    return false;
  const bool open_end = !GST_CLOCK_TIME_IS_VALID (duration);
  gap.end = gap.begin + (open_end ? 0 : std::min<GstClockTime> (duration, G_MAXINT64));
  {
    std::lock_guard guard (priv->lock);
    if (priv->schedule.frame_sets () == 0)
      return false;
  }
  if (!has_own_rate (self))
    return false;
  if (!priv->live)
    drain_until (self, gap.end);
  const GstClockTime next = next_pts (self);
  if (open_end)
    return GST_CLOCK_TIME_IS_VALID (next);
  if (priv->gap.end > priv->gap.begin) /* the one before still waits for pictures before it */
    gap.begin = priv->gap.begin;
  priv->gap = gap;
  push_gap (self, next);
  if (priv->live)
    priv->task.wake ();
  return true;
}

/* ---- serialized events and queries, with both stream locks ---- */

/* Draws and pushes what frame sets are still to show, and removes them.
 * @param new_stream  pictures to come need not be later than those */
void
drain (GstStripRender *self, bool new_stream)
{
  GstStripRenderPrivate *priv = self->priv;
  GstClockTime limit;
  {
    std::lock_guard guard (priv->lock);
    limit = priv->schedule.drain_limit ();
  }
  if (has_own_rate (self))
    drain_until (self, limit);
  push_gap (self, GST_CLOCK_TIME_NONE);
  gst_clear_buffer (&priv->drawn);
  std::lock_guard guard (priv->lock);
  if (new_stream) {
    priv->schedule.reset ();
    priv->task_flow = GST_FLOW_OK; /* its frame sets may be accepted */
  } else
    priv->schedule.remove_frame_sets ();
}

/* Replaces all frame sets that are held by copies, so that upstream gets their memory back. */
void
replace_frame_sets (GstStripRender *self)
{
  GstStripRenderPrivate *priv = self->priv;
  bool drawn_is_held = false;
  const auto frame_set = [&] (std::size_t i) -> GstBuffer * {
    std::lock_guard guard (priv->lock);
    return i < priv->schedule.frame_sets () ? priv->schedule.frame_set (i) : nullptr;
  };
  std::size_t i = 0;
  while (GstBuffer *original = frame_set (i)) { /* both stream locks keep it there */
    GstBuffer *copy = gst_buffer_copy_deep (original);
    if (original == priv->drawn) {
      gst_buffer_replace (&priv->drawn, copy);
      drawn_is_held = true;
    }
    {
      std::lock_guard guard (priv->lock);
      priv->schedule.replace_frame_set (i++, copy);
    }
    gst_buffer_unref (original);
  }
  if (!drawn_is_held)
    gst_clear_buffer (&priv->drawn);
}

bool
is_other_input (GstBaseTransform *base, GstEvent *caps_event)
{
  GstCaps *caps, *current = gst_pad_get_current_caps (base->sinkpad);
  gst_event_parse_caps (caps_event, &caps);
  const bool other = !current || !gst_caps_is_equal (current, caps);
  gst_clear_caps (&current);
  return other;
}

} // namespace

gboolean
gst_strip_render_sink_event (GstBaseTransform *base, GstEvent *event)
{
  auto self = GST_STRIP_RENDER (base);
  if (!(gst_event_type_get_flags (GST_EVENT_TYPE (event)) & GST_EVENT_TYPE_SERIALIZED))
    return parent_class ()->sink_event (base, event);
  StreamLocks locks (base);
  switch (GST_EVENT_TYPE (event)) {
    case GST_EVENT_FLUSH_STOP:
      strip_reset_stream (self);
      break;
    case GST_EVENT_CAPS:
      if (is_other_input (base, event))
        drain (self, false);
      break;
    case GST_EVENT_SEGMENT:
    case GST_EVENT_SEGMENT_DONE:
    case GST_EVENT_STREAM_START:
      drain (self, true);
      break;
    case GST_EVENT_EOS:
      drain (self, true);
      self->priv->reporter.finish ();
      break;
    case GST_EVENT_GAP:
      if (handle_gap (self, event)) {
        gst_event_unref (event);
        return TRUE;
      }
      break;
    default:
      break;
  }
  return parent_class ()->sink_event (base, event);
}

void
strip_select_mode (GstStripRender *self)
{
  GstStripRenderPrivate *priv = self->priv;
  GstClockTime before, period;
  FrameRate rate;
  {
    std::lock_guard guard (priv->lock);
    before = priv->schedule.period ();
    rate = priv->rate;
    const bool own = !rate.is_inputs || priv->settings.keep_rate;
    priv->schedule.set_rate (own ? rate.n : 0, rate.d);
    period = priv->schedule.period ();
    if (!priv->schedule.active ())
      priv->schedule.remove_frame_sets ();
  }
  if (period == before)
    return;
  if (period > 0)
    GST_DEBUG_OBJECT (self, "output at a frame rate of its own, %d/%d", rate.n, rate.d);
  else
    GST_DEBUG_OBJECT (self, "output of one picture per frame set");
  if (!has_own_rate (self))
    push_gap (self, GST_CLOCK_TIME_NONE);
  gst_element_post_message (GST_ELEMENT (self), gst_message_new_latency (GST_OBJECT (self)));
  priv->task.wake (); /* it may be waiting for a picture of the old rate */
}

void
strip_reset_stream (GstStripRender *self)
{
  GstStripRenderPrivate *priv = self->priv;
  priv->live_known = false;
  priv->gap = {};
  gst_clear_buffer (&priv->drawn);
  std::lock_guard guard (priv->lock);
  priv->schedule.reset ();
  priv->earliest = GST_CLOCK_TIME_NONE;
  priv->overrun = 0;
  priv->slow_pictures = 0;
  priv->task_flow = GST_FLOW_OK;
  priv->discont = false;
}

/* ---- QoS and latency ---- */

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

namespace {

/* A live picture is begun when its frame set is certain, a quarter of a period after its time, and
 * has the rest of the period to be drawn in, and longer where that has turned out to be too short.
 */
gboolean
answer_latency (GstStripRender *self, GstQuery *query)
{
  GstStripRenderPrivate *priv = self->priv;
  if (!gst_pad_peer_query (GST_BASE_TRANSFORM (self)->sinkpad, query))
    return FALSE;
  gboolean live;
  GstClockTime min, max;
  gst_query_parse_latency (query, &live, &min, &max);
  GstClockTime own;
  {
    std::lock_guard guard (priv->lock);
    priv->upstream_latency = min;
    const GstClockTime period = priv->schedule.period ();
    own = live && period > 0 ? period + priv->overrun : 0;
  }
  GST_DEBUG_OBJECT (self, "latency: upstream %" GST_TIME_FORMAT ", own %" GST_TIME_FORMAT,
      GST_TIME_ARGS (min), GST_TIME_ARGS (own));
  gst_query_set_latency (query, live, min + own, GST_CLOCK_TIME_IS_VALID (max) ? max + own : max);
  return TRUE;
}

} // namespace

gboolean
gst_strip_render_query (GstBaseTransform *base, GstPadDirection direction, GstQuery *query)
{
  auto self = GST_STRIP_RENDER (base);
  if (direction == GST_PAD_SRC && GST_QUERY_TYPE (query) == GST_QUERY_LATENCY)
    return answer_latency (self, query);
  if (direction != GST_PAD_SINK ||
      !(gst_query_type_get_flags (GST_QUERY_TYPE (query)) & GST_QUERY_TYPE_SERIALIZED))
    return parent_class ()->query (base, direction, query);
  StreamLocks locks (base); /* the base class may negotiate */
  if (GST_QUERY_TYPE (query) == GST_QUERY_DRAIN)
    replace_frame_sets (self);
  return parent_class ()->query (base, direction, query);
}

/* ---- times ---- */

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
