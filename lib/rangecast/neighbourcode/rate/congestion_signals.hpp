/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace rangecast {

/** A receiver's report of one packet (transport-wide feedback,
 *  draft-holmer-rmcat-transport-wide-cc-extensions-01). Packets of a report are in sending order.
 */
struct PacketReport {
  std::uint16_t sequence = 0;   ///< number of the packet, wraps
  std::uint64_t sent_ns = 0;    ///< on the sender's clock
  std::uint64_t arrival_ns = 0; ///< on the receiver's clock, unless lost
  std::uint32_t bytes = 0;
  bool lost = false;
};

/** The packets of the last second and the rate at which they were delivered. */
class ArrivalWindow {
public:
  void reset () { *this = ArrivalWindow (); }
  void add (const PacketReport &packet);

  /** Delivered bits/s; 0: not known, until there are three bursts in a third of a second. On a full
   *  link this is its capacity, else the rate of sending. Packets whose reports were lost are
   *  interpolated. If packets were lost, sending times are used. */
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

/** Minimum over the last 10 to 20 seconds. */
class SlidingMinimum {
public:
  void reset () { *this = SlidingMinimum (); }
  /** Adds a value. @return the minimum, `value` included */
  double add (std::uint64_t time_ns, double value);

private:
  bool known_ = false;
  std::uint64_t since_ns_ = 0;
  double older_ = 0, newer_ = 0;
};

/** Queueing delay, from one-way delays between clocks that need not agree: the delay of the
 * beginning of each burst (frame set) less the minimum of the last 10 to 20 seconds (RFC 8698, 4.2:
 * d_queue), as the minimum over the last quarter of a second to remove jitter. */
class QueueDelay {
public:
  void reset () { *this = QueueDelay (); }
  void add (const PacketReport &packet);

  /** Seconds; 0 before it is known. */
  [[nodiscard]] double queue_s () const { return queue_s_; }
  /** Change over half a second, seconds; negative if the queue shrinks. */
  [[nodiscard]] double growth_s () const { return growth_s_; }
  /** Usual size of that change, seconds: its mean over some seconds. */
  [[nodiscard]] double variation_s () const { return variation_s_; }
  /** Whether a burst was added since the last call, and enough are known. */
  bool poll_update ();

private:
  struct Sample {
    std::uint64_t sent_ns;
    double delay_s, queue_s;
  };
  void add_burst (std::uint64_t sent_ns, std::uint64_t arrival_ns);
  [[nodiscard]] const Sample &latest (std::size_t i) const
  {
    return samples_[(n_ - 1 - i) % samples_.size ()];
  }

  std::array<Sample, 64> samples_{}; /* a ring */
  std::size_t n_ = 0;
  SlidingMinimum min_;
  std::uint64_t burst_sent_ns_ = 0, first_arrival_ns_ = 0, last_sent_ns_ = 0;
  int burst_packets_ = 0;
  double queue_s_ = 0, growth_s_ = 0, variation_s_ = 0;
  bool has_update_ = false;
};

/** Distinguishes loss on a full link from other loss, such as that of radio links, which remains
 * when less is sent. The latter is the *usual* loss; only more than that is congestion. */
class LossEvaluator {
public:
  /** @param share  of packets lost since the last call, 0 to 1
   *  @param packets  packets since the last call
   *  @param elapsed_s  since the last call
   *  @return whether it is congestion: the caller then sends less and calls record_decrease() */
  bool evaluate (double share, double packets, double elapsed_s);
  void record_decrease ();
  /** The latest evaluate() found that sending less had not helped. */
  [[nodiscard]] bool was_usual () const { return was_usual_; }
  /** Share of packets lost in the latest evaluate(). */
  [[nodiscard]] double share () const { return share_; }

private:
  double usual_ = 0, share_ = 0, before_ = 0;
  bool tries_ = false, was_usual_ = false;
};

} // namespace rangecast
