/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "clockpublisher.hpp"

#include <gio/gio.h>

#include "common/realtimepriority.hpp"

/* Posts `error`, if there is one, and frees it. @return whether there is none */
static bool
report (GstElement *element, int port, GError *error)
{
  if (!error)
    return true;
  GST_ELEMENT_ERROR (element, RESOURCE, BUSY,
      ("clock-port: cannot publish the clock on UDP port %d: %s", port, error->message), (nullptr));
  g_error_free (error);
  return false;
}

/* GstNetTimeProvider binds with SO_REUSEADDR: two on one port would split the requests. */
bool
ClockPublisher::start (GstElement *element, int port)
{
  if (port == 0)
    return true;
  GError *error = nullptr;
  for (const GSocketFamily family : {G_SOCKET_FAMILY_IPV6, G_SOCKET_FAMILY_IPV4}) {
    g_clear_error (&error);
    g_autoptr (GSocket) socket =
        g_socket_new (family, G_SOCKET_TYPE_DATAGRAM, G_SOCKET_PROTOCOL_UDP, &error);
    g_autoptr (GInetAddress) any = g_inet_address_new_any (family);
    g_autoptr (GSocketAddress) address = g_inet_socket_address_new (any, guint16 (port));
    address_ = family == G_SOCKET_FAMILY_IPV6 ? "::" : "0.0.0.0"; /* the first one is both */
    if (socket && (g_socket_bind (socket, address, FALSE, &error) ||
                      g_error_matches (error, G_IO_ERROR, G_IO_ERROR_ADDRESS_IN_USE)))
      break;
  }
  if (!report (element, port, error))
    return false;
  {
    std::lock_guard guard (lock_);
    port_ = port;
  }
  GstClock *clock = gst_element_get_clock (element);
  set_clock (element, clock);
  gst_clear_object (&clock);
  return true;
}

void
ClockPublisher::set_clock (GstElement *element, GstClock *clock)
{
  GError *error = nullptr;
  int port = 0;
  {
    std::lock_guard guard (lock_);
    if (port_ == 0 || clock == clock_)
      return;
    gst_clear_object (&provider_); /* it keeps the clock that it was made with */
    gst_object_replace (reinterpret_cast<GstObject **> (&clock_), GST_OBJECT_CAST (clock));
    if (!clock)
      return;
    port = port_;
    const ScopedRealtimePriority priority; /* its thread inherits it; delays are clock error */
    provider_ = GST_NET_TIME_PROVIDER (g_initable_new (GST_TYPE_NET_TIME_PROVIDER, nullptr, &error,
        "clock", clock, "address", address_, "port", port, nullptr));
  }
  report (element, port, error);
}

void
ClockPublisher::stop ()
{
  std::lock_guard guard (lock_);
  gst_clear_object (&provider_); /* ends its thread and closes the port */
  gst_clear_object (&clock_);
  port_ = 0;
}
