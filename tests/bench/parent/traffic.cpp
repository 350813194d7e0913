/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "traffic.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

using rangecast::Status;
using rangecast::StatusCode;

namespace bench {

constexpr int kReceiveBuffer = 64 << 20;
constexpr std::size_t kBatch = 64, kMaxPacket = 2048;

std::uint64_t
now_ns ()
{
  timespec t;
  clock_gettime (CLOCK_MONOTONIC, &t);
  return std::uint64_t (t.tv_sec) * 1'000'000'000 + std::uint64_t (t.tv_nsec);
}

static sockaddr_in
local (int port)
{
  sockaddr_in address = {};
  address.sin_family = AF_INET;
  address.sin_port = htons (std::uint16_t (port));
  address.sin_addr.s_addr = htonl (INADDR_LOOPBACK);
  return address;
}

/* ---- the viewer ---- */

Status
Viewer::open ()
{
  socket_ = socket (AF_INET, SOCK_DGRAM, 0);
  sockaddr_in address = local (0);
  socklen_t length = sizeof address;
  if (socket_ < 0 || bind (socket_, reinterpret_cast<sockaddr *> (&address), length) < 0 ||
      getsockname (socket_, reinterpret_cast<sockaddr *> (&address), &length) < 0)
    return {StatusCode::kNoSpace, "no UDP socket for the viewer"};
  /* As root without the system's limit, so that losses are the parent's. */
  if (setsockopt (socket_, SOL_SOCKET, SO_RCVBUFFORCE, &kReceiveBuffer, sizeof kReceiveBuffer) < 0)
    (void)setsockopt (socket_, SOL_SOCKET, SO_RCVBUF, &kReceiveBuffer, sizeof kReceiveBuffer);
  port_ = ntohs (address.sin_port);
  thread_ = std::thread ([this] { run (); });
  return {};
}

Viewer::~Viewer ()
{
  stop ();
  if (socket_ >= 0)
    close (socket_);
}

void
Viewer::stop ()
{
  stop_ = true;
  if (thread_.joinable ())
    thread_.join ();
}

void
Viewer::take (const std::uint8_t *packet, std::size_t size, std::uint64_t now)
{
  const auto fields = find_capture_fields (packet, size);
  if (fields.empty ())
    return;
  std::uint64_t capture;
  std::memcpy (&capture, packet + fields[0], sizeof capture);
  std::lock_guard guard (lock_);
  arrivals_.push_back ({capture, now, std::uint32_t (fields.size ())});
  any_ = true;
}

void
Viewer::run ()
{
  std::vector<std::array<std::uint8_t, kMaxPacket>> room (kBatch);
  std::array<mmsghdr, kBatch> messages = {};
  std::array<iovec, kBatch> parts;
  for (std::size_t i = 0; i < kBatch; i++) {
    parts[i] = {room[i].data (), kMaxPacket};
    messages[i].msg_hdr.msg_iov = &parts[i];
    messages[i].msg_hdr.msg_iovlen = 1;
  }
  while (!stop_) {
    pollfd wait = {socket_, POLLIN, 0};
    if (poll (&wait, 1, 50) <= 0)
      continue;
    const int n = recvmmsg (socket_, messages.data (), kBatch, MSG_DONTWAIT, nullptr);
    const std::uint64_t now = now_ns ();
    for (int i = 0; i < n; i++)
      take (room[std::size_t (i)].data (), messages[std::size_t (i)].msg_len, now);
  }
}

std::vector<Viewer::Arrival>
Viewer::arrivals ()
{
  std::lock_guard guard (lock_);
  return arrivals_;
}

/* ---- the camera hosts ---- */

CameraHosts::CameraHosts (Recording &recording, double fps, int first_port)
    : recording_ (recording), fps_ (fps), first_port_ (first_port),
      sequence_ (recording.views.size ())
{
}

CameraHosts::~CameraHosts ()
{
  stop ();
  if (socket_ >= 0)
    close (socket_);
}

Status
CameraHosts::start ()
{
  socket_ = socket (AF_INET, SOCK_DGRAM, 0);
  if (socket_ < 0)
    return {StatusCode::kNoSpace, "no UDP socket for the camera hosts"};
  thread_ = std::thread ([this] { run (); });
  return {};
}

void
CameraHosts::stop ()
{
  stop_ = true;
  if (thread_.joinable ())
    thread_.join ();
}

static void
put_big_endian (std::uint8_t *to, std::uint64_t value, int bytes)
{
  for (int i = 0; i < bytes; i++)
    to[i] = std::uint8_t (value >> (8 * (bytes - 1 - i)));
}

/* Where a recording begins again its times and numbers go on. */
static void
stamp (Packet &packet, std::uint16_t sequence, std::uint32_t timestamp, std::uint32_t source,
    std::uint64_t capture_ns)
{
  put_big_endian (&packet.bytes[2], sequence, 2);
  put_big_endian (&packet.bytes[4], timestamp, 4);
  put_big_endian (&packet.bytes[8], source, 4);
  for (const std::uint16_t at : packet.capture_fields)
    std::memcpy (&packet.bytes[at], &capture_ns, sizeof capture_ns);
}

void
CameraHosts::send_frame (std::uint64_t number, std::uint64_t capture_ns)
{
  const std::size_t frame = number % recording_.frames ();
  const auto timestamp = std::uint32_t (std::llround (double (number) * 90000 / fps_));
  Sent sent{capture_ns, now_ns (), std::uint32_t (recording_.slices (frame)), 0};
  for (std::size_t v = 0; v < recording_.views.size (); v++) {
    auto &packets = recording_.views[v][frame];
    sockaddr_in to = local (first_port_ + int (v));
    std::vector<mmsghdr> messages (packets.size ());
    std::vector<iovec> parts (packets.size ());
    for (std::size_t i = 0; i < packets.size (); i++) {
      stamp (packets[i], sequence_[v]++, timestamp, std::uint32_t (v + 1), capture_ns);
      parts[i] = {packets[i].bytes.data (), packets[i].bytes.size ()};
      messages[i] = {};
      messages[i].msg_hdr.msg_name = &to;
      messages[i].msg_hdr.msg_namelen = sizeof to;
      messages[i].msg_hdr.msg_iov = &parts[i];
      messages[i].msg_hdr.msg_iovlen = 1;
    }
    sent.packets += std::uint32_t (packets.size ());
    for (std::size_t done = 0; done < messages.size ();) {
      const int n = sendmmsg (socket_, &messages[done], unsigned (messages.size () - done), 0);
      done += n > 0 ? std::size_t (n) : 1; /* nobody listens yet: that one is lost */
    }
  }
  std::lock_guard guard (lock_);
  sent_.push_back (sent);
}

void
CameraHosts::run ()
{
  const std::uint64_t begin = now_ns ();
  for (std::uint64_t number = 0; !stop_; number++) {
    const std::uint64_t due = begin + std::uint64_t (double (number) * 1e9 / fps_);
    const timespec t = {time_t (due / 1'000'000'000), long (due % 1'000'000'000)};
    clock_nanosleep (CLOCK_MONOTONIC, TIMER_ABSTIME, &t, nullptr);
    const std::uint64_t now = now_ns ();
    worst_delay_ms_ = std::max (worst_delay_ms_.load (), double (now - due) / 1e6);
    send_frame (number, due);
  }
}

std::vector<CameraHosts::Sent>
CameraHosts::sent ()
{
  std::lock_guard guard (lock_);
  return sent_;
}

} // namespace bench
