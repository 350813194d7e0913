/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "receive_buffer.hpp"

#include <cstdlib>
#include <filesystem>
#include <netinet/in.h>
#include <sys/socket.h>

namespace {

bool
is_udp_at (int fd, std::uint16_t port)
{
  int type = 0;
  socklen_t size = sizeof type;
  if (getsockopt (fd, SOL_SOCKET, SO_TYPE, &type, &size) != 0 || type != SOCK_DGRAM)
    return false;
  struct sockaddr_in address = {};
  size = sizeof address;
  return getsockname (fd, reinterpret_cast<struct sockaddr *> (&address), &size) == 0 &&
         address.sin_family == AF_INET && ntohs (address.sin_port) == port;
}

} // namespace

bool
enlarge_receive_buffer (std::uint16_t port, int bytes)
{
  bool found = false;
  std::error_code error;
  for (std::filesystem::directory_iterator entry ("/proc/self/fd", error), end;
       !error && entry != end; entry.increment (error)) {
    const int fd = std::atoi (entry->path ().filename ().c_str ());
    if (is_udp_at (fd, port))
      found |= setsockopt (fd, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof bytes) == 0;
  }
  return found;
}
