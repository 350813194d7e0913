/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "senderrivals.hpp"

#include <algorithm>

void
SenderRivals::clear ()
{
  g_clear_object (&address_);
  packets_ = total_ = 0;
  reported_ = false;
}

namespace {

bool
is_stale (GstClockTime since, GstClockTime now)
{
  return now < since || now - since >= SenderRivals::kStale;
}

} // namespace

/* One source is watched at a time. @return whether it is a rival */
bool
SenderRivals::watch (const SenderProbation::Packet &packet, GstClockTime sender_time)
{
  const bool stale = packets_ == 0 || is_stale (heard_, packet.time);
  const bool same =
      packet.ssrc == ssrc_ && packet.version == version_ && same_sender (packet.address, address_);
  if (!stale && !same)
    return false;
  if (stale) {
    g_set_object (&address_, packet.address);
    ssrc_ = packet.ssrc;
    version_ = packet.version;
    since_ = packet.time;
    packets_ = 0;
  }
  packets_ = std::min (packets_ + 1, kPackets);
  heard_ = packet.time;
  /* By the sender's own time: a source that begins after the sender has stopped is no rival. */
  return packets_ == kPackets && sender_time >= since_ && sender_time - since_ >= kBeside;
}

/* @return whether all sources together are rivals */
bool
SenderRivals::count (GstClockTime now)
{
  if (total_ == 0 || is_stale (all_since_, now)) {
    all_since_ = now;
    total_ = 0;
  }
  total_ = std::min (total_ + 1, kTotal);
  return total_ == kTotal;
}

bool
SenderRivals::add (const SenderProbation::Packet &packet, GstClockTime sender_time)
{
  const bool one = watch (packet, sender_time), all = count (packet.time);
  const bool first = (one || all) && !reported_;
  reported_ |= first;
  return first;
}
