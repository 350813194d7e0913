/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "congestion_signals.hpp"

namespace rangecast {

/** What an RTCP receiver report says (RFC 3550, 6.4.1), as far as it counts here. */
struct ReceiverReport {
  std::uint32_t receiver = 0; ///< SSRC of who reports
  double lost = 0;            ///< share of packets since the report before, 0 to 1
  double packets = 0;         ///< that it is of; 0: not known
  double jitter_s = 0;        ///< interarrival jitter
  double round_trip_s = 0;    ///< 0: not known
};

struct CongestionSettings {
  double least_bits_per_s = 200'000; ///< never below, unless `most` is
  double most_bits_per_s = 0;        ///< never above; 0: no limit

  friend bool operator== (const CongestionSettings &, const CongestionSettings &) = default;
};

/** Finds the bit rate that a network bears, from what receivers report.
 *
 *  It is additive increase and multiplicative decrease on signs of queues and of loss, as in Google
 *  Congestion Control (draft-ietf-rmcat-gcc-02, sections 5.5 and 6), with three changes for streams
 *  that come in bursts, one a frame set: queues are seen in the one-way delay of the first packet
 *  of each burst (RFC 8698, 4.2) as it grows, and not in the spacing of packets, which the burst
 *  itself makes;
 *  the increase near the last known capacity goes with the square root of the rate, so that
 *  streams which share a link get equal parts of it soon at 1 and at 20 Mbit/s; loss counts beyond
 *  what is *usual*, that is what stays where less is sent (LossJudge).
 *
 *  A rate of bytes that receivers report: payload where headers are not in `bytes`. Until the first
 *  sign of congestion it is most_bits_per_s, or no limit. Nothing is allocated. Not thread-safe. */
class CongestionControl {
public:
  void reset () { *this = CongestionControl (); }
  void configure (const CongestionSettings &settings);

  /** Transport-wide feedback of one receiver; while it comes, receiver reports do not count. Of a
   *  report with lost packets the times do not count: those that GStreamer 1.22 sends then are
   *  wrong, by some frame intervals, as its deltas and the packets that they are of do not agree.
   *  @param now_ns  of any steady clock, the same for all calls */
  void packets (std::span<const PacketReport> packets, std::uint64_t now_ns);
  /** The worst of several receivers counts, of up to 64. Its loss is judged over 20 packets or two
   *  seconds at least: with early feedback reports are of few packets, and come because one was
   *  lost.
   *  @param sent_bits_per_s  the rate of what was sent of late */
  void receiver_report (const ReceiverReport &report, double sent_bits_per_s, std::uint64_t now_ns);
  /** Before each frame set: where reports stay away, the rate falls to half every 3 s (packets) or
   *  15 s (receiver reports), and is back at half of what it was with the first that comes.
   *  @param sent_bits_per_s  the rate of what was sent of late */
  void tick (double sent_bits_per_s, std::uint64_t now_ns);

  /** 0: no limit. */
  [[nodiscard]] double bits_per_s () const;
  /** Reports came, and not too long ago. */
  [[nodiscard]] bool has_reports () const { return source_ != Source::kNone && halvings_ == 0; }
  /** Share of packets lost, of the latest half second or report. */
  [[nodiscard]] double lost () const { return loss_.share (); }
  /** Time in queues, seconds; from the round trip where there are receiver reports only. */
  [[nodiscard]] double queue_s () const { return queue_s_; }

private:
  enum class Source : std::uint8_t { kNone, kPackets, kReports };
  struct Receiver {
    std::uint32_t id = 0;
    std::uint64_t time_ns = 0;    /* of its last report; 0: free */
    double packets = 0, lost = 0; /* since its loss was judged */
    std::uint64_t since_ns = 0;   /* when that was */
    double share = 0, of = 0;     /* of packets lost, the last that was judged */
    bool has_news = false;        /* since the last judgement */
    double queue_s = 0;
    bool jitters = false;
    RecentLeast round_trip, jitter;
  };

  [[nodiscard]] double limited (double bits_per_s) const;
  void note_report (Source source, std::uint64_t now_ns);
  void decrease (double delivered, std::uint64_t now_ns);
  void take_back ();
  void increase (double delivered, double elapsed_s);
  void judge_queue (std::uint64_t sent_ns, std::uint64_t now_ns);
  void judge_loss (std::uint64_t now_ns);
  void count_losses (const PacketReport &packet);
  struct Worst {
    double lost = 0, packets = 0, queue_s = 0;
    bool is_new = false, jitters = false;
    bool queues = false; /* also of a receiver that has not reported since */
  };
  Receiver &find_receiver (std::uint32_t id, std::uint64_t now_ns);
  Worst find_worst (std::uint64_t now_ns);
  void judge_receivers (double sent_bits_per_s, std::uint64_t now_ns);

  CongestionSettings settings_;
  double rate_ = 0;        /* 0: no limit known */
  double capacity_ = 0;    /* of the link where it was full last; 0: not known */
  double before_loss_ = 0; /* the rate, if nothing but loss lowered it since */
  double calm_s_ = 0;      /* beyond capacity_ without congestion */
  Source source_ = Source::kNone;
  std::uint64_t report_ns_ = 0; /* of the last one */
  std::uint64_t silent_since_ns_ = 0;
  int halvings_ = 0;
  double before_silence_ = 0;

  ArrivalWindow arrivals_;
  QueueDelay delays_;
  LossJudge loss_;
  double queue_s_ = 0;
  bool drains_ = false; /* the queue of the last decrease is not yet gone */
  std::uint64_t decrease_ns_ = 0;
  bool decreased_ = false;
  /* Packets that were sent before this were sent at another rate. */
  std::uint64_t valid_sent_ns_ = 0, last_sent_ns_ = 0;
  std::uint64_t losses_since_ns_ = 0; /* sent time of the first packet that is counted */
  double counted_ = 0, counted_lost_ = 0;

  std::array<Receiver, 64> receivers_{}; /* the latest */
  std::uint64_t judged_ns_ = 0;          /* when receivers were judged last */
};

} // namespace rangecast
