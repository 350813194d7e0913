/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gio/gio.h>
#include <gst/gst.h>

#include <vector>

/** The receivers whose RTCP is accepted. Their number is limited because rtpsession keeps a source
 *  for every SSRC in RTCP, and iterates over all of them with every packet.
 *
 *  A receiver is admitted if it reports on the stream, whose SSRC cannot be guessed, and there is
 *  room; one address has a quarter of it, so that a flood from one host does not exclude others.
 *  Receivers that were silent for kTimeout are removed. */
class RtcpReceivers {
public:
  static constexpr guint kMax = 4096, kDefaultMax = 256;
  static constexpr GstClockTime kTimeout = 30 * GST_SECOND;

  struct Receiver {
    guint32 ssrc = 0;
    GInetAddress *host = nullptr; ///< a reference; null: unknown
    GstClockTime heard = 0;       ///< time of the last packet
    guint32 stream = 0;           ///< SSRC of its last report
    guint32 highest = 0;          ///< sequence number in that report
    bool has_reported = false;
  };

  /** Reserves memory for kMax; none is allocated later, while packets arrive. */
  RtcpReceivers () { receivers_.reserve (kMax); }
  ~RtcpReceivers () { clear (); }
  RtcpReceivers (const RtcpReceivers &) = delete;

  void clear ();
  /** The receiver that sent an RTCP packet.
   *  @param from  the packet's address, or null
   *  @param reports  the packet says something about the stream
   *  @param max  receivers at a time
   *  @return valid until the next call; nullptr if there is no room, if the address has changed, or
   *  if the receiver is new and says nothing about the stream */
  Receiver *admit (guint32 ssrc, GSocketAddress *from, bool reports, GstClockTime now, guint max);
  [[nodiscard]] guint size () const { return guint (receivers_.size ()); }

private:
  [[nodiscard]] bool has_room (GInetAddress *host, guint max) const;
  void remove_silent (GstClockTime now);

  std::vector<Receiver> receivers_;
  GstClockTime checked_ = 0; /* when remove_silent() ran last */
};
