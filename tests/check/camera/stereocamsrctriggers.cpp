/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* stereocamsrc: who fires the cameras, and by which clock. */
#include "stereocam-check.hpp"

#include <bit>
#include <gst/net/net.h>

using namespace rangecast;
using namespace rangecast::testing;

static constexpr std::int64_t kPeriod = GST_SECOND / 50;

GST_START_TEST (test_free_running_pairs_share_pts_near_the_exposure)
{
  TestCameras cameras;
  CameraPipeline p ("num-buffers=40");
  p.play_to_the_end ();
  expect_pairs (p, 2, kPeriod / 2);
  for (const SeenPicture &picture : p.seen (0)) {
    const auto off = static_cast<std::int64_t> (picture.capture) - picture.mark.taken_ns;
    fail_unless (std::llabs (off) < kPeriod / 2, "capture time is off by %d us", int (off / 1000));
  }
}
GST_END_TEST;

GST_START_TEST (test_stamp_that_is_an_hour_off_once_does_not_end_the_pairs)
{
  TestCameras cameras;
  CameraPipeline p ("trigger=free-run");
  p.play ();
  for (const std::int64_t hours : {1, -1}) {
    fail_unless (p.wait_for_pictures (0, 20) && p.wait_for_pictures (1, 20));
    cameras.list[0]->mistake_stamp (hours * 3600 * std::int64_t (GST_SECOND));
    p.forget ();
    fail_unless (p.wait_for_pictures (0, 20) && p.wait_for_pictures (1, 20));
    const auto pictures = p.seen (0);
    const GstClockTime took = pictures.back ().pts - pictures.front ().pts;
    fail_unless (took < 60 * GST_SECOND, "they span %d s", int (took / GST_SECOND));
  }
  p.stop ();
  expect_pairs (p, 2, kPeriod / 2);
}
GST_END_TEST;

/* ---- one look ---- */

static bool
follows (std::uint32_t address, std::uint32_t value)
{
  std::uint32_t right = 0, third = 0;
  for (int i = 0; i < 1000; i++, g_usleep (10000)) {
    right = read_register (1, address);
    third = read_register (2, address);
    if (right == value && third == value)
      return true;
  }
  g_print ("register 0x%x: right has %u, third %u, expected %u\n", address, right, third, value);
  return false;
}

GST_START_TEST (test_right_and_third_follow_what_the_left_regulates)
{
  TestCameras cameras (3);
  CameraPipeline p (
      "trigger=software auto-exposure=true auto-gain=true auto-white-balance=true", 3);
  p.play ();
  fail_unless (p.wait_for_pictures (0, 3));
  const auto bits = [] (float ratio) { return std::bit_cast<std::uint32_t> (ratio); };
  const struct {
    std::uint32_t address, value;
  } rows[] = {
      {ARV_FAKE_CAMERA_REGISTER_EXPOSURE_TIME_US, 4321},
      {ARV_FAKE_CAMERA_REGISTER_GAIN_RAW, 7},
      {kRegisterBalanceRatio, bits (1.5F)},
      {kRegisterBalanceRatio + 4, bits (0.75F)},
      {kRegisterBalanceRatio + 8, bits (2.25F)},
  };
  for (const auto &row : rows)
    cameras.list[0]->regulate (row.address, row.value);
  for (const auto &row : rows)
    fail_unless (follows (row.address, row.value));
}
GST_END_TEST;

/* ---- who fires ---- */

GST_START_TEST (test_left_camera_triggers_the_others_by_its_line)
{
  TestCameras cameras (3);
  CameraPipeline p ("trigger=hardware trigger-line=Line0 output-line=Line1 num-buffers=20", 3);
  p.play_to_the_end ();
  expect_pairs (p, 3, kPeriod / 2);
}
GST_END_TEST;

/* Cameras of other elements ignore the commands. */
GST_START_TEST (test_action_commands_trigger_all_cameras_of_an_element_on_ticks)
{
  TestCameras cameras (4);
  CameraPipeline one ("trigger=action num-buffers=20"),
      two ("trigger=action num-buffers=20 left=" + camera_address (2) +
               " right=" + camera_address (3),
          2, "video/x-raw,format=GRAY8,framerate=50/1", false);
  one.play ();
  two.play_to_the_end ();
  one.wait_for_eos ();
  for (CameraPipeline *p : {&one, &two}) {
    for (int side = 0; side < 2; side++)
      for (const SeenPicture &picture : p->seen (side)) {
        fail_unless_equals_int (picture.mark.camera, side + (p == &two ? 2 : 0));
        fail_unless_equals_uint64 (picture.capture % kPeriod, 0);
      }
    const auto left = p->seen (0);
    const auto ticks = guint64 ((left.back ().capture - left.front ().capture) / kPeriod);
    /* Twice as many if it did; a late image at either end is one of the next tick. */
    fail_unless (ticks + 2 >= guint64 (left.back ().mark.number - left.front ().mark.number),
        "more images than ticks: another element's commands trigger the camera, too");
  }
}
GST_END_TEST;

/* ---- clocks ---- */

GST_START_TEST (test_clock_of_a_server_is_provided_and_ticks_are_its_multiples)
{
  TestCameras cameras;
  GstClock *server = GST_CLOCK (g_object_new (GST_TYPE_SYSTEM_CLOCK, "name", "server", nullptr));
  /* an hour ahead of this machine's */
  gst_clock_set_calibration (server, 0, 3600 * GST_SECOND, 1, 1);
  GstNetTimeProvider *provider = gst_net_time_provider_new (server, "127.0.0.1", 0);
  gint port = 0;
  g_object_get (provider, "port", &port, nullptr);
  CameraPipeline p (
      "trigger=software num-buffers=20 clock-server=127.0.0.1:" + std::to_string (port));
  p.play ();
  fail_unless (p.says ("stereocamsrc-clock"));
  GstClock *used = gst_element_get_clock (p.source ());
  fail_unless (GST_IS_NET_CLIENT_CLOCK (used));
  gst_object_unref (used);
  p.wait_for_eos ();
  expect_pairs (p, 2, kPeriod / 2);
  for (const SeenPicture &picture : p.seen (0)) {
    fail_unless_equals_uint64 (picture.capture % kPeriod, 0);
    const auto ahead = static_cast<std::int64_t> (picture.capture) - picture.mark.taken_ns;
    fail_unless (std::llabs (ahead - 3600 * std::int64_t (GST_SECOND)) < std::int64_t (GST_SECOND),
        "ahead by %" G_GINT64_FORMAT " ns", ahead);
  }
  p.stop ();
  gst_object_unref (provider);
  gst_object_unref (server);
}
GST_END_TEST;

GST_START_TEST (test_clock_server_that_never_answers_is_one_error)
{
  TestCameras cameras;
  CameraPipeline p ("trigger=software clock-server=127.0.0.1:9");
  p.play ();
  const std::string text = p.next_text (GST_MESSAGE_ERROR);
  fail_unless_contains (text, "127.0.0.1:9 does not answer");
}
GST_END_TEST;

static Suite *
stereocamsrctriggers_suite ()
{
  Suite *suite = suite_create ("stereocamsrctriggers");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_free_running_pairs_share_pts_near_the_exposure);
  tcase_add_test (tc, test_stamp_that_is_an_hour_off_once_does_not_end_the_pairs);
  tcase_add_test (tc, test_right_and_third_follow_what_the_left_regulates);
  tcase_add_test (tc, test_left_camera_triggers_the_others_by_its_line);
  tcase_add_test (tc, test_action_commands_trigger_all_cameras_of_an_element_on_ticks);
  tcase_add_test (tc, test_clock_of_a_server_is_provided_and_ticks_are_its_multiples);
  tcase_add_test (tc, test_clock_server_that_never_answers_is_one_error);
  return suite;
}

GST_CHECK_MAIN (stereocamsrctriggers);
