/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* stereodepth with a third camera, and cameras that are slow, end or are exchanged. */
#include "stereodepth-check.hpp"

using namespace rangecast;
using namespace rangecast::testing;

/* A pipeline of the test scene whose rig is exported, run to its end. @param links  of element d;
 * gives the element, transfer full, and what its bus said. */
static std::string
play_scene (const std::string &source, const std::string &links, const std::string &properties,
    GstMessageType wanted, GstStructure **stats)
{
  gchar *rig = g_strdup_printf ("%s/stereodepth-scene-%d.yaml", g_get_tmp_dir (), int (getpid ()));
  GstElement *exporter = gst_parse_launch (
      (std::string ("avatartestsrc views=1 rig-export=") + rig).c_str (), nullptr);
  gst_element_set_state (exporter, GST_STATE_PAUSED);
  gst_element_set_state (exporter, GST_STATE_NULL);
  gst_object_unref (exporter);
  const std::string line = "avatartestsrc views=1 name=c " + source + " " + links +
                           " stereodepth name=d rig=" + rig + " " + properties + " ! fakesink";
  GError *error = nullptr;
  GstElement *pipeline = gst_parse_launch (line.c_str (), &error);
  fail_unless (pipeline && !error, "%s: %s", line.c_str (), error ? error->message : "");
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  GstBus *bus = gst_element_get_bus (pipeline);
  std::string text;
  for (bool end = false; !end;) {
    GstMessage *message = gst_bus_timed_pop_filtered (bus, 60 * GST_SECOND,
        GstMessageType (GST_MESSAGE_EOS | GST_MESSAGE_ERROR | GST_MESSAGE_WARNING));
    fail_unless (message != nullptr, "no end");
    end = GST_MESSAGE_TYPE (message) != GST_MESSAGE_WARNING;
    if (GST_MESSAGE_TYPE (message) == wanted && wanted != GST_MESSAGE_EOS) {
      GError *said = nullptr;
      if (wanted == GST_MESSAGE_ERROR)
        gst_message_parse_error (message, &said, nullptr);
      else
        gst_message_parse_warning (message, &said, nullptr);
      text += std::string (said->message) + "\n";
      g_error_free (said);
    } else
      fail_unless (GST_MESSAGE_TYPE (message) != GST_MESSAGE_ERROR, "an error");
    gst_message_unref (message);
  }
  GstElement *d = gst_bin_get_by_name (GST_BIN (pipeline), "d");
  if (stats)
    g_object_get (d, "stats", stats, nullptr);
  gst_object_unref (d);
  gst_object_unref (bus);
  gst_element_set_state (pipeline, GST_STATE_NULL);
  gst_object_unref (pipeline);
  g_unlink (rig);
  g_free (rig);
  return text;
}

static guint64
field (const GstStructure *stats, const char *name)
{
  guint64 value = G_MAXUINT64;
  fail_unless (gst_structure_get_uint64 (stats, name, &value), "no %s", name);
  return value;
}

static const std::string kLeftRight = "c.left ! queue ! d.left c.right ! queue ! d.right";

GST_START_TEST (test_third_camera_takes_part_in_every_frame)
{
  GstStructure *stats = nullptr;
  play_scene ("num-buffers=4", kLeftRight + " c.third ! queue ! d.third", "steady=0.5 n-threads=2",
      GST_MESSAGE_EOS, &stats);
  fail_unless_equals_uint64 (field (stats, "frames"), 4);
  fail_unless_equals_uint64 (field (stats, "third-frames"), 4);
  gst_structure_free (stats);
}
GST_END_TEST;

GST_START_TEST (test_third_camera_of_half_the_rate_takes_part_in_half_of_the_frames)
{
  GstStructure *stats = nullptr;
  play_scene ("num-buffers=8",
      kLeftRight + " c.third ! video/x-raw,framerate=25/1 ! videorate drop-only=true ! "
                   "video/x-raw,framerate=25/2 ! queue ! "
                   "d.third",
      "", GST_MESSAGE_EOS, &stats);
  fail_unless_equals_uint64 (field (stats, "frames"), 8);
  const guint64 third = field (stats, "third-frames");
  fail_unless (third >= 3 && third <= 5, "%d of 8", int (third));
  gst_structure_free (stats);
}
GST_END_TEST;

GST_START_TEST (test_third_camera_that_ends_leaves_two)
{
  GstStructure *stats = nullptr;
  play_scene ("num-buffers=6", kLeftRight + " c.third ! identity eos-after=2 ! queue ! d.third", "",
      GST_MESSAGE_EOS, &stats);
  fail_unless_equals_uint64 (field (stats, "frames"), 6);
  ck_assert_uint_lt (field (stats, "third-frames"), 6);
  gst_structure_free (stats);
}
GST_END_TEST;

GST_START_TEST (test_right_camera_of_half_the_rate_halves_the_output)
{
  GstStructure *stats = nullptr;
  play_scene ("num-buffers=8",
      "c.left ! queue ! d.left c.right ! video/x-raw,framerate=25/1 ! videorate drop-only=true ! "
      "video/x-raw,framerate=25/2 ! "
      "queue ! d.right",
      "", GST_MESSAGE_EOS, &stats);
  const guint64 frames = field (stats, "frames");
  fail_unless (frames >= 3 && frames <= 4, "%d of 8", int (frames));
  ck_assert_uint_ge (field (stats, "dropped-left"), 3);
  fail_unless_equals_uint64 (field (stats, "dropped-right"), 0);
  gst_structure_free (stats);
}
GST_END_TEST;

GST_START_TEST (test_exchanged_cameras_are_one_warning_that_names_the_cure)
{
  const std::string text =
      play_scene ("num-buffers=3", "c.left ! queue ! d.right c.right ! queue ! d.left",
          "refresh-interval=1", GST_MESSAGE_WARNING, nullptr);
  fail_unless (text.find ("swap") != std::string::npos, "'%s'", text.c_str ());
  fail_unless (text.find ('\n') == text.size () - 1, "more than one: %s", text.c_str ());
  fail_unless (play_scene ("num-buffers=3", kLeftRight, "", GST_MESSAGE_WARNING, nullptr).empty ());
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
  tcase_add_test (tc, test_third_camera_takes_part_in_every_frame);
  tcase_add_test (tc, test_third_camera_of_half_the_rate_takes_part_in_half_of_the_frames);
  tcase_add_test (tc, test_third_camera_that_ends_leaves_two);
  tcase_add_test (tc, test_right_camera_of_half_the_rate_halves_the_output);
  tcase_add_test (tc, test_exchanged_cameras_are_one_warning_that_names_the_cure);
  tcase_add_test (tc, test_third_camera_without_calibration_is_one_error);
  tcase_add_test (tc, test_third_camera_of_another_size_is_one_error);
  tcase_add_test (tc, test_all_three_cameras_may_change_their_size_one_after_the_other);
  tcase_add_test (tc, test_third_pad_that_is_released_is_forgotten);
  tcase_add_test (tc, test_live_a_silent_third_camera_costs_the_latency_and_no_frame);
  tcase_add_test (tc, test_live_the_stream_ends_though_the_third_camera_is_silent);
  return suite;
}

GST_CHECK_MAIN (stereodepththird);
