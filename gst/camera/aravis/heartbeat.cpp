/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "heartbeat.hpp"

#include <algorithm>
#include <array>

namespace {

/* More than a camera sends between two polls; the rest of a flood is read later. */
constexpr int kMaxAnswers = 16;

/* READREG_CMD of the control channel privilege: anybody may send it, and a camera that another
 * program controls refuses, which is an answer, too. */
void
send_request (GSocket *socket, std::uint16_t request)
{
  const std::array<std::uint8_t, 12> command = {0x42, 0x01, 0x00, 0x80, 0x00, 0x04,
      std::uint8_t (request >> 8), std::uint8_t (request), 0x00, 0x00, 0x0a, 0x00};
  g_socket_send (
      socket, reinterpret_cast<const gchar *> (command.data ()), command.size (), nullptr, nullptr);
}

/* Whether anything came: the socket is connected to the camera alone. An error means that its port
 * is closed now. */
bool
receive_answers (GSocket *socket)
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

} // namespace

void
Heartbeat::start (const std::string &address, std::int64_t now_ns)
{
  socket_ = connect_gvcp (address);
  alive_ns_ = asked_ns_ = now_ns;
  unanswered_ = 0;
}

void
Heartbeat::poll (std::int64_t heard_ns, std::int64_t now_ns)
{
  if (!socket_)
    return;
  const bool answered = unanswered_ > 0 && receive_answers (socket_.get ());
  if (answered || heard_ns > alive_ns_) {
    alive_ns_ = answered ? now_ns : heard_ns;
    unanswered_ = 0;
  }
  if (now_ns - std::max (alive_ns_, asked_ns_) < kInterval_ns)
    return;
  send_request (socket_.get (), ++request_ ? request_ : ++request_); /* 0 is not allowed */
  asked_ns_ = now_ns;
  unanswered_++;
}
