/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "rtcpreceivers.hpp"

#include <algorithm>

#include "netarrival.hpp"

void
RtcpReceivers::clear ()
{
  for (Receiver &receiver : receivers_)
    g_clear_object (&receiver.host);
  receivers_.clear ();
  forgot_ = 0;
}

/* Once a second: a flood of such who want to come in does not make us look at all of them. */
void
RtcpReceivers::forget (GstClockTime now)
{
  if (now >= forgot_ && now - forgot_ < GST_SECOND)
    return;
  forgot_ = now;
  std::erase_if (receivers_, [now] (Receiver &receiver) {
    /* Of two sources the one may be a little ahead; far ahead it is a clock that began anew. */
    if (now + GST_SECOND >= receiver.heard && now < receiver.heard + kForgotten)
      return false;
    g_clear_object (&receiver.host);
    return true;
  });
}

bool
RtcpReceivers::has_room (GInetAddress *host, guint most) const
{
  if (size () >= std::min (most, kMax))
    return false;
  const auto neighbours = std::ranges::count_if (
      receivers_, [host] (const Receiver &receiver) { return same_host (receiver.host, host); });
  return !host || neighbours < std::max (1, int (most / 4));
}

RtcpReceivers::Receiver *
RtcpReceivers::admit (
    guint32 ssrc, GSocketAddress *from, bool reports, GstClockTime now, guint most)
{
  GInetAddress *host = host_of (from);
  const auto known = std::ranges::find (receivers_, ssrc, &Receiver::ssrc);
  if (known != receivers_.end () && same_host (known->host, host)) {
    known->heard = now;
    return &*known;
  }
  if (!reports)
    return nullptr;
  forget (now);
  if (std::ranges::find (receivers_, ssrc, &Receiver::ssrc) != receivers_.end () ||
      !has_room (host, most))
    return nullptr;
  if (host)
    g_object_ref (host);
  receivers_.push_back ({.ssrc = ssrc, .host = host, .heard = now});
  return &receivers_.back ();
}
