/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "trigger_matcher.hpp"

#include <cstdlib>

namespace rangecast {

/* GigE Vision numbers blocks with 16 bits and leaves 0 out; its extended mode and USB3 Vision have
 * 64. A number beyond 16 bits says which it is; below, 64-bit numbers do not wrap either. */
std::int64_t
frame_id_step (std::uint64_t from, std::uint64_t to)
{
  constexpr std::int64_t kMax = 65535;
  const auto step = static_cast<std::int64_t> (to - from);
  if (from > kMax || to > kMax || std::llabs (step) <= kMax / 2)
    return step;
  return step < 0 ? step + kMax : step - kMax;
}

void
ShotFinder::start (std::int64_t period_ns)
{
  *this = {};
  period_ns_ = period_ns;
}

void
ShotFinder::fired (std::int64_t shot, std::int64_t time_ns, bool alone)
{
  shots_[count_++ % kShots] = {shot, time_ns};
  alone_ = alone;
}

const ShotFinder::Shot *
ShotFinder::shot_at (std::int64_t number) const
{
  for (std::int64_t i = count_ - 1; i >= 0 && i >= count_ - kShots; i--)
    if (shots_[i % kShots].number == number)
      return &shots_[i % kShots];
  return nullptr;
}

/* The shot whose frame is due nearest to that time. */
ShotFinder::Found
ShotFinder::nearest (std::int64_t time_ns) const
{
  Found found;
  for (std::int64_t i = count_ - 1; i >= 0 && i >= count_ - kShots; i--) {
    const Shot &shot = shots_[i % kShots];
    const std::int64_t residual = time_ns - (shot.time_ns + delay_ns_);
    if (found.known && std::llabs (residual) >= std::llabs (found.residual_ns))
      break; /* older ones are farther away still */
    found = {true, shot.number, residual};
  }
  found.known = found.known && std::llabs (found.residual_ns) <= period_ns_;
  return found;
}

bool
ShotFinder::by_id (std::uint64_t frame_id, std::int64_t &shot) const
{
  if (frame_id == 0 || last_id_ == 0)
    return false;
  shot = last_shot_ + frame_id_step (last_id_, frame_id);
  return shot_at (shot) != nullptr;
}

void
ShotFinder::accept (std::uint64_t frame_id, const Found &found)
{
  last_id_ = frame_id;
  last_shot_ = found.shot;
  strangers_ = 0;
  if (std::llabs (found.residual_ns) < period_ns_ / 4)
    delay_ns_ += found.residual_ns / 16; /* follows the drift of the camera's clock */
}

ShotFinder::Found
ShotFinder::stranger ()
{
  strangers_++;
  return {};
}

/* Only one shot is under way: it is that one. The first picture of a stream often comes late, so
 * the least delay counts, and two must agree. */
ShotFinder::Found
ShotFinder::learn (std::uint64_t frame_id, std::int64_t time_ns)
{
  if (count_ == 0 || !alone_)
    return stranger ();
  const Shot &shot = shots_[(count_ - 1) % kShots];
  if (learnt_shot_ == shot.number)
    return {}; /* a second answer to one shot */
  learnt_shot_ = shot.number;
  const std::int64_t delay = time_ns - shot.time_ns;
  settled_ = learnt_ && std::llabs (delay - delay_ns_) < period_ns_ / 4;
  delay_ns_ = delay;
  learnt_ = true;
  const Found found{true, shot.number, 0};
  accept (frame_id, found);
  return found;
}

ShotFinder::Found
ShotFinder::find (std::uint64_t frame_id, std::int64_t camera_ns, std::int64_t arrival_ns)
{
  if (count_ > 0 && !learnt_)
    stamped_ = camera_ns > 0;
  if (stamped_ && camera_ns <= 0)
    return stranger (); /* its head was lost */
  const std::int64_t time_ns = stamped_ ? camera_ns : arrival_ns;
  if (!settled_)
    return learn (frame_id, time_ns);
  Found by_time = nearest (time_ns);
  std::int64_t numbered = 0;
  if (by_id (frame_id, numbered) && (!by_time.known || numbered != by_time.shot)) {
    const Found by_number{true, numbered, time_ns - (shot_at (numbered)->time_ns + delay_ns_)};
    const std::int64_t differs = by_time.shot - numbered;
    contradictions_ = by_time.known && differs == contradiction_ ? contradictions_ + 1 : 1;
    contradiction_ = differs;
    const bool near = by_time.known && std::llabs (by_time.residual_ns) < period_ns_ / 4;
    const bool time_wins = near && (stamped_ || contradictions_ >= kMaxContradictions);
    if (!time_wins && std::llabs (by_number.residual_ns) < 2 * period_ns_)
      by_time = by_number;
  } else {
    contradictions_ = 0;
  }
  if (!by_time.known)
    return stranger ();
  accept (frame_id, by_time);
  return by_time;
}

} // namespace rangecast
