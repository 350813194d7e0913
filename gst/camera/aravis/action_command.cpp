/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "action_command.hpp"

#include <algorithm>

/* GigE Vision 2.0, chapter GVCP: command packets begin with a key, flags (here none: no
 * acknowledge, no time), the command, the length of the payload and the request id; all numbers are
 * big-endian. */
std::array<std::uint8_t, 20>
action_command_bytes (std::uint32_t device_key, std::uint16_t request_id)
{
  const auto byte = [] (std::uint32_t value, int shift) {
    return static_cast<std::uint8_t> (value >> shift);
  };
  return {0x42, 0, 0x01, 0x00, 0, 12, byte (request_id, 8), byte (request_id, 0),
      byte (device_key, 24), byte (device_key, 16), byte (device_key, 8), byte (device_key, 0), 0,
      0, 0, 1, 0, 0, 0, 1};
}

CameraStatus
ActionSender::open (std::span<const std::string> interfaces, std::uint16_t port)
{
  close ();
  for (const std::string &interface : interfaces) {
    const auto same = [&] (const Route &route) { return route.interface == interface; };
    if (std::any_of (routes_.begin (), routes_.end (), same))
      continue;
    GInetAddress *address = g_inet_address_new_from_string (interface.c_str ());
    GError *error = nullptr;
    GSocket *socket = address ? g_socket_new (g_inet_address_get_family (address),
                                    G_SOCKET_TYPE_DATAGRAM, G_SOCKET_PROTOCOL_UDP, &error)
                              : nullptr;
    if (socket) {
      GSocketAddress *local = g_inet_socket_address_new (address, 0);
      g_socket_set_broadcast (socket, TRUE);
      g_socket_set_blocking (socket, FALSE);
      g_socket_bind (socket, local, FALSE, &error);
      g_object_unref (local);
    }
    g_clear_object (&address);
    if (!socket || error) {
      CameraStatus status (CameraFault::kFailed,
          "action commands: cannot send from '" + interface +
              "': " + (error ? error->message : "it is no IP address of this host"));
      g_clear_error (&error);
      g_clear_object (&socket);
      close ();
      return status;
    }
    /* the loopback interface has no broadcast address; this one reaches every listener on it */
    const char *broadcast = interface.starts_with ("127.") ? "127.255.255.255" : "255.255.255.255";
    routes_.push_back (
        {interface, socket, g_inet_socket_address_new_from_string (broadcast, port)});
  }
  return {};
}

void
ActionSender::close ()
{
  for (Route &route : routes_) {
    g_object_unref (route.socket);
    g_object_unref (route.destination);
  }
  routes_.clear ();
}

CameraStatus
ActionSender::send (std::uint32_t device_key)
{
  if (++last_id_ == 0)
    last_id_ = 1;
  const auto packet = action_command_bytes (device_key, last_id_);
  CameraStatus status;
  for (const Route &route : routes_) {
    GError *error = nullptr;
    g_socket_send_to (route.socket, route.destination,
        reinterpret_cast<const gchar *> (packet.data ()), packet.size (), nullptr, &error);
    if (error && status.ok ())
      status = {CameraFault::kFailed,
          "action commands: cannot send from '" + route.interface + "': " + error->message};
    g_clear_error (&error);
  }
  return status;
}
