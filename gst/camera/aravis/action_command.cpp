/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "action_command.hpp"

#include <algorithm>

namespace {

/* GigE Vision 2.0, chapter GVCP: command packets begin with a key, flags, the command, the length
 * of the payload and the request id; all numbers are big-endian. */
constexpr std::uint8_t kCommandKey = 0x42;
constexpr std::uint8_t kFlagAcknowledge = 0x01;
constexpr std::uint8_t kFlagScheduled = 0x80; /* a time follows the masks */
constexpr std::uint16_t kActionCommand = 0x0100;
constexpr std::size_t kHeaderSize = 8;

} // namespace

ActionCommandBytes
action_command_bytes (const ActionCommand &command)
{
  ActionCommandBytes packet;
  const auto put = [&] (std::uint64_t value, int n_bytes) {
    for (int shift = 8 * (n_bytes - 1); shift >= 0; shift -= 8)
      packet.bytes[packet.size++] = static_cast<std::uint8_t> (value >> shift);
  };
  put (kCommandKey, 1);
  put ((command.acknowledge ? kFlagAcknowledge : 0) | (command.time_ns ? kFlagScheduled : 0), 1);
  put (kActionCommand, 2);
  put (command.time_ns ? 20 : 12, 2);
  put (command.request_id, 2);
  put (command.device_key, 4);
  put (command.group_key, 4);
  put (command.group_mask, 4);
  if (command.time_ns)
    put (*command.time_ns, 8);
  g_assert (packet.size == kHeaderSize + (command.time_ns ? 20 : 12));
  return packet;
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
              "': " + (error ? error->message : "expected an IPv4 address of this host"));
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
ActionSender::send (ActionCommand command)
{
  if (++last_id_ == 0)
    last_id_ = 1;
  command.request_id = last_id_;
  const ActionCommandBytes packet = action_command_bytes (command);
  CameraStatus status;
  for (const Route &route : routes_) {
    GError *error = nullptr;
    g_socket_send_to (route.socket, route.destination,
        reinterpret_cast<const gchar *> (packet.bytes.data ()), packet.size, nullptr, &error);
    if (error && status.ok ())
      status = {CameraFault::kFailed,
          "action commands: cannot send from '" + route.interface + "': " + error->message};
    g_clear_error (&error);
  }
  return status;
}
