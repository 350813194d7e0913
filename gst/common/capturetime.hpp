/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>
#include <gstrange/gstrangemeta.h>

/** When a frame set, or what RTP carried beside it, was captured: ns on the clock that the camera
 *  hosts share. Of other buffers than frame sets it is what depayloaders read from the header
 *  extension ntp-64 (RFC 6051). GST_CLOCK_TIME_NONE: unknown */
inline GstClockTime
capture_time_of (GstBuffer *buffer)
{
  const GstClockTime capture = gst_range_buffer_get_capture_time (buffer);
  if (GST_CLOCK_TIME_IS_VALID (capture))
    return capture;
  static GstStaticCaps ntp = GST_STATIC_CAPS ("timestamp/x-ntp");
  GstCaps *reference = gst_static_caps_get (&ntp);
  const auto meta = gst_buffer_get_reference_timestamp_meta (buffer, reference);
  gst_caps_unref (reference);
  return meta ? meta->timestamp : GST_CLOCK_TIME_NONE;
}
