/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Sends what nobody asked for to UDP ports, so many packets a second to each: random bytes, packets
 * of another codec as they are, the good stream's own packets with some bits turned, and RTCP of
 * receivers that never were. What it copies it takes from the network (that needs root): packets to
 * the ports of --flip, --copy and --about. */
#include <arpa/inet.h>
#include <linux/if_ether.h>
#include <netinet/ip.h>
#include <netinet/udp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <random>
#include <set>
#include <span>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

namespace {

using Packet = std::vector<std::uint8_t>;
using Clock = std::chrono::steady_clock;

struct Options {
  std::string to = "127.0.0.1", from;
  std::vector<int> ports;
  std::set<int> flip, copy, rtcp, about;
  int rate = 10000;
  double seconds = 10;
};

constexpr std::size_t kSamples = 256, kBatch = 64;
constexpr std::size_t kLongest = 1400, kPool = 1 << 20; /* bytes */
constexpr int kRoundsPerSecond = 200;

void
put_word (Packet &packet, std::size_t at, std::uint32_t value)
{
  for (std::size_t i = 0; i < 4; i++)
    packet[at + i] = std::uint8_t (value >> (24 - 8 * i));
}

/* RFC 3550, 6.4.2, 6.5 and 6.6: what a receiver reports of a stream, what it is called, and in
 * every other one that it leaves. */
void
make_rtcp (Packet &packet, std::uint32_t receiver, std::uint32_t stream, bool leaves)
{
  packet.assign (leaves ? 56 : 48, 0);
  put_word (packet, 0, 0x81c90007); /* RR, one block */
  put_word (packet, 4, receiver);
  put_word (packet, 8, stream);
  put_word (packet, 16, 1000);       /* highest sequence number */
  put_word (packet, 32, 0x81ca0003); /* SDES, one chunk */
  put_word (packet, 36, receiver);
  put_word (packet, 40, 0x01046e6f); /* CNAME of four letters */
  put_word (packet, 44, 0x6e650000);
  if (!leaves)
    return;
  put_word (packet, 48, 0x81cb0001); /* BYE */
  put_word (packet, 52, receiver);
}

/* The last packets that went to some ports. */
struct Samples {
  std::set<int> ports;
  std::vector<Packet> packets;
  std::size_t next = 0;

  void take (int port, const std::uint8_t *bytes, std::size_t size)
  {
    if (!ports.contains (port))
      return;
    if (packets.size () < kSamples)
      packets.emplace_back ();
    packets[next % packets.size ()].assign (bytes, bytes + size);
    next = (next + 1) % kSamples;
  }
};

class Flood {
public:
  explicit Flood (const Options &options)
      : options_ (options), good_{options.flip, {}, 0}, other_{options.copy, {}, 0},
        reported_{options.about, {}, 0}, pool_ (kPool)
  {
    for (std::uint8_t &byte : pool_) /* making them for each packet would cost more than sending */
      byte = std::uint8_t (random_ () >> 8);
    if (!options.flip.empty () || !options.copy.empty () || !options.about.empty ())
      tap_ = socket (AF_PACKET, SOCK_DGRAM | SOCK_NONBLOCK, htons (ETH_P_IP));
    for (const int port : options.ports) {
      sockaddr_in to{};
      to.sin_family = AF_INET;
      to.sin_port = htons (std::uint16_t (port));
      inet_pton (AF_INET, options.to.c_str (), &to.sin_addr);
      targets_.push_back (to);
    }
    out_ = socket (AF_INET, SOCK_DGRAM, 0);
    sockaddr_in from{};
    from.sin_family = AF_INET;
    if (!options.from.empty ())
      inet_pton (AF_INET, options.from.c_str (), &from.sin_addr);
    ready_ = out_ >= 0 && bind (out_, reinterpret_cast<sockaddr *> (&from), sizeof from) == 0;
    socklen_t size = sizeof own_;
    getsockname (out_, reinterpret_cast<sockaddr *> (&own_), &size);
  }
  ~Flood ()
  {
    close (out_);
    if (tap_ >= 0)
      close (tap_);
  }
  Flood (const Flood &) = delete;

  [[nodiscard]] bool ready () const { return ready_; }

  /* Each round sends what is due by now, but never more than a tenth of a second's: a machine that
   * stood still is not punished. */
  void run ()
  {
    const auto begin = Clock::now ();
    double due = 0;
    auto last = begin;
    while (Clock::now () - begin < std::chrono::duration<double> (options_.seconds)) {
      listen ();
      const auto now = Clock::now ();
      due += options_.rate * std::chrono::duration<double> (now - last).count ();
      due = std::min (due, options_.rate / 10.0);
      last = now;
      for (const sockaddr_in &target : targets_)
        send (target, int (due));
      due -= int (due);
      std::this_thread::sleep_for (std::chrono::milliseconds (1000 / kRoundsPerSecond));
    }
    const double took = std::chrono::duration<double> (Clock::now () - begin).count ();
    std::printf (
        "packets %llu seconds %.1f ports %zu rate %.0f random %llu copied %llu flipped %llu "
        "rtcp %llu\n",
        sent_, took, targets_.size (), double (sent_) / took / double (targets_.size ()), kinds_[0],
        kinds_[1], kinds_[2], kinds_[3]);
  }

private:
  void listen ()
  {
    std::uint8_t bytes[2048];
    ssize_t size;
    while (tap_ >= 0 && (size = recv (tap_, bytes, sizeof bytes, 0)) > 0) {
      const auto ip = reinterpret_cast<const iphdr *> (bytes);
      const std::size_t header = ip->ihl * 4u;
      if (ip->protocol != IPPROTO_UDP || std::size_t (size) < header + sizeof (udphdr))
        continue;
      const auto udp = reinterpret_cast<const udphdr *> (bytes + header);
      if (udp->source == own_.sin_port)
        continue;
      const std::uint8_t *payload = bytes + header + sizeof (udphdr);
      const std::size_t length = std::size_t (size) - header - sizeof (udphdr);
      for (Samples *samples : {&good_, &other_, &reported_})
        samples->take (ntohs (udp->dest), payload, length);
    }
  }

  /* The SSRC of the stream that is reported on, where it is known: every other time. */
  std::uint32_t some_stream ()
  {
    if (reported_.packets.empty () || random_ () % 2)
      return std::uint32_t (random_ ());
    const Packet &packet = reported_.packets.front ();
    std::uint32_t ssrc = 0;
    for (std::size_t i = 8; i < 12 && i < packet.size (); i++)
      ssrc = ssrc << 8 | packet[i];
    return ssrc;
  }

  /* Some bytes to send; `packet` holds them where no other place does. */
  std::span<const std::uint8_t> make (int port, Packet &packet)
  {
    const auto &any = [this] (const Samples &s) -> const Packet & {
      return s.packets[random_ () % s.packets.size ()];
    };
    const unsigned kind = random_ () % 3;
    if (kind > 0 && options_.rtcp.contains (port)) {
      make_rtcp (packet, ++receivers_ * 2654435761u, some_stream (), random_ () % 2);
      kinds_[3]++;
      return packet;
    }
    if (kind == 1 && !other_.packets.empty ()) {
      kinds_[1]++;
      return any (other_);
    }
    if (kind == 2 && !good_.packets.empty ()) {
      packet = any (good_);
      for (unsigned flips = 1 + random_ () % 8; flips > 0; flips--)
        packet[random_ () % packet.size ()] ^= std::uint8_t (1u << random_ () % 8);
      kinds_[2]++;
      return packet;
    }
    kinds_[0]++;
    return std::span (pool_).subspan (random_ () % (kPool - kLongest), 1 + random_ () % kLongest);
  }

  void send (sockaddr_in target, int count)
  {
    const int port = ntohs (target.sin_port);
    while (count > 0) {
      mmsghdr messages[kBatch] = {};
      iovec parts[kBatch];
      const unsigned batch = unsigned (std::min<int> (count, kBatch));
      for (unsigned i = 0; i < batch; i++) {
        const auto bytes = make (port, made_[i]);
        parts[i] = {const_cast<std::uint8_t *> (bytes.data ()), bytes.size ()};
        messages[i].msg_hdr.msg_iov = &parts[i];
        messages[i].msg_hdr.msg_iovlen = 1;
        messages[i].msg_hdr.msg_name = &target;
        messages[i].msg_hdr.msg_namelen = sizeof target;
      }
      const int done = sendmmsg (out_, messages, batch, 0);
      sent_ += done > 0 ? unsigned (done) : 0;
      count -= int (batch); /* what the kernel refuses is lost */
    }
  }

  const Options &options_;
  Samples good_, other_, reported_;
  Packet pool_, made_[kBatch];
  int tap_ = -1, out_ = -1;
  bool ready_ = false;
  sockaddr_in own_{};
  std::vector<sockaddr_in> targets_;
  std::minstd_rand random_{20};
  std::uint32_t receivers_ = 0;
  unsigned long long sent_ = 0, kinds_[4] = {};
};

std::vector<int>
numbers (const char *text)
{
  std::vector<int> list;
  std::istringstream words (text);
  for (std::string word; std::getline (words, word, ',');)
    list.push_back (std::atoi (word.c_str ()));
  return list;
}

bool
parse (int argc, char **argv, Options &options)
{
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string name = argv[i];
    const std::vector<int> list = numbers (argv[i + 1]);
    if (name == "--to")
      options.to = argv[i + 1];
    else if (name == "--from")
      options.from = argv[i + 1];
    else if (name == "--ports")
      options.ports = list;
    else if (name == "--flip")
      options.flip = {list.begin (), list.end ()};
    else if (name == "--copy")
      options.copy = {list.begin (), list.end ()};
    else if (name == "--rtcp")
      options.rtcp = {list.begin (), list.end ()};
    else if (name == "--about")
      options.about = {list.begin (), list.end ()};
    else if (name == "--rate")
      options.rate = std::atoi (argv[i + 1]);
    else if (name == "--seconds")
      options.seconds = std::atof (argv[i + 1]);
    else
      return false;
  }
  return argc % 2 == 1 && !options.ports.empty () && options.rate > 0;
}

} // namespace

int
main (int argc, char **argv)
{
  Options options;
  if (!parse (argc, argv, options)) {
    std::fprintf (stderr,
        "usage: packet-flood --ports A,B,... [--to ADDRESS] [--from ADDRESS] [--rate "
        "PER-SECOND-AND-PORT]\n"
        "  [--seconds S] [--flip PORTS] [--copy PORTS] [--rtcp PORTS] [--about PORT]\n"
        "  --flip PORTS  send packets to these ports again, with some bits turned\n"
        "  --copy PORTS  send packets to these ports again as they are\n"
        "  --rtcp PORTS  of --ports: RTCP of ever new receivers instead of copies\n"
        "  --about PORT  half of that reports on the stream that goes to this port\n");
    return 2;
  }
  Flood flood (options);
  if (!flood.ready ()) {
    std::fprintf (stderr, "packet-flood: no socket on '%s'; expected an address of this machine\n",
        options.from.c_str ());
    return 1;
  }
  flood.run ();
  return 0;
}
