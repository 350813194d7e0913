/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* rangerender, and that decodebin, playbin and playbin3 find it. */
#include "render-check.hpp"

#include <glib/gstdio.h>
#include <gst/app/gstappsink.h>
#include <gst/gl/gl.h>
#include <gst/video/video.h>

using namespace rangecast;
using namespace rangecast::testing;

/* A recording of 8 frame sets of two views, 10 a second, in the folder for temporary files. */
struct Recording {
  std::string path;

  Recording ()
  {
    gchar *name = nullptr;
    const gint file = g_file_open_tmp ("rangecast-XXXXXX.rcnc", &name, nullptr);
    ck_assert_int_ge (file, 0);
    g_close (file, nullptr);
    path = name;
    g_free (name);
    const std::string launch =
        "avatartestsrc views=2 num-buffers=8 range-person-only=true ! "
        "video/x-range,width=160,height=120,framerate=10/1 ! neighbourcodeenc "
        "! filesink location=" +
        path;
    GstElement *pipeline = gst_parse_launch (launch.c_str (), nullptr);
    play_to_the_end (pipeline);
    gst_object_unref (pipeline);
  }
  ~Recording () { g_unlink (path.c_str ()); }
  Recording (const Recording &) = delete;
  Recording &operator= (const Recording &) = delete;

  [[nodiscard]] std::string uri () const { return "file://" + path; }
};

/* Share of the picture's pixels that are not as their row's first one, which is the background:
 * what is shown is centred, and the background changes from row to row. */
static double
drawn_share (GstSample *sample)
{
  GstVideoInfo info;
  fail_unless (gst_video_info_from_caps (&info, gst_sample_get_caps (sample)));
  GstVideoFrame frame;
  fail_unless (gst_video_frame_map (&frame, &info, gst_sample_get_buffer (sample), GST_MAP_READ));
  int drawn = 0;
  for (int y = 0; y < info.height; y++) {
    auto pixel = static_cast<const guint8 *> (GST_VIDEO_FRAME_PLANE_DATA (&frame, 0)) +
                 y * GST_VIDEO_FRAME_PLANE_STRIDE (&frame, 0);
    const guint8 *first = pixel;
    for (int x = 0; x < info.width; x++, pixel += 4)
      drawn += std::abs (pixel[0] - first[0]) > 4 || std::abs (pixel[1] - first[1]) > 4;
  }
  gst_video_frame_unmap (&frame);
  return drawn / double (info.width * info.height);
}

/* Plays to the end and counts the pictures in the appsink, each of which must show somebody.
 * playbin3 adds its sink only when the stream is known. */
static int
count_pictures (GstElement *pipeline, GstElement *appsink)
{
  gst_element_set_state (pipeline, GST_STATE_PAUSED);
  fail_unless_equals_int (gst_element_get_state (pipeline, nullptr, nullptr, 20 * GST_SECOND),
      GST_STATE_CHANGE_SUCCESS);
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  int pictures = 0;
  while (
      GstSample *sample = gst_app_sink_try_pull_sample (GST_APP_SINK (appsink), 20 * GST_SECOND)) {
    const double share = drawn_share (sample);
    fail_unless (share > 0.1 && share < 0.9, "picture %d: %f", pictures, share);
    gst_sample_unref (sample);
    pictures++;
  }
  fail_unless (gst_app_sink_is_eos (GST_APP_SINK (appsink)));
  gst_element_set_state (pipeline, GST_STATE_NULL);
  return pictures;
}

GST_START_TEST (test_draws_into_system_memory_of_the_size_asked_for)
{
  const Rig rig = ring_rig (2);
  GstHarness *h = gst_harness_new ("rangerender");
  gst_harness_set_sink_caps_str (h, "video/x-raw,format=RGBA,width=200,height=150");
  gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (rig, 30, 1)));
  GstBuffer *output = gst_harness_push_and_pull (h, make_frame_set (rig, 5));
  fail_unless_equals_int (gst_buffer_get_size (output), 200 * 150 * 4);
  fail_unless_equals_uint64 (GST_BUFFER_PTS (output), 5);
  fail_unless_equals_uint64 (gst_range_buffer_get_capture_time (output), 5);
  gst_buffer_unref (output);
  gst_harness_teardown (h);
}
GST_END_TEST;

/* Where there is a choice, llvmpipe is none. */
GST_START_TEST (test_picture_is_opengls_where_that_is_asked_for)
{
  SKIP_WITHOUT_OPENGL ();
  const Rig rig = ring_rig (1);
  for (const bool choice : {false, true}) {
    GstHarness *h = gst_harness_new ("rangerender");
    gst_harness_set_sink_caps_str (h, choice ? "video/x-raw(memory:GLMemory); video/x-raw"
                                             : "video/x-raw(memory:GLMemory),format=RGBA");
    gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (rig, 30, 1)));
    GstBuffer *output = gst_harness_push_and_pull (h, make_frame_set (rig));
    const bool by_gl = gst_is_gl_memory (gst_buffer_peek_memory (output, 0));
    fail_unless (by_gl || choice);
    if (choice && g_getenv ("LIBGL_ALWAYS_SOFTWARE"))
      fail_if (by_gl);
    gst_buffer_unref (output);
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

GST_START_TEST (test_decodebin_shows_a_recording_as_pictures)
{
  const Recording recording;
  const std::string launch = "filesrc location=" + recording.path +
                             " ! decodebin ! video/x-raw,format=RGBA ! appsink name=s sync=false";
  GstElement *pipeline = gst_parse_launch (launch.c_str (), nullptr);
  GstElement *sink = gst_bin_get_by_name (GST_BIN (pipeline), "s");
  fail_unless_equals_int (count_pictures (pipeline, sink), 8);
  gst_object_unref (sink);
  gst_object_unref (pipeline);
}
GST_END_TEST;

/* A coded frame set, and its caps. */
static GstBuffer *
code (const Rig &rig, GstCaps **caps)
{
  GstHarness *h = gst_harness_new ("neighbourcodeenc");
  gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (rig, 30, 1)));
  GstBuffer *coded = gst_harness_push_and_pull (h, make_frame_set (rig));
  *caps = gst_pad_get_current_caps (h->sinkpad);
  gst_harness_teardown (h);
  return coded;
}

GST_START_TEST (test_input_changes_between_coded_and_raw)
{
  const Rig rig = ring_rig (2);
  GstCaps *caps = nullptr;
  GstBuffer *coded = code (rig, &caps);
  GstHarness *h = gst_harness_new ("rangerender");
  gst_harness_set_sink_caps_str (h, "video/x-raw,format=RGBA,width=200,height=150");
  for (int i = 0; i < 2; i++) {
    gst_harness_set_src_caps (h, gst_caps_ref (caps));
    gst_buffer_unref (gst_harness_push_and_pull (h, gst_buffer_copy (coded)));
    GstElement *decoder = gst_bin_get_by_name (GST_BIN (h->element), "decoder");
    fail_unless (decoder != nullptr);
    gst_object_unref (decoder);
    gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (rig, 30, 1)));
    gst_buffer_unref (gst_harness_push_and_pull (h, make_frame_set (rig)));
    fail_unless (gst_bin_get_by_name (GST_BIN (h->element), "decoder") == nullptr);
  }
  gst_buffer_unref (coded);
  gst_caps_unref (caps);
  gst_harness_teardown (h);
}
GST_END_TEST;

/* The sink takes nothing but system memory, and says so before anything is decoded: playbin then
 * looks for decoders whose output it takes. */
static const char *const kPlayers[] = {"playbin", "playbin3"};

GST_START_TEST (test_players_show_a_recording_to_a_sink_of_plain_video)
{
  const Recording recording;
  GstElement *playbin = gst_element_factory_make (kPlayers[__i__], nullptr);
  GstElement *sink = gst_element_factory_make ("appsink", nullptr);
  GstCaps *caps = gst_caps_from_string ("video/x-raw,format=RGBA");
  g_object_set (sink, "caps", caps, "sync", FALSE, nullptr);
  gst_caps_unref (caps);
  g_object_set (playbin, "uri", recording.uri ().c_str (), "video-sink", sink, nullptr);
  for (int i = 0; i < 2; i++)
    fail_unless_equals_int (count_pictures (playbin, sink), 8);
  gst_object_unref (playbin);
}
GST_END_TEST;

GST_START_TEST (test_players_seek_to_the_frame_set_at_a_time)
{
  const Recording recording;
  GstElement *playbin = gst_element_factory_make (kPlayers[__i__], nullptr);
  GstElement *sink = gst_element_factory_make ("appsink", nullptr);
  g_object_set (playbin, "uri", recording.uri ().c_str (), "video-sink", sink, nullptr);
  gst_element_set_state (playbin, GST_STATE_PAUSED);
  fail_unless_equals_int (
      gst_element_get_state (playbin, nullptr, nullptr, 20 * GST_SECOND), GST_STATE_CHANGE_SUCCESS);
  gint64 duration = 0;
  fail_unless (gst_element_query_duration (playbin, GST_FORMAT_TIME, &duration));
  ck_assert_int_lt (std::abs (duration - gint64 (800 * GST_MSECOND)), gint64 (GST_MSECOND));
  fail_unless (gst_element_seek_simple (playbin, GST_FORMAT_TIME,
      GstSeekFlags (GST_SEEK_FLAG_FLUSH | GST_SEEK_FLAG_ACCURATE), 500 * GST_MSECOND));
  GstSample *sample = gst_app_sink_try_pull_preroll (GST_APP_SINK (sink), 20 * GST_SECOND);
  fail_unless (sample != nullptr);
  fail_unless_equals_uint64 (GST_BUFFER_PTS (gst_sample_get_buffer (sample)), 500 * GST_MSECOND);
  gst_sample_unref (sample);
  gst_element_set_state (playbin, GST_STATE_NULL);
  gst_object_unref (playbin);
}
GST_END_TEST;

/* By rangealign's error, which names the field. */
GST_START_TEST (test_caps_without_a_size_are_named)
{
  GstHarness *h = gst_harness_new ("rangerender");
  GstBus *bus = gst_bus_new ();
  GstElement *align = gst_bin_get_by_name (GST_BIN (h->element), "align");
  gst_element_set_bus (align, bus);
  GstCaps *caps = gst_caps_new_empty_simple ("video/x-range");
  gst_harness_push_event (h, gst_event_new_stream_start ("a"));
  gst_harness_push_event (h, gst_event_new_caps (caps));
  gst_caps_unref (caps);
  const std::string found = next_message_text (bus, GST_MESSAGE_ERROR);
  fail_unless (found.find ("width") != std::string::npos, "'%s'", found.c_str ());
  gst_element_set_bus (align, nullptr);
  gst_object_unref (align);
  gst_object_unref (bus);
  gst_harness_teardown (h);
}
GST_END_TEST;

static Suite *
rangerender_suite ()
{
  Suite *suite = suite_create ("rangerender");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_caps_without_a_size_are_named);
  tcase_add_test (tc, test_draws_into_system_memory_of_the_size_asked_for);
  tcase_add_test (tc, test_picture_is_opengls_where_that_is_asked_for);
  tcase_add_test (tc, test_decodebin_shows_a_recording_as_pictures);
  tcase_add_test (tc, test_input_changes_between_coded_and_raw);
  tcase_add_loop_test (tc, test_players_show_a_recording_to_a_sink_of_plain_video, 0, 2);
  tcase_add_loop_test (tc, test_players_seek_to_the_frame_set_at_a_time, 0, 2);
  return suite;
}

GST_CHECK_MAIN (rangerender);
