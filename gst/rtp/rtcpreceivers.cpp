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
  checked_ = 0;
}

/* At most once a second, so that a flood of new receivers does not cost an iteration each. */
void
RtcpReceivers::remove_silent (GstClockTime now)
{
  if (now >= checked_ && now - checked_ < GST_SECOND)
    return;
  checked_ = now;
  std::erase_if (receivers_, [now] (Receiver &receiver) {
    /* Times of two sources may differ a little; one far in the future is from before a clock reset.
     */
    if (now + GST_SECOND >= receiver.heard && now < receiver.heard + kTimeout)
      return false;
    g_clear_object (&receiver.host);
    return true;
  });
}

bool
RtcpReceivers::has_room (GInetAddress *host, guint max) const
{
  if (size () >= std::min (max, kMax))
    return false;
  const auto neighbours = std::ranges::count_if (
      receivers_, [host] (const Receiver &receiver) { return same_host (receiver.host, host); });
  return !host || neighbours < std::max (1, int (max / 4));
}

RtcpReceivers::Receiver *
RtcpReceivers::admit (guint32 ssrc, GSocketAddress *from, bool reports, GstClockTime now, guint max)
{
  GInetAddress *host = host_of (from);
  const auto known = std::ranges::find (receivers_, ssrc, &Receiver::ssrc);
  if (known != receivers_.end () && same_host (known->host, host)) {
    known->heard = now;
    return &*known;
  }
  if (!reports)
    return nullptr;
  remove_silent (now);
  if (std::ranges::find (receivers_, ssrc, &Receiver::ssrc) != receivers_.end () ||
      !has_room (host, max))
    return nullptr;
  if (host)
    g_object_ref (host);
  receivers_.push_back ({.ssrc = ssrc, .host = host, .heard = now});
  return &receivers_.back ();
}
