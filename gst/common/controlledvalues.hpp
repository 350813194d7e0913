/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstbasetransform.h>

/** Sets controlled properties to their values at the buffer's stream time. Without one they stay:
 *  the buffer has no PTS, or is outside the segment, as the first one after a seek between frames.
 */
inline void
sync_controlled_values (GstBaseTransform *base, GstBuffer *buffer)
{
  const GstClockTime time =
      gst_segment_to_stream_time (&base->segment, GST_FORMAT_TIME, GST_BUFFER_PTS (buffer));
  if (GST_CLOCK_TIME_IS_VALID (time))
    gst_object_sync_values (GST_OBJECT (base), time);
}
