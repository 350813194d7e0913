/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* stereodepth with a third camera. */
#include "stereodepth-check.hpp"

using namespace rangecast;
using namespace rangecast::testing;

static guint64
field (const GstStructure *stats, const char *name)
{
  guint64 value = G_MAXUINT64;
  fail_unless (gst_structure_get_uint64 (stats, name, &value), "no %s", name);
  return value;
}

/* At half of the rate, until it ends. */
GST_START_TEST (test_third_camera_takes_part_while_it_has_images)
{
  RigFile rig;
  const std::string camera = std::string ("videotestsrc num-buffers=8 ! ") + kSmall;
  const std::string line =
      camera + " ! d.left " + camera + " ! d.right " + camera +
      " ! videorate drop-only=true ! video/x-raw,framerate=25/2 ! identity eos-after=3 ! d.third "
      "stereodepth name=d n-threads=2 " +
      rig.property () + " ! fakesink";
  GstElement *pipeline = gst_parse_launch (line.c_str (), nullptr);
  GstElement *d = gst_bin_get_by_name (GST_BIN (pipeline), "d");
  play_to_the_end (pipeline);
  GstStructure *stats = nullptr;
  g_object_get (d, "stats", &stats, nullptr);
  fail_unless_equals_uint64 (field (stats, "frames"), 8);
  fail_unless_equals_uint64 (field (stats, "third-frames"), 2);
  gst_structure_free (stats);
  gst_object_unref (d);
  gst_object_unref (pipeline);
}
GST_END_TEST;

/* Left, right and a third camera of a rig, 160x120. */
struct Trio {
  RigFile rig;
  Stereo s;
  GstPad *pad;
  GstHarness *third;

  explicit Trio (const char *properties = "", bool calibrated = true)
      : rig (calibrated), s (rig.property () + " " + properties)
  {
    pad = gst_element_request_pad_simple (s.left->element, "third");
    third = gst_harness_new_with_element (s.left->element, "third", nullptr);
    gst_harness_set_live (third, FALSE);
    gst_harness_set_src_caps_str (third, kSmall);
  }
  ~Trio ()
  {
    gst_harness_teardown (third);
    gst_object_unref (pad);
  }
  void push_pair (GstClockTime pts)
  {
    s.push (s.left, pts);
    s.push (s.right, pts);
  }
  /* A picture of random bytes. */
  static void push_noise (GstHarness *h, int width, int height, int bytes, GstClockTime pts)
  {
    GstBuffer *buffer = gst_buffer_new_allocate (nullptr, width * height * bytes, nullptr);
    gst_buffer_memset (buffer, 0, 77, gst_buffer_get_size (buffer));
    GST_BUFFER_PTS (buffer) = pts;
    gst_harness_push (h, buffer);
  }
  void pull (GstClockTime pts, int width = 160)
  {
    GstBuffer *output = gst_harness_pull (s.left);
    fail_unless (output != nullptr, "'%s'", next_message_text (s.bus, GST_MESSAGE_ERROR).c_str ());
    fail_unless_equals_uint64 (GST_BUFFER_PTS (output), pts);
    fail_unless_equals_int (gst_buffer_get_range_meta (output, 0)->width, width);
    gst_buffer_unref (output);
  }
};

static void
expect_one_error (Trio &t, const char *what)
{
  const std::string text = next_message_text (t.s.bus, GST_MESSAGE_ERROR);
  fail_unless (text.find ("pad third") != std::string::npos, "'%s'", text.c_str ());
  fail_unless (text.find (what) != std::string::npos, "'%s'", text.c_str ());
  GstMessage *another = gst_bus_pop_filtered (t.s.bus, GST_MESSAGE_ERROR);
  fail_unless (another == nullptr, "a second error after '%s'", text.c_str ());
}

GST_START_TEST (test_third_camera_without_calibration_is_one_error)
{
  Trio t ("", false);
  t.s.push (t.third, 0);
  t.push_pair (0);
  expect_one_error (t, "no calibration");
}
GST_END_TEST;

GST_START_TEST (test_third_camera_of_another_size_is_one_error)
{
  Trio t;
  gst_harness_set_src_caps_str (
      t.third, "video/x-raw,format=GRAY8,width=80,height=60,framerate=25/1");
  Trio::push_noise (t.third, 80, 60, 1, 0);
  t.push_pair (0);
  expect_one_error (t, "80x60");
}
GST_END_TEST;

GST_START_TEST (test_all_three_cameras_may_change_their_size_one_after_the_other)
{
  static const char *kLarge = "video/x-raw,format=GRAY8,width=320,height=240,framerate=25/1";
  Trio t;
  t.push_pair (0);
  /* The third camera's picture 0 was lost; its next is larger, as are those of the others. */
  gst_harness_set_src_caps_str (t.third, kLarge);
  Trio::push_noise (t.third, 320, 240, 1, kFrame);
  t.pull (0);
  for (GstHarness *h : {t.s.left, t.s.right}) {
    gst_harness_set_src_caps_str (h, kLarge);
    Trio::push_noise (h, 320, 240, 1, kFrame);
  }
  t.pull (kFrame, 320);
  fail_unless_equals_uint64 (t.s.stat ("third-frames"), 1);
}
GST_END_TEST;

GST_START_TEST (test_third_pad_that_is_released_is_forgotten)
{
  Trio t ("", false); /* not calibrated: an error if it counted */
  GstQuery *query = gst_query_new_allocation (nullptr, FALSE);
  gst_pad_peer_query (t.third->srcpad, query); /* after it, the caps have been seen */
  gst_query_unref (query);
  gst_element_release_request_pad (t.s.left->element, t.pad);
  t.push_pair (0);
  t.pull (0);
}
GST_END_TEST;

GST_START_TEST (test_live_a_silent_third_camera_costs_the_latency_and_no_frame)
{
  RigFile rig;
  GstElement *element =
      gst_parse_launch (("stereodepth latency=20000000 " + rig.property ()).c_str (), nullptr);
  GstHarness *left = gst_harness_new_with_element (element, "left", "src");
  GstHarness *right = gst_harness_new_with_element (element, "right", nullptr);
  GstHarness *third = gst_harness_new_with_element (element, "third", nullptr);
  gst_object_unref (element);
  gst_harness_use_testclock (left);
  for (GstHarness *h : {left, right, third}) {
    gst_harness_set_live (h, TRUE);
    gst_harness_set_src_caps_str (h, kSmall);
  }
  gst_harness_play (left);
  for (int i = 0; i < 4; i++) {
    gst_harness_push (left, Stereo::dots (false, i * kFrame));
    gst_harness_push (right, Stereo::dots (true, i * kFrame));
    if (i == 3) /* it is back */
      gst_harness_push (third, Stereo::dots (false, i * kFrame));
    else {
      fail_unless (gst_harness_wait_for_clock_id_waits (left, 1, 5));
      GstTestClock *clock = gst_harness_get_testclock (left);
      GstClockID waited = nullptr;
      gst_test_clock_wait_for_next_pending_id (clock, &waited);
      const GstClockTime deadline = gst_clock_id_get_time (waited) - i * kFrame;
      ck_assert_uint_le (deadline, 20 * GST_MSECOND);
      fail_unless ((i > 0 || deadline == 20 * GST_MSECOND));
      gst_clock_id_unref (waited);
      gst_object_unref (clock);
      fail_unless (gst_harness_crank_single_clock_wait (left));
    }
    GstBuffer *output = gst_harness_pull (left);
    fail_unless (output != nullptr);
    fail_unless_equals_uint64 (GST_BUFFER_PTS (output), i * kFrame);
    gst_buffer_unref (output);
  }
  GstStructure *stats;
  g_object_get (left->element, "stats", &stats, nullptr);
  fail_unless_equals_uint64 (field (stats, "third-frames"), 1);
  fail_unless_equals_uint64 (field (stats, "dropped-left"), 0);
  gst_structure_free (stats);
  for (GstHarness *h : {third, right, left})
    gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_live_the_stream_ends_though_the_third_camera_is_silent)
{
  RigFile rig;
  const std::string camera = std::string ("videotestsrc is-live=true num-buffers=3 ! ") + kSmall;
  const std::string line = camera + " ! d.left " + camera + " ! d.right " + camera +
                           " ! valve drop=true ! d.third stereodepth name=d latency=40000000 " +
                           rig.property () + " ! fakesink";
  GstElement *pipeline = gst_parse_launch (line.c_str (), nullptr);
  play_to_the_end (pipeline);
  gst_object_unref (pipeline);
}
GST_END_TEST;

static Suite *
stereodepththird_suite ()
{
  Suite *suite = suite_create ("stereodepththird");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_third_camera_takes_part_while_it_has_images);
  tcase_add_test (tc, test_third_camera_without_calibration_is_one_error);
  tcase_add_test (tc, test_third_camera_of_another_size_is_one_error);
  tcase_add_test (tc, test_all_three_cameras_may_change_their_size_one_after_the_other);
  tcase_add_test (tc, test_third_pad_that_is_released_is_forgotten);
  tcase_add_test (tc, test_live_a_silent_third_camera_costs_the_latency_and_no_frame);
  tcase_add_test (tc, test_live_the_stream_ends_though_the_third_camera_is_silent);
  return suite;
}

GST_CHECK_MAIN (stereodepththird);
