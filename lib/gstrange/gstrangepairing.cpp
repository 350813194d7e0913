/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "gstrangepairing.hpp"

#include <algorithm>
#include <cmath>

#include "gstrangemeta.h"

namespace gstrange {

GstFlowReturn
take_companion (GstAggregatorPad *pad, GstClockTime running_time, GstClockTime tolerance,
    bool timeout, guint64 &dropped, GstBuffer **result)
{
  *result = nullptr;
  while (GstBuffer *buffer = gst_aggregator_pad_peek_buffer (pad)) {
    const GstClockTime time = running_time_of (pad, buffer);
    const bool gap = is_gap (buffer);
    const bool timed = GST_CLOCK_TIME_IS_VALID (time) && GST_CLOCK_TIME_IS_VALID (running_time);
    const GstClockTime last = timed && gap ? gap_end (time, buffer, tolerance) : time + tolerance;
    gst_buffer_unref (buffer);
    if (timed && (time > running_time + tolerance || (gap && last >= running_time)))
      return GST_FLOW_OK;
    if (!gap && (!timed || last >= running_time)) {
      *result = gst_aggregator_pad_pop_buffer (pad);
      return GST_FLOW_OK;
    }
    gst_aggregator_pad_drop_buffer (pad);
    dropped += !gap;
  }
  return gst_aggregator_pad_is_eos (pad) || timeout ? GST_FLOW_OK : GST_AGGREGATOR_FLOW_NEED_DATA;
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

bool
is_gap (GstBuffer *buffer)
{
  return GST_BUFFER_FLAG_IS_SET (buffer, GST_BUFFER_FLAG_GAP) && gst_buffer_get_size (buffer) == 0;
}

GstClockTime
running_time_of (GstAggregatorPad *pad, GstBuffer *buffer)
{
  GST_OBJECT_LOCK (pad);
  const GstClockTime time =
      gst_segment_to_running_time (&pad->segment, GST_FORMAT_TIME, GST_BUFFER_PTS (buffer));
  GST_OBJECT_UNLOCK (pad);
  return time;
}

GstBuffer *
clip_to_segment (GstAggregator *, GstAggregatorPad *pad, GstBuffer *buffer)
{
  const GstClockTime begin = GST_BUFFER_PTS (buffer);
  if (pad->segment.format != GST_FORMAT_TIME || !GST_CLOCK_TIME_IS_VALID (begin))
    return buffer;
  GstClockTime end = begin;
  if (GST_BUFFER_DURATION_IS_VALID (buffer))
    end += std::min (GST_BUFFER_DURATION (buffer), GST_CLOCK_TIME_NONE - begin);
  guint64 from, to;
  if (gst_segment_clip (&pad->segment, GST_FORMAT_TIME, begin, end, &from, &to))
    return buffer;
  gst_buffer_unref (buffer);
  return nullptr;
}

GstClockTime
gap_end (GstClockTime running_time, GstBuffer *gap, GstClockTime tolerance)
{
  GstClockTime length = tolerance;
  if (GST_BUFFER_DURATION_IS_VALID (gap))
    length = GST_BUFFER_DURATION (gap) - std::min (tolerance, GST_BUFFER_DURATION (gap));
  return running_time + std::min (length, GST_CLOCK_TIME_NONE - running_time);
}

/* Which of the two fronts to drop (0, 1), or -1 where they are a pair. A gap stands for all that
 * would have been captured in it: it takes its partners with it and goes when it is over. */
static int
without_partner (GstBuffer *const buffers[2], const GstClockTime times[2], GstClockTime tolerance)
{
  const bool timed = GST_CLOCK_TIME_IS_VALID (times[0]) && GST_CLOCK_TIME_IS_VALID (times[1]);
  const bool gaps[2] = {is_gap (buffers[0]), is_gap (buffers[1])};
  if (gaps[0] != gaps[1] && timed) {
    const int gap = gaps[0] ? 0 : 1;
    return times[1 - gap] > gap_end (times[gap], buffers[gap], tolerance) ? gap : 1 - gap;
  }
  if (gaps[0] || gaps[1])
    return gaps[0] ? 0 : 1;
  if (timed && (times[0] > times[1] ? times[0] - times[1] : times[1] - times[0]) > tolerance)
    return times[0] < times[1] ? 0 : 1;
  return -1;
}

GstClockTime
pairing_tolerance (GstClockTime frame_duration)
{
  constexpr GstClockTime kUnknownRate = 5 * GST_MSECOND;
  return GST_CLOCK_TIME_IS_VALID (frame_duration) ? frame_duration / 2 : kUnknownRate;
}

/* What a gap took with it is as long as a frame if it does not say how long it is. */
void
PairMatcher::note_gap (GstBuffer *dropped, GstClockTime time, GstClockTime tolerance)
{
  if (!GST_CLOCK_TIME_IS_VALID (time))
    return;
  const GstClockTime length =
      GST_BUFFER_DURATION_IS_VALID (dropped) ? GST_BUFFER_DURATION (dropped) : 2 * tolerance;
  const GstClockTime end = time + std::min (length, GST_CLOCK_TIME_NONE - 1 - time);
  gap_end_ = GST_CLOCK_TIME_IS_VALID (gap_begin_) ? std::max (gap_end_, end) : end;
  gap_begin_ = std::min (gap_begin_, time); /* NONE is the greatest number */
}

bool
PairMatcher::take_gap (GstClockTime &begin, GstClockTime &end)
{
  const bool any = GST_CLOCK_TIME_IS_VALID (gap_begin_);
  begin = gap_begin_;
  end = gap_end_;
  gap_begin_ = GST_CLOCK_TIME_NONE;
  return any;
}

GstFlowReturn
PairMatcher::look (GstClockTime tolerance, int &drop)
{
  GstBuffer *buffers[2] = {
      gst_aggregator_pad_peek_buffer (pads_[0]), gst_aggregator_pad_peek_buffer (pads_[1])};
  GstFlowReturn flow = GST_FLOW_OK;
  if (!buffers[0] || !buffers[1])
    flow = GST_AGGREGATOR_FLOW_NEED_DATA;
  for (int i = 0; i < 2; i++)
    if (!buffers[i] && gst_aggregator_pad_is_eos (pads_[i]))
      flow = GST_FLOW_EOS;
  if (flow == GST_FLOW_OK) {
    const GstClockTime times[2] = {
        running_time_of (pads_[0], buffers[0]), running_time_of (pads_[1], buffers[1])};
    drop = without_partner (buffers, times, tolerance);
    if (drop >= 0 && !is_gap (buffers[drop]))
      dropped_[drop]++;
    if (drop >= 0 && (is_gap (buffers[0]) || is_gap (buffers[1])))
      note_gap (buffers[drop], times[drop], tolerance);
  }
  gst_clear_buffer (&buffers[0]);
  gst_clear_buffer (&buffers[1]);
  return flow;
}

GstFlowReturn
PairMatcher::take (GstClockTime frame_duration, Pair &pair)
{
  const GstClockTime tolerance = pairing_tolerance (frame_duration);
  for (int drop = 0; drop >= 0;) {
    if (const GstFlowReturn flow = look (tolerance, drop); flow != GST_FLOW_OK)
      return flow;
    if (drop >= 0)
      gst_aggregator_pad_drop_buffer (pads_[drop]);
  }
  pair.first = gst_aggregator_pad_pop_buffer (pads_[0]);
  pair.second = gst_aggregator_pad_pop_buffer (pads_[1]);
  if (pair.first && pair.second)
    return GST_FLOW_OK;
  gst_clear_buffer (&pair.first); /* a flush came between */
  gst_clear_buffer (&pair.second);
  return GST_AGGREGATOR_FLOW_NEED_DATA;
}

GstClockTime
capture_time_of (GstAggregatorPad *pad, GstBuffer *buffer, bool live)
{
  const GstClockTime told = gst_range_buffer_get_capture_time (buffer);
  if (GST_CLOCK_TIME_IS_VALID (told))
    return told;
  const GstClockTime running = running_time_of (pad, buffer);
  if (!GST_CLOCK_TIME_IS_VALID (running))
    return 0;
  if (!live)
    return running;
  GstObject *element = gst_object_get_parent (GST_OBJECT (pad));
  const GstClockTime base =
      element ? gst_element_get_base_time (GST_ELEMENT (element)) : GstClockTime{0};
  gst_clear_object (&element);
  return base + running;
}

/* In the output's segment, which has the rate of the last seek. */
static GstClockTime
position_of (const GstSegment &segment, GstClockTime running_time)
{
  const double rate = std::abs (segment.rate);
  return segment.start +
         (rate == 1 ? running_time : GstClockTime (std::round (double (running_time) * rate)));
}

void
stamp (GstAggregator *aggregator, GstBuffer *buffer, GstClockTime running_time,
    GstClockTime duration, GstClockTime capture_time)
{
  auto segment = &GST_AGGREGATOR_PAD (aggregator->srcpad)->segment;
  if (GST_CLOCK_TIME_IS_VALID (running_time)) {
    GST_OBJECT_LOCK (aggregator);
    GST_BUFFER_PTS (buffer) = position_of (*segment, running_time);
    segment->position = GST_BUFFER_PTS (buffer);
    GST_OBJECT_UNLOCK (aggregator);
  }
  GST_BUFFER_DURATION (buffer) = duration;
  gst_range_buffer_set_capture_time (buffer, capture_time);
}

void
GapSender::note_buffer (GstClockTime running_time, GstClockTime duration)
{
  segment_sent_ = true; /* GstAggregator sends it with the first buffer */
  if (GST_CLOCK_TIME_IS_VALID (running_time))
    position_ = running_time + (GST_CLOCK_TIME_IS_VALID (duration) ? duration : 0);
}

bool
GapSender::cut (GstClockTime &begin, GstClockTime end) const
{
  begin = std::max (begin, position_);
  return begin < end;
}

/* GstAggregator sends it with buffers only. It comes again with the first one, which changes
 * nothing. */
static void
push_segment (GstAggregator *aggregator, GstAggregatorPad *cause, const GstSegment &segment)
{
  GstEvent *event = gst_event_new_segment (&segment);
  GstEvent *reason = gst_pad_get_sticky_event (GST_PAD (cause), GST_EVENT_SEGMENT, 0);
  if (reason)
    gst_event_set_seqnum (event, gst_event_get_seqnum (reason));
  gst_clear_event (&reason);
  gst_pad_push_event (aggregator->srcpad, event);
}

void
GapSender::push (
    GstAggregator *aggregator, GstAggregatorPad *cause, GstClockTime begin, GstClockTime end)
{
  GST_OBJECT_LOCK (aggregator);
  const GstSegment segment = GST_AGGREGATOR_PAD (aggregator->srcpad)->segment;
  GST_OBJECT_UNLOCK (aggregator);
  if (!segment_sent_)
    push_segment (aggregator, cause, segment);
  segment_sent_ = true;
  position_ = end;
  begin = position_of (segment, begin);
  gst_pad_push_event (
      aggregator->srcpad, gst_event_new_gap (begin, position_of (segment, end) - begin));
}

} // namespace gstrange
