/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "senderrivals.hpp"

void
SenderRivals::clear ()
{
  g_clear_object (&address_);
  packets_ = total_ = 0;
  told_ = false;
}

/* @return whether the one that is looked at is a rival */
bool
SenderRivals::look (const SenderProbation::Packet &packet, GstClockTime sender_time)
{
  const bool same = packets_ > 0 && packet.ssrc == ssrc_ && packet.version == version_ &&
                    same_sender (packet.address, address_);
  if (!same && packets_ > 0 && packet.time >= heard_ && packet.time - heard_ < kStale)
    return false;
  if (!same) {
    g_set_object (&address_, packet.address);
    ssrc_ = packet.ssrc;
    version_ = packet.version;
    since_ = packet.time;
    packets_ = 0;
  }
  packets_++;
  heard_ = packet.time;
  /* The sender's own time: who comes because it is gone is no rival. */
  return packets_ >= kPackets && sender_time >= since_ && sender_time - since_ >= kBeside;
}

bool
SenderRivals::add (const SenderProbation::Packet &packet, GstClockTime sender_time)
{
  const bool tell = look (packet, sender_time) || ++total_ >= kTotal;
  const bool first = tell && !told_;
  told_ |= tell;
  return first;
}
