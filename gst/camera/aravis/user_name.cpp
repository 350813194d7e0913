/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "user_name.hpp"

#include <gio/gio.h>

#include "action_command.hpp"

namespace {

/* GigE Vision, chapter GVCP and table of bootstrap registers */
constexpr std::uint8_t kUserNameRegister = 0xe8;
constexpr std::size_t kHeaderSize = 8, kAnswerSize = kHeaderSize + 4 + kUserNameSize;
constexpr std::uint16_t kReadAnswer = 0x0085;

/* A non-blocking socket that exchanges datagrams with the camera at that address alone. Null: no IP
 * address, or no route to it. Transfer full. */
GSocket *
connect_gvcp (const std::string &address)
{
  GSocketAddress *camera = g_inet_socket_address_new_from_string (address.c_str (), kGvcpPort);
  if (!camera)
    return nullptr;
  GSocket *socket = g_socket_new (
      g_socket_address_get_family (camera), G_SOCKET_TYPE_DATAGRAM, G_SOCKET_PROTOCOL_UDP, nullptr);
  if (socket) {
    g_socket_set_blocking (socket, FALSE);
    if (!g_socket_connect (socket, camera, nullptr, nullptr))
      g_clear_object (&socket);
  }
  g_object_unref (camera);
  return socket;
}

} // namespace

std::array<std::uint8_t, 16>
user_name_request (std::uint16_t request_id)
{
  return {0x42, 0x01, 0x00, 0x84, 0x00, 0x08, std::uint8_t (request_id >> 8),
      std::uint8_t (request_id), 0, 0, 0, kUserNameRegister, 0, 0, 0, std::uint8_t (kUserNameSize)};
}

std::optional<std::string>
user_name_in (std::span<const std::uint8_t> answer, std::uint16_t request_id)
{
  const auto number = [&] (std::size_t at) { return answer[at] << 8 | answer[at + 1]; };
  if (answer.size () != kAnswerSize || number (0) != 0 || number (2) != kReadAnswer ||
      number (6) != request_id)
    return std::nullopt;
  std::string name;
  for (const std::uint8_t c : answer.subspan (kHeaderSize + 4)) {
    if (c == 0)
      break;
    name += static_cast<char> (c);
  }
  return name;
}

std::string
read_user_name (const std::string &address)
{
  constexpr std::uint16_t kRequest = 1;
  GSocket *socket = connect_gvcp (address);
  const auto request = user_name_request (kRequest);
  std::optional<std::string> name;
  for (int attempt = 0; socket && !name && attempt < 3; attempt++) {
    g_socket_send (socket, reinterpret_cast<const gchar *> (request.data ()), request.size (),
        nullptr, nullptr);
    if (!g_socket_condition_timed_wait (socket, G_IO_IN, 100'000, nullptr, nullptr))
      continue;
    std::array<std::uint8_t, 64> answer;
    const gssize size = g_socket_receive (
        socket, reinterpret_cast<gchar *> (answer.data ()), answer.size (), nullptr, nullptr);
    if (size > 0)
      name = user_name_in (std::span (answer).first (std::size_t (size)), kRequest);
  }
  g_clear_object (&socket);
  return name.value_or ("");
}
