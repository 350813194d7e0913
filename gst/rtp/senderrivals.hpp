/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "senderprobation.hpp"

/** Tells when somebody else sends beside the sender that passes. Of what others send the kernel may
 *  let a sample through only (SenderFilter), so their packets need not follow one another. */
class SenderRivals {
public:
  static constexpr guint kPackets = 4; ///< of one rival, if he has been there beside the sender ...
  static constexpr GstClockTime kBeside = 2 * GST_SECOND; ///< ... for so long
  static constexpr GstClockTime kStale = 10 * GST_SECOND; ///< then another one may be looked at
  static constexpr guint kTotal = 100;                    ///< or so many of all within kStale

  SenderRivals () = default;
  ~SenderRivals () { clear (); }
  SenderRivals (const SenderRivals &) = delete;

  void clear ();
  /** Takes note of a sound packet of somebody who is not the sender.
   *  @param sender_time  of the sender's last packet
   *  @return whether there is a rival now; once until clear() */
  bool add (const SenderProbation::Packet &packet, GstClockTime sender_time);
  /** Whether the rival that is looked at sends from there. */
  [[nodiscard]] bool comes_from (GSocketAddress *address) const
  {
    return packets_ > 0 && same_sender (address, address_);
  }

private:
  bool look (const SenderProbation::Packet &packet, GstClockTime sender_time);
  bool count (GstClockTime now);

  GSocketAddress *address_ = nullptr; /* a reference */
  guint32 ssrc_ = 0;
  int version_ = 0;
  guint packets_ = 0; /* of this one */
  GstClockTime since_ = 0, heard_ = 0;
  guint total_ = 0; /* of all since all_since_, up to kTotal */
  GstClockTime all_since_ = 0;
  bool told_ = false;
};
