/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* stereocamsrc: which frames belong together, without cameras. */
#include "camera/pairing.hpp"

#include <deque>

#include "../rangecast-check.hpp"

static constexpr std::int64_t kMs = 1'000'000, kPeriod = 20 * kMs;

using By = FramePairing::TriggeredBy;

/* A whole picture. Cameras' clocks are that of the test. */
static CameraFrame
picture (std::uint64_t number, std::int64_t taken_ns, std::int64_t way_ns = 2 * kMs)
{
  CameraFrame frame;
  frame.number = number;
  frame.camera_time_ns = static_cast<std::uint64_t> (taken_ns);
  frame.arrived_us = (taken_ns + way_ns) / 1000;
  frame.buffer.reset (gst_buffer_new ());
  return frame;
}

/* Ticks of which one trigger is fired where the pairing allows it; each camera's answer gets lost
 * where the caller says so. @return ticks without a trigger */
template <typename Lost>
static int
run_triggers (FramePairing &pairing, int ticks, Lost lost)
{
  int missed = 0, fired = 0;
  std::uint64_t numbers[2] = {};
  for (int tick = 1; tick <= ticks; tick++) {
    const std::int64_t now = 1000 * kMs + tick * kPeriod;
    if (!pairing.may_trigger (now)) {
      missed++;
      continue;
    }
    pairing.add_trigger (static_cast<GstClockTime> (now), now);
    for (int camera = 0; camera < 2; camera++) {
      CameraFrame frame = picture (numbers[camera]++, now + kMs);
      if (!lost (fired, camera))
        pairing.add_frame (camera, std::move (frame));
    }
    fired++;
    ImageSet set;
    while (pairing.next_set (set))
      set = {};
  }
  return missed;
}

GST_START_TEST (test_answers_that_get_lost_while_delays_are_learnt_cost_few_ticks)
{
  FramePairing pairing;
  pairing.configure (2, By::kElement, kPeriod, 0, 3);
  pairing.reset ();
  const int missed = run_triggers (pairing, 200, [] (int trigger, int camera) {
    return (trigger == 0 && camera == 0) || (trigger == 1 && camera == 1);
  });
  fail_unless (missed > 0, "nothing was waited for");
  fail_unless (missed < 15, "%d ticks of 200 without a trigger", missed);
}
GST_END_TEST;

GST_START_TEST (test_camera_that_never_answers_is_waited_for_longer_and_longer)
{
  FramePairing pairing;
  pairing.configure (2, By::kElement, kPeriod, 0, 3);
  pairing.reset ();
  const int missed = run_triggers (pairing, 200, [] (int, int camera) { return camera == 1; });
  fail_unless (missed > 100, "%d ticks of 200 without a trigger", missed);
}
GST_END_TEST;

/* Answers of the right camera come long after the next trigger was fired: whose they are must not
 * be mistaken. */
GST_START_TEST (test_camera_that_is_late_from_the_start_is_never_given_another_trigger)
{
  for (const std::int64_t late : {70, 100, 130, 170, 250}) {
    FramePairing pairing;
    pairing.configure (2, By::kElement, kPeriod, 0, FramePairing::kMaxWaiting);
    pairing.reset ();
    std::deque<std::pair<std::int64_t, CameraFrame>> under_way; /* with its arrival */
    std::uint64_t number = 0;
    int sets = 0;
    for (int tick = 1; tick <= 400; tick++) {
      const std::int64_t now = 1000 * kMs + tick * kPeriod;
      for (; !under_way.empty () && under_way.front ().first <= now; under_way.pop_front ())
        pairing.add_frame (1, std::move (under_way.front ().second));
      ImageSet set;
      for (; pairing.next_set (set); set = {}, sets++)
        for (int camera = 0; camera < 2; camera++)
          fail_unless_equals_uint64 (
              GST_BUFFER_OFFSET (set.images[camera].get ()), set.trigger_time);
      if (!pairing.may_trigger (now))
        continue;
      pairing.add_trigger (static_cast<GstClockTime> (now), now);
      CameraFrame left = picture (number, now + kMs), right = picture (number, now + kMs);
      number++;
      GST_BUFFER_OFFSET (left.buffer.get ()) = static_cast<guint64> (now);
      GST_BUFFER_OFFSET (right.buffer.get ()) = static_cast<guint64> (now);
      right.arrived_us = (now + late * kMs) / 1000;
      pairing.add_frame (0, std::move (left));
      under_way.emplace_back (now + late * kMs, std::move (right));
    }
    fail_unless (sets > 0 || late > 130, "no set at %d ms", int (late));
  }
}
GST_END_TEST;

static Suite *
stereocampairing_suite ()
{
  Suite *suite = suite_create ("stereocampairing");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_answers_that_get_lost_while_delays_are_learnt_cost_few_ticks);
  tcase_add_test (tc, test_camera_that_is_late_from_the_start_is_never_given_another_trigger);
  tcase_add_test (tc, test_camera_that_never_answers_is_waited_for_longer_and_longer);
  return suite;
}

GST_CHECK_MAIN (stereocampairing);
