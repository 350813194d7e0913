/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstaggregator.h>

#include "gstrange-prelude.h"

/* Times of the buffers of an aggregator, for elements that associate buffers of several pads. All
 * times are in ns. */
namespace gstrange {

/** Maximum difference of the running times of buffers that belong together: half a frame, or 5 ms
 *  if the frame duration is GST_CLOCK_TIME_NONE. */
GstClockTime pairing_tolerance (GstClockTime frame_duration);

/** Running time of a buffer on this pad, or GST_CLOCK_TIME_NONE. */
GstClockTime running_time_of (GstAggregatorPad *pad, GstBuffer *buffer);

/** When a buffer was captured: the time of its GstReferenceTimestampMeta; without one the clock
 *  time of its running time in a live pipeline, else its running time. */
GstClockTime capture_time_of (GstAggregatorPad *pad, GstBuffer *buffer, bool live);

/** Whether this is the empty buffer into which GstAggregator turns a GAP event. */
bool is_gap (GstBuffer *buffer);

/** The last running time of a frame that belongs to a gap: the gap's end less the tolerance. A gap
 *  without duration covers one frame. */
GstClockTime gap_end (GstClockTime running_time, GstBuffer *gap, GstClockTime tolerance);

/** GstAggregator's clip(): drops buffers that lie completely outside of the pad's segment, such as
 *  the first frames after an accurate seek. */
GstBuffer *clip_to_segment (GstAggregator *aggregator, GstAggregatorPad *pad, GstBuffer *buffer);

/** Position of a running time in an aggregator's output segment, which starts at running time 0 and
 *  has the rate of the last seek. */
GstClockTime position_of (const GstSegment &segment, GstClockTime running_time);

/** Sets PTS (in the aggregator's output segment), duration and capture time of an output buffer.
 *  @param running_time  GST_CLOCK_TIME_NONE: no PTS */
void stamp (GstAggregator *aggregator, GstBuffer *buffer, GstClockTime running_time,
    GstClockTime duration, GstClockTime capture_time);

} // namespace gstrange
