/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <cstdint>
#include <span>

#include "congestion_signals.hpp"

namespace rangecast {

struct CongestionSettings {
  double min_bits_per_s = 200'000; ///< never below, unless max_bits_per_s is
  double max_bits_per_s = 0;       ///< never above; 0: no limit

  friend bool operator== (const CongestionSettings &, const CongestionSettings &) = default;
};

/** Finds the bit rate that a network sustains, from a receiver's transport-wide feedback.
 *
 *  Additive increase and multiplicative decrease on signs of queues and of loss, as in Google
 *  Congestion Control (draft-ietf-rmcat-gcc-02, sections 5.5 and 6), with three changes for streams
 *  of bursts, one a frame set. Queues are detected by growth of the one-way delay of each burst's
 *  first packets (RFC 8698, 4.2) instead of the spacing of packets, which depends on the burst. The
 *  increase near the last known capacity is proportional to the square root of the rate, so that
 *  streams which share a link soon get equal parts of it at 1 as well as at 20 Mbit/s. Only loss
 *  beyond the *usual*, which remains when less is sent, counts (LossEvaluator).
 *
 *  The rate counts the bytes of PacketReport: payload only, if these exclude headers. Until the
 * first sign of congestion it is max_bits_per_s, or no limit. Nothing is allocated. Not
 * thread-safe. */
class CongestionControl {
public:
  void reset () { *this = CongestionControl (); }
  void configure (const CongestionSettings &settings);

  /** Transport-wide feedback of one receiver. Times in a report with lost packets are ignored:
   *  GStreamer 1.22 assigns its deltas to the wrong packets then, which makes them wrong by some
   *  frame intervals.
   *  @param now_ns  of any steady clock, the same for all calls */
  void packets (std::span<const PacketReport> packets, std::uint64_t now_ns);
  /** To be called before each frame set. While reports are missing the rate is halved every 3 s;
   *  the first report restores it to half of its old value.
   *  @param sent_bits_per_s  the recent rate of sending */
  void tick (double sent_bits_per_s, std::uint64_t now_ns);

  /** The rate to send at; 0: no limit. */
  [[nodiscard]] double bits_per_s () const;
  /** Share of packets lost in the latest half second, 0 to 1. */
  [[nodiscard]] double lost () const { return loss_.share (); }
  /** Queueing delay, seconds. */
  [[nodiscard]] double queue_s () const { return queue_s_; }

private:
  [[nodiscard]] double limited (double bits_per_s) const;
  void record_report (std::uint64_t now_ns);
  void decrease (double delivered);
  void increase (double delivered, double elapsed_s);
  void evaluate_queue (std::uint64_t sent_ns);
  void evaluate_loss ();

  CongestionSettings settings_;
  double rate_ = 0;        /* 0: no limit known */
  double capacity_ = 0;    /* of the link where it was full last; 0: not known */
  double before_loss_ = 0; /* the rate before it was lowered, if for loss alone; else 0 */
  double calm_s_ = 0;      /* beyond capacity_ without congestion */
  bool has_feedback_ = false;
  std::uint64_t report_ns_ = 0; /* of the last one */
  std::uint64_t silent_since_ns_ = 0;
  int halvings_ = 0;
  double before_silence_ = 0;

  ArrivalWindow arrivals_;
  QueueDelay delays_;
  LossEvaluator loss_;
  double queue_s_ = 0;
  bool drains_ = false; /* the queue that caused the last decrease is not yet gone */
  bool decreased_ = false;
  /* Packets that were sent before this were sent at another rate. */
  std::uint64_t valid_sent_ns_ = 0, last_sent_ns_ = 0;
  std::uint64_t losses_since_ns_ = 0; /* sent time of the first packet that is counted */
  double counted_ = 0, counted_lost_ = 0;
};

} // namespace rangecast
