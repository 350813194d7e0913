/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* stereocamsrc: pairs, pads, formats, life. */
#include "stereocam-check.hpp"
#include <rangecast/rigfile/rig_file.hpp>

using namespace rangecast;
using namespace rangecast::testing;

static constexpr std::int64_t kPeriod = GST_SECOND / 50;

/* ---- pairs ---- */

GST_START_TEST (test_software_pairs_share_pts_and_capture_time_on_ticks)
{
  TestCameras cameras;
  CameraPipeline p ("trigger=software num-buffers=30");
  p.play_to_the_end ();
  expect_pairs (p, 2, kPeriod / 2);
  const GstClockTime base = gst_element_get_base_time (p.source ());
  fail_unless_equals_int (int (p.seen (0).size ()), 30);
  for (const SeenPicture &picture : p.seen (0)) {
    fail_unless_equals_uint64 (picture.capture % kPeriod, 0);
    fail_unless_equals_uint64 (picture.pts, picture.capture - base);
    fail_unless_equals_uint64 (picture.duration, kPeriod);
    /* the system clock is CLOCK_MONOTONIC: it was taken after its tick */
    ck_assert_int_ge (picture.mark.taken_ns, static_cast<std::int64_t> (picture.capture));
  }
  fail_unless_equals_uint64 (p.stat ("sets"), 30);
}
GST_END_TEST;

GST_START_TEST (test_third_pad_is_there_only_while_its_camera_is_named)
{
  TestCameras cameras (3);
  CameraPipeline p ("trigger=software", 2);
  g_object_set (p.source (), "third", camera_address (2).c_str (), nullptr);
  fail_unless (gst_element_get_static_pad (p.source (), "third") == nullptr);
  gst_element_set_state (p.pipeline (), GST_STATE_PAUSED);
  GstPad *pad = gst_element_get_static_pad (p.source (), "third");
  fail_unless (pad != nullptr);
  gst_object_unref (pad);
  gst_element_set_state (p.pipeline (), GST_STATE_READY);
  fail_unless (gst_element_get_static_pad (p.source (), "third") == nullptr);
}
GST_END_TEST;

static GstPadProbeReturn
keep (GstPad *, GstPadProbeInfo *info, gpointer kept)
{
  static_cast<SharedList<GstBuffer *> *> (kept)->add (
      gst_buffer_ref (GST_PAD_PROBE_INFO_BUFFER (info)));
  return GST_PAD_PROBE_OK;
}

/* Who keeps all pictures keeps all buffers that the cameras' streams have, and no picture comes any
 * more. Copies would not run out. */
GST_START_TEST (test_pixels_are_not_copied)
{
  TestCameras cameras;
  CameraPipeline p ("trigger=software buffers=4");
  SharedList<GstBuffer *> kept[2];
  for (int side = 0; side < 2; side++) {
    GstPad *pad = gst_element_get_static_pad (p.source (), kSides[side]);
    gst_pad_add_probe (pad, GST_PAD_PROBE_TYPE_BUFFER, keep, &kept[side], nullptr);
    gst_object_unref (pad);
  }
  p.play ();
  for (int i = 0; i < 1000 && p.stat ("underruns") < 10 && kept[0].all ().size () < 20; i++)
    g_usleep (10000);
  p.stop ();
  for (auto &side : kept) {
    const auto all = side.all ();
    fail_unless (!all.empty () && all.size () <= 4, "%d buffers", int (all.size ()));
    for (GstBuffer *buffer : all)
      gst_buffer_unref (buffer);
  }
}
GST_END_TEST;

/* ---- formats ---- */

static GstCaps *
caps_after_one_pair (const char *properties, const char *wanted)
{
  CameraPipeline p (std::string ("trigger=software num-buffers=1 ") + properties, 2, wanted);
  p.play_to_the_end ();
  GstPad *pad = gst_element_get_static_pad (p.source (), "right");
  GstCaps *caps = gst_pad_get_current_caps (pad);
  gst_object_unref (pad);
  fail_unless (caps != nullptr);
  return caps;
}

static void
expect_caps (const char *properties, const char *wanted, const char *expected)
{
  GstCaps *caps = caps_after_one_pair (properties, wanted), *text = gst_caps_from_string (expected);
  fail_unless (gst_caps_is_subset (caps, text), "%" GST_PTR_FORMAT, caps);
  gst_caps_unref (caps);
  gst_caps_unref (text);
}

GST_START_TEST (test_downstream_chooses_format_size_and_rate)
{
  TestCameras cameras;
  expect_caps ("", "video/x-raw,format=RGB,framerate=25/1",
      "video/x-raw,format=RGB,width=64,height=48,framerate=25/1");
  expect_caps (
      "", "video/x-raw,width=32,height=16", "video/x-raw,width=32,height=16,framerate=30/1");
  expect_caps ("", "video/x-bayer,format=rggb", "video/x-bayer,format=rggb,width=64");
  expect_caps ("format=BayerGB8", "ANY", "video/x-bayer,format=gbrg");
}
GST_END_TEST;

GST_START_TEST (test_caps_that_no_camera_has_are_one_error_that_names_the_pad)
{
  TestCameras cameras;
  const struct {
    const char *left, *right, *expected;
  } rows[] = {
      {"ANY", "video/x-raw,width=1920",
          "pad right: downstream accepts video/x-raw, width=(int)1920; the cameras and the pads"},
      {"video/x-raw,format=RGB", "video/x-raw,format=GRAY8",
          "pad right: downstream accepts video/x-raw, format=(string)GRAY8; the cameras"},
  };
  for (const auto &row : rows) {
    CameraPipeline p ("trigger=software", 2, row.left);
    gst_util_set_object_arg (G_OBJECT (p.filter (1).get ()), "caps", row.right);
    p.play ();
    const std::string text = p.next_text (GST_MESSAGE_ERROR);
    fail_unless_contains (text, row.expected);
  }
}
GST_END_TEST;

GST_START_TEST (test_format_that_is_not_there_is_one_error_that_lists_the_cameras)
{
  TestCameras cameras;
  CameraPipeline p ("trigger=software format=Mono12Packed", 2, "ANY");
  p.play ();
  const std::string text = p.next_text (GST_MESSAGE_ERROR);
  for (const char *part : {"Mono12Packed", "Mono8"})
    fail_unless_contains (text, part);
  for (int camera = 0; camera < 2; camera++)
    fail_unless_contains (text, camera_address (camera));
}
GST_END_TEST;

/* ---- which cameras ---- */

static std::string
write_rig (bool with_names)
{
  Rig rig = ring_rig (1, 64, 48);
  PartnerCamera right;
  right.intrinsics = rig.views[0].intrinsics;
  right.partner_from_left.translation.x = -0.1;
  if (with_names) {
    rig.views[0].camera = camera_address (0);
    right.camera = camera_address (1);
  }
  rig.views[0].right = right;
  const std::string path =
      std::string (g_get_tmp_dir ()) + "/rangecast-cameras-" + std::to_string (getpid ()) + ".yaml";
  fail_unless_ok (save_rig (path, rig));
  return path;
}

static std::string
error_going_to_paused (const std::string &properties)
{
  CameraPipeline p (properties, 2, "ANY", false);
  fail_unless_equals_int (
      gst_element_set_state (p.pipeline (), GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE);
  return p.next_text (GST_MESSAGE_ERROR);
}

GST_START_TEST (test_cameras_are_named_by_properties_or_a_rig_file)
{
  {
    TestCameras cameras;
    CameraPipeline p ("trigger=software num-buffers=3 rig=" + write_rig (true), 2, "ANY", false);
    p.play_to_the_end ();
    expect_pairs (p, 2, kPeriod);
  }
  const std::string path = write_rig (false);
  const struct {
    std::string properties, expected;
  } rows[] = {
      {"", "property left"},
      {"left=a", "property right"},
      {"left=a right=a", "named twice"},
      {"left=a rig=" + path, "set property right; rig is ignored where one of left and right"},
      {"rig=/nowhere.yaml", "/nowhere.yaml: no such rig file"},
      {"rig=" + path, "does not name its left camera"},
      {"view-id=7 rig=" + path, "view-id 7"},
      {"left=a right=b clock-server=here", "clock-server here is neither HOST:PORT"},
      {"left=a right=b clock-server=here:0", "clock-server here:0 is neither HOST:PORT"},
      {"left=a right=b clock-server=ptp:900", "clock-server ptp:900 is neither HOST:PORT"},
  };
  for (const auto &row : rows) {
    const std::string text = error_going_to_paused (row.properties);
    fail_unless (text.find (row.expected) != std::string::npos, "%s: %s", row.properties.c_str (),
        text.c_str ());
  }
  unlink (path.c_str ());
}
GST_END_TEST;

/* ---- pads ---- */

static GstPadProbeReturn
block (GstPad *, GstPadProbeInfo *, gpointer)
{
  return GST_PAD_PROBE_OK;
}

GST_START_TEST (test_blocked_branch_does_not_hold_up_the_other)
{
  TestCameras cameras;
  CameraPipeline p ("trigger=software buffers=12");
  GstPad *left = gst_element_get_static_pad (p.source (), "left");
  const gulong id = gst_pad_add_probe (left,
      GstPadProbeType (GST_PAD_PROBE_TYPE_BLOCK | GST_PAD_PROBE_TYPE_BUFFER), block, nullptr,
      nullptr);
  p.play ();
  fail_unless (p.wait_for_pictures (1, 40));
  fail_unless_equals_int (int (p.seen (0).size ()), 0);
  ck_assert_uint_gt (p.stat ("overrun-left"), 0);
  fail_unless_equals_uint64 (p.stat ("overrun-right"), 0);
  gst_pad_remove_probe (left, id);
  fail_unless (p.wait_for_pictures (0, 5));
  gst_object_unref (left);
}
GST_END_TEST;

GST_START_TEST (test_pad_goes_on_after_its_downstream_was_in_ready)
{
  TestCameras cameras;
  CameraPipeline p ("trigger=software");
  p.play ();
  fail_unless (p.wait_for_pictures (0, 3));
  gst_element_set_state (p.filter (0).get (), GST_STATE_READY);
  p.forget ();
  fail_unless (p.wait_for_pictures (1, 8)); /* more than the left pad's queue holds */
  fail_unless_equals_int (p.seen (0).size (), 0);
  gst_element_set_state (p.filter (0).get (), GST_STATE_PLAYING);
  fail_unless (p.wait_for_pictures (0, 3));
  fail_unless (p.wait_for_pictures (1, p.seen (1).size () + 3));
  fail_unless (p.seen (0)[0].discont);
}
GST_END_TEST;

GST_START_TEST (test_one_pad_alone_may_be_linked)
{
  TestCameras cameras;
  const std::string launch =
      "stereocamsrc trigger=software num-buffers=5 left=" + camera_address (0) +
      " right=" + camera_address (1) + " name=c c.right ! fakesink async=false";
  GstElement *pipeline = gst_parse_launch (launch.c_str (), nullptr);
  play_to_the_end (pipeline);
  gst_object_unref (pipeline);
}
GST_END_TEST;

GST_START_TEST (test_downstream_that_refuses_is_one_error_and_eos)
{
  TestCameras cameras;
  const std::string launch = "stereocamsrc trigger=software left=" + camera_address (0) +
                             " right=" + camera_address (1) +
                             " name=c c.right ! identity error-after=3 ! fakesink async=false "
                             "c.left ! fakesink async=false";
  GstElement *pipeline = gst_parse_launch (launch.c_str (), nullptr);
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  GstBus *bus = gst_element_get_bus (pipeline);
  fail_if (next_message_text (bus, GST_MESSAGE_ERROR).empty ());
  gst_element_set_state (pipeline, GST_STATE_NULL);
  gst_object_unref (bus);
  gst_object_unref (pipeline);
}
GST_END_TEST;

/* ---- life ---- */

GST_START_TEST (test_runs_again_after_any_state_and_after_quick_changes)
{
  TestCameras cameras;
  CameraPipeline p ("trigger=software");
  for (GstState between : {GST_STATE_NULL, GST_STATE_READY, GST_STATE_PAUSED}) {
    p.forget ();
    p.play ();
    fail_unless (p.wait_for_pictures (0, 5) && p.wait_for_pictures (1, 5));
    gst_element_set_state (p.pipeline (), between);
  }
  for (int i = 0; i < 3; i++)
    for (GstState state : {GST_STATE_PLAYING, GST_STATE_READY, GST_STATE_PAUSED, GST_STATE_NULL}) {
      gst_element_set_state (p.pipeline (), state);
      g_usleep (g_random_int_range (0, 3000));
    }
  p.forget ();
  p.play ();
  fail_unless (p.wait_for_pictures (0, 3));
}
GST_END_TEST;

static GstClockTime
latency_now (CameraPipeline &p)
{
  GstQuery *query = gst_query_new_latency ();
  GstPad *pad = gst_element_get_static_pad (p.source (), "left");
  GstClockTime least = 0;
  gboolean live = FALSE;
  fail_unless (gst_pad_query (pad, query));
  gst_query_parse_latency (query, &live, &least, nullptr);
  fail_unless (live);
  gst_query_unref (query);
  gst_object_unref (pad);
  return least;
}

/* Sinks ask when the pipeline goes to PLAYING, which is before cameras have answered. */
GST_START_TEST (test_latency_is_exposure_and_a_period_also_before_the_cameras_answer)
{
  TestCameras cameras;
  CameraPipeline p ("trigger=software exposure=5000");
  fail_unless_equals_int (
      gst_element_set_state (p.pipeline (), GST_STATE_PAUSED), GST_STATE_CHANGE_NO_PREROLL);
  fail_unless_equals_uint64 (latency_now (p), 5 * GST_MSECOND + GST_SECOND / 30);
  p.play ();
  fail_unless (p.wait_for_pictures (0, 3));
  for (int i = 0; i < 2; i++) {
    const GstClockTime now = latency_now (p);
    /* Where images come late it is raised, by three eighths at least. */
    const GstClockTime expected = 5 * GST_MSECOND + kPeriod;
    fail_unless (now == expected || now > expected * 11 / 8, "%" G_GUINT64_FORMAT, now);
    ck_assert_uint_ne (now, 5 * GST_MSECOND + GST_SECOND / 30); /* of before the cameras answered */
    gst_element_set_state (p.pipeline (), GST_STATE_READY);
    gst_element_set_state (p.pipeline (), GST_STATE_PAUSED); /* then it is as it was */
  }
}
GST_END_TEST;

GST_START_TEST (test_no_picture_is_taken_while_paused)
{
  TestCameras cameras;
  CameraPipeline p ("trigger=software");
  p.play ();
  fail_unless (p.wait_for_pictures (0, 5));
  gst_element_set_state (p.pipeline (), GST_STATE_PAUSED);
  std::uint64_t taken = cameras.list[0]->pictures (), before = 0;
  for (int i = 0; i < 100 && before != taken; i++, taken = cameras.list[0]->pictures ()) {
    before = taken; /* until ten periods pass without one */
    g_usleep (200000);
  }
  fail_unless_equals_uint64 (before, taken);
}
GST_END_TEST;

GST_START_TEST (test_eos_event_ends_all_pads_also_before_cameras_answer)
{
  {
    /* Nobody answers there. It may try to open them even after its end. */
    CameraPipeline p (
        "trigger=software left=" + camera_address (6) + " right=" + camera_address (7), 2,
        "video/x-raw", false);
    p.play ();
    fail_unless (gst_element_send_event (p.source (), gst_event_new_eos ()));
    p.wait_for_eos ();
  }
  TestCameras cameras;
  CameraPipeline p ("trigger=software");
  p.play ();
  fail_unless (p.wait_for_pictures (0, 5));
  fail_unless (gst_element_send_event (p.source (), gst_event_new_eos ()));
  p.wait_for_eos ();
}
GST_END_TEST;

GST_START_TEST (test_downstream_may_want_another_size_mid_stream)
{
  TestCameras cameras;
  CameraPipeline p ("trigger=software");
  p.play ();
  fail_unless (p.wait_for_pictures (0, 5));
  for (int side = 0; side < 2; side++)
    gst_util_set_object_arg (G_OBJECT (p.filter (side).get ()), "caps",
        "video/x-raw,format=GRAY8,width=32,framerate=50/1");
  GstPad *pad = gst_element_get_static_pad (p.source (), "right");
  int width = 0;
  for (int i = 0; i < 1000 && width != 32; i++, g_usleep (10000))
    if (GstCaps *caps = gst_pad_get_current_caps (pad)) {
      gst_structure_get_int (gst_caps_get_structure (caps, 0), "width", &width);
      gst_caps_unref (caps);
    }
  fail_unless_equals_int (width, 32);
  gst_object_unref (pad);
  p.forget ();
  fail_unless (p.wait_for_pictures (0, 10) && p.wait_for_pictures (1, 10));
}
GST_END_TEST;

static Suite *
stereocamsrc_suite ()
{
  Suite *suite = suite_create ("stereocamsrc");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_software_pairs_share_pts_and_capture_time_on_ticks);
  tcase_add_test (tc, test_third_pad_is_there_only_while_its_camera_is_named);
  tcase_add_test (tc, test_pixels_are_not_copied);
  tcase_add_test (tc, test_downstream_chooses_format_size_and_rate);
  tcase_add_test (tc, test_caps_that_no_camera_has_are_one_error_that_names_the_pad);
  tcase_add_test (tc, test_format_that_is_not_there_is_one_error_that_lists_the_cameras);
  tcase_add_test (tc, test_cameras_are_named_by_properties_or_a_rig_file);
  tcase_add_test (tc, test_blocked_branch_does_not_hold_up_the_other);
  tcase_add_test (tc, test_pad_goes_on_after_its_downstream_was_in_ready);
  tcase_add_test (tc, test_one_pad_alone_may_be_linked);
  tcase_add_test (tc, test_downstream_that_refuses_is_one_error_and_eos);
  tcase_add_test (tc, test_runs_again_after_any_state_and_after_quick_changes);
  tcase_add_test (tc, test_latency_is_exposure_and_a_period_also_before_the_cameras_answer);
  tcase_add_test (tc, test_no_picture_is_taken_while_paused);
  tcase_add_test (tc, test_eos_event_ends_all_pads_also_before_cameras_answer);
  tcase_add_test (tc, test_downstream_may_want_another_size_mid_stream);
  return suite;
}

GST_CHECK_MAIN (stereocamsrc);
