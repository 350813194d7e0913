/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "pairing.hpp"

#include <algorithm>
#include <cstdlib>
#include <span>
#include <utility>

using rangecast::FrameSets;

/* A camera that did not answer a shot within this time does not any more. */
static constexpr std::int64_t kAnswerTime = 1'000'000'000;
static constexpr std::int64_t kMinAnswerTime = 60'000'000;

/* How wrong the reading of a camera's clock may be. */
static constexpr std::int64_t kClockError = 50'000'000;

CamSourcePairing::CamSourcePairing ()
{
  for (Held &held : held_)
    held.next_free = std::exchange (free_, &held);
}

CamSourcePairing::~CamSourcePairing ()
{
  drop_waiting ();
}

void
CamSourcePairing::start (
    int cameras, Fired fired, GstClockTime period, GstClockTime exposure, int waiting)
{
  drop_waiting ();
  std::lock_guard guard (lock_);
  cameras_ = cameras;
  waiting_ = waiting;
  triggered_ = fired == Fired::kHere;
  one_signal_ = fired == Fired::kElsewhere;
  period_ = period > 0 ? period : GST_SECOND;
  exposure_ = exposure;
}

bool
CamSourcePairing::clocks_are_off ()
{
  std::lock_guard guard (lock_);
  return std::exchange (clocks_are_off_, false);
}

void
CamSourcePairing::forget ()
{
  drop_waiting ();
  std::lock_guard guard (lock_);
  tolerance_ = static_cast<std::int64_t> (period_) / 2;
  sets_.start (cameras_, triggered_ ? 0 : tolerance_, waiting_);
  intervals_.forget ();
  counted_intervals_ = 0;
  clocks_are_off_ = false;
  for (int c = 0; c < kMaxCameras; c++) {
    finders_[c].start (static_cast<std::int64_t> (period_));
    partners_[c].start (static_cast<std::int64_t> (period_));
    clocks_[c].forget ();
    offsets_[c].reset ();
    answered_[c] = last_arrival_ns_[c] = last_taken_ns_[c] = 0;
    has_number_[c] = false;
  }
  ticks_ = {};
  shots_ = 0;
  lone_shots_ = 0;
  spacing_ = 0;
  owing_ = false;
}

/* ---- frames that are kept ---- */

CamSourcePairing::Held *
CamSourcePairing::hold (CameraFrame frame, std::int64_t taken_ns, std::int64_t exposed_ns)
{
  if (!free_) /* FrameSets keeps fewer than there are */
    return nullptr;
  Held *held = std::exchange (free_, free_->next_free);
  held->frame = std::move (frame);
  held->taken_ns = taken_ns;
  held->exposed_ns = exposed_ns;
  return held;
}

void
CamSourcePairing::let_go (Held *held)
{
  held->frame.buffer.reset ();
  held->next_free = std::exchange (free_, held);
}

void
CamSourcePairing::drop (FrameSets::Set &set)
{
  for (int c = 0; c < cameras_; c++)
    if (set.frames[c]) {
      counts_.dropped[c]++;
      let_go (static_cast<Held *> (set.frames[c]));
    }
}

void
CamSourcePairing::drop_waiting ()
{
  std::lock_guard guard (lock_);
  FrameSets::Set set;
  while (sets_.take_rest (set) == FrameSets::Step::kDrop)
    for (FrameSets::Frame frame : set.frames)
      if (frame)
        let_go (static_cast<Held *> (frame));
}

/* ---- shots ---- */

/* How long a shot that teaches waits for its answers: where pictures get lost, the next one should
 * come soon; a camera that is slow to begin gets longer each time. */
std::int64_t
CamSourcePairing::answer_time () const
{
  std::int64_t time =
      std::max<std::int64_t> (3 * static_cast<std::int64_t> (period_), kMinAnswerTime);
  for (int i = 1; i < lone_shots_ && time < kAnswerTime; i++)
    time *= 2;
  return std::min (time, kAnswerTime) + 2 * static_cast<std::int64_t> (exposure_);
}

bool
CamSourcePairing::may_fire (bool alone, std::int64_t now_ns)
{
  std::lock_guard guard (lock_);
  const auto finders = std::span (finders_).first (static_cast<std::size_t> (cameras_));
  for (auto &finder : finders)
    if (finder.lost_step ()) {
      finder.start (static_cast<std::int64_t> (period_));
      lone_shots_ = 0;
    }
  if (!alone && std::ranges::all_of (finders, [] (const auto &f) { return f.settled (); }))
    return true;
  if (lone_shots_ > kMaxLoneShots) {
    for (auto &finder : finders)
      finder.settle ();
    lone_shots_ = 0;
  }
  const Tick &last = ticks_[(shots_ + kTicks - 1) % kTicks];
  /* An answer that is late would be taken for that of a later shot, by the time between the two.
   * Where each of these times is more than all before it, two such mistakes do not agree. */
  if (owing_ && now_ns - last.fired_ns <
                    std::min (2 * spacing_ + static_cast<std::int64_t> (period_), kAnswerTime))
    return false;
  const std::int64_t patience =
      alone ? kAnswerTime + 2 * static_cast<std::int64_t> (exposure_) : answer_time ();
  if (shots_ == 0 || now_ns - last.fired_ns > patience)
    return true;
  for (int c = 0; c < cameras_; c++)
    if (answered_[c] < shots_)
      return false;
  return true;
}

void
CamSourcePairing::fired (GstClockTime tick, std::int64_t fired_ns)
{
  std::lock_guard guard (lock_);
  const Tick &last = ticks_[(shots_ + kTicks - 1) % kTicks];
  bool answered = true;
  for (int c = 0; c < cameras_; c++)
    answered &= answered_[c] >= shots_;
  const bool alone = answered || fired_ns - last.fired_ns > answer_time ();
  bool settled = true;
  for (int c = 0; c < cameras_; c++) {
    finders_[c].fired (shots_, fired_ns, alone);
    settled &= finders_[c].settled ();
  }
  lone_shots_ = settled ? 0 : lone_shots_ + 1;
  owing_ = !settled && (owing_ || !answered);
  spacing_ = shots_ > 0 ? std::min (fired_ns - last.fired_ns, kAnswerTime) : 0;
  ticks_[shots_ % kTicks] = {shots_, tick, fired_ns};
  shots_++;
}

/* ---- frames ---- */

void
CamSourcePairing::set_clock_offset (int camera, std::int64_t offset_ns)
{
  std::lock_guard guard (lock_);
  offsets_[camera] = offset_ns;
}

/* A stamp that no clock reaches is none. */
static std::int64_t
stamp_of (const CameraFrame &frame)
{
  constexpr std::uint64_t kMax = std::uint64_t (1) << 62;
  return frame.camera_time_ns < kMax ? static_cast<std::int64_t> (frame.camera_time_ns) : 0;
}

/* By the cameras' clocks, if all were read and this one was not set since. */
std::optional<std::int64_t>
CamSourcePairing::exposed_at (int camera, const CameraFrame &frame)
{
  const std::int64_t stamp = stamp_of (frame), arrived = frame.arrived_us * 1000;
  const auto offsets = std::span (offsets_).first (static_cast<std::size_t> (cameras_));
  if (stamp == 0 || !std::ranges::all_of (offsets, [] (const auto &o) { return o.has_value (); }))
    return {};
  const std::int64_t time = stamp + *offsets_[camera];
  const auto most = kAnswerTime + 2 * static_cast<std::int64_t> (exposure_);
  if (time <= arrived + kClockError && time >= arrived - most)
    return time;
  clocks_are_off_ = true;
  return {};
}

void
CamSourcePairing::place_by_shot (int camera, CameraFrame frame)
{
  const auto found =
      finders_[camera].find (frame.number + 1, stamp_of (frame), frame.arrived_us * 1000);
  if (shots_ > 0)
    answered_[camera] = std::max (answered_[camera], found.known ? found.shot + 1 : 0);
  if (!found.known || owing_) {
    counts_.dropped[camera] += frame.buffer != nullptr;
    counts_.unknown += frame.buffer != nullptr;
    return;
  }
  const Tick &tick = ticks_[found.shot % kTicks];
  /* without stamps the residual is of the arrival, and says nothing about the exposure */
  const std::int64_t taken = tick.fired_ns + (stamp_of (frame) ? found.residual_ns : 0);
  if (frame.buffer)
    delay_.add (frame.arrived_us * 1000 - tick.fired_ns);
  put (camera, found.shot, std::move (frame), taken);
}

/* Pictures of a line may come faster than the caps say: what belongs together then lies closer. A
 * quarter of the intervals, for losses make them longer and jitter some shorter. */
void
CamSourcePairing::learn_interval (int camera, std::int64_t taken)
{
  const std::int64_t last = std::exchange (last_taken_ns_[camera], taken);
  if (last == 0 || taken <= last)
    return;
  const auto period = static_cast<std::int64_t> (period_);
  intervals_.add (taken - last);
  if (++counted_intervals_ % 16 == 0)
    tolerance_ = std::clamp (intervals_.quantile (0.25), period / 8, period) / 2;
  sets_.set_tolerance (tolerance_);
}

/* Comparable between cameras. */
std::optional<std::int64_t>
CamSourcePairing::time_of (int camera, const CameraFrame &frame)
{
  const std::int64_t arrived =
      clocks_[camera].host_time (stamp_of (frame), frame.arrived_us * 1000);
  const auto exposed = exposed_at (camera, frame);
  std::optional<std::int64_t> taken;
  if (frame.buffer || frame.camera_time_ns > 0) /* else it came too late to say when */
    taken = exposed ? *exposed : arrived - static_cast<std::int64_t> (exposure_);
  if (!one_signal_)
    return taken;
  if (camera > 0)
    return partners_[camera].place (frame.number, taken, exposed.has_value ());
  for (int c = 1; taken && c < cameras_; c++)
    partners_[c].leader (frame.number, *taken);
  return taken;
}

void
CamSourcePairing::place_by_time (int camera, CameraFrame frame)
{
  const auto taken = time_of (camera, frame);
  if (!taken)
    return;
  if (frame.buffer)
    delay_.add (frame.arrived_us * 1000 - *taken);
  if (stamp_of (frame) > 0) /* arrivals come in bursts */
    learn_interval (camera, *taken);
  put (camera, *taken, std::move (frame), *taken);
}

void
CamSourcePairing::put (int camera, std::int64_t key, CameraFrame frame, std::int64_t taken)
{
  Held *held = nullptr;
  if (frame.buffer) {
    const std::int64_t exposed = exposed_at (camera, frame).value_or (taken);
    held = hold (std::move (frame), taken, exposed);
    counts_.dropped[camera] += held == nullptr;
  }
  if (auto refused = static_cast<Held *> (sets_.put (camera, key, held))) {
    counts_.dropped[camera]++;
    let_go (refused);
  }
}

void
CamSourcePairing::take (int camera, CameraFrame frame)
{
  std::lock_guard guard (lock_);
  last_arrival_ns_[camera] = frame.arrived_us * 1000;
  counts_.missing_packets += frame.missing_packets;
  if (has_number_[camera] && frame.number > last_number_[camera] + 1)
    counts_.incomplete[camera] += frame.number - last_number_[camera] - 1;
  last_number_[camera] = frame.number;
  has_number_[camera] = true;
  counts_.incomplete[camera] += frame.buffer == nullptr;
  if (triggered_)
    place_by_shot (camera, std::move (frame));
  else
    place_by_time (camera, std::move (frame));
}

/* @return false: taken too far apart to be one set; it is dropped */
bool
CamSourcePairing::hand_out (FrameSets::Set &from, CamSourceSet &set)
{
  const auto held_by = [&] (int c) { return static_cast<Held *> (from.frames[c]); };
  std::int64_t spread = 0, apart = 0;
  for (int c = 1; c < cameras_; c++)
    for (int d = 0; d < c; d++) {
      spread = std::max (spread, std::abs (held_by (c)->exposed_ns - held_by (d)->exposed_ns));
      apart = std::max (apart, std::abs (held_by (c)->taken_ns - held_by (d)->taken_ns));
    }
  if (apart > tolerance_) {
    drop (from);
    counts_.apart++;
    return false;
  }
  spread_.add (spread);
  set.tick = triggered_ ? ticks_[from.keys[0] % kTicks].time : GST_CLOCK_TIME_NONE;
  set.taken_ns = held_by (0)->taken_ns;
  for (int c = 0; c < cameras_; c++) {
    const auto held = static_cast<Held *> (from.frames[c]);
    set.pictures[c] = std::move (held->frame.buffer);
    let_go (held);
  }
  counts_.sets++;
  return true;
}

bool
CamSourcePairing::next (CamSourceSet &set)
{
  std::lock_guard guard (lock_);
  FrameSets::Set from;
  for (;;)
    switch (sets_.next (from)) {
      case FrameSets::Step::kWait:
        return false;
      case FrameSets::Step::kDrop:
        drop (from);
        break;
      case FrameSets::Step::kSet:
        if (hand_out (from, set))
          return true;
    }
}

std::int64_t
CamSourcePairing::last_arrival (int camera)
{
  std::lock_guard guard (lock_);
  return last_arrival_ns_[camera];
}

CamSourcePairingStats
CamSourcePairing::stats ()
{
  std::lock_guard guard (lock_);
  CamSourcePairingStats stats = counts_;
  stats.has_spread = !spread_.empty ();
  stats.spread_p50_ns = spread_.quantile (0.5);
  stats.spread_p99_ns = spread_.quantile (0.99);
  stats.delay_p50_ns = delay_.quantile (0.5);
  stats.delay_p99_ns = delay_.quantile (0.99);
  return stats;
}
