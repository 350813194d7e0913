/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include <rangecast/scene/scene.hpp> // before check's macro fail(), which <memory> does not survive

#include "../rangecast-check.hpp"

#include <glib/gstdio.h>
#include <gst/video/video.h>

#include <rangecast/rigfile/rig_file.hpp>

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
      source_harness ("left", "video/x-raw,format=RGBx,width=64,height=48,framerate=10/1");
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
  fail_unless_ok (gstrange::parse_caps (caps, info));
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
  ck_assert_int_gt (meta->width, 40);
  ck_assert_int_lt (meta->width, 140);
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
  fail_unless_contains (run ("avatartestsrc view-id=9 ! fakesink"), "view-id");
  fail_unless_contains (run ("avatartestsrc location=/no/head.glb ! fakesink"), "/no/head.glb");
  const std::string path = std::string (g_get_tmp_dir ()) + "/rangecast-no-model.glb";
  fail_unless (g_file_set_contents (path.c_str (), "no model", -1, nullptr));
  fail_unless_contains (run (("avatartestsrc location=" + path + " ! fakesink").c_str ()), path);
  g_remove (path.c_str ());
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
        ck_assert_int_ne (gst_element_set_state (pipeline, state), GST_STATE_CHANGE_FAILURE);
        ck_assert_int_ne (gst_element_get_state (pipeline, nullptr, nullptr, 10 * GST_SECOND),
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
  fail_unless_ok (load_rig (path, rig));
  fail_unless_equals_int (static_cast<int> (rig.views.size ()), 4);
  fail_unless_equals_int (rig.views[0].width, 64);
  fail_unless (rig.views[0].right.has_value ());
  g_remove (path);
  g_free (line);
  g_free (path);
}
GST_END_TEST;

/* ---- the same picture everywhere ---- */

/* The n-th picture (from 0) of a source with that frame rate and seed. */
static GstBuffer *
nth_picture (int n, int frames_per_second, guint seed)
{
  gchar *caps = g_strdup_printf (
      "video/x-raw,format=RGBx,width=64,height=48,framerate=%d/1", frames_per_second);
  GstHarness *h = source_harness ("left", caps);
  g_free (caps);
  g_object_set (h->element, "num-buffers", n + 1, "seed", seed, nullptr);
  gst_harness_play (h);
  GstBuffer *buffer = gst_harness_pull (h);
  for (int i = 0; i < n; i++) {
    gst_buffer_unref (buffer);
    buffer = gst_harness_pull (h);
  }
  gst_harness_teardown (h);
  return buffer;
}

static std::string
bytes_of (GstBuffer *buffer)
{
  std::string bytes (gst_buffer_get_size (buffer), 0);
  gst_buffer_extract (buffer, 0, bytes.data (), bytes.size ());
  return bytes;
}

static std::string
take_bytes (GstBuffer *buffer)
{
  std::string bytes = bytes_of (buffer);
  gst_buffer_unref (buffer);
  return bytes;
}

GST_START_TEST (test_loop_goes_forwards_and_backwards_through_the_first_pictures)
{
  GstHarness *h =
      source_harness ("left", "video/x-raw,format=RGBx,width=64,height=48,framerate=10/1");
  g_object_set (
      h->element, "num-buffers", 9, "seed", 7, "loop-frames", 3, "empty-frames", 2, nullptr);
  gst_harness_play (h);
  std::string shown[9], drawn[3];
  for (std::string &picture : shown)
    picture = take_bytes (gst_harness_pull (h));
  gst_harness_teardown (h);
  for (int i = 0; i < 3; i++)
    drawn[i] = take_bytes (nth_picture (i, 10, 7));
  fail_if (shown[0] == shown[1] || shown[0] == drawn[0], "the empty room is not looped");
  const int expected[] = {0, 1, 2, 1, 0, 1, 2, 1, 0};
  for (int i = 2; i < 9; i++)
    fail_unless (shown[i] == drawn[expected[i]], "picture %d is none of frame %d", i, expected[i]);
}
GST_END_TEST;

GST_START_TEST (test_loop_that_needs_too_much_memory_is_an_error_that_names_it)
{
  fail_unless_contains (run ("avatartestsrc name=s loop-frames=5000000 s.left ! "
                             "video/x-raw,width=64,height=48 ! fakesink"),
      "loop-frames 5000000");
}
GST_END_TEST;

GST_START_TEST (test_each_camera_pad_gives_its_own_cameras_picture)
{
  SceneSettings settings;
  settings.width = 64;
  settings.height = 48;
  std::unique_ptr<Scene> scene;
  fail_unless_ok (Scene::create (settings, scene));
  const char *pads[] = {"left", "right", "third"};
  for (int i = 0; i < 3; i++) {
    GstHarness *h = source_harness (pads[i], "video/x-raw,format=RGBx,width=64,height=48");
    g_object_set (h->element, "num-buffers", 1, nullptr);
    gst_harness_play (h);
    std::string expected (64 * 48 * 4, 0);
    const ImageView<Rgbx> view{reinterpret_cast<Rgbx *> (expected.data ()), 64, 48, 64 * 4};
    fail_unless_ok (scene->render (0, static_cast<SceneCamera> (i), 0, false, view, {}, {}));
    fail_unless (take_bytes (gst_harness_pull (h)) == expected, "%s", pads[i]);
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

GST_START_TEST (test_capsfilters_change_changes_all_pads_at_one_frame)
{
  GstElement *pipeline =
      gst_parse_launch ("avatartestsrc name=s num-buffers=400 s.left ! capsfilter name=f "
                        "caps=video/x-raw,format=RGBx,width=64,height=48 ! queue "
                        "max-size-buffers=2 ! appsink name=a max-buffers=1 sync=false "
                        "s.right ! video/x-raw,format=RGBx ! queue ! appsink name=b sync=false",
          nullptr);
  fail_unless (pipeline != nullptr);
  GstElement *filter = gst_bin_get_by_name (GST_BIN (pipeline), "f");
  GstElement *sinks[] = {
      gst_bin_get_by_name (GST_BIN (pipeline), "a"), gst_bin_get_by_name (GST_BIN (pipeline), "b")};
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  GstClockTime changed[2] = {GST_CLOCK_TIME_NONE, GST_CLOCK_TIME_NONE};
  for (int i = 0; i < 400 && (i < 3 || changed[0] == GST_CLOCK_TIME_NONE); i++) {
    if (i == 2) {
      GstCaps *caps = gst_caps_from_string ("video/x-raw,format=RGBx,width=32,height=24");
      g_object_set (filter, "caps", caps, nullptr);
      gst_caps_unref (caps);
    }
    for (int k = 0; k < 2; k++) {
      GstSample *sample = nullptr;
      g_signal_emit_by_name (sinks[k], "pull-sample", &sample);
      fail_unless (sample != nullptr, "ended without the new size");
      GstBuffer *buffer = gst_sample_get_buffer (sample);
      if (gst_buffer_get_size (buffer) == 32 * 24 * 4)
        changed[k] = MIN (changed[k], GST_BUFFER_PTS (buffer));
      gst_sample_unref (sample);
    }
  }
  ck_assert_uint_ne (changed[0], GST_CLOCK_TIME_NONE);
  fail_unless_equals_uint64 (changed[0], changed[1]);
  gst_element_set_state (pipeline, GST_STATE_NULL);
  for (GstElement *element : {filter, sinks[0], sinks[1], pipeline})
    gst_object_unref (element);
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
  tcase_add_test (tc, test_sizes_that_do_not_agree_are_an_error);
  tcase_add_test (tc, test_state_changes_can_be_repeated);
  tcase_add_test (tc, test_live_frames_lie_on_multiples_of_the_frame_period);
  tcase_add_test (tc, test_rig_is_exported_with_the_size_of_the_caps);
  tcase_add_test (tc, test_loop_goes_forwards_and_backwards_through_the_first_pictures);
  tcase_add_test (tc, test_loop_that_needs_too_much_memory_is_an_error_that_names_it);
  tcase_add_test (tc, test_each_camera_pad_gives_its_own_cameras_picture);
  tcase_add_test (tc, test_capsfilters_change_changes_all_pads_at_one_frame);
  return suite;
}

GST_CHECK_MAIN (avatartestsrc);
