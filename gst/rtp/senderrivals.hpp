/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "senderprobation.hpp"

/** Detects other sources that send at the same time as the accepted sender. SenderFilter may pass
 *  only a sample of their packets, so that sequence numbers need not be consecutive, as they are
 *  for SenderProbation. */
class SenderRivals {
public:
  /* A rival is one source with kPackets packets while the sender has sent for kBeside since the
   * first of them, or all sources together with kTotal packets within kStale. */
  static constexpr guint kPackets = 4, kTotal = 100;
  static constexpr GstClockTime kBeside = 2 * GST_SECOND;
  static constexpr GstClockTime kStale = 10 * GST_SECOND; ///< silence of the watched source

  SenderRivals () = default;
  ~SenderRivals () { clear (); }
  SenderRivals (const SenderRivals &) = delete;

  void clear ();
  /** Records a valid packet of another source than the sender.
   *  @param sender_time  of the sender's last packet
   *  @return whether a rival is detected; only once until clear() */
  bool add (const SenderProbation::Packet &packet, GstClockTime sender_time);
  /** Whether the watched source has this address. */
  [[nodiscard]] bool comes_from (GSocketAddress *address) const
  {
    return packets_ > 0 && same_sender (address, address_);
  }

private:
  bool watch (const SenderProbation::Packet &packet, GstClockTime sender_time);
  bool count (GstClockTime now);

  GSocketAddress *address_ = nullptr; /* a reference */
  guint32 ssrc_ = 0;
  int version_ = 0;
  guint packets_ = 0; /* of the watched source, up to kPackets */
  GstClockTime since_ = 0, heard_ = 0;
  guint total_ = 0; /* of all sources since all_since_, up to kTotal */
  GstClockTime all_since_ = 0;
  bool reported_ = false;
};
