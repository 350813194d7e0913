/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "senderprobation.hpp"

#include <algorithm>
#include <tuple>

#include "netarrival.hpp"

namespace {

/* Whether two addresses are known and differ at most in their ports. */
bool
share_host (GSocketAddress *a, GSocketAddress *b)
{
  return host_of (a) && same_host (host_of (a), host_of (b));
}

} // namespace

bool
same_sender (GSocketAddress *a, GSocketAddress *b)
{
  if (a == b)
    return true;
  return share_host (a, b) && g_inet_socket_address_get_port (G_INET_SOCKET_ADDRESS (a)) ==
                                  g_inet_socket_address_get_port (G_INET_SOCKET_ADDRESS (b));
}

void
SenderProbation::Stream::unref ()
{
  for (GstBuffer *packet : *this)
    gst_buffer_unref (packet);
  release ();
}

void
SenderProbation::Candidate::clear ()
{
  packets.unref ();
  g_clear_object (&address);
  used = 0;
}

void
SenderProbation::clear ()
{
  for (Candidate &candidate : candidates_)
    candidate.clear ();
}

SenderProbation::Candidate &
SenderProbation::make_room (const Packet &packet)
{
  const auto of_same_host = [&] (const Candidate &c) {
    return c.used > 0 && share_host (c.address, packet.address);
  };
  const bool host_is_full = std::ranges::count_if (candidates_, of_same_host) >= kPerHost;
  return *std::ranges::min_element (candidates_, {}, [&] (const Candidate &c) {
    const bool stale = c.used == 0 || packet.time < c.heard || packet.time - c.heard >= kStale;
    const bool spared = !stale && host_is_full && !of_same_host (c);
    return std::tuple (spared, stale ? 0 : c.packets.size (), c.used);
  });
}

SenderProbation::Candidate &
SenderProbation::find (const Packet &packet)
{
  for (Candidate &c : candidates_)
    if (c.used > 0 && c.ssrc == packet.ssrc && c.version == packet.version &&
        same_sender (c.address, packet.address))
      return c;
  Candidate &c = make_room (packet);
  c.clear ();
  c.ssrc = packet.ssrc;
  c.version = packet.version;
  c.address = packet.address;
  if (c.address)
    g_object_ref (c.address);
  return c;
}

bool
SenderProbation::add (const Packet &packet, GstBuffer *buffer, Stream &stream)
{
  Candidate &c = find (packet);
  c.used = ++uses_;
  c.heard = packet.time;
  if (!c.packets.empty () && packet.sequence == c.sequence)
    return false; /* duplicated by the network */
  if (!c.packets.empty () && packet.sequence != guint16 (c.sequence + 1))
    c.packets.unref ();
  c.packets.push (gst_buffer_ref (buffer));
  c.sequence = packet.sequence;
  if (c.packets.size () < kPackets)
    return false;
  stream = c.packets;
  c.packets.release ();
  c.clear ();
  return true;
}
