/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Simulates a bad network: relays UDP packets with losses, delays and other faults. */
#include "network-faults.hpp"

#include <arpa/inet.h>
#include <linux/if_ether.h>
#include <linux/if_packet.h>
#include <net/if.h>
#include <netdb.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/signalfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <memory>
#include <string>
#include <vector>

namespace {

const char *const kUsage =
    "usage: udp-relay --listen PORT --to HOST:PORT [--listen PORT --to HOST:PORT ...] [options]\n"
    "       udp-relay --between INTERFACE,INTERFACE [options]\n"
    "Relays packets that arrive at a UDP port, and the answers; or, as root, bridges two network\n"
    "interfaces, with faults for UDP over IPv4. Faults apply to both\n"
    "directions. Prints its counters at SIGINT or SIGTERM.\n";

int64_t
now_ns ()
{
  timespec now;
  clock_gettime (CLOCK_MONOTONIC, &now);
  return int64_t (now.tv_sec) * 1'000'000'000 + now.tv_nsec;
}

[[noreturn]] void
refuse (const std::string &what)
{
  std::fprintf (stderr, "udp-relay: %s\n", what.c_str ());
  std::exit (2);
}

[[noreturn]] void
refuse_with_reason (const std::string &what)
{
  refuse (what + ": " + std::strerror (errno));
}

/** One direction: from a socket, through the faults, into another one. */
struct Direction {
  int from, to;
  bool cable;                 /* only its frames of UDP have faults */
  sockaddr_storage *heard;    /* where packets come from, for answers; may be nullptr */
  sockaddr_storage *receiver; /* nullptr: the socket is connected or a cable */
  NetworkFaults faults;
  std::vector<uint8_t> buffer = std::vector<uint8_t> (70000);
};

/* Bytes of struct virtio_net_hdr, whose header file is not for C++. */
constexpr std::size_t kOffloadHeader = 10;

/* Frames come with what the network card would have to do yet (checksums): the kernel's header says
 * it, and is handed on with the frame. */
bool
suffers (const Direction &direction, std::size_t size)
{
  if (!direction.cable)
    return true;
  const std::size_t ether = kOffloadHeader;
  const uint8_t *frame = direction.buffer.data () + ether;
  if (size < ether + 34 || frame[12] != 0x08 || frame[13] != 0x00)
    return false;
  return frame[23] == IPPROTO_UDP;
}

void
send_on (Direction &direction, std::span<const uint8_t> packet)
{
  /* Packets that the network does not accept are lost, as in any network. */
  if (direction.receiver && direction.receiver->ss_family == 0)
    return;
  const ssize_t sent = direction.receiver ? sendto (direction.to, packet.data (), packet.size (), 0,
                                                reinterpret_cast<sockaddr *> (direction.receiver),
                                                sizeof (sockaddr_in))
                                          : send (direction.to, packet.data (), packet.size (), 0);
  static_cast<void> (sent);
}

void
read_all (Direction &direction)
{
  for (int i = 0; i < 64; i++) { /* then the other direction has its turn */
    socklen_t length = sizeof (sockaddr_storage);
    const ssize_t size =
        recvfrom (direction.from, direction.buffer.data (), direction.buffer.size (), MSG_DONTWAIT,
            reinterpret_cast<sockaddr *> (direction.heard), direction.heard ? &length : nullptr);
    if (size < 0)
      return;
    const std::span<const uint8_t> packet (direction.buffer.data (), std::size_t (size));
    if (suffers (direction, packet.size ()))
      direction.faults.offer (packet, now_ns ());
    else
      send_on (direction, packet);
  }
}

/* ---- sockets ---- */

int
listening_socket (int port)
{
  const int fd = socket (AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  const int room = 4 << 20;
  setsockopt (fd, SOL_SOCKET, SO_RCVBUF, &room, sizeof room);
  sockaddr_in address = {};
  address.sin_family = AF_INET;
  address.sin_port = htons (uint16_t (port));
  if (fd < 0 || bind (fd, reinterpret_cast<sockaddr *> (&address), sizeof address) != 0)
    refuse_with_reason ("--listen " + std::to_string (port));
  return fd;
}

int
connected_socket (const std::string &target)
{
  const std::size_t colon = target.rfind (':');
  if (colon == std::string::npos)
    refuse ("--to " + target + ": expected HOST:PORT");
  addrinfo hints = {}, *found = nullptr;
  hints.ai_family = AF_INET;
  hints.ai_socktype = SOCK_DGRAM;
  const std::string host = target.substr (0, colon), port = target.substr (colon + 1);
  if (const int error = getaddrinfo (host.c_str (), port.c_str (), &hints, &found))
    refuse ("--to " + target + ": " + gai_strerror (error));
  const int fd = socket (AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (fd < 0 || connect (fd, found->ai_addr, found->ai_addrlen) != 0)
    refuse_with_reason ("--to " + target);
  freeaddrinfo (found);
  return fd;
}

int
cable_end (const std::string &interface)
{
  const int fd = socket (AF_PACKET, SOCK_RAW | SOCK_CLOEXEC, htons (ETH_P_ALL));
  if (fd < 0)
    refuse_with_reason ("--between " + interface);
  ifreq request = {};
  interface.copy (request.ifr_name, sizeof request.ifr_name - 1);
  if (ioctl (fd, SIOCGIFFLAGS, &request) == 0 && (request.ifr_flags & IFF_LOOPBACK))
    refuse ("--between " + interface + ": is the loopback interface; use a network interface");
  sockaddr_ll address = {};
  address.sll_family = AF_PACKET;
  address.sll_protocol = htons (ETH_P_ALL);
  address.sll_ifindex = int (if_nametoindex (interface.c_str ()));
  packet_mreq all = {};
  all.mr_ifindex = address.sll_ifindex;
  all.mr_type = PACKET_MR_PROMISC;
  const int on = 1, room = 4 << 20;
  setsockopt (fd, SOL_SOCKET, SO_RCVBUFFORCE, &room, sizeof room);
  if (address.sll_ifindex == 0 ||
      setsockopt (fd, SOL_PACKET, PACKET_IGNORE_OUTGOING, &on, sizeof on) != 0 ||
      setsockopt (fd, SOL_PACKET, PACKET_VNET_HDR, &on, sizeof on) != 0 ||
      setsockopt (fd, SOL_PACKET, PACKET_ADD_MEMBERSHIP, &all, sizeof all) != 0 ||
      bind (fd, reinterpret_cast<sockaddr *> (&address), sizeof address) != 0)
    refuse_with_reason ("--between " + interface);
  return fd;
}

/* ---- the program ---- */

struct Settings {
  std::vector<std::pair<int, std::string>> links; /* port, HOST:PORT */
  std::vector<std::string> cable;
  FaultSettings faults;
};

std::vector<std::string>
read_cable (const std::string &value)
{
  const std::size_t comma = value.find (',');
  const std::string one = value.substr (0, comma),
                    two = comma == std::string::npos ? "" : value.substr (comma + 1);
  if (one.empty () || two.empty () || one == two)
    refuse ("--between " + value + ": expected two interfaces, INTERFACE,INTERFACE");
  return {one, two};
}

Settings
read_options (int argc, char **argv)
{
  Settings settings;
  for (int i = 1; i < argc; i++) {
    const std::string name = argv[i];
    if (name == "--help" || name == "-h") {
      std::fputs (kUsage, stdout);
      std::fputs (kFaultOptions, stdout);
      std::exit (0);
    }
    if (i + 1 == argc)
      refuse ("option " + name + " needs a value, or is unknown (--help lists the options)");
    const std::string value = argv[++i];
    std::string problem;
    if (name == "--listen") {
      const int port = std::atoi (value.c_str ());
      if (port < 1 || port > 65535)
        refuse ("--listen " + value + ": expected a port from 1 to 65535");
      settings.links.emplace_back (port, "");
    } else if (name == "--to") {
      if (settings.links.empty () || !settings.links.back ().second.empty ())
        refuse ("--to " + value + ": expected after its --listen PORT");
      settings.links.back ().second = value;
    } else if (name == "--between") {
      settings.cable = read_cable (value);
    } else if (!read_fault_option (name, value, settings.faults, problem)) {
      refuse ("unknown option '" + name + "' (--help lists the options)");
    }
    if (!problem.empty ())
      refuse (name + " " + value + ": expected " + problem);
  }
  for (const auto &[port, target] : settings.links)
    if (target.empty ())
      refuse ("--listen " + std::to_string (port) + ": expected --to HOST:PORT after it");
  if (settings.links.empty () == settings.cable.empty ())
    refuse (settings.links.empty ()
                ? "expected --listen PORT --to HOST:PORT, or --between INTERFACE,INTERFACE"
                : "--listen and --between: expected only one of them");
  return settings;
}

using Directions = std::vector<std::unique_ptr<Direction>>;

void
add_pair (Directions &directions, int a, int b, bool cable, const FaultSettings &faults)
{
  FaultSettings back = faults;
  back.seed += 0x9e3779b97f4a7c15; /* other chances than those of the way there */
  sockaddr_storage *client = cable ? nullptr : new sockaddr_storage (); /* lives as the program */
  directions.emplace_back (new Direction{a, b, cable, client, nullptr, NetworkFaults (faults)});
  directions.emplace_back (new Direction{b, a, cable, nullptr, client, NetworkFaults (back)});
}

/* Until a signal comes. */
void
relay (Directions &directions, int signals)
{
  std::vector<pollfd> polled;
  for (const auto &direction : directions)
    polled.push_back ({direction->from, POLLIN, 0});
  polled.push_back ({signals, POLLIN, 0});
  while (!(polled.back ().revents & POLLIN)) {
    int64_t wait_ns = 1'000'000'000;
    for (const auto &direction : directions)
      if (const auto due = direction->faults.due_ns ())
        wait_ns = std::min (wait_ns, std::max<int64_t> (*due - now_ns (), 0));
    const timespec wait = {wait_ns / 1'000'000'000, wait_ns % 1'000'000'000};
    ppoll (polled.data (), polled.size (), &wait, nullptr);
    for (std::size_t i = 0; i < directions.size (); i++) {
      Direction &direction = *directions[i];
      if (polled[i].revents)
        read_all (direction);
      while (const auto packet = direction.faults.take (now_ns ()))
        send_on (direction, *packet);
    }
  }
}

} // namespace

int
main (int argc, char **argv)
{
  const Settings settings = read_options (argc, argv);
  sigset_t set;
  sigemptyset (&set);
  sigaddset (&set, SIGINT);
  sigaddset (&set, SIGTERM);
  sigprocmask (SIG_BLOCK, &set, nullptr);
  const int signals = signalfd (-1, &set, SFD_CLOEXEC);

  Directions directions;
  for (const auto &[port, target] : settings.links)
    add_pair (
        directions, listening_socket (port), connected_socket (target), false, settings.faults);
  if (!settings.cable.empty ())
    add_pair (directions, cable_end (settings.cable[0]), cable_end (settings.cable[1]), true,
        settings.faults);
  std::printf ("ready\n");
  std::fflush (stdout);
  relay (directions, signals);
  for (std::size_t i = 0; i < directions.size (); i++) {
    const FaultCounters &c = directions[i]->faults.counters ();
    std::printf ("%s: %llu in, %llu out, %llu lost, %llu lost for bandwidth, %llu duplicated, %llu "
                 "reordered\n",
        i % 2 ? "back" : "there", (unsigned long long)c.in, (unsigned long long)c.out,
        (unsigned long long)c.lost, (unsigned long long)c.congested,
        (unsigned long long)c.duplicated, (unsigned long long)c.held_back);
  }
  return 0;
}
