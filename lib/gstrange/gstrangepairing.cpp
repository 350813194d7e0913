/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "gstrangepairing.hpp"

#include "gstrangemeta.h"

namespace gstrange {

GstClockTime
running_time_of (GstAggregatorPad *pad, GstBuffer *buffer)
{
  GST_OBJECT_LOCK (pad);
  const GstClockTime time =
      gst_segment_to_running_time (&pad->segment, GST_FORMAT_TIME, GST_BUFFER_PTS (buffer));
  GST_OBJECT_UNLOCK (pad);
  return time;
}

GstFlowReturn
PairMatcher::take (GstClockTime frame_duration, Pair &pair)
{
  const GstClockTime tolerance =
      GST_CLOCK_TIME_IS_VALID (frame_duration) ? frame_duration / 2 : GstClockTime{0};
  while (true) {
    GstBuffer *buffers[2] = {
        gst_aggregator_pad_peek_buffer (pads_[0]), gst_aggregator_pad_peek_buffer (pads_[1])};
    GstFlowReturn flow = GST_FLOW_OK;
    int drop = -1;
    bool gap = false; /* GstAggregator makes an empty buffer of a GAP event */
    for (int i = 0; i < 2; i++)
      if (buffers[i] && GST_BUFFER_FLAG_IS_SET (buffers[i], GST_BUFFER_FLAG_GAP) &&
          gst_buffer_get_size (buffers[i]) == 0) {
        gst_aggregator_pad_drop_buffer (pads_[i]);
        gap = true;
      }
    if (gap) {
      gst_clear_buffer (&buffers[0]);
      gst_clear_buffer (&buffers[1]);
      continue;
    }
    for (int i = 0; i < 2; i++)
      if (!buffers[i] && gst_aggregator_pad_is_eos (pads_[i]))
        flow = GST_FLOW_EOS;
    if (flow == GST_FLOW_OK && (!buffers[0] || !buffers[1]))
      flow = GST_AGGREGATOR_FLOW_NEED_DATA;
    if (flow == GST_FLOW_OK) {
      const GstClockTime a = running_time_of (pads_[0], buffers[0]);
      const GstClockTime b = running_time_of (pads_[1], buffers[1]);
      const bool timed = GST_CLOCK_TIME_IS_VALID (a) && GST_CLOCK_TIME_IS_VALID (b);
      if (timed && (a > b ? a - b : b - a) > tolerance)
        drop = a < b ? 0 : 1;
    }
    gst_clear_buffer (&buffers[0]);
    gst_clear_buffer (&buffers[1]);
    if (flow != GST_FLOW_OK)
      return flow;
    if (drop < 0)
      break;
    gst_aggregator_pad_drop_buffer (pads_[drop]);
    dropped_[drop]++;
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

void
stamp (GstAggregator *aggregator, GstBuffer *buffer, GstClockTime running_time,
    GstClockTime duration, GstClockTime capture_time)
{
  auto segment = &GST_AGGREGATOR_PAD (aggregator->srcpad)->segment;
  if (GST_CLOCK_TIME_IS_VALID (running_time)) {
    GST_OBJECT_LOCK (aggregator);
    GST_BUFFER_PTS (buffer) = segment->start + running_time;
    segment->position = GST_BUFFER_PTS (buffer);
    GST_OBJECT_UNLOCK (aggregator);
  }
  GST_BUFFER_DURATION (buffer) = duration;
  gst_range_buffer_set_capture_time (buffer, capture_time);
}

} // namespace gstrange
