/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "framepairing.hpp"

#include <algorithm>
#include <gstrange/gstrangepairing.hpp>
#include <utility>

using gstrange::gap_end;
using gstrange::is_gap;
using gstrange::running_time_of;

#define MS_FORMAT ".1f ms"
#define MS_ARGS(ns) (double (ns) / GST_MSECOND)

/* Of a live pipeline, ahead of its clock. */
static constexpr GstClockTime kFarAhead = 10 * GST_SECOND;
/* More in a row are no accident, but what a pad has. */
static constexpr int kMaxFarAhead = 5;

/* The oldest buffer of a pad. */
struct PairMatcher::Front {
  GstBuffer *buffer; /* null: none */
  GstClockTime time = GST_CLOCK_TIME_NONE;
  bool gap = false;

  explicit Front (GstAggregatorPad *pad) : buffer (gst_aggregator_pad_peek_buffer (pad))
  {
    if (!buffer)
      return;
    time = running_time_of (pad, buffer);
    gap = is_gap (buffer);
  }
  ~Front () { gst_clear_buffer (&buffer); }
  Front (const Front &) = delete;
  Front &operator= (const Front &) = delete;
};

GstFlowReturn
PairMatcher::pop_pair (GstClockTime frame_duration, Pair &pair)
{
  const GstClockTime tolerance = gstrange::pairing_tolerance (frame_duration);
  for (;;) {
    const Front fronts[2] = {Front (pads_[0]), Front (pads_[1])};
    const Front &a = fronts[0], &b = fronts[1];
    for (int i = 0; i < 2; i++)
      if (!fronts[i].buffer && gst_aggregator_pad_is_eos (pads_[i])) {
        GST_CAT_DEBUG_OBJECT (category_, pads_[i], "EOS");
        return GST_FLOW_EOS;
      }
    if (!a.buffer || !b.buffer)
      return GST_AGGREGATOR_FLOW_NEED_DATA;

    const bool timed = GST_CLOCK_TIME_IS_VALID (a.time) && GST_CLOCK_TIME_IS_VALID (b.time);
    const int newer = a.time < b.time ? 1 : 0;
    if (timed && is_far_ahead (fronts[newer], fronts[1 - newer], newer)) {
      drop (fronts, newer, tolerance);
      warn_far_ahead (fronts[newer], newer);
    } else if (a.gap != b.gap && timed) { /* drop what the gap covers, then the gap itself */
      const int gap = a.gap ? 0 : 1;
      const GstClockTime last = gap_end (fronts[gap].time, fronts[gap].buffer, tolerance);
      drop (fronts, fronts[1 - gap].time > last ? gap : 1 - gap, tolerance);
    } else if (a.gap || b.gap)
      drop (fronts, a.gap ? 0 : 1, tolerance);
    else if (timed && fronts[newer].time - fronts[1 - newer].time > tolerance)
      drop (fronts, 1 - newer, tolerance);
    else
      break;
  }
  pair.first = gst_aggregator_pad_pop_buffer (pads_[0]);
  pair.second = gst_aggregator_pad_pop_buffer (pads_[1]);
  if (pair.first && pair.second) {
    far_ahead_[0] = far_ahead_[1] = 0;
    pair.discont = std::exchange (discont_, false) || GST_BUFFER_IS_DISCONT (pair.first) ||
                   GST_BUFFER_IS_DISCONT (pair.second);
    return GST_FLOW_OK;
  }
  gst_clear_buffer (&pair.first); /* flushed in between */
  gst_clear_buffer (&pair.second);
  return GST_AGGREGATOR_FLOW_NEED_DATA;
}

/* Sources that are not live and stamp buffers by the clock (fdsrc do-timestamp=true) may do so in
 * the moment between the pipeline's clock and its base time, and be hours ahead. */
bool
PairMatcher::is_far_ahead (const Front &front, const Front &other, int side) const
{
  if (far_ahead_[side] >= kMaxFarAhead)
    return false;
  GstElement *element = GST_PAD_PARENT (pads_[0]);
  if (front.time < other.time + kFarAhead || GST_STATE (element) != GST_STATE_PLAYING ||
      !GST_CLOCK_TIME_IS_VALID (gst_aggregator_get_latency (GST_AGGREGATOR (element))))
    return false;
  const GstClockTime now = gst_element_get_current_running_time (element);
  return GST_CLOCK_TIME_IS_VALID (now) && front.time > now + kFarAhead;
}

void
PairMatcher::warn_far_ahead (const Front &front, int side)
{
  GstAggregatorPad *pad = pads_[side];
  far_ahead_[side]++;
  if (std::exchange (warned_far_ahead_, true))
    return;
  GstElement *element = GST_PAD_PARENT (pad);
  const GstClockTime now = gst_element_get_current_running_time (element);
  GST_ELEMENT_WARNING (element, STREAM, FAILED,
      ("Pad %s: dropped a buffer %.0f s ahead of the clock", GST_PAD_NAME (pad),
          (double (front.time) - double (now)) / GST_SECOND),
      ("running time %" GST_TIME_FORMAT "; further ones are only logged",
          GST_TIME_ARGS (front.time)));
}

/* Drops the front of one pad. If either front is a GAP, its time becomes one without pairs; a
 * buffer without duration counts as one frame. */
void
PairMatcher::drop (const Front (&fronts)[2], int side, GstClockTime tolerance)
{
  const Front &front = fronts[side], &other = fronts[1 - side];
  if (front.gap)
    GST_CAT_LOG_OBJECT (category_, pads_[side], "end of the GAP from %" GST_TIME_FORMAT,
        GST_TIME_ARGS (front.time));
  else if (other.gap)
    GST_CAT_DEBUG_OBJECT (category_, pads_[side],
        "dropping frame at %" GST_TIME_FORMAT ": GAP on pad %s", GST_TIME_ARGS (front.time),
        GST_PAD_NAME (pads_[1 - side]));
  else
    GST_CAT_DEBUG_OBJECT (category_, pads_[side],
        "dropping frame at %" GST_TIME_FORMAT ": no partner, pad %s is %" MS_FORMAT
        " ahead, tolerance %" MS_FORMAT,
        GST_TIME_ARGS (front.time), GST_PAD_NAME (pads_[1 - side]),
        MS_ARGS (GST_CLOCK_DIFF (front.time, other.time)), MS_ARGS (tolerance));
  if (!front.gap)
    dropped_[side]++;
  discont_ |= GST_BUFFER_IS_DISCONT (front.buffer);
  if ((front.gap || other.gap) && GST_CLOCK_TIME_IS_VALID (front.time)) {
    const GstClockTime length = GST_BUFFER_DURATION_IS_VALID (front.buffer)
                                    ? GST_BUFFER_DURATION (front.buffer)
                                    : 2 * tolerance;
    const GstClockTime end = front.time + std::min (length, GST_CLOCK_TIME_NONE - 1 - front.time);
    gap_end_ = GST_CLOCK_TIME_IS_VALID (gap_begin_) ? std::max (gap_end_, end) : end;
    gap_begin_ = std::min (gap_begin_, front.time); /* NONE is the maximum */
  }
  gst_aggregator_pad_drop_buffer (pads_[side]);
}

void
PairMatcher::record_output (GstClockTime running_time, GstClockTime duration)
{
  segment_sent_ = true; /* GstAggregator sends it with the first buffer */
  if (GST_CLOCK_TIME_IS_VALID (running_time))
    output_end_ = running_time + (GST_CLOCK_TIME_IS_VALID (duration) ? duration : 0);
}

bool
PairMatcher::pop_gap (GstClockTime until, GstClockTime &begin, GstClockTime &end)
{
  const bool found = GST_CLOCK_TIME_IS_VALID (gap_begin_);
  begin = std::max (gap_begin_, output_end_);
  end = std::min (gap_end_, until);
  gap_begin_ = GST_CLOCK_TIME_NONE;
  return found && begin < end;
}

void
PairMatcher::push_gap (GstAggregator *aggregator, GstClockTime begin, GstClockTime end)
{
  GST_OBJECT_LOCK (aggregator);
  const GstSegment segment = GST_AGGREGATOR_PAD (aggregator->srcpad)->segment;
  GST_OBJECT_UNLOCK (aggregator);
  if (!segment_sent_) { /* GstAggregator sends it with buffers only, and will send it again */
    GstEvent *event = gst_event_new_segment (&segment);
    if (GstEvent *cause = gst_pad_get_sticky_event (GST_PAD (pads_[0]), GST_EVENT_SEGMENT, 0)) {
      gst_event_set_seqnum (event, gst_event_get_seqnum (cause));
      gst_event_unref (cause);
    }
    gst_pad_push_event (aggregator->srcpad, event);
  }
  segment_sent_ = true;
  output_end_ = end;
  const GstClockTime from = gstrange::position_of (segment, begin);
  const GstClockTime to = gstrange::position_of (segment, end);
  GST_CAT_DEBUG_OBJECT (category_, aggregator, "GAP from %" GST_TIME_FORMAT " to %" GST_TIME_FORMAT,
      GST_TIME_ARGS (from), GST_TIME_ARGS (to));
  gst_pad_push_event (aggregator->srcpad, gst_event_new_gap (from, to - from));
}

void
PairMatcher::flush ()
{
  gap_begin_ = GST_CLOCK_TIME_NONE;
  far_ahead_[0] = far_ahead_[1] = 0;
  output_end_ = 0;
  segment_sent_ = false;
}

void
PairMatcher::reset ()
{
  dropped_[0] = dropped_[1] = 0;
  warned_far_ahead_ = false;
  flush ();
}

GstFlowReturn
pop_companion (GstAggregatorPad *pad, GstDebugCategory *category, GstClockTime running_time,
    GstClockTime tolerance, bool timeout, guint64 &dropped, GstBuffer **result)
{
  *result = nullptr;
  while (GstBuffer *buffer = gst_aggregator_pad_peek_buffer (pad)) {
    const GstClockTime time = running_time_of (pad, buffer);
    const bool gap = is_gap (buffer);
    const bool timed = GST_CLOCK_TIME_IS_VALID (time) && GST_CLOCK_TIME_IS_VALID (running_time);
    const GstClockTime last = timed && gap ? gap_end (time, buffer, tolerance) : time + tolerance;
    gst_buffer_unref (buffer);
    if (timed && (time > running_time + tolerance || (gap && last >= running_time))) {
      GST_CAT_DEBUG_OBJECT (category, pad,
          "no frame for the pair at %" GST_TIME_FORMAT ", %s %" GST_TIME_FORMAT,
          GST_TIME_ARGS (running_time), gap ? "GAP from" : "the next one is at",
          GST_TIME_ARGS (time));
      return GST_FLOW_OK;
    }
    if (!gap && (!timed || last >= running_time)) {
      *result = gst_aggregator_pad_pop_buffer (pad);
      return GST_FLOW_OK;
    }
    if (!gap) {
      dropped++;
      GST_CAT_DEBUG_OBJECT (category, pad,
          "dropping frame at %" GST_TIME_FORMAT ": %" MS_FORMAT
          " before the pair at %" GST_TIME_FORMAT,
          GST_TIME_ARGS (time), MS_ARGS (running_time - time), GST_TIME_ARGS (running_time));
    }
    gst_aggregator_pad_drop_buffer (pad);
  }
  if (gst_aggregator_pad_is_eos (pad))
    return GST_FLOW_OK;
  if (!timeout)
    return GST_AGGREGATOR_FLOW_NEED_DATA;
  GST_CAT_DEBUG_OBJECT (category, pad, "no frame for the pair at %" GST_TIME_FORMAT " in time",
      GST_TIME_ARGS (running_time));
  return GST_FLOW_OK;
}

void
log_waiting (GstDebugCategory *category, GstAggregatorPad *pad)
{
  if (!gst_aggregator_pad_has_buffer (pad) && !gst_aggregator_pad_is_eos (pad))
    GST_CAT_LOG_OBJECT (category, pad, "waiting for %s",
        gst_pad_has_current_caps (GST_PAD (pad)) ? "a frame" : "caps and a frame");
}

std::optional<GstVideoInfo>
parse_caps_event (GstDebugCategory *category, GstAggregatorPad *pad, GstEvent *event)
{
  GstCaps *caps;
  GstVideoInfo info;
  gst_event_parse_caps (event, &caps);
  if (!gst_video_info_from_caps (&info, caps)) {
    GST_CAT_WARNING_OBJECT (category, pad, "refused caps %" GST_PTR_FORMAT, caps);
    return {};
  }
  GST_CAT_INFO_OBJECT (category, pad, "caps %" GST_PTR_FORMAT, caps);
  return info;
}

GstClockTime
frame_duration (const std::optional<GstVideoInfo> &info)
{
  return info && info->fps_n > 0 ? gst_util_uint64_scale_int (GST_SECOND, info->fps_d, info->fps_n)
                                 : GST_CLOCK_TIME_NONE;
}

GstAggregatorPad *
add_sink_pad (GstElement *aggregator, const char *name)
{
  GstPadTemplate *pad_template =
      gst_element_class_get_pad_template (GST_ELEMENT_GET_CLASS (aggregator), name);
  auto pad = static_cast<GstPad *> (g_object_new (GST_TYPE_AGGREGATOR_PAD, "name", name,
      "direction", GST_PAD_SINK, "template", pad_template, nullptr));
  gst_element_add_pad (aggregator, pad);
  return GST_AGGREGATOR_PAD (pad);
}
