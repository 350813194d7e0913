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

/** The stream lock of the sink pad, for stop(). GstBaseTransform has stopped buffers and events by
 *  then, but GStreamer 1.22 still passes serialized queries to flushing pads, and an ALLOCATION
 *  query may call set_caps(). */
[[nodiscard]] inline GRecMutexLocker *
lock_stream (GstBaseTransform *base)
{
  return g_rec_mutex_locker_new (GST_PAD_GET_STREAM_LOCK (GST_BASE_TRANSFORM_SINK_PAD (base)));
}

/** transform_meta() of elements whose output has the capture time, but no other meta of the input.
 */
inline gboolean
keep_capture_time (GstBaseTransform *, GstBuffer *, GstMeta *meta, GstBuffer *)
{
  return meta->info->api == GST_REFERENCE_TIMESTAMP_META_API_TYPE;
}

/** transform() of elements with generate_output(): never called, but without it GstBaseTransform
 *  would operate in passthrough mode. */
inline GstFlowReturn
transform_nothing (GstBaseTransform *, GstBuffer *, GstBuffer *)
{
  return GST_FLOW_ERROR;
}
