/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* stereocamsrc: cameras that are not there, are taken, go away, come back, refuse. */
#include "stereocam-check.hpp"

using namespace rangecast;
using namespace rangecast::testing;

static constexpr std::int64_t kPeriod = GST_SECOND / 50;

static void
expect_text (const std::string &text, const std::string &part)
{
  fail_unless (text.find (part) != std::string::npos, "\"%s\" does not say \"%s\"", text.c_str (),
      part.c_str ());
}

GST_START_TEST (test_camera_that_is_not_there_is_one_error_that_names_pad_and_camera)
{
  TestCameras cameras (1);
  CameraPipeline p ("trigger=software");
  p.play ();
  const std::string text = p.next_text (GST_MESSAGE_ERROR);
  expect_text (text, "pad right");
  expect_text (text, camera_address (1));
  fail_unless (
      gst_bus_timed_pop_filtered (p.bus (), 200 * GST_MSECOND, GST_MESSAGE_ERROR) == nullptr);
}
GST_END_TEST;

GST_START_TEST (test_camera_of_another_program_is_said_to_be_taken)
{
  TestCameras cameras;
  CameraPipeline first ("trigger=software"), second ("trigger=software");
  first.play ();
  fail_unless (first.wait_for_pictures (0, 3));
  second.play ();
  const std::string text = second.next_text (GST_MESSAGE_ERROR);
  expect_text (text, camera_address (0));
  expect_text (text, "another");
  const std::size_t before = first.seen (0).size ();
  fail_unless (first.wait_for_pictures (0, before + 5), "the first program was disturbed");
}
GST_END_TEST;

GST_START_TEST (test_camera_is_free_for_others_after_null)
{
  TestCameras cameras;
  CameraPipeline first ("trigger=software"), second ("trigger=software num-buffers=3");
  first.play ();
  fail_unless (first.wait_for_pictures (0, 3));
  first.stop ();
  second.play_to_the_end ();
}
GST_END_TEST;

GST_START_TEST (test_feature_that_is_not_there_is_one_error_that_names_it)
{
  TestCameras cameras;
  const struct {
    const char *features, *expected;
  } rows[] = {
      {"features=NoSuchFeature=3", "NoSuchFeature"},
      {"features=\"Gamma =3\"", "features"},
      {"features=ExposureTimeAbs=fast", "ExposureTimeAbs"},
  };
  for (const auto &row : rows) {
    CameraPipeline p (std::string ("trigger=software ") + row.features);
    p.play ();
    expect_text (p.next_text (GST_MESSAGE_ERROR), row.expected);
  }
}
GST_END_TEST;

GST_START_TEST (test_features_reach_the_cameras)
{
  TestCameras cameras;
  CameraPipeline p ("trigger=software num-buffers=2 features=\"GainRaw=5 ExposureTimeAbs=3000\"");
  p.play_to_the_end ();
  for (int camera = 0; camera < 2; camera++) {
    fail_unless_equals_int (int (read_register (camera, ARV_FAKE_CAMERA_REGISTER_GAIN_RAW)), 5);
    fail_unless_equals_int (
        int (read_register (camera, ARV_FAKE_CAMERA_REGISTER_EXPOSURE_TIME_US)), 3000);
  }
}
GST_END_TEST;

GST_START_TEST (test_lost_camera_is_one_error)
{
  TestCameras cameras;
  CameraPipeline p ("trigger=software");
  p.play ();
  fail_unless (p.wait_for_pictures (0, 5));
  cameras.unplug (1);
  expect_text (p.next_text (GST_MESSAGE_ERROR), camera_address (1));
}
GST_END_TEST;

GST_START_TEST (test_unplugged_camera_is_said_with_one_text_whatever_fires_it)
{
  for (const char *trigger : {"free-run", "software", "hardware", "action",
           "hardware output-line=Line2", "software single-shot=true"}) {
    TestCameras cameras;
    CameraPipeline p (std::string ("trigger=") + trigger, 2, "video/x-raw,format=GRAY8");
    p.play ();
    for (int i = 0; i < 2000 && read_register (0, ARV_FAKE_CAMERA_REGISTER_ACQUISITION) == 0; i++)
      g_usleep (10000);
    g_usleep (1000000); /* the right one is started, too */
    cameras.unplug (1);
    const std::string text = p.next_text (GST_MESSAGE_ERROR);
    expect_text (text, camera_address (1));
    expect_text (text, "no longer responds; check power and cable");
    fail_unless (text.find ("timeout") == std::string::npos, "%s", text.c_str ());
  }
}
GST_END_TEST;

GST_START_TEST (test_one_camera_under_two_names_is_said_to_be_one)
{
  TestCameras cameras;
  const std::string names[][2] = {
      {camera_address (0), camera_serial (0)}, {camera_serial (0), camera_address (0)}};
  for (const auto &name : names) {
    CameraPipeline p ("left=" + name[0] + " right=" + name[1], 2, "ANY", false);
    p.play ();
    const std::string text = p.next_text (GST_MESSAGE_ERROR);
    expect_text (text, "'" + name[1] + "' is the same camera as '" + name[0] + "' of pad left");
  }
}
GST_END_TEST;

static GstPadProbeReturn
count_gaps (GstPad *, GstPadProbeInfo *info, gpointer count)
{
  if (GST_EVENT_TYPE (GST_PAD_PROBE_INFO_EVENT (info)) == GST_EVENT_GAP)
    ++*static_cast<std::atomic<int> *> (count);
  return GST_PAD_PROBE_OK;
}

static void
expect_comeback (const char *trigger)
{
  TestCameras cameras;
  std::atomic<int> gaps = 0;
  CameraPipeline p (std::string ("reconnect=true trigger=") + trigger);
  GstPad *left = gst_element_get_static_pad (p.source (), "left");
  gst_pad_add_probe (left, GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM, count_gaps, &gaps, nullptr);
  gst_object_unref (left);
  p.play ();
  fail_unless (p.wait_for_pictures (0, 20));
  for (int round = 0; round < 2; round++) {
    cameras.unplug (1);
    expect_text (p.next_text (GST_MESSAGE_WARNING), camera_address (1));
    g_usleep (1500000);
    cameras.plug (1);
    fail_unless (p.says ("stereocamsrc-back"));
    const std::size_t before = p.seen (1).size ();
    fail_unless (p.wait_for_pictures (1, before + 20), "no pictures after it came back");
  }
  fail_unless (gaps > 2, "%d gaps", gaps.load ());
  fail_unless_equals_uint64 (p.stat ("reconnects"), 2);
  fail_unless (p.stat ("sets") + 3 >= p.seen (0).size (), "the statistics started over");
  p.stop ();
  auto left_pictures = p.seen (0), right_pictures = p.seen (1);
  const std::size_t n = std::min (left_pictures.size (), right_pictures.size ());
  for (std::size_t i = 0; i < n; i++) {
    fail_unless_equals_uint64 (left_pictures[i].pts, right_pictures[i].pts);
    ck_assert_int_lt (std::llabs (left_pictures[i].mark.taken_ns - right_pictures[i].mark.taken_ns),
        slowdown () * kPeriod / 2);
  }
}

GST_START_TEST (test_camera_that_is_killed_comes_back_and_pairs_stay_exact)
{
  expect_comeback ("software");
}
GST_END_TEST;

GST_START_TEST (test_free_running_camera_that_is_killed_comes_back)
{
  expect_comeback ("free-run");
}
GST_END_TEST;

GST_START_TEST (test_camera_that_comes_late_is_waited_for)
{
  TestCameras cameras (1);
  CameraPipeline p ("trigger=software reconnect=true");
  p.play ();
  expect_text (p.next_text (GST_MESSAGE_WARNING), "pad right");
  cameras.listener.reset ();
  cameras.resize (2);
  cameras.plug (1);
  fail_unless (p.wait_for_pictures (0, 5) && p.wait_for_pictures (1, 5));
}
GST_END_TEST;

static GstBusSyncReply
count_errors (GstBus *, GstMessage *message, gpointer count)
{
  if (GST_MESSAGE_TYPE (message) == GST_MESSAGE_ERROR)
    ++*static_cast<std::atomic<int> *> (count);
  return GST_BUS_PASS;
}

/* No state change waits for the search: it goes on for a second, but nobody wants its result. */
GST_START_TEST (test_search_that_null_ended_says_nothing)
{
  std::atomic<int> errors = 0;
  CameraPipeline p ("trigger=software");
  g_object_set (p.pipeline (), "auto-flush-bus", FALSE, nullptr);
  gst_bus_set_sync_handler (p.bus (), count_errors, &errors, nullptr);
  for (int i = 0; i < 3; i++) {
    p.play ();
    g_usleep (i * 100000);
    p.stop ();
  }
  g_usleep (4000000);
  fail_unless_equals_int (errors, 0);
  p.play (); /* the next search does say that it found nothing */
  for (int i = 0; i < 2000 && errors == 0; i++)
    g_usleep (10000);
  fail_unless_equals_int (errors, 1);
  gst_bus_set_sync_handler (p.bus (), nullptr, nullptr, nullptr);
}
GST_END_TEST;

/* Downstream keeps all pictures: said once, and the cameras go on when it lets go. */
static GstPadProbeReturn
keep (GstPad *, GstPadProbeInfo *info, gpointer kept)
{
  auto list = static_cast<std::vector<GstBuffer *> *> (kept);
  if (list->size () < 4)
    list->push_back (gst_buffer_ref (GST_PAD_PROBE_INFO_BUFFER (info)));
  return GST_PAD_PROBE_OK;
}

GST_START_TEST (test_downstream_that_keeps_all_buffers_is_warned_once)
{
  TestCameras cameras;
  CameraPipeline p ("trigger=software buffers=4");
  std::vector<GstBuffer *> kept;
  GstPad *left = gst_element_get_static_pad (p.source (), "left");
  const gulong id = gst_pad_add_probe (left, GST_PAD_PROBE_TYPE_BUFFER, keep, &kept, nullptr);
  p.play ();
  expect_text (p.next_text (GST_MESSAGE_WARNING), "property buffers");
  gst_pad_remove_probe (left, id);
  for (GstBuffer *buffer : kept)
    gst_buffer_unref (buffer);
  const std::size_t before = p.seen (0).size ();
  fail_unless (p.wait_for_pictures (0, before + 10));
  fail_unless (gst_bus_pop_filtered (p.bus (), GST_MESSAGE_WARNING) == nullptr);
  ck_assert_uint_gt (p.stat ("underruns"), 0);
  gst_object_unref (left);
}
GST_END_TEST;

static Suite *
stereocamsrcfaults_suite ()
{
  Suite *suite = suite_create ("stereocamsrcfaults");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_camera_that_is_not_there_is_one_error_that_names_pad_and_camera);
  tcase_add_test (tc, test_camera_of_another_program_is_said_to_be_taken);
  tcase_add_test (tc, test_camera_is_free_for_others_after_null);
  tcase_add_test (tc, test_feature_that_is_not_there_is_one_error_that_names_it);
  tcase_add_test (tc, test_features_reach_the_cameras);
  tcase_add_test (tc, test_lost_camera_is_one_error);
  tcase_add_test (tc, test_unplugged_camera_is_said_with_one_text_whatever_fires_it);
  tcase_add_test (tc, test_one_camera_under_two_names_is_said_to_be_one);
  tcase_add_test (tc, test_camera_that_is_killed_comes_back_and_pairs_stay_exact);
  tcase_add_test (tc, test_free_running_camera_that_is_killed_comes_back);
  tcase_add_test (tc, test_camera_that_comes_late_is_waited_for);
  tcase_add_test (tc, test_search_that_null_ended_says_nothing);
  tcase_add_test (tc, test_downstream_that_keeps_all_buffers_is_warned_once);
  return suite;
}

GST_CHECK_MAIN (stereocamsrcfaults);
