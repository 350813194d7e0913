/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <gio/gio.h>
#include <memory>
#include <string>

/** UDP port of GVCP, the GigE Vision control protocol. */
inline constexpr std::uint16_t kGvcpPort = 3956;

struct SocketUnref {
  void operator() (GSocket *socket) const { g_object_unref (socket); }
};
using SocketPtr = std::unique_ptr<GSocket, SocketUnref>;

/** A non-blocking socket that exchanges GVCP datagrams with the camera at that address alone.
 *  @return null: no IP address, or no route to it */
inline SocketPtr
connect_gvcp (const std::string &address)
{
  GSocketAddress *camera = g_inet_socket_address_new_from_string (address.c_str (), kGvcpPort);
  if (!camera)
    return nullptr;
  SocketPtr socket (g_socket_new (g_socket_address_get_family (camera), G_SOCKET_TYPE_DATAGRAM,
      G_SOCKET_PROTOCOL_UDP, nullptr));
  if (socket) {
    g_socket_set_blocking (socket.get (), FALSE);
    if (!g_socket_connect (socket.get (), camera, nullptr, nullptr))
      socket = nullptr;
  }
  g_object_unref (camera);
  return socket;
}
