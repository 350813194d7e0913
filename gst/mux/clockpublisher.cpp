/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "clockpublisher.hpp"

#include <gio/gio.h>

#include <string>

#include "common/realtimepriority.hpp"

using rangecast::Status;
using rangecast::StatusCode;

namespace {

/* GstNetTimeProvider binds with SO_REUSEADDR: two on one port would split the requests. */
Status
check_free (int port)
{
  GError *error = nullptr;
  GSocket *socket =
      g_socket_new (G_SOCKET_FAMILY_IPV4, G_SOCKET_TYPE_DATAGRAM, G_SOCKET_PROTOCOL_UDP, &error);
  if (socket) {
    GInetAddress *any = g_inet_address_new_any (G_SOCKET_FAMILY_IPV4);
    GSocketAddress *address = g_inet_socket_address_new (any, guint16 (port));
    g_socket_bind (socket, address, FALSE, &error);
    g_object_unref (address);
    g_object_unref (any);
    g_object_unref (socket);
  }
  if (!error)
    return {};
  const std::string why = error->message;
  g_error_free (error);
  return {StatusCode::kBadValue,
      "clock-port: expected a free UDP port, got " + std::to_string (port) + " (" + why + ")"};
}

} // namespace

Status
ClockPublisher::open (int port, GstClock *clock)
{
  if (port != kAnyPort)
    if (Status s = check_free (port); !s.ok ())
      return s;
  /* A provider needs a clock: without one it is inactive, but has the port. */
  GstClock *provided = clock ? GST_CLOCK (gst_object_ref (clock)) : gst_system_clock_obtain ();
  GError *error = nullptr;
  const ScopedRealtimePriority priority; /* its thread inherits it; delays are clock error */
  provider_ = GST_NET_TIME_PROVIDER (g_initable_new (GST_TYPE_NET_TIME_PROVIDER, nullptr, &error,
      "clock", provided, "port", port, "active", gboolean (clock != nullptr), nullptr));
  gst_object_unref (provided);
  if (!provider_) {
    const std::string why = error ? error->message : "no socket";
    g_clear_error (&error);
    return {StatusCode::kBadValue,
        "clock-port: cannot publish the clock on UDP port " + std::to_string (port) + ": " + why};
  }
  gint actual = 0;
  g_object_get (provider_, "port", &actual, nullptr);
  gst_object_replace (reinterpret_cast<GstObject **> (&clock_), GST_OBJECT_CAST (clock));
  port_ = actual;
  return {};
}

void
ClockPublisher::close ()
{
  gst_clear_object (&provider_); /* ends its thread and closes the port */
  gst_clear_object (&clock_);
}

static bool
report (GstElement *element, const Status &status)
{
  if (!status.ok ())
    GST_ELEMENT_ERROR (element, RESOURCE, BUSY, ("%s", status.message ().c_str ()), (nullptr));
  return status.ok ();
}

bool
ClockPublisher::start (GstElement *element, int port)
{
  if (port == kOff)
    return true;
  GstClock *clock = gst_element_get_clock (element);
  Status status;
  {
    std::lock_guard guard (lock_);
    status = open (port, clock);
    started_ = status.ok ();
  }
  gst_clear_object (&clock);
  return report (element, status);
}

void
ClockPublisher::set_clock (GstElement *element, GstClock *clock)
{
  Status status;
  {
    std::lock_guard guard (lock_);
    if (!started_ || clock == clock_)
      return;
    close (); /* a provider keeps the clock that it was made with; the port stays the same */
    status = open (port_, clock);
  }
  report (element, status);
}

void
ClockPublisher::stop ()
{
  std::lock_guard guard (lock_);
  close ();
  started_ = false;
  port_ = kOff;
}
