/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "clockpublisher.hpp"

#include <gio/gio.h>

#include <string>

#include "common/realtimepriority.hpp"

using rangecast::Status;
using rangecast::StatusCode;

void
ClockPublisher::set_port (int port)
{
  std::lock_guard guard (lock_);
  wanted_ = port;
}

int
ClockPublisher::port ()
{
  std::lock_guard guard (lock_);
  return actual_ != kOff ? actual_ : wanted_;
}

/* GstNetTimeProvider shares its port with whoever shares it, and clients would then ask one or the
 * other. */
static Status
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

Status
ClockPublisher::open (GstClock *clock)
{
  const int port = this->port ();
  if (port != kAnyPort)
    if (Status s = check_free (port); !s.ok ())
      return s;
  /* Without a clock the port is taken all the same; nobody gets an answer. */
  GstClock *told = clock ? GST_CLOCK (gst_object_ref (clock)) : gst_system_clock_obtain ();
  GError *error = nullptr;
  const ScopedRealtimePriority priority; /* its thread inherits it; delays are clock error */
  provider_ = GST_NET_TIME_PROVIDER (g_initable_new (GST_TYPE_NET_TIME_PROVIDER, nullptr, &error,
      "clock", told, "port", port, "active", gboolean (clock != nullptr), nullptr));
  gst_object_unref (told);
  if (!provider_) {
    const std::string why = error ? error->message : "no socket";
    g_clear_error (&error);
    return {StatusCode::kBadValue,
        "clock-port: cannot publish the clock on UDP port " + std::to_string (port) + ": " + why};
  }
  gint actual = 0;
  g_object_get (provider_, "port", &actual, nullptr);
  gst_object_replace (reinterpret_cast<GstObject **> (&clock_), GST_OBJECT_CAST (clock));
  std::lock_guard guard (lock_);
  actual_ = actual;
  return {};
}

void
ClockPublisher::close ()
{
  gst_clear_object (&provider_); /* its thread ends, the port is free */
  gst_clear_object (&clock_);
}

Status
ClockPublisher::start (GstClock *clock)
{
  std::lock_guard guard (calls_);
  {
    std::lock_guard settings (lock_);
    if (wanted_ == kOff)
      return {};
  }
  const Status status = open (clock);
  started_ = status.ok ();
  return status;
}

Status
ClockPublisher::use (GstClock *clock)
{
  std::lock_guard guard (calls_);
  if (!started_ || clock == clock_)
    return {};
  close (); /* a provider keeps the clock that it was made for; the port stays the same */
  return open (clock);
}

void
ClockPublisher::stop ()
{
  std::lock_guard guard (calls_);
  close ();
  started_ = false;
  std::lock_guard settings (lock_);
  actual_ = kOff;
}
