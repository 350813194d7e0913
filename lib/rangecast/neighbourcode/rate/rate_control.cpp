/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "rate_control.hpp"

#include <algorithm>
#include <cmath>

namespace rangecast {
namespace {

/* Seconds. The account is paid back over the first. What refreshes cost more is paid in two steps
 * of the second each: of large ones, one a second, every frame set then bears the same within 6 %.
 */
constexpr double kPayBack = 1.0, kSpread = 1.0;

/* The share of the target that refreshes take of other frame sets at most, and the seconds' worth
 * of bytes that each of the two steps holds at most: what refreshes of that share come to. */
constexpr double kMaxForRefreshes = 0.9, kMaxSpread = 1.6;

constexpr double kMemoryOfModel = 0.3, kMemoryOfInterval = 0.5;

/* A frame set that comes later, or so many intervals later, than the one before is a new beginning:
 * nothing was saved while nothing was there. */
constexpr double kLongestPause = 2, kMaxIntervals = 4;

/* A target that differs by more is another one; by less it is the old one that follows a network.
 */
constexpr double kOtherTarget = 0.125;

/* What a share of the target a frame set is planned for at least and at most. */
constexpr double kMinShare = 0.7, kGreatestShare = 1.3;

/* Seconds' worth of bytes that the account holds at most. Little where nothing can be done about
 * it: at the limits, and while nobody is there. */
constexpr double kMaxDebt = 0.5, kMaxCredit = 0.25, kLittle = 0.05;

/* Logarithms of a threshold a second. More where the model says that bytes are far from the plan.
 */
constexpr double kSlowest = 1.5, kFaster = 8, kFarOff = 0.2;

/* A whole threshold stays until the wanted one is half a code from it and so much more, codes for
 * each code. Where thresholds are small, bytes differ much from one to the next, and nobody sees
 * them change: there it is better to go to and fro between the two that the target lies between. */
constexpr double kHysteresis = 0.02, kMaxHysteresis = 0.25;

/* b of the model: what recordings came to, and limits. */
constexpr double kFirstSlope = 0.6, kMinSlope = 0.15, kGreatestSlope = 1.6;

/* Logarithm of bits by which a frame set is none that the model may follow at once. */
constexpr double kOutlier = 0.3;

double
log_ratio (int worst, int best)
{
  return std::log ((worst + 0.5) / (best + 0.5));
}

/* How much of the new to take for a memory of some seconds. */
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
  const double share = most_x_ > 0 ? x / most_x_ : 0;
  return (best + 0.5) * std::exp (share * log_ratio (worst, best)) - 0.5;
}

/* Of thresholds that are whole numbers, the x that gives their mean place between best and worst.
 */
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
  return n > 0 ? most_x_ * sum / n : 0;
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
  most_x_ = std::max (depth_span_, colour_span_);
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

void
RateControl::take_time (std::uint64_t time_ns)
{
  const double elapsed =
      has_time_ ? 1e-9 * static_cast<double> (static_cast<std::int64_t> (time_ns - time_ns_)) : -1;
  const bool goes_on =
      elapsed > 0 && elapsed < std::max (kLongestPause, kMaxIntervals * interval_s_);
  elapsed_s_ = goes_on ? elapsed : interval_s_;
  if (goes_on)
    interval_s_ += gain (elapsed, kMemoryOfInterval) * (elapsed - interval_s_);
  has_time_ = true;
  time_ns_ = time_ns;
}

/* What the next frame set bears of the refreshes before it, bytes. */
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
  const double excess = account_ + usual; /* if this one is as it should be */
  const double share = 1 - excess / usual * std::min (interval_s_ / kPayBack, 0.5);
  return usual * std::clamp (share, kMinShare, kGreatestShare);
}

Thresholds
RateControl::next (std::uint64_t time_ns, std::uint64_t pixels)
{
  take_time (time_ns);
  const double planned = plan_bytes ();
  const double points = fill_ * static_cast<double> (pixels);
  if (points >= 1) {
    const double bits_at_best = std::log (points) + a_;
    const double wanted = (bits_at_best - std::log (8 * planned)) / b_;
    const double far_off = std::abs (wanted - x_) * b_ - kFarOff;
    const double speed = kSlowest + kFaster * std::max (0.0, far_off);
    const double most = frames_ > 0 ? speed * elapsed_s_ : most_x_;
    x_ = std::clamp (x_ + std::clamp (wanted - x_, -most, most), 0.0, most_x_);
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
    const double slope = std::clamp ((learnt_bits_ - bits) / dx, kMinSlope, kGreatestSlope);
    const double before = b_;
    b_ += dx * dx / (dx * dx + 0.05) * (slope - b_);
    a_ += (b_ - before) * learnt_x_; /* where it was, the model stays right */
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

void
RateControl::limit_account ()
{
  const double second = bytes_per_s ();
  const double debt = x_ >= most_x_ ? kLittle : kMaxDebt;
  const double credit = x_ <= 0 ? kLittle : kMaxCredit;
  account_ = std::clamp (account_, -credit * second, debt * second);
}

double
RateControl::least_bits () const
{
  return frames_ > 0 ? points_ * std::exp (a_ - b_ * most_x_) : 0;
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
  entering_ = std::min (entering_ + more, kMaxSpread * bytes_per_s ());
  account_ += bytes - more;
  limit_account ();
  if (frame.points == 0 || frame.bytes == 0) {
    account_ = std::max (account_, -kLittle * bytes_per_s ());
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
