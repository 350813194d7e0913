/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <mutex>
#include <rangecast/neighbourcode/rate/congestion_control.hpp>
#include <vector>

/** Within which limits the bit rate follows receivers. */
struct AdaptiveRateLimits {
  double least_bits_per_s = 0, most_bits_per_s = 0; ///< most: 0: none
};

/** The bit rate that receivers let an encoder have, from the events that they send upstream:
 *  RTPTWCCPackets (rtpsession, of transport-wide feedback) and RangecastReceiverReport (rtcpreports
 *  or an application, of RTCP receiver reports). Any thread. */
class AdaptiveRate {
public:
  void reset ();

  /** Takes note of an event, whatever it holds. @return false if it is another one */
  bool note (GstEvent *event);

  /** Before each frame set.
   *  @param sent_bits_per_s  of what was sent of late
   *  @return bits/s; 0: no limit is known */
  double next (const AdaptiveRateLimits &limits, double sent_bits_per_s);

  /** Adds what receivers say to statistics. */
  void describe (GstStructure *structure) const;
  [[nodiscard]] double bits_per_s () const;

private:
  void note_packets (const GstStructure *structure);
  void note_report (const GstStructure *structure);

  mutable std::mutex lock_;
  rangecast::CongestionControl control_;
  double sent_bits_per_s_ = 0;
  guint64 reports_ = 0;
  std::vector<rangecast::PacketReport> packets_; /* of the event at hand; keeps its memory */
};
