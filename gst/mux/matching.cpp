/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include <algorithm>
#include <gstrange/gstrangepairing.hpp>
#include <gstrange/gstrangestatus.hpp>

#include "rangemuxprivate.hpp"

using rangecast::Status;
using rangecast::StatusCode;

GST_DEBUG_CATEGORY_EXTERN (gst_range_mux_debug);
#define GST_CAT_DEFAULT gst_range_mux_debug

/* What lasts so long is told. Pictures that a host which stood still sends at once are not. */
static constexpr GstClockTime kWorthTelling = GST_SECOND;
static constexpr GstClockTime kDefaultTolerance = 5 * GST_MSECOND;

void
set_state (GstRangeMux *self, MuxPad &entry, MuxState state, GstClockTime running)
{
  GstRangeMuxPrivate *priv = self->priv;
  if (state != entry.state) {
    std::lock_guard guard (priv->lock);
    entry.state = state;
    entry.since = running;
  }
  if (state == entry.said)
    return;
  const bool lasts = GST_CLOCK_TIME_IS_VALID (running) && GST_CLOCK_TIME_IS_VALID (entry.since) &&
                     running >= entry.since + kWorthTelling;
  if (!lasts && (state == MuxState::kLate || state == MuxState::kOutOfStep))
    return;
  GST_INFO_OBJECT (self, "%s is %s", entry.title ().c_str (), name_of (state));
  if (!priv->live)
    tell_state (GST_ELEMENT (self), entry, state, entry.ahead);
  else
    tell_state (GST_ELEMENT (self), entry, state,
        entry.offset_known ? entry.offset - priv->steps.reference () : 0);
}

GstClockTime
matching_tolerance (GstRangeMuxPrivate *priv)
{
  std::lock_guard guard (priv->lock);
  if (priv->max_skew > 0)
    return priv->max_skew;
  return GST_CLOCK_TIME_IS_VALID (priv->frame_duration) ? priv->frame_duration / 2
                                                        : kDefaultTolerance;
}

void
note_arrivals (GstRangeMux *self, const MuxPads &pads, const WaitingBuffers &waiting)
{
  GstRangeMuxPrivate *priv = self->priv;
  GstClockTime now = GST_CLOCK_TIME_NONE;
  for (const auto &entry : pads)
    entry->waits = false;
  for (const auto *buffers : {&waiting.list, &waiting.gaps})
    for (const Waiting &w : *buffers) {
      w.entry->waits = true;
      if (!GST_CLOCK_TIME_IS_VALID (w.running))
        continue;
      w.entry->seen = w.running;
      now = std::min (now, w.running); /* NONE is the greatest number there is */
    }
  priv->now = now;
  if (!GST_CLOCK_TIME_IS_VALID (now))
    return;
  for (const auto &entry : pads) {
    if (!GST_CLOCK_TIME_IS_VALID (entry->seen))
      entry->seen = now; /* it did not come so far */
    const bool alive = entry->waits || now <= entry->seen || now - entry->seen <= kSilentAfter;
    if (alive != entry->alive)
      priv->caps_dirty = true;
    entry->alive = alive;
    if (!alive && priv->live && !gst_aggregator_pad_is_eos (entry->pad))
      set_state (self, *entry, MuxState::kSilent, now);
  }
}

void
judge_steps (GstRangeMux *self, const MuxPads &pads, const WaitingBuffers &waiting)
{
  GstRangeMuxPrivate *priv = self->priv;
  const GstClockTime base = gst_element_get_base_time (GST_ELEMENT (self));
  for (const Waiting &w : waiting.list)
    if (GST_CLOCK_TIME_IS_VALID (w.running)) {
      std::lock_guard guard (priv->lock);
      w.entry->offset = MuxSteps::offset_of (w.capture, base + w.running);
      w.entry->offset_known = true;
    }
  priv->votes.clear ();
  priv->voters.clear ();
  for (const auto &entry : pads)
    if (entry->chosen && entry->alive && entry->offset_known) {
      priv->votes.push_back ({entry->offset});
      priv->voters.push_back (entry.get ());
    }
  if (priv->steps.judge (priv->votes))
    priv->last.capture = GST_CLOCK_TIME_NONE; /* times of another clock */
  for (std::size_t i = 0; i < priv->voters.size (); i++)
    priv->voters[i]->in_step = priv->votes[i].in_step;
}

void
judge_recordings (GstRangeMux *self, const WaitingBuffers &waiting)
{
  GstRangeMuxPrivate *priv = self->priv;
  if (priv->recordings.judge (waiting.list, priv->last.capture))
    priv->last.capture = GST_CLOCK_TIME_NONE;
  if (const Waiting *apart = MuxRecordings::find_apart (waiting.list);
      apart && !apart->entry->told_apart) {
    apart->entry->told_apart = true;
    set_state (self, *apart->entry, MuxState::kApart, apart->running);
  }
}

void
tell_strangers (GstRangeMux *self, const MuxPads &pads)
{
  while (MuxPad *stranger = MuxRecordings::find_stranger (pads)) {
    stranger->told_apart = true;
    stranger->ahead = 0;
    set_state (self, *stranger, MuxState::kApart, GST_CLOCK_TIME_NONE);
  }
}

/* Whether a buffer can be part of a frame set to come, and why not. */
static MuxState
fate_of (const GstRangeMuxPrivate *priv, const Waiting &w, GstClockTime tolerance)
{
  if (!w.entry->chosen)
    return w.entry->other_rig.ok () ? MuxState::kClash : MuxState::kOtherRig;
  if (!w.entry->in_step)
    return MuxState::kOutOfStep;
  const bool late =
      GST_CLOCK_TIME_IS_VALID (priv->last.capture) && w.capture <= priv->last.capture + tolerance;
  return late ? MuxState::kLate : MuxState::kIn;
}

bool
drop_useless (GstRangeMux *self, const WaitingBuffers &waiting, GstClockTime tolerance)
{
  GstRangeMuxPrivate *priv = self->priv;
  bool any = false;
  for (const Waiting &w : waiting.list) {
    const MuxState fate = fate_of (priv, w, tolerance);
    if (fate == MuxState::kIn)
      continue;
    any = true;
    gst_aggregator_pad_drop_buffer (w.entry->pad);
    {
      std::lock_guard guard (priv->lock);
      w.entry->received++;
      (fate == MuxState::kLate           ? w.entry->late
          : fate == MuxState::kOutOfStep ? w.entry->out_of_step
                                         : w.entry->left_out)++;
    }
    set_state (self, *w.entry, fate, w.running);
  }
  return any;
}

static void
report_clash (GstRangeMux *self, MuxPad &entry)
{
  if (entry.clash_reported)
    return;
  entry.clash_reported = true;
  gst_range_post_warning (GST_ELEMENT (self),
      {StatusCode::kBadValue, "pad " + std::string (GST_PAD_NAME (entry.pad)) +
                                  ": its buffers have view-ids of another pad; dropped"});
}

/* The buffers of one frame set. */
struct Match {
  std::size_t streams = 0;
  FrameTimes times; /* running time: the least of them */
  double speed = 1; /* of that one, see speed_of() */
};

/* Takes the buffers of one frame set from their pads. */
static Match
join_matching (
    GstRangeMux *self, const WaitingBuffers &waiting, GstClockTime first, GstClockTime tolerance)
{
  GstRangeMuxPrivate *priv = self->priv;
  const auto matches = [&] (const Waiting &w) { return w.capture <= first + tolerance; };
  guint memories = 0;
  Match match;
  match.times.capture = first;
  for (const Waiting &w : waiting.list)
    if (matches (w)) {
      memories += gst_buffer_n_memory (w.buffer);
      match.streams++;
    }
  priv->joiner.begin (memories, waiting.list.front ().entry->coded);
  for (const Waiting &w : waiting.list) {
    if (!matches (w))
      continue;
    if (w.running < match.times.running) { /* NONE is the greatest number there is */
      match.times.running = w.running;
      match.speed = speed_of (w);
    }
    gst_aggregator_pad_drop_buffer (w.entry->pad); /* we hold a reference */
    if (!priv->joiner.add (w.buffer))
      report_clash (self, *w.entry);
    w.entry->met = w.entry->met || match.streams > 1;
    set_state (self, *w.entry, MuxState::kIn, w.running);
    std::lock_guard guard (priv->lock);
    w.entry->received++;
    w.entry->matched++;
    w.entry->last_skew = GST_CLOCK_DIFF (first, w.capture);
  }
  return match;
}

/* Live, streams' running times can be compared, and tell when frame sets are due. */
static GstClockTime
running_time_of (const GstRangeMuxPrivate *priv, const Match &match, GstClockTime tolerance)
{
  if (!priv->live)
    return running_time_after (priv->last, match.times, match.speed,
        GST_CLOCK_TIME_IS_VALID (priv->frame_duration) ? priv->frame_duration : 2 * tolerance);
  if (GST_CLOCK_TIME_IS_VALID (match.times.running) && GST_CLOCK_TIME_IS_VALID (priv->last.running))
    return std::max (match.times.running, priv->last.running); /* never backwards */
  return match.times.running;
}

GstFlowReturn
push_frame_set (GstRangeMux *self, const WaitingBuffers &waiting, GstClockTime first,
    GstClockTime tolerance, std::size_t streams)
{
  GstRangeMuxPrivate *priv = self->priv;
  const Match match = join_matching (self, waiting, first, tolerance);
  GstBuffer *frame_set = nullptr;
  const Status status = priv->joiner.finish (frame_set);
  if (const GstFlowReturn flow = gst_range_flow_return (GST_ELEMENT (self), status);
      flow != GST_FLOW_OK)
    return flow;
  priv->last = {first, running_time_of (priv, match, tolerance)};
  gstrange::stamp (
      GST_AGGREGATOR (self), frame_set, priv->last.running, priv->frame_duration, first);
  {
    std::lock_guard guard (priv->lock);
    priv->sent.frames++;
    priv->sent.complete += match.streams == streams;
  }
  priv->reporter.passed (GST_ELEMENT (self), frame_set);
  return gst_aggregator_finish_buffer (GST_AGGREGATOR (self), frame_set);
}
