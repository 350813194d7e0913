/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "senderprobation.hpp"

#include <algorithm>

bool
same_sender (GSocketAddress *a, GSocketAddress *b)
{
  if (a == b)
    return true;
  if (!G_IS_INET_SOCKET_ADDRESS (a) || !G_IS_INET_SOCKET_ADDRESS (b))
    return false;
  auto x = G_INET_SOCKET_ADDRESS (a), y = G_INET_SOCKET_ADDRESS (b);
  return g_inet_socket_address_get_port (x) == g_inet_socket_address_get_port (y) &&
         g_inet_address_equal (
             g_inet_socket_address_get_address (x), g_inet_socket_address_get_address (y));
}

void
SenderProbation::Candidate::clear ()
{
  for (GstBuffer *buffer : packets)
    gst_buffer_unref (buffer);
  packets.clear ();
  g_clear_object (&address);
  used = 0;
}

void
SenderProbation::clear ()
{
  for (Candidate &candidate : candidates_)
    candidate.clear ();
}

/* The one who sent it; the one that was silent for longest makes room for somebody new. */
SenderProbation::Candidate &
SenderProbation::find (const Packet &packet)
{
  for (Candidate &c : candidates_)
    if (c.used > 0 && c.ssrc == packet.ssrc && c.version == packet.version &&
        same_sender (c.address, packet.address))
      return c;
  Candidate &c = *std::ranges::min_element (candidates_, {}, &Candidate::used);
  c.clear ();
  c.ssrc = packet.ssrc;
  c.version = packet.version;
  c.address = packet.address;
  if (c.address)
    g_object_ref (c.address);
  return c;
}

bool
SenderProbation::add (const Packet &packet, GstBuffer *buffer, std::vector<GstBuffer *> &stream)
{
  Candidate &c = find (packet);
  c.used = ++uses_;
  if (!c.packets.empty () && packet.sequence == c.sequence)
    return false; /* the network doubled it */
  if (!c.packets.empty () && packet.sequence != guint16 (c.sequence + 1)) {
    for (GstBuffer *old : c.packets)
      gst_buffer_unref (old);
    c.packets.clear ();
  }
  c.packets.push_back (gst_buffer_ref (buffer));
  c.sequence = packet.sequence;
  if (c.packets.size () < kPackets)
    return false;
  stream.swap (c.packets);
  c.clear ();
  return true;
}
