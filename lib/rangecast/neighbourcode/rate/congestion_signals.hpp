/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace rangecast {

/** What a receiver says of one packet (transport-wide feedback,
 *  draft-holmer-rmcat-transport-wide-cc-extensions-01). Packets of a report are in the order in
 *  which they were sent. */
struct PacketReport {
  std::uint16_t sequence = 0;   ///< counts packets sent, wraps
  std::uint64_t sent_ns = 0;    ///< on the sender's clock
  std::uint64_t arrival_ns = 0; ///< on the receiver's clock, where it is not lost
  std::uint32_t bytes = 0;
  bool lost = false;
};

/** The packets of the last second: how much of them arrived, and how fast. */
class ArrivalWindow {
public:
  void reset () { *this = ArrivalWindow (); }
  void add (const PacketReport &packet);

  /** Bits/s at which bytes arrived; 0: not known yet, which takes three bursts and a third of a
   *  second. On a link that is full this is its capacity, on another what was sent. Packets of
   *  which the report got lost count as those around them. Where packets were lost, the time is
   *  that in which they were sent. */
  [[nodiscard]] double delivered_bits_per_s () const;

private:
  struct Entry {
    std::uint64_t sent_ns, arrival_ns;
    std::uint32_t bytes;
    std::uint16_t sequence;
    bool lost;
  };
  [[nodiscard]] const Entry &at (std::size_t i) const
  {
    return entries_[(first_ + i) % entries_.size ()];
  }
  std::array<Entry, 4096> entries_{}; /* a ring; of faster streams the window is shorter */
  std::size_t first_ = 0, count_ = 0;
};

/** The least of what was seen in the last 10 to 20 seconds. */
class RecentLeast {
public:
  void reset () { *this = RecentLeast (); }
  /** @return the least, `value` included */
  double add (std::uint64_t time_ns, double value);

private:
  bool known_ = false;
  std::uint64_t since_ns_ = 0;
  double older_ = 0, newer_ = 0;
};

/** How long packets wait in queues, from one-way delays of clocks that need not agree: the delay of
 *  the beginning of each burst (frame set), less the least of the last 10 to 20 seconds
 *  (RFC 8698, 4.2: d_queue); of the last quarter of a second the least, which is free of jitter. */
class QueueDelay {
public:
  void reset () { *this = QueueDelay (); }
  void add (const PacketReport &packet);

  /** Seconds; 0 before it is known. */
  [[nodiscard]] double queue_s () const { return queue_s_; }
  /** By how much it is more than half a second before, seconds; negative where it falls. */
  [[nodiscard]] double growth_s () const { return growth_s_; }
  /** How much it grows and falls anyhow, seconds: the mean over some seconds. */
  [[nodiscard]] double unrest_s () const { return unrest_s_; }
  /** A burst was added since this was called last, and enough are known. */
  bool take_news ();

private:
  struct Sample {
    std::uint64_t sent_ns;
    double delay_s, queue_s;
  };
  void finish (std::uint64_t sent_ns, std::uint64_t arrival_ns);
  [[nodiscard]] const Sample &latest (std::size_t i) const
  {
    return samples_[(n_ - 1 - i) % samples_.size ()];
  }

  std::array<Sample, 64> samples_{}; /* a ring */
  std::size_t n_ = 0;
  RecentLeast least_;
  std::uint64_t burst_sent_ns_ = 0, first_arrival_ns_ = 0, last_sent_ns_ = 0;
  int burst_packets_ = 0;
  double queue_s_ = 0, growth_s_ = 0, unrest_s_ = 0;
  bool news_ = false;
};

/** Tells losses of a full link from those that come anyhow, as of radio: the latter stay where less
 *  is sent. What stays is the *usual* loss; only more than that is congestion. */
class LossJudge {
public:
  /** @param share  of packets lost since the last call, 0 to 1
   *  @param packets  that it is of
   *  @param elapsed_s  since the last call
   *  @return whether it is congestion: the caller then sends less, and says so by sends_less() */
  bool judge (double share, double packets, double elapsed_s);
  void sends_less ();
  /** The latest call found that sending less had not helped. */
  [[nodiscard]] bool was_usual () const { return was_usual_; }
  [[nodiscard]] double usual () const { return usual_; }
  /** Of the latest call. */
  [[nodiscard]] double share () const { return share_; }

private:
  double usual_ = 0, share_ = 0, before_ = 0;
  bool tries_ = false, was_usual_ = false;
};

} // namespace rangecast
