/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "camsourcepairing.hpp"

#include <algorithm>
#include <climits>
#include <span>
#include <utility>

using rangecast::FrameSets;

/* A camera that did not answer a shot within this time does not any more. */
static constexpr std::int64_t kAnswerTime = 1'000'000'000;

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
    int cameras, bool triggered, GstClockTime period, GstClockTime exposure, int waiting)
{
  drop_waiting ();
  std::lock_guard guard (lock_);
  cameras_ = cameras;
  waiting_ = waiting;
  triggered_ = triggered;
  period_ = period > 0 ? period : GST_SECOND;
  exposure_ = exposure;
  counts_ = {};
  spread_.forget ();
  delay_.forget ();
}

void
CamSourcePairing::forget ()
{
  drop_waiting ();
  std::lock_guard guard (lock_);
  sets_.start (cameras_, triggered_ ? 0 : static_cast<std::int64_t> (period_) / 2, waiting_);
  for (int c = 0; c < kMaxCameras; c++) {
    finders_[c].start (static_cast<std::int64_t> (period_));
    clocks_[c].forget ();
    offsets_[c].reset ();
    answered_[c] = last_arrival_ns_[c] = 0;
    has_number_[c] = false;
  }
  ticks_ = {};
  shots_ = 0;
  lone_shots_ = 0;
}

/* ---- frames that are kept ---- */

CamSourcePairing::Held *
CamSourcePairing::hold (CameraFrame frame, std::int64_t taken_ns)
{
  if (!free_) /* FrameSets keeps fewer than there are */
    return nullptr;
  Held *held = std::exchange (free_, free_->next_free);
  held->frame = std::move (frame);
  held->taken_ns = taken_ns;
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

bool
CamSourcePairing::may_fire (std::int64_t now_ns)
{
  std::lock_guard guard (lock_);
  const auto finders = std::span (finders_).first (static_cast<std::size_t> (cameras_));
  for (auto &finder : finders)
    if (finder.lost_step ()) {
      finder.start (static_cast<std::int64_t> (period_));
      lone_shots_ = 0;
    }
  if (std::ranges::all_of (finders, [] (const auto &f) { return f.settled (); }))
    return true;
  if (lone_shots_ > kMostLoneShots) {
    for (auto &finder : finders)
      finder.settle ();
    lone_shots_ = 0;
  }
  const Tick &last = ticks_[(shots_ + kTicks - 1) % kTicks];
  if (shots_ == 0 ||
      now_ns - last.fired_ns > kAnswerTime + 2 * static_cast<std::int64_t> (exposure_))
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
  bool alone = true;
  const Tick &last = ticks_[(shots_ + kTicks - 1) % kTicks];
  for (int c = 0; c < cameras_; c++)
    alone &= answered_[c] >= shots_ || fired_ns - last.fired_ns > kAnswerTime;
  bool settled = true;
  for (int c = 0; c < cameras_; c++) {
    finders_[c].fired (shots_, fired_ns, alone);
    settled &= finders_[c].settled ();
  }
  lone_shots_ = settled ? 0 : lone_shots_ + 1;
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

/* With the cameras' clocks read, times of exposure; else of arrival, without what only held them
 * up. */
std::int64_t
CamSourcePairing::taken_at (int camera, const CameraFrame &frame)
{
  const auto stamp = static_cast<std::int64_t> (frame.camera_time_ns);
  const std::int64_t least = clocks_[camera].host_time (stamp, frame.arrived_us * 1000);
  bool read = stamp > 0;
  for (int c = 0; c < cameras_; c++)
    read &= offsets_[c].has_value ();
  return read ? stamp + *offsets_[camera] : least - static_cast<std::int64_t> (exposure_);
}

void
CamSourcePairing::place_by_shot (int camera, CameraFrame frame)
{
  const auto stamp = static_cast<std::int64_t> (frame.camera_time_ns);
  const auto found = finders_[camera].find (frame.number + 1, stamp, frame.arrived_us * 1000);
  if (shots_ > 0)
    answered_[camera] = std::max (answered_[camera], found.known ? found.shot + 1 : 0);
  if (!found.known) {
    counts_.dropped[camera] += frame.buffer != nullptr;
    counts_.unknown += frame.buffer != nullptr;
    return;
  }
  const Tick &tick = ticks_[found.shot % kTicks];
  const bool read = stamp > 0 && std::ranges::all_of (std::span (offsets_).first (cameras_),
                                     [] (const auto &o) { return o.has_value (); });
  const std::int64_t taken = read ? stamp + *offsets_[camera] : tick.fired_ns + found.residual_ns;
  if (frame.buffer)
    delay_.add (frame.arrived_us * 1000 - tick.fired_ns);
  const bool whole = frame.buffer != nullptr;
  sets_.put (camera, found.shot, whole ? hold (std::move (frame), taken) : nullptr);
}

void
CamSourcePairing::place_by_time (int camera, CameraFrame frame)
{
  const std::int64_t taken = taken_at (camera, frame);
  const bool whole = frame.buffer != nullptr;
  if (whole)
    delay_.add (frame.arrived_us * 1000 - taken);
  else if (frame.camera_time_ns == 0)
    return; /* came too late to say when it was taken */
  sets_.put (camera, taken, whole ? hold (std::move (frame), taken) : nullptr);
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
  std::int64_t least = INT64_MAX, most = INT64_MIN;
  for (int c = 0; c < cameras_; c++) {
    const auto held = static_cast<Held *> (from.frames[c]);
    least = std::min (least, held->taken_ns);
    most = std::max (most, held->taken_ns);
  }
  if (most - least > static_cast<std::int64_t> (period_) / 2) {
    drop (from);
    counts_.apart++;
    return false;
  }
  spread_.add (most - least);
  const Tick &tick = ticks_[from.keys[0] % kTicks];
  set.tick = triggered_ ? tick.time : GST_CLOCK_TIME_NONE;
  set.taken_ns = static_cast<Held *> (from.frames[0])->taken_ns;
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
