/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* stereocamsrc: cameras that are not there, are taken, go away, come back, refuse. */
#include "stereocam-check.hpp"

using namespace rangecast;
using namespace rangecast::testing;

static constexpr std::int64_t kPeriod = GST_SECOND / 50;

/* Left and right are the cameras of these numbers. */
static std::unique_ptr<CameraPipeline>
pair_of (const std::string &properties, int left)
{
  return std::make_unique<CameraPipeline> (
      properties + " left=" + camera_address (left) + " right=" + camera_address (left + 1), 2,
      "video/x-raw,format=GRAY8", false);
}

GST_START_TEST (test_cameras_that_cannot_be_used_are_one_error)
{
  TestCameras cameras;
  const std::string a = camera_address (0), b = camera_address (1), none = camera_address (7);
  const struct {
    std::string properties, expected;
  } rows[] = {
      {"left=" + a + " right=" + none, "pad right: no camera '" + none},
      {"left=" + a + " right=" + camera_serial (0),
          "'" + camera_serial (0) + "' is the same camera as '" + a + "' of pad left"},
      {"left=" + camera_serial (0) + " right=" + a, "of pad left"},
      {"left=" + a + " right=" + b + " features=NoSuchFeature=3", "NoSuchFeature"},
  };
  for (const auto &row : rows) {
    CameraPipeline p ("trigger=software " + row.properties, 2, "ANY", false);
    p.play ();
    const std::string text = p.next_text (GST_MESSAGE_ERROR);
    fail_unless_contains (text, row.expected);
    fail_unless (gst_bus_pop_filtered (p.bus (), GST_MESSAGE_ERROR) == nullptr);
  }
}
GST_END_TEST;

GST_START_TEST (test_camera_of_another_program_is_taken_until_that_one_is_in_null)
{
  TestCameras cameras;
  CameraPipeline first ("trigger=software"), second ("trigger=software"),
      third ("trigger=software num-buffers=3");
  first.play ();
  fail_unless (first.wait_for_pictures (0, 3));
  second.play ();
  const std::string text = second.next_text (GST_MESSAGE_ERROR);
  fail_unless_contains (text, camera_address (0));
  fail_unless_contains (text, "another");
  const std::size_t before = first.seen (0).size ();
  fail_unless (first.wait_for_pictures (0, before + 5), "the first program was disturbed");
  first.stop ();
  third.play_to_the_end ();
}
GST_END_TEST;

GST_START_TEST (test_lost_camera_is_one_error_with_one_text_whatever_triggers_it)
{
  static constexpr const char *kTriggers[] = {
      "free-run", "software", "hardware", "action", "hardware output-line=Line2"};
  constexpr int kPairs = 5;
  TestCameras cameras (2 * kPairs);
  std::vector<std::unique_ptr<CameraPipeline>> pipelines;
  for (int i = 0; i < kPairs; i++) {
    pipelines.push_back (pair_of (std::string ("trigger=") + kTriggers[i], 2 * i));
    pipelines.back ()->play ();
  }
  for (int i = 0; i < 2 * kPairs; i++)
    while (read_register (i, ARV_FAKE_CAMERA_REGISTER_ACQUISITION) == 0)
      g_usleep (10000);
  for (int i = 0; i < kPairs; i++)
    cameras.unplug (2 * i + 1);
  for (int i = 0; i < kPairs; i++) {
    const std::string text = pipelines[i]->next_text (GST_MESSAGE_ERROR);
    fail_unless_contains (text, camera_address (2 * i + 1));
    fail_unless_contains (text, "no longer responds; check power and cable");
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

GST_START_TEST (test_lost_cameras_come_back_and_pairs_stay_exact)
{
  TestCameras cameras (4);
  std::atomic<int> gaps[2] = {};
  std::unique_ptr<CameraPipeline> pipelines[] = {pair_of ("reconnect=true trigger=software", 0),
      pair_of ("reconnect=true trigger=free-run", 2)};
  for (int i = 0; i < 2; i++) {
    GstPad *left = gst_element_get_static_pad (pipelines[i]->source (), "left");
    gst_pad_add_probe (left, GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM, count_gaps, &gaps[i], nullptr);
    gst_object_unref (left);
    pipelines[i]->play ();
  }
  for (int i = 0; i < 2; i++) {
    fail_unless (pipelines[i]->wait_for_pictures (0, 10));
    cameras.unplug (2 * i + 1);
  }
  for (int i = 0; i < 2; i++) {
    const std::string text = pipelines[i]->next_text (GST_MESSAGE_WARNING);
    fail_unless_contains (text, camera_address (2 * i + 1));
    fail_unless (pipelines[i]->says ("stereocamsrc-lost"));
    while (gaps[i] < 3)
      g_usleep (10000);
    cameras.plug (2 * i + 1);
  }
  for (int i = 0; i < 2; i++) {
    CameraPipeline &p = *pipelines[i];
    fail_unless (p.says ("stereocamsrc-back"));
    const std::size_t before = p.seen (1).size ();
    fail_unless (p.wait_for_pictures (1, before + 20), "no images after it came back");
    fail_unless_equals_uint64 (p.stat ("reconnects"), 1);
    fail_unless (p.stat ("sets") + 3 >= p.seen (0).size (), "the statistics started over");
    p.stop ();
    const auto left = p.seen (0), right = p.seen (1);
    for (std::size_t n = 0; n < std::min (left.size (), right.size ()); n++) {
      fail_unless_equals_uint64 (left[n].pts, right[n].pts);
      ck_assert_int_lt (
          std::llabs (left[n].mark.taken_ns - right[n].mark.taken_ns), slowdown () * kPeriod);
    }
  }
}
GST_END_TEST;

static GstBusSyncReply
count_errors (GstBus *, GstMessage *message, gpointer count)
{
  if (GST_MESSAGE_TYPE (message) == GST_MESSAGE_ERROR)
    ++*static_cast<std::atomic<int> *> (count);
  return GST_BUS_PASS;
}

GST_START_TEST (test_search_that_null_ended_says_nothing)
{
  std::atomic<int> errors = 0;
  CameraPipeline p ("trigger=software"); /* nobody answers there */
  g_object_set (p.pipeline (), "auto-flush-bus", FALSE, nullptr);
  gst_bus_set_sync_handler (p.bus (), count_errors, &errors, nullptr);
  for (int i = 0; i < 3; i++) {
    p.play ();
    g_usleep (i * 100000);
    p.stop ();
  }
  fail_unless_equals_int (errors, 0);
  p.play (); /* the next search does say that it found nothing */
  while (errors == 0)
    g_usleep (10000);
  p.stop ();
  fail_unless_equals_int (errors, 1);
  gst_bus_set_sync_handler (p.bus (), nullptr, nullptr, nullptr);
}
GST_END_TEST;

/* Downstream keeps all images: said once, and the cameras go on when it lets go. */
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
  const std::string text = p.next_text (GST_MESSAGE_WARNING);
  fail_unless_contains (text, "property buffers");
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
  tcase_add_test (tc, test_cameras_that_cannot_be_used_are_one_error);
  tcase_add_test (tc, test_camera_of_another_program_is_taken_until_that_one_is_in_null);
  tcase_add_test (tc, test_lost_camera_is_one_error_with_one_text_whatever_triggers_it);
  tcase_add_test (tc, test_lost_cameras_come_back_and_pairs_stay_exact);
  tcase_add_test (tc, test_search_that_null_ended_says_nothing);
  tcase_add_test (tc, test_downstream_that_keeps_all_buffers_is_warned_once);
  return suite;
}

GST_CHECK_MAIN (stereocamsrcfaults);
