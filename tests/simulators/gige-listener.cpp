/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "gige-listener.hpp"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <set>

GigeListener::GigeListener (const std::vector<std::unique_ptr<GigeCamera>> &cameras)
    : cameras_ (cameras)
{
}

GigeListener::~GigeListener ()
{
  if (thread_.joinable ()) {
    eventfd_write (wake_, 1);
    thread_.join ();
  }
  for (int fd : sockets_)
    close (fd);
  if (wake_ >= 0)
    close (wake_);
}

namespace {

/* The loopback network has no broadcast flag, but Linux delivers to its broadcast address. */
std::set<std::string>
broadcast_addresses ()
{
  std::set<std::string> found = {"255.255.255.255", "127.255.255.255"};
  ifaddrs *all = nullptr;
  if (getifaddrs (&all) != 0)
    return found;
  for (const ifaddrs *i = all; i; i = i->ifa_next) {
    if (!i->ifa_addr || i->ifa_addr->sa_family != AF_INET || !(i->ifa_flags & IFF_BROADCAST) ||
        !i->ifa_broadaddr)
      continue;
    char text[INET_ADDRSTRLEN] = "";
    const auto *address = reinterpret_cast<const sockaddr_in *> (i->ifa_broadaddr);
    if (inet_ntop (AF_INET, &address->sin_addr, text, sizeof text))
      found.insert (text);
  }
  freeifaddrs (all);
  return found;
}

} // namespace

void
GigeListener::add_socket (const char *address)
{
  const int fd = socket (AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0), yes = 1;
  sockaddr_in local{};
  local.sin_family = AF_INET;
  local.sin_port = htons (kGvcpPort);
  inet_pton (AF_INET, address, &local.sin_addr);
  setsockopt (fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes); /* each of several programs hears */
  if (bind (fd, reinterpret_cast<const sockaddr *> (&local), sizeof local) == 0)
    sockets_.push_back (fd);
  else
    close (fd);
}

std::size_t
GigeListener::start ()
{
  for (const std::string &address : broadcast_addresses ())
    add_socket (address.c_str ());
  wake_ = eventfd (0, EFD_CLOEXEC);
  thread_ = std::thread ([this] { run (); });
  return sockets_.size ();
}

void
GigeListener::receive (int socket)
{
  std::uint8_t packet[2048];
  sockaddr_in from{};
  socklen_t size = sizeof from;
  const ssize_t got = recvfrom (
      socket, packet, sizeof packet, MSG_DONTWAIT, reinterpret_cast<sockaddr *> (&from), &size);
  GvcpCommand command;
  if (got <= 0 || !parse_gvcp ({packet, std::size_t (got)}, command))
    return;
  for (const auto &camera : cameras_) {
    if (Gvcp (command.command) == Gvcp::kDiscovery)
      camera->answer_discovery (command, from);
    else if (Gvcp (command.command) == Gvcp::kAction)
      camera->handle_action (command, from);
  }
}

void
GigeListener::run ()
{
  std::vector<pollfd> fds = {{wake_, POLLIN, 0}};
  for (int fd : sockets_)
    fds.push_back ({fd, POLLIN, 0});
  while (poll (fds.data (), fds.size (), -1) >= 0 || errno == EINTR) {
    if (fds[0].revents)
      return;
    for (std::size_t i = 1; i < fds.size (); i++)
      if (fds[i].revents)
        receive (fds[i].fd);
  }
}
