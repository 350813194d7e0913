/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "rangecast-check.hpp"

#include <glib/gstdio.h>

using namespace rangecast;
using namespace rangecast::testing;

static GstHarness *
source_harness (const char *pad, const char *caps)
{
  GstHarness *h = gst_harness_new_with_padnames ("avatartestsrc", nullptr, pad);
  gst_harness_set_sink_caps_str (h, caps);
  return h;
}

GST_START_TEST (test_frames_follow_the_frame_rate_and_carry_capture_time)
{
  GstHarness *h =
      source_harness ("left", "video/x-raw,format=RGB,width=64,height=48,framerate=10/1");
  g_object_set (h->element, "num-buffers", 3, nullptr);
  gst_harness_play (h);
  for (guint64 i = 0; i < 3; i++) {
    GstBuffer *buffer = gst_harness_pull (h);
    fail_unless (buffer != nullptr);
    fail_unless_equals_uint64 (GST_BUFFER_PTS (buffer), i * 100 * GST_MSECOND);
    fail_unless_equals_uint64 (GST_BUFFER_DURATION (buffer), 100 * GST_MSECOND);
    fail_unless_equals_uint64 (gst_range_buffer_get_capture_time (buffer), GST_BUFFER_PTS (buffer));
    gst_buffer_unref (buffer);
  }
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_all_views_come_in_one_frame_set)
{
  GstHarness *h = source_harness ("src", "video/x-range,width=64,height=48");
  g_object_set (h->element, "num-buffers", 1, "views", 3, nullptr);
  gst_harness_play (h);
  GstBuffer *buffer = gst_harness_pull (h);
  fail_unless_equals_int (gst_buffer_n_range_metas (buffer), 3);
  GstCaps *caps = gst_pad_get_current_caps (h->sinkpad);
  gstrange::RangeInfo info;
  fail_unless (gstrange::parse_caps (caps, info).ok ());
  fail_unless_equals_int (info.views (), 3);
  fail_unless_equals_int (info.width, 64);
  gst_caps_unref (caps);
  gst_buffer_unref (buffer);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_person_only_crops_and_empty_frames_have_nobody)
{
  GstHarness *h = source_harness ("src", "video/x-range,width=160,height=120");
  g_object_set (h->element, "num-buffers", 2, "view-id", 2, "range-person-only", TRUE,
      "empty-frames", 1, nullptr);
  gst_harness_play (h);
  GstBuffer *empty = gst_harness_pull (h), *person = gst_harness_pull (h);
  fail_unless_equals_int (gst_buffer_get_range_meta (empty, 2)->width, 0);
  const GstRangeMeta *meta = gst_buffer_get_range_meta (person, 2);
  fail_unless (meta->width > 40 && meta->width < 140);
  gst_buffer_unref (empty);
  gst_buffer_unref (person);
  gst_harness_teardown (h);
}
GST_END_TEST;

/* Runs a launch line to its end. */
static std::string
run (const char *line)
{
  GstElement *pipeline = gst_parse_launch (line, nullptr);
  fail_unless (pipeline != nullptr);
  GstBus *bus = gst_element_get_bus (pipeline);
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  GstMessage *message = gst_bus_timed_pop_filtered (
      bus, 20 * GST_SECOND, GstMessageType (GST_MESSAGE_EOS | GST_MESSAGE_ERROR));
  fail_unless (message != nullptr);
  std::string text;
  if (GST_MESSAGE_TYPE (message) == GST_MESSAGE_ERROR) {
    GError *error = nullptr;
    gst_message_parse_error (message, &error, nullptr);
    text = error->message;
    g_error_free (error);
  }
  gst_message_unref (message);
  gst_element_set_state (pipeline, GST_STATE_NULL);
  gst_object_unref (bus);
  gst_object_unref (pipeline);
  return text;
}

GST_START_TEST (test_bad_view_and_model_are_named)
{
  fail_unless (run ("avatartestsrc view-id=9 ! fakesink").find ("view-id") != std::string::npos);
  fail_unless (run ("avatartestsrc location=/no/head.glb ! fakesink").find ("/no/head.glb") !=
               std::string::npos);
}
GST_END_TEST;

GST_START_TEST (test_left_and_right_end_together_in_their_own_formats)
{
  fail_unless (run ("avatartestsrc name=s num-buffers=4 "
                    "s.left ! video/x-raw,format=GRAY8,width=50,height=40 ! queue ! fakesink "
                    "s.right ! video/x-raw,format=BGRx ! queue ! fakesink "
                    "s.src ! queue ! fakesink")
                   .empty ());
}
GST_END_TEST;

GST_START_TEST (test_sizes_that_do_not_agree_are_an_error)
{
  fail_if (run ("avatartestsrc name=s s.left ! video/x-raw,width=50 ! queue ! fakesink "
                "s.right ! video/x-raw,width=60 ! queue ! fakesink")
               .empty ());
}
GST_END_TEST;

GST_START_TEST (test_state_changes_can_be_repeated)
{
  for (const char *line : {"avatartestsrc ! video/x-range,width=64,height=48 ! fakesink sync=true",
           "avatartestsrc is-live=true ! video/x-range,width=64,height=48 ! fakesink sync=true"}) {
    GstElement *pipeline = gst_parse_launch (line, nullptr);
    for (int i = 0; i < 2; i++)
      for (GstState state : {GST_STATE_PAUSED, GST_STATE_PLAYING, GST_STATE_PAUSED, GST_STATE_READY,
               GST_STATE_PLAYING, GST_STATE_NULL}) {
        fail_if (gst_element_set_state (pipeline, state) == GST_STATE_CHANGE_FAILURE);
        fail_if (gst_element_get_state (pipeline, nullptr, nullptr, 10 * GST_SECOND) ==
                 GST_STATE_CHANGE_FAILURE);
      }
    gst_object_unref (pipeline);
  }
}
GST_END_TEST;

GST_START_TEST (test_live_frames_lie_on_multiples_of_the_frame_period)
{
  GstHarness *h =
      source_harness ("left", "video/x-raw,format=RGBx,width=64,height=48,framerate=20/1");
  g_object_set (h->element, "is-live", TRUE, "num-buffers", 2, nullptr);
  gst_harness_use_systemclock (h);
  gst_harness_play (h);
  for (int i = 0; i < 2; i++) {
    GstBuffer *buffer = gst_harness_pull (h);
    fail_unless (buffer != nullptr);
    fail_unless_equals_uint64 (gst_range_buffer_get_capture_time (buffer) % (50 * GST_MSECOND), 0);
    gst_buffer_unref (buffer);
  }
  fail_unless_equals_uint64 (gst_harness_query_latency (h), 50 * GST_MSECOND);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_rig_is_exported_with_the_size_of_the_caps)
{
  gchar *path = g_build_filename (g_get_tmp_dir (), "rangecast-avatar-rig.yaml", nullptr);
  gchar *line = g_strdup_printf (
      "avatartestsrc num-buffers=1 rig-export=%s ! video/x-range,width=64,height=48 ! fakesink",
      path);
  fail_unless (run (line).empty ());
  Rig rig;
  fail_unless (load_rig (path, rig).ok ());
  fail_unless_equals_int (static_cast<int> (rig.views.size ()), 4);
  fail_unless_equals_int (rig.views[0].width, 64);
  fail_unless (rig.views[0].right.has_value ());
  g_remove (path);
  g_free (line);
  g_free (path);
}
GST_END_TEST;

GST_START_TEST (test_caps_change_mid_stream_changes_the_size)
{
  GstHarness *h =
      source_harness ("left", "video/x-raw,format=RGBx,width=64,height=48,framerate=20/1");
  gst_harness_play (h);
  gst_buffer_unref (gst_harness_pull (h));
  gst_harness_set_sink_caps_str (h, "video/x-raw,format=RGBx,width=32,height=24,framerate=20/1");
  gsize size = 0;
  GstClockTime last = 0;
  for (int i = 0; i < 1000 && size != 32 * 24 * 4; i++) {
    GstBuffer *buffer = gst_harness_pull (h);
    fail_unless (buffer && (i == 0 || GST_BUFFER_PTS (buffer) > last));
    size = gst_buffer_get_size (buffer);
    last = GST_BUFFER_PTS (buffer);
    gst_buffer_unref (buffer);
  }
  fail_unless_equals_int (static_cast<int> (size), 32 * 24 * 4);
  gst_harness_teardown (h);
}
GST_END_TEST;

static Suite *
avatartestsrc_suite ()
{
  Suite *suite = suite_create ("avatartestsrc");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_frames_follow_the_frame_rate_and_carry_capture_time);
  tcase_add_test (tc, test_all_views_come_in_one_frame_set);
  tcase_add_test (tc, test_person_only_crops_and_empty_frames_have_nobody);
  tcase_add_test (tc, test_bad_view_and_model_are_named);
  tcase_add_test (tc, test_left_and_right_end_together_in_their_own_formats);
  tcase_add_test (tc, test_sizes_that_do_not_agree_are_an_error);
  tcase_add_test (tc, test_state_changes_can_be_repeated);
  tcase_add_test (tc, test_live_frames_lie_on_multiples_of_the_frame_period);
  tcase_add_test (tc, test_rig_is_exported_with_the_size_of_the_caps);
  tcase_add_test (tc, test_caps_change_mid_stream_changes_the_size);
  return suite;
}

GST_CHECK_MAIN (avatartestsrc);
