/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "congestion_control.hpp"

#include <algorithm>
#include <cmath>

namespace rangecast {
namespace {

constexpr std::uint64_t kMs = 1'000'000;

/* Seconds, but for kTimesVariation. A queue that grows in half a second by more than kGrowth and by
 * more than kTimesVariation times its usual variation is congestion; so is one longer than
 * kLongQueue. Below kNoQueue there is none. Growth counts rather than length, because on a shared
 * link the bursts of some streams always follow those of others, and wait for them. */
constexpr double kGrowth = 0.008, kTimesVariation = 2.5, kLongQueue = 0.08, kNoQueue = 0.012;

/* Share of the delivered rate that is sent after congestion (draft-ietf-rmcat-gcc-02, 5.5: beta),
 * and the least share of the old rate, for sources that sent little. */
constexpr double kDecrease = 0.85, kMaxDecrease = 0.5;

/* Time until a new rate takes effect in encoder and network. */
constexpr std::uint64_t kReactionNs = 500 * kMs;

/* Increase a second: near the known capacity additive, kAdditive times the square root of the rate
 * in bits/s; below it the share kRecovery; beyond it a share that starts at kProbe and doubles
 * every kDoubling seconds up to kMaxProbe. */
constexpr double kAdditive = 30, kRecovery = 0.2, kProbe = 0.08, kMaxProbe = 0.35;
constexpr double kNearBelow = 0.92, kNearAbove = 1.08, kDoubling = 2;

/* The rate of a source that sends less than it may is limited to kHeadroom times what is delivered
 * plus kMore bits/s (draft-ietf-rmcat-gcc-02, 5.5). */
constexpr double kHeadroom = 1.5, kMore = 50'000;

constexpr std::uint64_t kLossIntervalNs = 500 * kMs;
constexpr double kMinPackets = 20, kManyPackets = 150;

constexpr std::uint64_t kSilenceNs = 3'000 * kMs, kMaxLossSpanNs = 2'000 * kMs;
constexpr int kMaxHalvings = 10;

double
seconds (std::uint64_t ns)
{
  return 1e-9 * static_cast<double> (ns);
}

/* Whether there are enough packets to evaluate loss: more are needed if one or two were lost. */
bool
is_enough (double packets, double lost, std::uint64_t span_ns)
{
  if (span_ns >= kMaxLossSpanNs)
    return packets > 0;
  return packets >= kMinPackets && (lost < 0.5 || lost > 2.5 || packets >= kManyPackets);
}

} // namespace

void
CongestionControl::configure (const CongestionSettings &settings)
{
  if (settings == settings_)
    return;
  settings_ = settings;
  if (rate_ > 0)
    rate_ = limited (rate_);
}

double
CongestionControl::limited (double bits_per_s) const
{
  const double rate = std::max (bits_per_s, settings_.min_bits_per_s);
  return settings_.max_bits_per_s > 0 ? std::min (rate, settings_.max_bits_per_s) : rate;
}

double
CongestionControl::bits_per_s () const
{
  return rate_ > 0 ? rate_ : settings_.max_bits_per_s;
}

void
CongestionControl::record_report (std::uint64_t now_ns)
{
  if (halvings_ > 0 && rate_ > 0) {
    rate_ = limited (std::max (rate_, before_silence_ / 2));
    capacity_ = 0;
    arrivals_.reset ();
    delays_.reset ();
  }
  halvings_ = 0;
  has_feedback_ = true;
  report_ns_ = silent_since_ns_ = now_ns;
}

/* Lowers the rate after congestion. Whether loss persists then is what LossEvaluator observes. */
void
CongestionControl::decrease (double delivered)
{
  const double wanted = kDecrease * delivered;
  const double min = rate_ > 0 ? kMaxDecrease * rate_ : 0;
  const double before = bits_per_s ();
  rate_ = limited (before > 0 ? std::min (std::max (wanted, min), before) : wanted);
  capacity_ = delivered;
  calm_s_ = 0;
  before_loss_ = 0;
  decreased_ = true;
  valid_sent_ns_ = last_sent_ns_ + kReactionNs;
  counted_ = counted_lost_ = 0;
  loss_.record_decrease ();
}

void
CongestionControl::increase (double delivered, double elapsed_s)
{
  if (rate_ <= 0)
    return;
  double more = 0;
  if (capacity_ > 0 && rate_ < kNearBelow * capacity_) {
    more = kRecovery * rate_;
    calm_s_ = 0;
  } else if (capacity_ > 0 && rate_ < kNearAbove * capacity_) {
    more = kAdditive * std::sqrt (rate_);
    calm_s_ = 0;
  } else {
    more = std::min (kProbe * std::exp2 (calm_s_ / kDoubling), kMaxProbe) * rate_;
    calm_s_ += elapsed_s;
  }
  const double max = std::max (rate_, kHeadroom * delivered + kMore);
  rate_ = limited (std::min (rate_ + more * elapsed_s, max));
}

void
CongestionControl::evaluate_queue (std::uint64_t sent_ns)
{
  if (!delays_.poll_update ())
    return;
  queue_s_ = delays_.queue_s ();
  const double growth = delays_.growth_s ();
  const double much = std::max (kGrowth, kTimesVariation * delays_.variation_s ());
  if (sent_ns < valid_sent_ns_)
    return;
  if (queue_s_ < kNoQueue || growth > -kGrowth)
    drains_ = false;
  if (drains_ || (growth <= much && queue_s_ <= kLongQueue) || queue_s_ < kNoQueue)
    return;
  const double delivered = arrivals_.delivered_bits_per_s ();
  if (delivered <= 0)
    return;
  decrease (delivered);
  drains_ = true;
}

void
CongestionControl::evaluate_loss ()
{
  if (static_cast<std::int64_t> (last_sent_ns_ - losses_since_ns_) <
      static_cast<std::int64_t> (kLossIntervalNs)) /* also where old reports come late */
    return;
  const std::uint64_t span = last_sent_ns_ - losses_since_ns_;
  if (!is_enough (counted_, counted_lost_, span))
    return;
  const double share = counted_lost_ / counted_;
  const bool congestion = loss_.evaluate (share, counted_, seconds (span));
  counted_ = counted_lost_ = 0;
  if (loss_.was_usual () && before_loss_ > rate_) { /* the decrease did not help: undo it */
    rate_ = limited (before_loss_);
    capacity_ = 0;
    before_loss_ = 0;
  }
  const double delivered = arrivals_.delivered_bits_per_s ();
  if (!congestion || delivered <= 0)
    return;
  const double before = bits_per_s ();
  decrease (delivered);
  before_loss_ = before;
}

void
CongestionControl::packets (std::span<const PacketReport> packets, std::uint64_t now_ns)
{
  if (packets.empty ())
    return;
  const double elapsed = !has_feedback_ ? 0
                                        : std::min (seconds (now_ns - report_ns_),
                                              0.5); /* a gap in reports is not calm */
  record_report (now_ns);
  if (static_cast<std::int64_t> (packets.front ().sent_ns - last_sent_ns_) < -1'000'000'000)
    valid_sent_ns_ = 0, counted_ = counted_lost_ = 0; /* the sender's clock was reset */
  const bool was_decreased = decreased_;
  decreased_ = false;
  const bool has_losses = std::ranges::any_of (packets, &PacketReport::lost);
  for (const PacketReport &packet : packets) {
    arrivals_.add (packet);
    if (!has_losses)
      delays_.add (packet);
    last_sent_ns_ = packet.sent_ns;
    if (packet.sent_ns >= valid_sent_ns_) {
      if (counted_ == 0)
        losses_since_ns_ = packet.sent_ns;
      counted_++;
      counted_lost_ += packet.lost ? 1 : 0;
    }
    evaluate_queue (packet.sent_ns);
  }
  evaluate_loss ();
  const bool waits = last_sent_ns_ < valid_sent_ns_;
  if (!decreased_ && !was_decreased && !waits && !drains_)
    increase (arrivals_.delivered_bits_per_s (), elapsed);
}

void
CongestionControl::tick (double sent_bits_per_s, std::uint64_t now_ns)
{
  if (!has_feedback_ || now_ns - silent_since_ns_ < kSilenceNs || sent_bits_per_s <= 0 ||
      halvings_ == kMaxHalvings)
    return;
  const double before = rate_ > 0 ? rate_ : sent_bits_per_s;
  if (halvings_ == 0)
    before_silence_ = before;
  halvings_++;
  silent_since_ns_ = now_ns;
  rate_ = limited (std::min (before, sent_bits_per_s) / 2);
}

} // namespace rangecast
