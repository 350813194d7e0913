/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "congestion_control.hpp"

#include <algorithm>
#include <cmath>

namespace rangecast {
namespace {

constexpr std::uint64_t kMs = 1'000'000;

/* A queue that grows by the first in half a second, and by so many times what it grows and falls
 * anyhow, is congestion; so is one of the third length. Where it is shorter than the last there is
 * none. Not its length counts but how it grows: of streams that share a link the bursts of some
 * come just behind those of others, and wait for them always. Seconds. */
constexpr double kGrowth = 0.008, kTimesUnrest = 2.5, kLongQueue = 0.08, kNoQueue = 0.012;

/* Of what arrives, so much is sent after congestion (draft-ietf-rmcat-gcc-02, 5.5: beta). But
 * never less than half of what was sent, where that was little by itself. */
constexpr double kDecrease = 0.85, kMaxDecrease = 0.5;

/* So long encoder and network take until a new rate shows. */
constexpr std::uint64_t kReactionNs = 500 * kMs;

/* Near the capacity that is known: additive, this times the square root of the rate, bits/s each
 * second. Below: a share each second. Beyond, a share that doubles every two seconds. */
constexpr double kAdditive = 30, kRecovery = 0.2, kProbe = 0.08, kMaxProbe = 0.35;
constexpr double kNearBelow = 0.92, kNearAbove = 1.08, kDoubling = 2;

/* A source that makes less than it may is not given more than this times what it makes, and so
 * much (draft-ietf-rmcat-gcc-02, 5.5). */
constexpr double kHeadroom = 1.5, kMore = 50'000;

constexpr std::uint64_t kLossIntervalNs = 500 * kMs;
constexpr double kMinPackets = 20, kManyPackets = 150;

constexpr std::uint64_t kSilencePacketsNs = 3'000 * kMs, kSilenceReportsNs = 15'000 * kMs;
constexpr int kMaxHalvings = 10;

/* Of receiver reports: round trips longer by this are a queue; jitter greater by this forbids more.
 * Reports older than the last do not count. */
constexpr double kRoundTripQueue = 0.1, kJitter = 0.03;
constexpr std::uint64_t kFreshNs = 15'000 * kMs, kReportIntervalNs = 400 * kMs;
constexpr std::uint64_t kLongestLossNs = 2'000 * kMs;
constexpr double kLongestElapsed = 6;
/* No more is sent while one loses so much beyond the usual. */
constexpr double kReportedLoss = 0.02;

double
seconds (std::uint64_t ns)
{
  return 1e-9 * static_cast<double> (ns);
}

/* Whether to judge loss now. Where one or two of few packets were lost, more are waited for. */
bool
is_enough (double packets, double lost, std::uint64_t span_ns)
{
  if (span_ns >= kLongestLossNs)
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
  const double rate = std::max (bits_per_s, settings_.least_bits_per_s);
  return settings_.most_bits_per_s > 0 ? std::min (rate, settings_.most_bits_per_s) : rate;
}

double
CongestionControl::bits_per_s () const
{
  return rate_ > 0 ? rate_ : settings_.most_bits_per_s;
}

void
CongestionControl::note_report (Source source, std::uint64_t now_ns)
{
  if (halvings_ > 0 && rate_ > 0) {
    rate_ = limited (std::max (rate_, before_silence_ / 2));
    capacity_ = 0;
    arrivals_.reset ();
    delays_.reset ();
  }
  halvings_ = 0;
  source_ = source;
  report_ns_ = silent_since_ns_ = now_ns;
}

/* Every decrease is a question, too: does what was wrong go away? */
void
CongestionControl::decrease (double delivered, std::uint64_t now_ns)
{
  const double wanted = kDecrease * delivered;
  const double least = rate_ > 0 ? kMaxDecrease * rate_ : 0;
  const double before = bits_per_s ();
  rate_ = limited (before > 0 ? std::min (std::max (wanted, least), before) : wanted);
  capacity_ = delivered;
  calm_s_ = 0;
  before_loss_ = 0;
  decreased_ = true;
  decrease_ns_ = now_ns;
  valid_sent_ns_ = last_sent_ns_ + kReactionNs;
  counted_ = counted_lost_ = 0;
  loss_.sends_less ();
}

/* The loss for which the rate was lowered is there all the same. */
void
CongestionControl::take_back ()
{
  if (before_loss_ <= rate_)
    return;
  rate_ = limited (before_loss_);
  capacity_ = 0;
  before_loss_ = 0;
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
  const double most = std::max (rate_, kHeadroom * delivered + kMore);
  rate_ = limited (std::min (rate_ + more * elapsed_s, most));
}

void
CongestionControl::judge_queue (std::uint64_t sent_ns, std::uint64_t now_ns)
{
  if (!delays_.take_news ())
    return;
  queue_s_ = delays_.queue_s ();
  const double growth = delays_.growth_s ();
  const double much = std::max (kGrowth, kTimesUnrest * delays_.unrest_s ());
  if (sent_ns < valid_sent_ns_)
    return;
  if (queue_s_ < kNoQueue || growth > -kGrowth)
    drains_ = false;
  if (drains_ || (growth <= much && queue_s_ <= kLongQueue) || queue_s_ < kNoQueue)
    return;
  const double delivered = arrivals_.delivered_bits_per_s ();
  if (delivered <= 0)
    return;
  decrease (delivered, now_ns);
  drains_ = true;
}

void
CongestionControl::count_losses (const PacketReport &packet)
{
  if (packet.sent_ns < valid_sent_ns_)
    return;
  if (counted_ == 0)
    losses_since_ns_ = packet.sent_ns;
  counted_++;
  counted_lost_ += packet.lost ? 1 : 0;
}

void
CongestionControl::judge_loss (std::uint64_t now_ns)
{
  if (static_cast<std::int64_t> (last_sent_ns_ - losses_since_ns_) <
      static_cast<std::int64_t> (kLossIntervalNs)) /* also where old reports come late */
    return;
  const std::uint64_t span = last_sent_ns_ - losses_since_ns_;
  if (!is_enough (counted_, counted_lost_, span))
    return;
  const double share = counted_lost_ / counted_;
  const bool congestion = loss_.judge (share, counted_, seconds (span));
  counted_ = counted_lost_ = 0;
  if (loss_.was_usual ())
    take_back ();
  const double delivered = arrivals_.delivered_bits_per_s ();
  if (!congestion || delivered <= 0)
    return;
  const double before = bits_per_s ();
  decrease (delivered, now_ns);
  before_loss_ = before;
}

void
CongestionControl::packets (std::span<const PacketReport> packets, std::uint64_t now_ns)
{
  if (packets.empty ())
    return;
  const bool first = source_ != Source::kPackets;
  const double elapsed =
      first ? 0 : std::min (seconds (now_ns - report_ns_), 0.5); /* silence is no calm */
  note_report (Source::kPackets, now_ns);
  if (static_cast<std::int64_t> (packets.front ().sent_ns - last_sent_ns_) < -1'000'000'000)
    valid_sent_ns_ = 0, counted_ = counted_lost_ = 0; /* the sender's clock began anew */
  const bool was_decreased = decreased_;
  decreased_ = false;
  const bool has_losses = std::ranges::any_of (packets, &PacketReport::lost);
  for (const PacketReport &packet : packets) {
    arrivals_.add (packet);
    if (!has_losses)
      delays_.add (packet);
    last_sent_ns_ = packet.sent_ns;
    count_losses (packet);
    judge_queue (packet.sent_ns, now_ns);
  }
  judge_loss (now_ns);
  const bool waits = last_sent_ns_ < valid_sent_ns_;
  if (!decreased_ && !was_decreased && !waits && !drains_)
    increase (arrivals_.delivered_bits_per_s (), elapsed);
}

CongestionControl::Receiver &
CongestionControl::find_receiver (std::uint32_t id, std::uint64_t now_ns)
{
  Receiver *oldest = receivers_.data ();
  for (Receiver &receiver : receivers_) {
    if (receiver.time_ns > 0 && receiver.id == id)
      return receiver;
    if (receiver.time_ns < oldest->time_ns)
      oldest = &receiver;
  }
  *oldest = Receiver ();
  oldest->id = id;
  oldest->time_ns = oldest->since_ns = now_ns;
  return *oldest;
}

void
CongestionControl::receiver_report (
    const ReceiverReport &report, double sent_bits_per_s, std::uint64_t now_ns)
{
  if (source_ == Source::kPackets && now_ns - report_ns_ < kSilencePacketsNs)
    return;
  Receiver &receiver = find_receiver (report.receiver, now_ns);
  const double packets = report.packets > 0 ? report.packets : kMinPackets;
  receiver.time_ns = std::max<std::uint64_t> (now_ns, 1);
  receiver.has_news = true;
  receiver.packets += packets;
  receiver.lost += packets * std::clamp (report.lost, 0.0, 1.0);
  if (report.round_trip_s > 0)
    receiver.queue_s = report.round_trip_s - receiver.round_trip.add (now_ns, report.round_trip_s);
  receiver.jitters = report.jitter_s - receiver.jitter.add (now_ns, report.jitter_s) > kJitter;
  if (source_ != Source::kReports)
    judged_ns_ = 0;
  note_report (Source::kReports, now_ns);
  if (judged_ns_ == 0 || now_ns - judged_ns_ >= kReportIntervalNs)
    judge_receivers (sent_bits_per_s, now_ns);
}

/* Loss of a receiver that has not reported since is still the worst, but no reason to send less
 * once more. What it counted before a decrease took effect tells nothing of whether that helped:
 * taken for the answer, it would make loss by congestion the usual one. */
CongestionControl::Worst
CongestionControl::find_worst (std::uint64_t now_ns)
{
  Worst worst;
  for (Receiver &receiver : receivers_) {
    if (receiver.time_ns == 0 || now_ns - receiver.time_ns > kFreshNs)
      continue;
    const bool is_old = decrease_ns_ > 0 && receiver.since_ns < decrease_ns_ + kReactionNs;
    if (is_old && receiver.has_news) { /* the next report is of what comes from now on */
      receiver.packets = receiver.lost = 0;
      receiver.since_ns = now_ns;
    }
    const bool is_judged =
        !is_old && is_enough (receiver.packets, receiver.lost, now_ns - receiver.since_ns);
    if (is_judged) {
      receiver.share = receiver.lost / receiver.packets;
      receiver.of = receiver.packets;
      receiver.packets = receiver.lost = 0;
      receiver.since_ns = now_ns;
    }
    if (receiver.share > worst.lost || (is_judged && receiver.share == worst.lost))
      worst = {receiver.share, receiver.of, worst.queue_s, is_judged, worst.jitters, worst.queues};
    if (receiver.has_news)
      worst.queue_s = std::max (worst.queue_s, receiver.queue_s);
    worst.jitters = worst.jitters || receiver.jitters;
    worst.queues = worst.queues || receiver.queue_s > kRoundTripQueue;
    receiver.has_news = false;
  }
  return worst;
}

void
CongestionControl::judge_receivers (double sent_bits_per_s, std::uint64_t now_ns)
{
  const double elapsed =
      judged_ns_ == 0 ? 0 : std::min (seconds (now_ns - judged_ns_), kLongestElapsed);
  const Worst worst = find_worst (now_ns);
  queue_s_ = worst.queue_s;
  judged_ns_ = now_ns;
  const bool loses = worst.is_new && loss_.judge (worst.lost, worst.packets, elapsed);
  const bool is_bad = worst.lost - loss_.usual () > kReportedLoss;
  /* A report that comes at once after a decrease is still of the time before. */
  const bool waits = decrease_ns_ > 0 && now_ns - decrease_ns_ < 2 * kReactionNs;
  if (waits || sent_bits_per_s <= 0)
    return;
  if (loses || queue_s_ > kRoundTripQueue)
    decrease (sent_bits_per_s * (1 - worst.lost), now_ns);
  else if (!worst.jitters && !worst.queues && !is_bad)
    increase (sent_bits_per_s, elapsed);
}

void
CongestionControl::tick (double sent_bits_per_s, std::uint64_t now_ns)
{
  const std::uint64_t patience =
      source_ == Source::kPackets ? kSilencePacketsNs : kSilenceReportsNs;
  if (source_ == Source::kNone || now_ns - silent_since_ns_ < patience || sent_bits_per_s <= 0 ||
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
