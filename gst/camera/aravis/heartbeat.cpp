/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "heartbeat.hpp"

#include <algorithm>
#include <array>

/* GigE Vision, chapter GVCP: READREG_CMD of the control channel privilege, which everybody may ask
 * for, and which a camera that another program has refuses, but answers. */
static constexpr std::uint16_t kPort = 3956;

static void
ask (GSocket *socket, std::uint16_t request)
{
  const std::array<std::uint8_t, 12> command = {0x42, 0x01, 0x00, 0x80, 0x00, 0x04,
      std::uint8_t (request >> 8), std::uint8_t (request), 0x00, 0x00, 0x0a, 0x00};
  g_socket_send (
      socket, reinterpret_cast<const gchar *> (command.data ()), command.size (), nullptr, nullptr);
}

/* More than a camera answers in the time between two looks: a flood is read later. */
static constexpr int kMaxAnswers = 16;

/* Whatever came: it is connected to the camera alone. An error is a port that is not there now. */
static bool
hears (GSocket *socket)
{
  bool any = false;
  std::array<gchar, 64> answer;
  for (int i = 0; i < kMaxAnswers; i++) {
    if (!(g_socket_condition_check (socket, G_IO_IN) & (G_IO_IN | G_IO_ERR)) ||
        g_socket_receive (socket, answer.data (), answer.size (), nullptr, nullptr) <= 0)
      break;
    any = true;
  }
  return any;
}

void
Heartbeat::start (const std::string &address, std::int64_t now_ns)
{
  socket_ = nullptr;
  alive_ns_ = asked_ns_ = now_ns;
  unanswered_ = 0;
  GSocketAddress *camera = g_inet_socket_address_new_from_string (address.c_str (), kPort);
  if (!camera)
    return;
  socket_.reset (g_socket_new (g_socket_address_get_family (camera), G_SOCKET_TYPE_DATAGRAM,
      G_SOCKET_PROTOCOL_UDP, nullptr));
  if (socket_)
    g_socket_set_blocking (socket_.get (), FALSE);
  if (socket_ && !g_socket_connect (socket_.get (), camera, nullptr, nullptr))
    socket_ = nullptr;
  g_object_unref (camera);
}

void
Heartbeat::poll (std::int64_t heard_ns, std::int64_t now_ns)
{
  if (!socket_)
    return;
  const bool answered = unanswered_ > 0 && hears (socket_.get ());
  if (answered || heard_ns > alive_ns_) {
    alive_ns_ = answered ? now_ns : heard_ns;
    unanswered_ = 0;
  }
  if (now_ns - std::max (alive_ns_, asked_ns_) < kQuestion_ns)
    return;
  ask (socket_.get (), ++request_ ? request_ : ++request_); /* 0 is no request's number */
  asked_ns_ = now_ns;
  unanswered_++;
}
