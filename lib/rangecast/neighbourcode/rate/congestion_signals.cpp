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

/* The first arrival of so many packets of a burst counts: jitter may exchange them. */
constexpr int kHead = 4;

/* Of jitter the least of so long, but of so many bursts. */
constexpr std::uint64_t kFilterNs = 250 * kMs, kGrowthNs = 500 * kMs;
constexpr std::size_t kMinBursts = 3;

constexpr std::uint64_t kHalfMemoryNs = 10'000 * kMs;

/* Seconds; an outburst counts as the second at most. */
constexpr double kMemoryOfUnrest = 5, kMaxUnrest = 0.03;

/* A delay that is so far from the last one is of another clock: of a sender or receiver that began
 * anew. */
constexpr double kOtherClock = 10;

/* Below the first, loss is never congestion (draft-ietf-rmcat-gcc-02, 6); above the second it is
 * never usual. */
constexpr double kHarmlessLoss = 0.02, kMaxUsualLoss = 0.1;

/* Packets that must be lost: of one or two nothing follows. */
constexpr double kMinLost = 2.5;

/* The loss that stays of that before, where less is sent, if it was usual. */
constexpr double kStays = 0.6;

/* Seconds after which usual loss is doubted: by 1/e. */
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
  if (lost > 0) { /* times of reports with losses are not to be trusted */
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
RecentLeast::add (std::uint64_t time_ns, double value)
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

/* A packet on its own tells little: of each list of buffers GStreamer's rtpsession knows when the
 * first one came to it, but of the others when the socket took them, which is later where the sink
 * waits for the clock. So bursts of one packet are left out. */
void
QueueDelay::add (const PacketReport &packet)
{
  if (burst_packets_ > 0 && packet.sent_ns - last_sent_ns_ > kBurstNs) {
    if (burst_packets_ > 1 && burst_packets_ < kHead)
      finish (burst_sent_ns_, first_arrival_ns_);
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
    finish (burst_sent_ns_, first_arrival_ns_);
}

void
QueueDelay::finish (std::uint64_t sent_ns, std::uint64_t arrival_ns)
{
  const double delay = seconds_between (sent_ns, arrival_ns);
  if (n_ > 0 && std::abs (delay - latest (0).delay_s) > kOtherClock) {
    n_ = 0;
    least_.reset ();
    queue_s_ = growth_s_ = unrest_s_ = 0;
  }
  const double least = least_.add (sent_ns, delay);
  const double elapsed = n_ > 0 ? seconds_between (latest (0).sent_ns, sent_ns) : 0;
  samples_[n_++ % samples_.size ()] = {sent_ns, delay, 0};
  const std::size_t known = std::min (n_, samples_.size ());
  double jitter_free = delay;
  for (std::size_t i = 1; i < known; i++) {
    if (i >= kMinBursts && sent_ns - latest (i).sent_ns > kFilterNs)
      break;
    jitter_free = std::min (jitter_free, latest (i).delay_s);
  }
  queue_s_ = jitter_free - least;
  samples_[(n_ - 1) % samples_.size ()].queue_s = queue_s_;
  std::size_t then = 0;
  while (then + 1 < known && sent_ns - latest (then).sent_ns < kGrowthNs)
    then++;
  growth_s_ = queue_s_ - latest (then).queue_s;
  unrest_s_ += (1 - std::exp (-elapsed / kMemoryOfUnrest)) *
               (std::min (std::abs (growth_s_), kMaxUnrest) - unrest_s_);
  news_ = known >= kMinBursts;
}

bool
QueueDelay::take_news ()
{
  const bool news = news_;
  news_ = false;
  return news;
}

bool
LossJudge::judge (double share, double packets, double elapsed_s)
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
LossJudge::sends_less ()
{
  tries_ = true;
  before_ = share_;
}

} // namespace rangecast
