/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "pairing.hpp"

#include <algorithm>
#include <cstdlib>
#include <span>
#include <utility>

#include "camera/aravis/debug.hpp"

namespace {

/* A camera that has not answered a trigger after this time will not. */
constexpr std::int64_t kMaxAnswer_ns = 1'000'000'000;
constexpr std::int64_t kMinAnswer_ns = 60'000'000;

/* Error of reading a camera's clock. */
constexpr std::int64_t kClockError_ns = 50'000'000;

/* 0: no timestamp. A time that no clock reaches is none. */
std::int64_t
timestamp (const CameraFrame &frame)
{
  return frame.camera_time_ns < kMaxCameraTime_ns ? static_cast<std::int64_t> (frame.camera_time_ns)
                                                  : 0;
}

} // namespace

void
FramePairing::configure (
    int cameras, TriggeredBy by, GstClockTime period_ns, GstClockTime exposure_ns, int max_waiting)
{
  drop_waiting ();
  std::lock_guard guard (lock_);
  cameras_ = cameras;
  max_waiting_ = std::clamp (max_waiting, 1, kMaxWaiting);
  by_ = by;
  period_ns_ = static_cast<std::int64_t> (period_ns);
  exposure_ns_ = static_cast<std::int64_t> (exposure_ns);
}

void
FramePairing::reset ()
{
  drop_waiting ();
  std::lock_guard guard (lock_);
  tolerance_ns_ = period_ns_ / 2;
  intervals_.reset ();
  counted_intervals_ = 0;
  clocks_are_off_ = false;
  for (int c = 0; c < kMaxCameras; c++) {
    matchers_[c].start (period_ns_);
    lanes_[c].last_key.reset ();
    clocks_[c].reset ();
    offsets_ns_[c].reset ();
    answered_[c] = last_frame_ns_[c] = last_taken_ns_[c] = 0;
    last_number_[c].reset ();
  }
  triggers_ = {};
  n_triggers_ = 0;
  learning_triggers_ = 0;
  spacing_ns_ = 0;
  answers_owed_ = false;
}

void
FramePairing::drop_waiting ()
{
  std::lock_guard guard (lock_);
  for (int c = 0; c < kMaxCameras; c++)
    while (lanes_[c].count > 0)
      pop (c);
}

void
FramePairing::set_clock_offset (int camera, std::int64_t offset_ns)
{
  std::lock_guard guard (lock_);
  offsets_ns_[camera] = offset_ns;
}

bool
FramePairing::clocks_are_off ()
{
  std::lock_guard guard (lock_);
  return std::exchange (clocks_are_off_, false);
}

/* ---- triggers ---- */

bool
FramePairing::all_answered () const
{
  return std::all_of (answered_.begin (), answered_.begin () + cameras_,
      [this] (std::int64_t answered) { return answered >= n_triggers_; });
}

/* How long a trigger from which delays are learnt waits for its answers. Where images get lost the
 * next one should come soon; a camera that is slow to begin gets longer each time. */
std::int64_t
FramePairing::answer_timeout () const
{
  std::int64_t timeout = std::max (3 * period_ns_, kMinAnswer_ns);
  for (int i = 1; i < learning_triggers_ && timeout < kMaxAnswer_ns; i++)
    timeout *= 2;
  return std::min (timeout, kMaxAnswer_ns) + 2 * exposure_ns_;
}

bool
FramePairing::may_trigger (std::int64_t now_ns)
{
  std::lock_guard guard (lock_);
  const auto matchers = std::span (matchers_).first (static_cast<std::size_t> (cameras_));
  for (auto &matcher : matchers)
    if (matcher.lost_sync ()) {
      GST_DEBUG_OBJECT (element_, "a camera lost synchronisation; learning its delay again");
      matcher.start (period_ns_);
      learning_triggers_ = 0;
    }
  if (std::ranges::all_of (matchers, [] (const auto &m) { return m.settled (); }))
    return true;
  if (learning_triggers_ > kMaxLearningTriggers) {
    for (auto &matcher : matchers)
      matcher.settle ();
    learning_triggers_ = 0;
  }
  const std::int64_t since_ns =
      now_ns - triggers_[(n_triggers_ + kMaxTriggers - 1) % kMaxTriggers].sent_ns;
  /* A late answer would be taken for that of a later trigger, by the time between the two. Where
   * each of these times is longer than all before it, two such mistakes do not agree. */
  if (answers_owed_ && since_ns < std::min (2 * spacing_ns_ + period_ns_, kMaxAnswer_ns))
    return false;
  return n_triggers_ == 0 || all_answered () || since_ns > answer_timeout ();
}

void
FramePairing::add_trigger (GstClockTime time, std::int64_t sent_ns)
{
  std::lock_guard guard (lock_);
  const std::int64_t since_ns =
      sent_ns - triggers_[(n_triggers_ + kMaxTriggers - 1) % kMaxTriggers].sent_ns;
  const bool answered = all_answered ();
  bool settled = true;
  for (int c = 0; c < cameras_; c++) {
    matchers_[c].fired (n_triggers_, sent_ns, answered || since_ns > answer_timeout ());
    settled &= matchers_[c].settled ();
  }
  learning_triggers_ = settled ? 0 : learning_triggers_ + 1;
  answers_owed_ = !settled && (answers_owed_ || !answered);
  spacing_ns_ = n_triggers_ > 0 ? std::min (since_ns, kMaxAnswer_ns) : 0;
  triggers_[n_triggers_ % kMaxTriggers] = {time, sent_ns};
  n_triggers_++;
}

/* ---- frames ---- */

void
FramePairing::add_frame (int camera, CameraFrame frame)
{
  std::lock_guard guard (lock_);
  last_frame_ns_[camera] = frame.arrived_us * 1000;
  counters_.missing_packets += frame.missing_packets;
  if (last_number_[camera] && frame.number > *last_number_[camera] + 1) {
    const std::uint64_t lost = frame.number - *last_number_[camera] - 1;
    counters_.incomplete[camera] += lost;
    GST_DEBUG_OBJECT (element_,
        "camera %d: %" G_GUINT64_FORMAT " images lost before number %" G_GUINT64_FORMAT, camera,
        guint64 (lost), guint64 (frame.number));
  }
  last_number_[camera] = frame.number;
  if (!frame.buffer) {
    counters_.incomplete[camera]++;
    GST_DEBUG_OBJECT (element_,
        "camera %d: image %" G_GUINT64_FORMAT
        " dropped: packets are missing, or another size or pixel format came",
        camera, guint64 (frame.number));
  }
  if (by_ == TriggeredBy::kElement)
    add_triggered_frame (camera, std::move (frame));
  else
    add_timed_frame (camera, std::move (frame));
}

void
FramePairing::add_triggered_frame (int camera, CameraFrame frame)
{
  const auto found =
      matchers_[camera].find (frame.number + 1, timestamp (frame), frame.arrived_us * 1000);
  if (n_triggers_ > 0)
    answered_[camera] = std::max (answered_[camera], found.known ? found.trigger + 1 : 0);
  if (!found.known || answers_owed_) {
    if (frame.buffer) {
      counters_.dropped[camera]++;
      counters_.unknown++;
      GST_DEBUG_OBJECT (element_, "camera %d: image %" G_GUINT64_FORMAT " dropped: %s", camera,
          guint64 (frame.number),
          found.known ? "delays are being learnt" : "it answers no known trigger");
    }
    return;
  }
  const std::int64_t sent_ns = triggers_[found.trigger % kMaxTriggers].sent_ns;
  if (frame.buffer)
    delay_.add (frame.arrived_us * 1000 - sent_ns);
  /* without a timestamp the residual is the arrival's, and does not tell the exposure */
  const std::int64_t residual_ns = timestamp (frame) ? found.residual_ns : 0;
  queue (camera, found.trigger, std::move (frame), sent_ns + residual_ns);
}

void
FramePairing::add_timed_frame (int camera, CameraFrame frame)
{
  const auto taken_ns = capture_time (camera, frame);
  if (!taken_ns)
    return;
  if (frame.buffer)
    delay_.add (frame.arrived_us * 1000 - *taken_ns);
  if (timestamp (frame) > 0) /* arrivals come in bursts */
    update_tolerance (camera, *taken_ns);
  queue (camera, *taken_ns, std::move (frame), *taken_ns);
}

/* When a frame was taken, comparable between cameras; absent: unknown. */
std::optional<std::int64_t>
FramePairing::capture_time (int camera, const CameraFrame &frame)
{
  const std::int64_t arrived_ns =
      clocks_[camera].host_time (timestamp (frame), frame.arrived_us * 1000);
  const auto exposed_ns = exposure_time (camera, frame);
  std::optional<std::int64_t> taken_ns;
  if (frame.buffer || frame.camera_time_ns > 0) /* otherwise it timed out long after its arrival */
    taken_ns = exposed_ns ? *exposed_ns : arrived_ns - exposure_ns_;
  return taken_ns;
}

/* The timestamp on the host's clock, if all cameras' clocks were read and this one was not set
 * since. */
std::optional<std::int64_t>
FramePairing::exposure_time (int camera, const CameraFrame &frame)
{
  const std::int64_t stamp_ns = timestamp (frame), arrived_ns = frame.arrived_us * 1000;
  const auto offsets = std::span (offsets_ns_).first (static_cast<std::size_t> (cameras_));
  if (stamp_ns == 0 ||
      !std::ranges::all_of (offsets, [] (const auto &offset) { return offset.has_value (); }))
    return {};
  const std::int64_t time_ns = stamp_ns + *offsets_ns_[camera];
  if (time_ns <= arrived_ns + kClockError_ns &&
      time_ns >= arrived_ns - kMaxAnswer_ns - 2 * exposure_ns_)
    return time_ns;
  clocks_are_off_ = true;
  return {};
}

/* Images on an external signal may come faster than the caps say: then partners lie closer. Takes
 * the first quartile of the intervals, since losses make some longer and jitter some shorter. */
void
FramePairing::update_tolerance (int camera, std::int64_t taken_ns)
{
  const std::int64_t last_ns = std::exchange (last_taken_ns_[camera], taken_ns);
  if (last_ns == 0 || taken_ns <= last_ns)
    return;
  intervals_.add (taken_ns - last_ns);
  if (++counted_intervals_ % 16 == 0)
    tolerance_ns_ = std::clamp (intervals_.quantile (0.25), period_ns_ / 8, period_ns_) / 2;
}

/* @param key  trigger number, or taken_ns */
void
FramePairing::queue (int camera, std::int64_t key, CameraFrame frame, std::int64_t taken_ns)
{
  Lane &lane = lanes_[camera];
  if (lane.count == lane.ring.size () || (lane.last_key && key <= *lane.last_key)) {
    counters_.dropped[camera] += frame.buffer != nullptr;
    GST_DEBUG_OBJECT (element_, "camera %d: image %" G_GUINT64_FORMAT " dropped: out of order",
        camera, guint64 (frame.number));
    return;
  }
  lane.last_key = key;
  const std::int64_t exposed_ns = exposure_time (camera, frame).value_or (taken_ns);
  lane.ring[(lane.first + lane.count++) % lane.ring.size ()] = {
      std::move (frame), key, taken_ns, exposed_ns};
}

void
FramePairing::pop (int camera)
{
  Lane &lane = lanes_[camera];
  lane.front ().frame.buffer.reset ();
  lane.first = (lane.first + 1) % lane.ring.size ();
  lane.count--;
}

/* ---- sets ---- */

bool
FramePairing::next_set (ImageSet &set)
{
  std::lock_guard guard (lock_);
  std::array<MatchStream *, kMaxCameras> heads{};
  for (int c = 0; c < cameras_; c++)
    heads[c] = &lanes_[c].head;
  const auto streams = std::span (heads).first (static_cast<std::size_t> (cameras_));
  const GstClockTime tolerance =
      by_ == TriggeredBy::kElement ? 0 : static_cast<GstClockTime> (tolerance_ns_);
  for (;;) {
    bool timeout = false; /* a camera's frames have waited long enough */
    for (int c = 0; c < cameras_; c++) {
      Lane &lane = lanes_[c];
      lane.head.required = true;
      lane.head.head = lane.count == 0              ? MatchStream::Head::kMissing
                       : lane.front ().frame.buffer ? MatchStream::Head::kFrame
                                                    : MatchStream::Head::kGap;
      if (lane.count > 0)
        lane.head.time = lane.head.end = static_cast<GstClockTime> (lane.front ().key);
      timeout |= lane.count > static_cast<std::size_t> (max_waiting_);
    }
    MatchStream *dropped = nullptr;
    switch (match_streams (streams, tolerance, timeout, dropped)) {
      case MatchStep::kDrop:
        drop (static_cast<int> (std::ranges::find (streams, dropped) - streams.begin ()),
            "no partner");
        break;
      case MatchStep::kSet:
        if (complete (set))
          return true;
        break;
      default:
        return false;
    }
  }
}

/* @return false: exposed too far apart to be one set; it is dropped */
bool
FramePairing::complete (ImageSet &set)
{
  const auto front = [this] (int c) -> WaitingFrame & { return lanes_[c].front (); };
  std::int64_t spread_ns = 0, apart_ns = 0;
  for (int c = 1; c < cameras_; c++)
    for (int d = 0; d < c; d++) {
      spread_ns = std::max (spread_ns, std::abs (front (c).exposed_ns - front (d).exposed_ns));
      apart_ns = std::max (apart_ns, std::abs (front (c).taken_ns - front (d).taken_ns));
    }
  if (apart_ns > tolerance_ns_) {
    for (int c = 0; c < cameras_; c++)
      drop (c, "exposed too far apart from its partners");
    counters_.time_mismatch++;
    return false;
  }
  spread_.add (spread_ns);
  set.trigger_time = by_ == TriggeredBy::kElement ? triggers_[front (0).key % kMaxTriggers].time
                                                  : GST_CLOCK_TIME_NONE;
  set.taken_ns = front (0).taken_ns;
  for (int c = 0; c < cameras_; c++) {
    set.images[c] = std::move (front (c).frame.buffer);
    pop (c);
  }
  counters_.sets++;
  return true;
}

void
FramePairing::drop (int camera, const char *reason)
{
  const WaitingFrame &waiting = lanes_[camera].front ();
  if (waiting.frame.buffer) {
    counters_.dropped[camera]++;
    GST_DEBUG_OBJECT (element_, "camera %d: image %" G_GUINT64_FORMAT " dropped: %s", camera,
        guint64 (waiting.frame.number), reason);
  }
  pop (camera);
}

/* ---- statistics ---- */

std::int64_t
FramePairing::last_frame_ns (int camera)
{
  std::lock_guard guard (lock_);
  return last_frame_ns_[camera];
}

PairingStatistics
FramePairing::stats ()
{
  std::lock_guard guard (lock_);
  PairingStatistics stats = counters_;
  stats.has_spread = !spread_.empty ();
  stats.spread_p50_ns = spread_.quantile (0.5);
  stats.spread_p99_ns = spread_.quantile (0.99);
  stats.delay_p50_ns = delay_.quantile (0.5);
  stats.delay_p99_ns = delay_.quantile (0.99);
  return stats;
}
