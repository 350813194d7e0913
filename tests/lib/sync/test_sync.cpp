/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../test-support.hpp"

#include <algorithm>
#include <random>
#include <rangecast/sync/camera_clock.hpp>
#include <rangecast/sync/frame_associator.hpp>
#include <rangecast/sync/frame_sets.hpp>
#include <rangecast/sync/ticks.hpp>
#include <rangecast/sync/trigger_matcher.hpp>
#include <set>

using namespace rangecast;

static constexpr std::int64_t kPeriod = 33'333'333, kMs = 1'000'000, kSecond = 1'000'000'000;

/* ---- ticks ---- */

TEST (Ticks, are_multiples_of_the_period_since_zero)
{
  const TickRate rate{30000, 1001};
  for (std::int64_t tick : {0LL, 1LL, 29LL, 1'000'000'007LL})
    EXPECT_EQ (rate.time_of (tick),
        static_cast<std::int64_t> (static_cast<__int128> (tick) * 1001 * kSecond / 30000));
}

TEST (Ticks, next_one_is_at_or_after_the_time)
{
  const TickRate rate{30, 1};
  EXPECT_EQ (rate.at_or_after (0), 0);
  EXPECT_EQ (rate.at_or_after (1), 1);
  EXPECT_EQ (rate.at_or_after (rate.time_of (5)), 5);
  EXPECT_EQ (rate.at_or_after (rate.time_of (5) + 1), 6);
}

/* Clocks of 1970 count 1.8e18 ns: the products need more than 64 bits. */
TEST (Ticks, do_not_drift_in_a_clock_of_1970)
{
  const TickRate rate{60, 1};
  const std::int64_t now = 1'800'000'000 * kSecond + 1;
  const std::int64_t tick = rate.at_or_after (now);
  EXPECT_EQ (tick, 1'800'000'000LL * 60 + 1);
  EXPECT_EQ (rate.time_of (tick + 59), 1'800'000'001 * kSecond);
}

/* ---- numbers of frames ---- */

TEST (FrameIds, sixteen_bits_wrap_over_zero)
{
  EXPECT_EQ (frame_id_step (65535, 1), 1);
  EXPECT_EQ (frame_id_step (65534, 2), 3);
  EXPECT_EQ (frame_id_step (1, 65535), -1);
  EXPECT_EQ (frame_id_step (10, 13), 3);
}

TEST (FrameIds, sixty_four_bits_do_not_wrap)
{
  EXPECT_EQ (frame_id_step (65535, 65536), 1);
  EXPECT_EQ (frame_id_step (1'000'000, 1'000'002), 2);
}

/* ---- which trigger a frame answers ---- */

namespace {

/* A camera that is fired every period; its clock began elsewhere. */
struct FakeCamera {
  TriggerMatcher finder;
  std::int64_t trigger = 0;
  std::uint64_t id = 1;
  std::int64_t delay = 200'000, clock = 77 * kSecond;
  bool stamps = true;

  explicit FakeCamera (bool with_stamps = true) : stamps (with_stamps)
  {
    finder.start (kPeriod);
    settle ();
  }
  [[nodiscard]] std::int64_t now () const { return 5 * kSecond + trigger * kPeriod; }
  void fire (bool alone = false) { finder.fired (trigger, now (), alone); }
  TriggerMatcher::Found answer (std::int64_t late = 0)
  {
    return finder.find (
        id++, stamps ? now () + delay + late - clock + 100 * kSecond : 0, now () + 8 * kMs + late);
  }
  void settle ()
  {
    for (int i = 0; i < 4 && !finder.settled (); i++, trigger++) {
      fire (true);
      answer ();
    }
  }
  /* One trigger and its answer, which must be known for it. */
  void expect_in_step (const char *when)
  {
    fire ();
    const auto found = answer ();
    EXPECT_TRUE (found.known) << when << ": trigger " << trigger;
    EXPECT_EQ (found.trigger, trigger) << when;
    trigger++;
  }
};

} // namespace

TEST (TriggerMatcher, two_lone_triggers_settle_it)
{
  FakeCamera camera;
  EXPECT_EQ (camera.trigger, 2);
  EXPECT_TRUE (camera.finder.settled ());
}

TEST (TriggerMatcher, first_picture_that_comes_late_teaches_nothing_wrong)
{
  TriggerMatcher finder;
  finder.start (kPeriod);
  std::int64_t time = kSecond;
  for (std::int64_t trigger = 0; trigger < 3; trigger++, time += kSecond) {
    finder.fired (trigger, time, true);
    finder.find (
        static_cast<std::uint64_t> (trigger + 1), time + (trigger == 0 ? 95 * kMs : kMs), time);
    EXPECT_EQ (finder.settled (), trigger == 2);
  }
  finder.fired (3, time, false);
  EXPECT_EQ (finder.find (4, time + kMs, time).trigger, 3);
}

TEST (TriggerMatcher, lost_frame_shifts_nothing)
{
  FakeCamera camera;
  for (int i = 0; i < 10; i++) {
    camera.fire ();
    camera.id++; /* its frame was lost */
    camera.trigger++;
    camera.expect_in_step ("after a loss");
  }
}

TEST (TriggerMatcher, missed_trigger_shifts_nothing)
{
  FakeCamera camera;
  camera.fire (); /* the camera was busy: no frame, no number */
  camera.trigger++;
  for (int i = 0; i < 5; i++)
    camera.expect_in_step ("after a missed trigger");
}

TEST (TriggerMatcher, missed_trigger_of_a_camera_without_stamps_is_found_after_three_frames)
{
  FakeCamera camera (false);
  camera.fire ();
  camera.trigger++;
  int wrong = 0;
  for (int i = 0; i < 6; i++, camera.trigger++) {
    camera.fire ();
    wrong += camera.answer ().trigger != camera.trigger;
  }
  EXPECT_EQ (wrong, 2);
}

TEST (TriggerMatcher, numbers_that_jump_shift_nothing)
{
  FakeCamera camera;
  for (std::uint64_t id : {65535u, 1u, 2u, 40000u, 7u, 70000u}) {
    camera.id = id;
    camera.expect_in_step ("after a jump");
    camera.expect_in_step ("and the next");
  }
}

TEST (TriggerMatcher, late_frame_of_a_busy_camera_keeps_its_trigger)
{
  FakeCamera camera;
  camera.fire ();
  const std::int64_t trigger = camera.trigger;
  const auto found = camera.answer (kPeriod * 6 / 10);
  EXPECT_TRUE (found.known);
  EXPECT_EQ (found.trigger, trigger);
}

TEST (TriggerMatcher, late_arrival_shifts_nothing_without_stamps)
{
  FakeCamera camera (false);
  for (int i = 0; i < 3; i++) {
    camera.fire ();
    EXPECT_EQ (camera.answer (i == 0 ? kPeriod : 0).trigger, camera.trigger);
    camera.trigger++;
  }
}

/* 200 ppm are a period in 3 minutes. */
TEST (TriggerMatcher, drift_of_the_cameras_clock_is_followed)
{
  FakeCamera camera;
  for (int i = 0; i < 20000; i++) {
    camera.clock -= kPeriod / 5000;
    camera.expect_in_step ("while it drifts");
  }
}

TEST (TriggerMatcher, restarted_camera_is_said_to_have_lost_step)
{
  FakeCamera camera;
  camera.expect_in_step ("before");
  camera.clock += 1000 * kSecond;
  camera.id = 1'000'000;
  for (int i = 0; i < 8; i++, camera.trigger++) {
    EXPECT_FALSE (camera.finder.lost_sync ());
    camera.fire ();
    EXPECT_FALSE (camera.answer ().known);
  }
  EXPECT_TRUE (camera.finder.lost_sync ());
  camera.finder.start (kPeriod);
  camera.settle ();
  camera.expect_in_step ("after it was learnt again");
}

TEST (TriggerMatcher, frames_before_any_trigger_are_not_known)
{
  TriggerMatcher finder;
  finder.start (kPeriod);
  EXPECT_FALSE (finder.find (1, kSecond, kSecond).known);
}

/* ---- sets ---- */

namespace {

FrameSets::Frame
frame (std::intptr_t number)
{
  return reinterpret_cast<FrameSets::Frame> (number);
}

} // namespace

TEST (FrameSets, partners_meet_whoever_comes_first)
{
  FrameSets sets;
  sets.start (2, 0);
  FrameSets::Set set;
  EXPECT_EQ (sets.put (1, 7, frame (2)), nullptr);
  EXPECT_EQ (sets.next (set), FrameSets::Step::kWait);
  EXPECT_EQ (sets.put (0, 7, frame (1)), nullptr);
  ASSERT_EQ (sets.next (set), FrameSets::Step::kSet);
  EXPECT_EQ (set.frames[0], frame (1));
  EXPECT_EQ (set.frames[1], frame (2));
  EXPECT_EQ (set.keys[0], 7);
}

TEST (FrameSets, frame_without_partner_is_dropped_alone)
{
  FrameSets sets;
  sets.start (2, 0);
  FrameSets::Set set;
  EXPECT_EQ (sets.put (0, 1, frame (1)), nullptr);
  EXPECT_EQ (sets.put (0, 2, frame (2)), nullptr);
  EXPECT_EQ (sets.put (1, 2, frame (22)), nullptr);
  ASSERT_EQ (sets.next (set), FrameSets::Step::kDrop);
  EXPECT_EQ (set.frames[0], frame (1));
  EXPECT_EQ (set.frames[1], nullptr);
  EXPECT_EQ (sets.next (set), FrameSets::Step::kSet);
  EXPECT_EQ (sets.dropped (0), 1u);
  EXPECT_EQ (sets.dropped (1), 0u);
}

TEST (FrameSets, lost_frame_takes_its_partner_at_once)
{
  FrameSets sets;
  sets.start (2, 0);
  FrameSets::Set set;
  EXPECT_EQ (sets.put (0, 1, frame (1)), nullptr);
  EXPECT_EQ (sets.put (1, 1, nullptr), nullptr);
  ASSERT_EQ (sets.next (set), FrameSets::Step::kDrop);
  EXPECT_EQ (set.frames[0], frame (1));
  EXPECT_EQ (sets.dropped (0), 1u);
  EXPECT_EQ (sets.dropped (1), 0u);
}

TEST (FrameSets, key_that_does_not_grow_is_one_frame_too_many)
{
  FrameSets sets;
  sets.start (2, 0);
  FrameSets::Set set;
  EXPECT_EQ (sets.put (0, 5, frame (1)), nullptr);
  EXPECT_EQ (sets.next (set), FrameSets::Step::kWait);
  EXPECT_EQ (sets.put (0, 5, frame (2)), frame (2));
  EXPECT_EQ (sets.dropped (0), 1u);
}

TEST (FrameSets, what_waits_for_a_dead_camera_is_bounded)
{
  FrameSets sets;
  sets.start (3, 0);
  FrameSets::Set set;
  int held = 0, most = 0;
  for (int i = 1; i <= 1000; i++) {
    EXPECT_EQ (sets.put (0, i, frame (i)), nullptr);
    held++;
    while (sets.next (set) == FrameSets::Step::kDrop)
      held--;
    most = std::max (most, held);
  }
  EXPECT_LE (most, 8);
  while (sets.drain (set) == FrameSets::Step::kDrop)
    held--;
  EXPECT_EQ (held, 0);
}

/* A caller that does not follow each put() with next() gets its frames back. */
TEST (FrameSets, batch_of_one_camera_loses_no_frame)
{
  FrameSets sets;
  sets.start (2, 0, 3);
  FrameSets::Set set;
  int held = 0;
  for (int camera = 0; camera < 2; camera++)
    for (int i = 1; i <= 20; i++)
      held += sets.put (camera, i, frame (i)) == nullptr;
  EXPECT_EQ (held, 8);
  for (auto step = sets.next (set); step != FrameSets::Step::kWait; step = sets.next (set))
    for (FrameSets::Frame out : set.frames)
      held -= out != nullptr;
  EXPECT_EQ (held, 0);
}

TEST (FrameSets, times_within_the_tolerance_meet)
{
  FrameSets sets;
  sets.start (2, kPeriod / 2);
  FrameSets::Set set;
  EXPECT_EQ (sets.put (0, 0, frame (1)), nullptr);
  EXPECT_EQ (sets.put (1, kPeriod * 2 / 5, frame (2)), nullptr);
  EXPECT_EQ (sets.next (set), FrameSets::Step::kSet);
  EXPECT_EQ (sets.put (0, kPeriod, frame (3)), nullptr);
  EXPECT_EQ (sets.put (1, kPeriod * 8 / 5, frame (4)), nullptr);
  ASSERT_EQ (sets.next (set), FrameSets::Step::kDrop);
  EXPECT_EQ (set.frames[0], frame (3));
}

/* Three cameras, frames lost at random, in any order of arrival between cameras: every set is of
 * one key, every frame comes back once, and all complete keys become sets. */
TEST (FrameSets, random_losses_never_mix_keys)
{
  std::mt19937 random (1);
  for (int round = 0; round < 50; round++) {
    FrameSets sets;
    sets.start (3, 0);
    std::array<int, 3> next_key{1, 1, 1};
    std::multiset<std::intptr_t> out;
    std::array<std::set<int>, 3> sent;
    int found = 0;
    FrameSets::Set set;
    const auto drain = [&] {
      for (auto step = sets.next (set); step != FrameSets::Step::kWait; step = sets.next (set)) {
        for (int c = 0; c < 3; c++)
          if (set.frames[c])
            out.insert (reinterpret_cast<std::intptr_t> (set.frames[c]));
        if (step != FrameSets::Step::kSet)
          continue;
        found++;
        for (int c = 0; c < 3; c++)
          EXPECT_EQ (reinterpret_cast<std::intptr_t> (set.frames[c]), set.keys[0] * 4 + c);
      }
    };
    while (next_key[0] < 200 || next_key[1] < 200 || next_key[2] < 200) {
      const int c = static_cast<int> (random () % 3);
      const int least = *std::ranges::min_element (next_key);
      if (next_key[c] >= 200 || next_key[c] > least + 3)
        continue;
      const int key = next_key[c]++;
      if (random () % 10 == 0)
        continue;
      const bool lost = random () % 10 == 0;
      if (!lost)
        sent[c].insert (key);
      EXPECT_EQ (sets.put (c, key, lost ? nullptr : frame (key * 4 + c)), nullptr);
      drain ();
    }
    int complete = 0, all = 0;
    for (int key = 1; key < 200; key++)
      complete += sent[0].contains (key) && sent[1].contains (key) && sent[2].contains (key);
    for (const auto &of_camera : sent)
      all += static_cast<int> (of_camera.size ());
    EXPECT_EQ (found, complete);
    while (sets.drain (set) == FrameSets::Step::kDrop)
      for (FrameSets::Frame rest : set.frames)
        if (rest)
          out.insert (reinterpret_cast<std::intptr_t> (rest));
    EXPECT_EQ (static_cast<int> (out.size ()), all);
  }
}

/* ---- clocks ---- */

TEST (CameraClock, jitter_of_arrival_moves_nothing)
{
  CameraClock clock;
  std::mt19937 random (2);
  std::int64_t worst = 0;
  for (int i = 0; i < 2000; i++) {
    const std::int64_t taken = i * kPeriod,
                       jitter = static_cast<std::int64_t> (random () % 9) * kMs;
    const std::int64_t time = clock.host_time (taken + kSecond, taken + 3 * kMs + jitter);
    if (i > 50)
      worst = std::max (worst, std::abs (time - (taken + 3 * kMs)));
  }
  EXPECT_LT (worst, kMs);
}

TEST (CameraClock, drift_is_followed)
{
  CameraClock clock;
  for (int i = 1; i < 20000; i++) {
    const std::int64_t taken = i * kPeriod;
    const std::int64_t time = clock.host_time (taken + taken / 10000, taken + 3 * kMs);
    ASSERT_NEAR (double (time), double (taken + 3 * kMs), 2.0 * kMs) << i;
  }
}

TEST (CameraClock, camera_without_stamps_is_known_by_arrival)
{
  CameraClock clock;
  EXPECT_EQ (clock.host_time (0, 12345), 12345);
}

TEST (CameraClock, restarted_clock_starts_over)
{
  CameraClock clock;
  clock.host_time (500 * kSecond, 10 * kSecond);
  EXPECT_EQ (clock.host_time (kSecond, 11 * kSecond), 11 * kSecond);
}

/* ---- FrameAssociator ---- */

namespace {

/* Signals every 20 ms; the leading camera counts from 100, the other from 7. */
constexpr std::int64_t kSignal = 20 * kMs;

FrameAssociator
learnt_finder (std::int64_t signals = 10)
{
  FrameAssociator finder;
  finder.start (kSignal);
  for (std::int64_t i = 0; i < signals; i++) {
    finder.leader (static_cast<std::uint64_t> (100 + i), i * kSignal);
    finder.place (static_cast<std::uint64_t> (7 + i), i * kSignal + kMs, true);
  }
  return finder;
}

} // namespace

TEST (FrameAssociator, frame_with_a_wrong_stamp_is_found_by_its_number)
{
  FrameAssociator finder = learnt_finder ();
  ASSERT_TRUE (finder.learnt ());
  finder.leader (110, 10 * kSignal);
  EXPECT_EQ (finder.place (17, 10 * kSignal + kSignal / 2 - kMs, true), 10 * kSignal);
  finder.leader (111, 11 * kSignal);
  EXPECT_EQ (finder.place (18, 3600 * kSecond, true), 11 * kSignal);
}

TEST (FrameAssociator, frame_whose_time_nobody_knows_is_found_by_its_number)
{
  FrameAssociator finder = learnt_finder ();
  finder.leader (110, 10 * kSignal);
  EXPECT_EQ (finder.place (17, {}, false), 10 * kSignal);
  EXPECT_EQ (finder.place (18, {}, false), std::nullopt); /* its partner has not come */
}

TEST (FrameAssociator, numbers_decide_nothing_before_they_agreed_eight_times)
{
  FrameAssociator finder = learnt_finder (7);
  finder.leader (110, 10 * kSignal);
  const std::int64_t off = 10 * kSignal + kSignal / 2 - kMs;
  EXPECT_FALSE (finder.learnt ());
  EXPECT_EQ (finder.place (17, off, true), off);
}

TEST (FrameAssociator, missed_signal_shifts_nothing_where_there_are_stamps)
{
  FrameAssociator finder = learnt_finder ();
  for (std::int64_t i = 10; i < 30; i++) { /* it missed signal 10 */
    finder.leader (static_cast<std::uint64_t> (100 + i), i * kSignal);
    if (i == 10)
      continue;
    EXPECT_EQ (finder.place (static_cast<std::uint64_t> (6 + i), i * kSignal + kMs, true),
        i * kSignal + kMs);
  }
  finder.leader (130, 30 * kSignal);
  EXPECT_EQ (finder.place (36, {}, false), 30 * kSignal) << "the new difference is not learnt";
}

TEST (FrameAssociator, arrival_that_is_one_period_late_once_changes_no_partner)
{
  FrameAssociator finder = learnt_finder ();
  finder.leader (110, 10 * kSignal);
  finder.leader (111, 11 * kSignal);
  EXPECT_EQ (finder.place (17, 11 * kSignal, false), 10 * kSignal);
  EXPECT_EQ (finder.place (18, 11 * kSignal + kMs, false), 11 * kSignal + kMs);
}

TEST (FrameAssociator, arrivals_that_are_a_period_off_three_times_are_believed)
{
  FrameAssociator finder = learnt_finder ();
  for (std::int64_t i = 10; i < 13; i++)
    finder.leader (static_cast<std::uint64_t> (100 + i), i * kSignal);
  finder.place (16, 10 * kSignal, false);
  finder.place (17, 11 * kSignal, false);
  EXPECT_EQ (finder.place (18, 12 * kSignal, false), 12 * kSignal);
}

TEST (RecentValues, quantiles_are_of_the_last_values)
{
  RecentValues values;
  EXPECT_EQ (values.quantile (0.5), 0);
  for (int i = 0; i < 5000; i++)
    values.add (1'000'000);
  for (int i = 1; i <= 512; i++)
    values.add (i);
  EXPECT_EQ (values.quantile (0.5), 256);
  EXPECT_EQ (values.quantile (1), 512);
  EXPECT_EQ (values.quantile (0), 1);
}
