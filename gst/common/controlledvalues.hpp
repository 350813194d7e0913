/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/base/gstbasetransform.h>

/** Updates controlled properties to the buffer's stream time. A buffer without PTS or outside the
 *  segment (the first one after a seek between two frames) has none, and neither has a
 *  segment in bytes: values stay as they are. */
inline void
sync_controlled_values (GstBaseTransform *base, GstBuffer *buffer)
{
  if (base->segment.format != GST_FORMAT_TIME)
    return;
  const GstClockTime time =
      gst_segment_to_stream_time (&base->segment, GST_FORMAT_TIME, GST_BUFFER_PTS (buffer));
  if (GST_CLOCK_TIME_IS_VALID (time))
    gst_object_sync_values (GST_OBJECT (base), time);
}
