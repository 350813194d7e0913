/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gio/gio.h>
#include <gst/gst.h>

#include <vector>

/** The receivers of a stream that a sender listens to, so many and no more: rtpsession keeps a
 *  source for every SSRC that RTCP names, and looks through all of them with every packet.
 *
 *  Who reports on the stream (its SSRC is not to be guessed) is taken, while there is room; one
 *  address has a quarter of it, so that a host that floods does not keep the others out. Who was
 *  silent for kForgotten makes room. */
class RtcpReceivers {
public:
  static constexpr guint kMax = 4096, kDefaultMost = 256;
  static constexpr GstClockTime kForgotten = 30 * GST_SECOND;

  struct Receiver {
    guint32 ssrc = 0;
    GInetAddress *host = nullptr; ///< a reference; null: packets do not say
    GstClockTime heard = 0;       ///< last
    guint32 stream = 0;           ///< that it reported on last
    guint32 highest = 0;          ///< sequence number of that stream then
    bool has_reported = false;
  };

  /** Takes memory for kMax; none is taken later, while packets come. */
  RtcpReceivers () { receivers_.reserve (kMax); }
  ~RtcpReceivers () { clear (); }
  RtcpReceivers (const RtcpReceivers &) = delete;

  void clear ();
  /** The one who speaks in a packet of RTCP.
   *  @param from  where the packet comes from, or null
   *  @param reports  it says something about the stream
   *  @return nullptr: there is no room, or it comes from elsewhere than before, or it is not
   *          known and says nothing about the stream. Valid until the next call. */
  Receiver *admit (guint32 ssrc, GSocketAddress *from, bool reports, GstClockTime now, guint most);
  [[nodiscard]] guint size () const { return guint (receivers_.size ()); }

private:
  [[nodiscard]] bool has_room (GInetAddress *host, guint most) const;
  void forget (GstClockTime now);

  std::vector<Receiver> receivers_;
  GstClockTime forgot_ = 0; /* when room was made last */
};
