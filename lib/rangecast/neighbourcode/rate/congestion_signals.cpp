/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "congestion_signals.hpp"

#include <algorithm>
#include <cmath>

namespace rangecast {
namespace {

constexpr std::uint64_t kMs = 1'000'000;

/* Packets that are sent within such a time are one burst (draft-ietf-rmcat-gcc-02, 5.2). */
constexpr std::uint64_t kBurstNs = 5 * kMs;

constexpr std::uint64_t kWindowNs = 1000 * kMs, kMinSpanNs = 330 * kMs;

/* The earliest arrival among so many packets of a burst counts, as jitter may reorder them. */
constexpr int kHead = 4;

/* Jitter is removed by the minimum over kFilterNs, but at least kMinBursts bursts. */
constexpr std::uint64_t kFilterNs = 250 * kMs, kGrowthNs = 500 * kMs;
constexpr std::size_t kMinBursts = 3;

constexpr std::uint64_t kHalfMemoryNs = 10'000 * kMs;

/* Seconds: time constant of the variation, and the limit of what one change adds to it. */
constexpr double kVariationMemory = 5, kMaxVariation = 0.03;

/* Seconds. A larger step of the delay means that the sender's or receiver's clock was reset. */
constexpr double kMaxDelayStep = 10;

/* Below the first, loss is never congestion (draft-ietf-rmcat-gcc-02, 6); above the second it is
 * never usual. */
constexpr double kHarmlessLoss = 0.02, kMaxUsualLoss = 0.1;

/* Lost packets that are needed: one or two mean nothing. */
constexpr double kMinLost = 2.5;

/* Share of the loss that remains, if it was usual, when less is sent. */
constexpr double kStays = 0.6;

/* Time constant with which the usual loss is forgotten, seconds. */
constexpr double kMemoryOfLoss = 40;

double
seconds_between (std::uint64_t begin_ns, std::uint64_t end_ns)
{
  return 1e-9 * static_cast<double> (static_cast<std::int64_t> (end_ns - begin_ns));
}

} // namespace

void
ArrivalWindow::add (const PacketReport &packet)
{
  if (count_ > 0) {
    const double step = seconds_between (at (count_ - 1).sent_ns, packet.sent_ns);
    if (step < -1 || step > 5)
      reset ();
  }
  while (count_ > 0 && (count_ == entries_.size () ||
                           seconds_between (at (0).sent_ns, packet.sent_ns) * 1e9 > kWindowNs)) {
    first_ = (first_ + 1) % entries_.size ();
    count_--;
  }
  entries_[(first_ + count_) % entries_.size ()] = {
      packet.sent_ns, packet.arrival_ns, packet.bytes, packet.sequence, packet.lost};
  count_++;
}

double
ArrivalWindow::delivered_bits_per_s () const
{
  if (count_ == 0)
    return 0;
  /* From the end of the first burst to the end of the last one. */
  double bytes = 0;
  std::uint64_t begin_ns = 0, end_ns = 0;
  std::size_t reported = 0, bursts = 0, first = 0, lost = 0;
  for (std::size_t i = 0; i < count_; i++) {
    const Entry &e = at (i);
    lost += e.lost ? 1 : 0;
    if (i == 0 || seconds_between (at (i - 1).sent_ns, e.sent_ns) * 1e9 > kBurstNs)
      bursts++;
    if (bursts <= 1) {
      begin_ns = std::max (begin_ns, e.arrival_ns);
      first = i;
      continue;
    }
    reported++;
    bytes += e.lost ? 0 : e.bytes;
    end_ns = std::max (end_ns, e.arrival_ns);
  }
  const Entry &last = at (count_ - 1);
  if (lost > 0) { /* arrival times in reports with losses are unreliable */
    begin_ns = at (first).sent_ns;
    end_ns = last.sent_ns;
  }
  if (bursts < 3 || begin_ns == 0 || end_ns < begin_ns + kMinSpanNs)
    return 0;
  const auto sent = static_cast<std::uint16_t> (last.sequence - at (first).sequence);
  const double share = reported > 0 ? std::clamp (double (sent) / double (reported), 1.0, 4.0) : 1;
  return 8 * bytes * share / seconds_between (begin_ns, end_ns);
}

double
SlidingMinimum::add (std::uint64_t time_ns, double value)
{
  if (!known_) {
    known_ = true;
    since_ns_ = time_ns;
    older_ = newer_ = value;
  } else if (time_ns > since_ns_ && time_ns - since_ns_ >= kHalfMemoryNs) {
    since_ns_ = time_ns;
    older_ = newer_;
    newer_ = value;
  }
  newer_ = std::min (newer_, value);
  return std::min (older_, newer_);
}

/* Bursts of one packet are ignored: for the first packet of a buffer list GStreamer's rtpsession
 * reports the time when it received the list, for the others the time when the socket took them,
 * which is later if the sink waits for the clock. */
void
QueueDelay::add (const PacketReport &packet)
{
  if (burst_packets_ > 0 && packet.sent_ns - last_sent_ns_ > kBurstNs) {
    if (burst_packets_ > 1 && burst_packets_ < kHead)
      add_burst (burst_sent_ns_, first_arrival_ns_);
    burst_packets_ = 0;
  }
  last_sent_ns_ = packet.sent_ns;
  if (packet.lost)
    return;
  if (burst_packets_++ == 0) {
    burst_sent_ns_ = packet.sent_ns;
    first_arrival_ns_ = packet.arrival_ns;
  }
  first_arrival_ns_ = std::min (first_arrival_ns_, packet.arrival_ns);
  if (burst_packets_ == kHead)
    add_burst (burst_sent_ns_, first_arrival_ns_);
}

void
QueueDelay::add_burst (std::uint64_t sent_ns, std::uint64_t arrival_ns)
{
  const double delay = seconds_between (sent_ns, arrival_ns);
  if (n_ > 0 && std::abs (delay - latest (0).delay_s) > kMaxDelayStep) {
    n_ = 0;
    min_.reset ();
    queue_s_ = growth_s_ = variation_s_ = 0;
  }
  const double min = min_.add (sent_ns, delay);
  const double elapsed = n_ > 0 ? seconds_between (latest (0).sent_ns, sent_ns) : 0;
  samples_[n_++ % samples_.size ()] = {sent_ns, delay, 0};
  const std::size_t known = std::min (n_, samples_.size ());
  double jitter_free = delay;
  for (std::size_t i = 1; i < known; i++) {
    if (i >= kMinBursts && sent_ns - latest (i).sent_ns > kFilterNs)
      break;
    jitter_free = std::min (jitter_free, latest (i).delay_s);
  }
  queue_s_ = jitter_free - min;
  samples_[(n_ - 1) % samples_.size ()].queue_s = queue_s_;
  std::size_t then = 0;
  while (then + 1 < known && sent_ns - latest (then).sent_ns < kGrowthNs)
    then++;
  growth_s_ = queue_s_ - latest (then).queue_s;
  variation_s_ += (1 - std::exp (-elapsed / kVariationMemory)) *
                  (std::min (std::abs (growth_s_), kMaxVariation) - variation_s_);
  has_update_ = known >= kMinBursts;
}

bool
QueueDelay::poll_update ()
{
  const bool has_update = has_update_;
  has_update_ = false;
  return has_update;
}

bool
LossEvaluator::evaluate (double share, double packets, double elapsed_s)
{
  share_ = share;
  was_usual_ = tries_ && before_ > 0 && share > kStays * before_ && share < kMaxUsualLoss;
  if (was_usual_)
    usual_ = std::max (usual_, share);
  tries_ = false;
  usual_ *= std::exp (-elapsed_s / kMemoryOfLoss);
  if (share < usual_)
    usual_ += 0.3 * (share - usual_);
  const double chance = 2.5 * std::sqrt (usual_ * (1 - usual_) / std::max (packets, 1.0));
  const double excess = share - usual_;
  return excess > std::max (kHarmlessLoss, chance) && excess * packets > kMinLost;
}

void
LossEvaluator::record_decrease ()
{
  tries_ = true;
  before_ = share_;
}

} // namespace rangecast
