/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../test-support.hpp"

#include <algorithm>
#include <random>
#include <rangecast/sync/camera_clock.hpp>
#include <rangecast/sync/ticks.hpp>
#include <rangecast/sync/trigger_matcher.hpp>

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

/* Clocks of 1970 count 1.8e18 ns: the products need more than 64 bits. */
TEST (Ticks, do_not_drift_in_a_clock_of_1970)
{
  const TickRate rate{60, 1};
  const std::int64_t now = 1'800'000'000 * kSecond + 1;
  const std::int64_t tick = rate.at_or_after (now);
  EXPECT_EQ (tick, 1'800'000'000LL * 60 + 1);
  EXPECT_EQ (rate.time_of (tick + 59), 1'800'000'001 * kSecond);
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

TEST (CameraClock, restarted_clock_starts_over)
{
  CameraClock clock;
  clock.host_time (500 * kSecond, 10 * kSecond);
  EXPECT_EQ (clock.host_time (kSecond, 11 * kSecond), 11 * kSecond);
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
