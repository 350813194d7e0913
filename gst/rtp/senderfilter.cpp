/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "senderfilter.hpp"

#ifdef __linux__

#include <linux/filter.h>
#include <sys/socket.h>

#include <cstdint>
#include <vector>

namespace {

/* Offsets: those of the IP header count from kIp, of the UDP header from 0. */
constexpr std::uint32_t kIp = std::uint32_t (SKF_NET_OFF);
constexpr std::uint32_t kRandom = std::uint32_t (SKF_AD_OFF + SKF_AD_RANDOM);
constexpr std::uint32_t kAll = 0xffffffff;

/* A filter that passes packets for which all comparisons hold, and a sample of the others. */
class Program {
public:
  /* Jumps in classic BPF are relative to the next instruction; finish() fills in the distance to
   * the sampling. */
  void expect (std::uint16_t size, std::uint32_t offset, std::uint32_t value)
  {
    code_.push_back (BPF_STMT (std::uint16_t (BPF_LD | size | BPF_ABS), offset));
    jumps_.push_back (code_.size ());
    code_.push_back (BPF_JUMP (BPF_JMP | BPF_JEQ | BPF_K, value, 0, 0));
  }
  void expect_ip_version (std::uint32_t version)
  {
    code_.push_back (BPF_STMT (BPF_LD | BPF_B | BPF_ABS, kIp));
    code_.push_back (BPF_STMT (BPF_ALU | BPF_AND | BPF_K, 0xf0));
    jumps_.push_back (code_.size ());
    code_.push_back (BPF_JUMP (BPF_JMP | BPF_JEQ | BPF_K, version << 4, 0, 0));
  }
  sock_fprog finish ()
  {
    code_.push_back (BPF_STMT (BPF_RET | BPF_K, kAll));
    for (const std::size_t at : jumps_)
      code_[at].jf = std::uint8_t (code_.size () - at - 1);
    code_.push_back (BPF_STMT (BPF_LD | BPF_W | BPF_ABS, kRandom));
    code_.push_back (BPF_STMT (BPF_ALU | BPF_AND | BPF_K, SenderFilter::kSample - 1));
    code_.push_back (BPF_JUMP (BPF_JMP | BPF_JEQ | BPF_K, 0, 0, 1));
    code_.push_back (BPF_STMT (BPF_RET | BPF_K, kAll));
    code_.push_back (BPF_STMT (BPF_RET | BPF_K, 0));
    return {std::uint16_t (code_.size ()), code_.data ()};
  }

private:
  std::vector<sock_filter> code_;
  std::vector<std::size_t> jumps_;
};

std::uint32_t
word_at (const guint8 *bytes)
{
  return std::uint32_t (bytes[0]) << 24 | std::uint32_t (bytes[1]) << 16 |
         std::uint32_t (bytes[2]) << 8 | bytes[3];
}

} // namespace

bool
SenderFilter::attach (GSocket *socket, GSocketAddress *sender)
{
  if (!G_IS_INET_SOCKET_ADDRESS (sender))
    return false;
  auto full = G_INET_SOCKET_ADDRESS (sender);
  GInetAddress *address = g_inet_socket_address_get_address (full);
  const guint8 *bytes = g_inet_address_to_bytes (address);
  Program program;
  if (g_inet_address_get_family (address) == G_SOCKET_FAMILY_IPV4) {
    program.expect_ip_version (4);
    program.expect (BPF_W, kIp + 12, word_at (bytes));
  } else {
    program.expect_ip_version (6);
    for (std::uint32_t i = 0; i < 16; i += 4)
      program.expect (BPF_W, kIp + 8 + i, word_at (bytes + i));
  }
  program.expect (BPF_H, 0, g_inet_socket_address_get_port (full));
  const sock_fprog filter = program.finish ();
  return setsockopt (
             g_socket_get_fd (socket), SOL_SOCKET, SO_ATTACH_FILTER, &filter, sizeof filter) == 0;
}

void
SenderFilter::detach (GSocket *socket)
{
  const int unused = 0;
  setsockopt (g_socket_get_fd (socket), SOL_SOCKET, SO_DETACH_FILTER, &unused, sizeof unused);
}

#else

bool
SenderFilter::attach (GSocket *, GSocketAddress *)
{
  return false;
}

void
SenderFilter::detach (GSocket *)
{
}

#endif
