/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "rate_control.hpp"

#include <algorithm>
#include <cmath>

namespace rangecast {
namespace {

/* Seconds. The account is paid back over kPayBack. The extra bytes of refreshes pass two stages of
 * kSpread each; with one large refresh a second all frame sets then pay the same within 6 %. */
constexpr double kPayBack = 1.0, kSpread = 1.0;

/* Greatest share of the target that refreshes take from other frame sets, and the greatest content
 * of each of the two stages, in seconds of the target: what refreshes of that share amount to. */
constexpr double kMaxForRefreshes = 0.9, kMaxSpread = 1.6;

constexpr double kMemoryOfModel = 0.3, kMemoryOfInterval = 0.5;

/* A longer pause, in seconds or intervals, is a discontinuity: nothing is saved during it. */
constexpr double kMaxPause = 2, kMaxIntervals = 4;

/* A target that differs by a greater share begins a new account; a smaller change is congestion
 * control following the network. */
constexpr double kOtherTarget = 0.125;

/* Limits of the planned size of a frame set, as a share of the target. */
constexpr double kMinShare = 0.7, kMaxShare = 1.3;

/* Limits of the account, in seconds of the target: kLittle where thresholds cannot change it, at
 * their limits and while the scene is empty. */
constexpr double kMaxDebt = 0.5, kMaxCredit = 0.25, kLittle = 0.05;

/* Speed of thresholds, logarithms a second: kSlowest, and more when the predicted size is farther
 * than kFarOff from the plan. */
constexpr double kSlowest = 1.5, kFaster = 8, kFarOff = 0.2;

/* A threshold changes when the wanted one differs by half a code plus this, codes per code. Small
 * thresholds have little hysteresis: their sizes differ much from one to the next and changes are
 * not visible, so alternating between two neighbours meets the target better. */
constexpr double kHysteresis = 0.02, kMaxHysteresis = 0.25;

/* b of the model: the value for recordings, and limits. */
constexpr double kFirstSlope = 0.6, kMinSlope = 0.15, kMaxSlope = 1.6;

/* Error of the model, logarithm of bits, from which a single frame set is an outlier. */
constexpr double kOutlier = 0.3;

double
log_ratio (int worst, int best)
{
  return std::log ((worst + 0.5) / (best + 0.5));
}

/* Weight of a new value in an exponential average with that time constant. */
double
gain (double elapsed_s, double memory_s)
{
  return 1 - std::exp (-elapsed_s / memory_s);
}

int
with_hysteresis (int present, double wanted)
{
  const double stays = 0.5 + std::min (kHysteresis * present, kMaxHysteresis);
  return std::abs (wanted - present) > stays ? static_cast<int> (std::lround (wanted)) : present;
}

} // namespace

double
RateControl::threshold_at (int best, int worst, double x) const
{
  const double share = max_x_ > 0 ? x / max_x_ : 0;
  return (best + 0.5) * std::exp (share * log_ratio (worst, best)) - 0.5;
}

/* The x of whole-number thresholds: their mean position between best and worst. */
double
RateControl::coarseness_of (const Thresholds &t) const
{
  double sum = 0;
  int n = 0;
  const auto add = [&] (double span, int now, int best) {
    if (span <= 0)
      return;
    sum += log_ratio (now, best) / span;
    n++;
  };
  add (depth_span_, t.depth, settings_.best.depth);
  add (colour_span_, t.colour, settings_.best.colour);
  return n > 0 ? max_x_ * sum / n : 0;
}

void
RateControl::configure (const RateSettings &wanted)
{
  RateSettings settings = wanted;
  settings.worst.depth = std::max (settings.worst.depth, settings.best.depth);
  settings.worst.colour = std::max (settings.worst.colour, settings.best.colour);
  if (configured_ && settings == settings_)
    return;
  const bool first = !configured_;
  if (first ||
      std::abs (settings.bits_per_s - settings_.bits_per_s) > kOtherTarget * settings_.bits_per_s)
    account_ = entering_ = spread_ = 0;
  const Thresholds before = thresholds_;
  const bool same_limits = settings.best == settings_.best && settings.worst == settings_.worst;
  settings_ = settings;
  configured_ = true;
  if (!first && same_limits)
    return;
  depth_span_ = log_ratio (settings.worst.depth, settings.best.depth);
  colour_span_ = log_ratio (settings.worst.colour, settings.best.colour);
  max_x_ = std::max (depth_span_, colour_span_);
  thresholds_ = {std::clamp (before.depth, settings.best.depth, settings.worst.depth),
      std::clamp (before.colour, settings.best.colour, settings.worst.colour)};
  if (first) {
    a_ = std::log (settings.bits_per_point);
    b_ = kFirstSlope;
    fill_ = 0.6;
    interval_s_ = settings.interval_s > 0 ? settings.interval_s : RateSettings ().interval_s;
    return;
  }
  /* The same thresholds have another x now: a means the bits at x = 0. */
  const double x = coarseness_of (thresholds_);
  a_ = learnt_bits_ + b_ * x;
  learnt_x_ = x;
  x_ = x;
}

/* Bytes of earlier refreshes that the next frame set pays back. */
double
RateControl::pay_for_refreshes ()
{
  const double share = gain (elapsed_s_, kSpread);
  const double moved = entering_ * share;
  entering_ -= moved;
  spread_ = std::min (spread_ + moved, kMaxSpread * bytes_per_s ());
  const double paid = std::min (spread_ * share, kMaxForRefreshes * bytes_per_s () * elapsed_s_);
  spread_ -= paid;
  return paid;
}

/* Bytes that the next frame set should have. */
double
RateControl::plan_bytes ()
{
  const double fair = bytes_per_s () * elapsed_s_ - pay_for_refreshes ();
  account_ -= fair;
  const double usual = fair * interval_s_ / elapsed_s_;
  const double excess = account_ + usual; /* if this one has its usual size */
  const double share = 1 - excess / usual * std::min (interval_s_ / kPayBack, 0.5);
  return usual * std::clamp (share, kMinShare, kMaxShare);
}

Thresholds
RateControl::next (std::uint64_t time_ns, std::uint64_t pixels)
{
  const double elapsed =
      has_time_ ? 1e-9 * static_cast<double> (static_cast<std::int64_t> (time_ns - time_ns_)) : -1;
  const bool continues = elapsed > 0 && elapsed < std::max (kMaxPause, kMaxIntervals * interval_s_);
  elapsed_s_ = continues ? elapsed : interval_s_;
  if (continues)
    interval_s_ += gain (elapsed, kMemoryOfInterval) * (elapsed - interval_s_);
  has_time_ = true;
  time_ns_ = time_ns;
  const double planned = plan_bytes ();
  const double points = fill_ * static_cast<double> (pixels);
  if (points >= 1) {
    const double bits_at_best = std::log (points) + a_;
    const double wanted = (bits_at_best - std::log (8 * planned)) / b_;
    const double far_off = std::abs (wanted - x_) * b_ - kFarOff;
    const double speed = kSlowest + kFaster * std::max (0.0, far_off);
    const double max_step = frames_ > 0 ? speed * elapsed_s_ : max_x_;
    x_ = std::clamp (x_ + std::clamp (wanted - x_, -max_step, max_step), 0.0, max_x_);
  }
  const RateSettings &s = settings_;
  thresholds_ = {
      with_hysteresis (thresholds_.depth, threshold_at (s.best.depth, s.worst.depth, x_)),
      with_hysteresis (thresholds_.colour, threshold_at (s.best.colour, s.worst.colour, x_))};
  return thresholds_;
}

/* @param bits  logarithm of bits a point */
void
RateControl::learn (double bits)
{
  const double x = coarseness_of (thresholds_), dx = x - learnt_x_;
  if (frames_ > 0 && std::abs (dx) > 0.01) {
    const double slope = std::clamp ((learnt_bits_ - bits) / dx, kMinSlope, kMaxSlope);
    const double before = b_;
    b_ += dx * dx / (dx * dx + 0.05) * (slope - b_);
    a_ += (b_ - before) * learnt_x_; /* keeps the prediction at the old x */
  }
  const double error = bits + b_ * x - a_;
  const bool outlier = frames_ > 0 && std::abs (error) > kOutlier;
  outliers_ = outlier ? outliers_ + 1 : 0;
  const double share = frames_ == 0 || outliers_ > 1 ? 1 : gain (elapsed_s_, kMemoryOfModel);
  a_ += std::min (share, frames_ < 3 ? 1 : 0.6) * error;
  frames_ = std::min (frames_ + 1, 1000);
  learnt_x_ = x;
  learnt_bits_ = bits;
}

double
RateControl::min_bits () const
{
  return frames_ > 0 ? points_ * std::exp (a_ - b_ * max_x_) : 0;
}

void
RateControl::coded (const CodedFrame &frame)
{
  const auto bytes = static_cast<double> (frame.bytes);
  const auto points = static_cast<double> (frame.points);
  const bool refresh = frame.refresh && frames_ > 0;
  points_ = points;
  const double usual = points * std::exp (a_ - b_ * coarseness_of (thresholds_)) / 8;
  const double more = refresh ? std::max (0.0, bytes - usual) : 0;
  const double second = bytes_per_s ();
  entering_ = std::min (entering_ + more, kMaxSpread * second);
  const double debt = x_ >= max_x_ ? kLittle : kMaxDebt;
  const double credit = x_ <= 0 ? kLittle : kMaxCredit;
  account_ = std::clamp (account_ + (bytes - more), -credit * second, debt * second);
  if (frame.points == 0 || frame.bytes == 0) {
    account_ = std::max (account_, -kLittle * second);
    return;
  }
  if (refresh)
    return;
  if (frame.pixels > 0) {
    const double fill = points / static_cast<double> (frame.pixels);
    fill_ += (frames_ == 0 ? 1 : gain (elapsed_s_, kMemoryOfModel)) * (fill - fill_);
  }
  learn (std::log (8 * bytes / points));
}

void
RateMeter::add (std::uint64_t time_ns, std::uint64_t bytes)
{
  if (count_ > 0 && time_ns <= at (count_ - 1).time_ns)
    reset ();
  const auto drop = [&] {
    sum_ -= at (0).bytes;
    first_ = (first_ + 1) % entries_.size ();
    count_--;
    is_full_ = true;
  };
  while (count_ > 1 && (count_ == entries_.size () || time_ns - at (1).time_ns >= kWindowNs))
    drop ();
  entries_[(first_ + count_) % entries_.size ()] = {time_ns, bytes};
  count_++;
  sum_ += bytes;
}

double
RateMeter::bits_per_s (std::uint64_t interval_ns) const
{
  const auto rate = [] (std::uint64_t bytes, double ns) { return 8e9 * double (bytes) / ns; };
  if (count_ == 1 && interval_ns > 0)
    return rate (sum_, double (interval_ns));
  if (count_ < 2)
    return 0;
  const double ns = double (at (count_ - 1).time_ns - at (0).time_ns);
  if (is_full_) /* the oldest one is where the two seconds begin */
    return rate (sum_ - at (0).bytes, ns);
  return rate (sum_, ns * double (count_) / double (count_ - 1));
}

} // namespace rangecast
