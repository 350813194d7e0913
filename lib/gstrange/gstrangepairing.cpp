/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "gstrangepairing.hpp"

#include <algorithm>
#include <cmath>

#include "gstrangemeta.h"
#include "gstrangestatus.hpp"

namespace gstrange {

GstClockTime
pairing_tolerance (GstClockTime frame_duration)
{
  return GST_CLOCK_TIME_IS_VALID (frame_duration) ? frame_duration / 2 : 5 * GST_MSECOND;
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

GstClockTime
capture_time_of (GstAggregatorPad *pad, GstBuffer *buffer, bool live)
{
  const GstClockTime capture = gst_range_buffer_get_capture_time (buffer);
  if (GST_CLOCK_TIME_IS_VALID (capture))
    return capture;
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

bool
is_gap (GstBuffer *buffer)
{
  return GST_BUFFER_FLAG_IS_SET (buffer, GST_BUFFER_FLAG_GAP) && gst_buffer_get_size (buffer) == 0;
}

GstClockTime
gap_end (GstClockTime running_time, GstBuffer *gap, GstClockTime tolerance)
{
  GstClockTime length = tolerance;
  if (GST_BUFFER_DURATION_IS_VALID (gap))
    length = GST_BUFFER_DURATION (gap) - std::min (tolerance, GST_BUFFER_DURATION (gap));
  return running_time + std::min (length, GST_CLOCK_TIME_NONE - running_time);
}

GstBuffer *
clip_to_segment (GstAggregator *aggregator, GstAggregatorPad *pad, GstBuffer *buffer)
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
  GST_CAT_DEBUG_OBJECT (gst_range_debug_category (GST_ELEMENT (aggregator)), pad,
      "dropping frame with PTS %" GST_TIME_FORMAT ": outside of %" GST_SEGMENT_FORMAT,
      GST_TIME_ARGS (begin), &pad->segment);
  gst_buffer_unref (buffer);
  return nullptr;
}

GstClockTime
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

} // namespace gstrange
