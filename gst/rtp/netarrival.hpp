/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Arrival time and host of packets. */
#pragma once

#include <gio/gio.h>
#include <gst/gst.h>

/** The running time at which udpsrc received a packet, or the current one if the buffer has no
 *  time. Without a pipeline clock, when no packet can have a time, it is the monotonic time. */
inline GstClockTime
arrival_time (GstElement *element, GstBuffer *buffer)
{
  GstClockTime time = GST_BUFFER_DTS_OR_PTS (buffer);
  if (!GST_CLOCK_TIME_IS_VALID (time))
    time = gst_element_get_current_running_time (element);
  return GST_CLOCK_TIME_IS_VALID (time) ? time : gst_util_get_timestamp ();
}

/** The host of an address: (transfer none), or null. */
inline GInetAddress *
host_of (GSocketAddress *address)
{
  return address && G_IS_INET_SOCKET_ADDRESS (address)
             ? g_inet_socket_address_get_address (G_INET_SOCKET_ADDRESS (address))
             : nullptr;
}

/** Whether both are the same host; two unknown ones (null) are. */
inline bool
same_host (GInetAddress *a, GInetAddress *b)
{
  return a == b || (a && b && g_inet_address_equal (a, b));
}
