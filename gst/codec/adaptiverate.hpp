/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <mutex>
#include <rangecast/neighbourcode/rate/congestion_control.hpp>
#include <vector>

/** Limits of an adaptive bit rate, bits/s; a maximum of 0 is none. */
struct AdaptiveRateLimits {
  double min_bits_per_s = 0, max_bits_per_s = 0;
};

/** Estimates the bit rate that the network allows from transport-wide feedback: RTPTWCCPackets, an
 *  upstream event of rtpsession. Any thread. */
class AdaptiveRate {
public:
  void reset ();

  /** Handles it, whatever it holds. @return false if it is another event */
  bool handle_event (GstEvent *event);

  /** Call it before each frame set.
   *  @param sent_bits_per_s  the encoder's recent bit rate
   *  @return bits/s; 0: no limit is known */
  double update (const AdaptiveRateLimits &limits, double sent_bits_per_s);

  /** Adds estimated-bitrate, receiver-reports, receiver-loss and receiver-queue. */
  void add_stats (GstStructure *structure) const;
  [[nodiscard]] double bits_per_s () const;

private:
  void handle_packets (const GstStructure *structure);

  mutable std::mutex lock_;
  rangecast::CongestionControl control_;
  guint64 reports_ = 0;
  std::vector<rangecast::PacketReport> packets_; /* of the current event; kept for its memory */
};
