/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../../lib/board-renderer.hpp"
#include "../rangecast-check.hpp"

#include <glib/gstdio.h>
#include <gst/video/video.h>

#include <map>

#include <rangecast/rigfile/rig_file.hpp>
#include <vector>

using namespace rangecast;
using namespace rangecast::testing;

static constexpr int kWidth = 320, kHeight = 240;
static constexpr const char *kCaps = "video/x-raw,format=GRAY8,width=320,height=240,framerate=1/1";

/* Cameras 0.1 m apart, of which boards are rendered. */
static TrueCamera
true_camera (int number)
{
  TrueCamera t;
  t.camera = {"", 0, CameraRole::kLeft, kWidth, kHeight};
  t.lens = {300. + number, 301, 160, 118, -0.1, 0.05};
  t.world_from_camera.translation.x = 0.1 * number;
  return t;
}

static std::string
temporary_rig ()
{
  return std::string (g_get_tmp_dir ()) + "/rigcalibrate-" + std::to_string (getpid ()) + ".yaml";
}

/* A rigcalibrate with sink pads that are fed by hand; the first two are a stereo pair. */
struct Calibrate {
  GstElement *element;
  GstHarness *out = nullptr;
  std::vector<GstHarness *> in;
  GstBus *bus = gst_bus_new ();
  std::mt19937 random{11};
  std::vector<TrueCamera> cameras;
  std::vector<BoardRenderer> renderers;

  explicit Calibrate (int pads, const std::string &properties = "", const char *caps = kCaps)
  {
    element = gst_parse_launch (("rigcalibrate " + properties).c_str (), nullptr);
    gst_element_set_bus (element, bus);
    for (int i = 0; i < pads; i++) {
      in.push_back (gst_harness_new_with_element (element, "sink_%u", i == 0 ? "src" : nullptr));
      gst_harness_set_live (in[i], FALSE);
      cameras.push_back (true_camera (i));
      renderers.emplace_back (cameras[i], BoardSpec{});
    }
    out = in[0];
    if (pads > 1)
      gst_child_proxy_set (GST_CHILD_PROXY (element), "sink_1::view", 0, nullptr);
    if (pads > 1)
      gst_util_set_object_arg (child (1), "role", "right");
    for (GstHarness *h : in)
      gst_harness_set_src_caps_str (h, caps);
  }
  ~Calibrate ()
  {
    gst_element_set_bus (element, nullptr);
    gst_object_unref (bus);
    for (GstHarness *h : in)
      gst_harness_teardown (h);
    gst_object_unref (element);
    g_unlink (temporary_rig ().c_str ());
  }
  GObject *child (int pad)
  {
    GObject *found = gst_child_proxy_get_child_by_index (GST_CHILD_PROXY (element), guint (pad));
    g_object_unref (found); /* the element keeps it */
    return found;
  }
  GstFlowReturn push_picture (int pad, GstClockTime pts, std::vector<std::uint8_t> pixels)
  {
    GstBuffer *buffer = gst_buffer_new_memdup (pixels.data (), pixels.size ());
    GST_BUFFER_PTS (buffer) = pts;
    GST_BUFFER_DURATION (buffer) = GST_SECOND;
    return gst_harness_push (in[pad], buffer);
  }
  void push_grey (int pad, GstClockTime pts)
  {
    push_picture (pad, pts, std::vector<std::uint8_t> (kWidth * kHeight, 128));
  }
  /* Boards at a place that all cameras see: `count` moments, a second each. */
  void push_boards (int count, int first = 0)
  {
    for (int i = first; i < first + count; i++) {
      Pose board;
      for (bool seen = false; !seen;) {
        std::uniform_real_distribution<double> distance (0.36, 0.5);
        board = random_board (cameras[0], {}, distance (random), 0.6, 35, random);
        seen = true;
        for (const TrueCamera &t : cameras)
          seen &=
              !project_board (t, t.world_from_camera.inverse () * board, {}, 0, random).empty ();
      }
      for (std::size_t c = 0; c < cameras.size (); c++)
        push_picture (int (c), i * GST_SECOND,
            renderers[c].render (cameras[c].world_from_camera.inverse () * board, 1, random));
    }
  }
  /* The board all over the picture of the only camera, until the element has enough. */
  GstFlowReturn show_everywhere ()
  {
    int moment = 0;
    GstFlowReturn flow = GST_FLOW_OK;
    const auto show = [&] (double x, double y, double z, double yaw, double pitch) {
      Pose pose =
          rotation_about ({0, 1, 0}, yaw * kDegree) * rotation_about ({1, 0, 0}, pitch * kDegree);
      pose.translation = {x, y, z};
      pose = pose * Pose{kIdentity3, -0.5 * BoardSpec{}.corner (53)};
      if (flow == GST_FLOW_OK)
        flow = push_picture (0, moment++ * GST_SECOND, renderers[0].render (pose, 1, random));
    };
    for (const double angle : {-30., 30.}) {
      show (0, 0, 0.4, angle, 0);
      show (0, 0, 0.4, 0, angle);
    }
    show (0, 0, 0.35, 10, 10);
    for (const double x : {-0.13, -0.05, 0.05, 0.13})
      for (const double y : {-0.11, 0., 0.11})
        show (x, y, 0.5, 5, -5);
    while (flow == GST_FLOW_OK && moment < 25)
      show (0, 0, 0.5, 0, 0);
    return flow;
  }
  /* After READY: the pads have forgotten what they knew. */
  void play_again ()
  {
    gst_element_set_state (element, GST_STATE_PLAYING);
    GstSegment segment;
    gst_segment_init (&segment, GST_FORMAT_TIME);
    for (GstHarness *h : in) {
      gst_harness_push_event (h, gst_event_new_stream_start ("again"));
      gst_harness_set_src_caps_str (h, kCaps);
      gst_harness_push_event (h, gst_event_new_segment (&segment));
    }
  }
  void end ()
  {
    for (GstHarness *h : in)
      gst_harness_push_event (h, gst_event_new_eos ());
  }
  /* The next element message of that name; ends the test after 90 s. Transfer full. */
  GstMessage *message (const char *name)
  {
    while (true) {
      GstMessage *found = gst_bus_timed_pop_filtered (
          bus, 90 * GST_SECOND, GstMessageType (GST_MESSAGE_ELEMENT | GST_MESSAGE_ERROR));
      fail_unless (found != nullptr, "no message %s", name);
      if (GST_MESSAGE_TYPE (found) == GST_MESSAGE_ERROR) {
        GError *error;
        gst_message_parse_error (found, &error, nullptr);
        fail ("error instead of %s: %s", name, error->message);
      }
      if (gst_message_has_name (found, name))
        return found;
      gst_message_unref (found);
    }
  }
  void expect_error (const char *text)
  {
    const std::string said = next_message_text (bus, GST_MESSAGE_ERROR, 90 * GST_SECOND);
    fail_unless (
        said.find (text) != std::string::npos, "expected '%s', got '%s'", text, said.c_str ());
    fail_unless (gst_bus_pop_filtered (bus, GST_MESSAGE_ERROR) == nullptr, "a second error");
  }
  /* Pads have queues: what was pushed may not have been looked at yet. */
  void wait_until_examined (guint64 moments)
  {
    for (int i = 0; i < 9000 && stat ("examined") < moments; i++)
      g_usleep (10000);
    fail_unless_equals_uint64 (stat ("examined"), moments);
  }
  guint64 stat (const char *field) { return stats_field (element, field); }
};

static double
number (const GstStructure *s, const char *field)
{
  double value = NAN;
  fail_unless (gst_structure_get_double (s, field, &value), field);
  return value;
}

/* One structure of an array field. */
static const GstStructure *
item (const GstStructure *s, const char *field, guint index)
{
  const GValue *array = gst_structure_get_value (s, field);
  fail_unless (array && index < gst_value_array_get_size (array), field);
  return gst_value_get_structure (gst_value_array_get_value (array, index));
}

GST_START_TEST (test_boards_in_two_cameras_become_a_rig_file_at_eos)
{
  const std::string location = temporary_rig ();
  Calibrate c (2, "location=" + location + " near=0.4 far=2");
  c.push_boards (12);
  c.end ();
  GstMessage *message = c.message ("rigcalibrate-result");
  const GstStructure *s = gst_message_get_structure (message);
  fail_unless_equals_string (gst_structure_get_string (s, "location"), location.c_str ());
  fail_unless_cmp (number (s, "rms"), <, 0.3);
  const GstStructure *camera = item (s, "cameras", 1);
  fail_unless_equals_string (gst_structure_get_string (camera, "pad"), "sink_1");
  fail_unless_equals_string (gst_structure_get_string (camera, "role"), "right");
  fail_unless_cmp (number (camera, "rms"), <, 0.3);
  fail_unless_cmp (number (camera, "alone-rms"), <, 0.3);
  const GstStructure *pair = item (s, "pairs", 0);
  fail_unless_cmp (std::abs (number (pair, "distance") - 0.1), <, 0.003);
  fail_unless_cmp (number (pair, "row-error"), >=, 0);
  fail_unless_cmp (number (pair, "row-error"), <, 0.5);
  guint frames = 0;
  fail_unless (gst_structure_get_uint (pair, "frames", &frames));
  fail_unless (frames >= 10, "%u", frames);

  Rig rig;
  fail_unless_ok (load_rig (location, rig));
  fail_unless_equals_int (rig.views.size (), 1);
  fail_unless (rig.views[0].right.has_value ());
  fail_unless_cmp (std::abs (rig.views[0].right->partner_from_left.translation.x + 0.1), <, 0.003);
  fail_unless_cmp (std::abs (rig.views[0].intrinsics.fx - 300), <, 10);
  fail_unless_cmp (rig.views[0].near_m, ==, 0.4);
  fail_unless_cmp (rig.views[0].far_m, ==, 2);
  GstBuffer *blob = nullptr;
  fail_unless (gst_structure_get (s, "rig", GST_TYPE_BUFFER, &blob, nullptr));
  GstMapInfo map;
  gst_buffer_map (blob, &map, GST_MAP_READ);
  Rig posted;
  fail_unless_ok (decode_rig ({map.data, map.size}, posted));
  gst_buffer_unmap (blob, &map);
  gst_buffer_unref (blob);
  ck_assert_int_eq (posted.views[0].width, kWidth);
  fail_unless (posted.views[0].right.has_value ());
  gst_message_unref (message);
}
GST_END_TEST;

GST_START_TEST (test_messages_say_which_camera_saw_the_board)
{
  Calibrate c (2);
  Pose board = random_board (c.cameras[0], {}, 0.5, 0, 0, c.random);
  c.push_picture (0, 5 * GST_SECOND, c.renderers[0].render (board, 0, c.random));
  c.push_grey (1, 5 * GST_SECOND);
  for (const bool seen : {true, false}) {
    GstMessage *message = c.message ("rigcalibrate-board");
    const GstStructure *s = gst_message_get_structure (message);
    gboolean said;
    guint corners;
    guint64 time;
    fail_unless (gst_structure_get_boolean (s, "seen", &said));
    ck_assert_int_eq (bool (said), seen);
    fail_unless (gst_structure_get_uint (s, "corners", &corners));
    fail_unless_equals_int (corners, seen ? 54 : 0);
    fail_unless (gst_structure_get_uint64 (s, "running-time", &time));
    fail_unless_equals_uint64 (time, 5 * GST_SECOND);
    fail_unless_equals_string (gst_structure_get_string (s, "pad"), seen ? "sink_0" : "sink_1");
    fail_unless_equals_string (gst_structure_get_string (s, "verdict"), "taken");
    gst_message_unref (message);
  }
  for (const bool seen : {true, false}) {
    GstMessage *message = c.message ("rigcalibrate-coverage");
    const GstStructure *s = gst_message_get_structure (message);
    guint frames;
    fail_unless (gst_structure_get_uint (s, "frames", &frames));
    fail_unless_equals_int (frames, seen ? 1 : 0);
    ck_assert_int_eq (seen, (number (s, "share") > 0));
    fail_unless_equals_int (strlen (gst_structure_get_string (s, "cells")), 12);
    ck_assert_int_ge (gst_value_array_get_size (gst_structure_get_value (s, "missing")), 5);
    gst_message_unref (message);
  }
}
GST_END_TEST;

GST_START_TEST (test_still_pictures_stand_side_by_side)
{
  Calibrate c (2);
  c.push_boards (1, 3);
  GstBuffer *still = gst_harness_pull (c.out);
  GstCaps *caps = gst_pad_get_current_caps (c.out->sinkpad);
  GstVideoInfo info;
  fail_unless (gst_video_info_from_caps (&info, caps));
  gst_caps_unref (caps);
  fail_unless_equals_int (info.width, 960);
  fail_unless_equals_int (info.height, 360);
  fail_unless_equals_int (GST_VIDEO_INFO_FORMAT (&info), GST_VIDEO_FORMAT_RGBx);
  fail_unless_equals_uint64 (GST_BUFFER_PTS (still), 3 * GST_SECOND);
  GstMapInfo map;
  gst_buffer_map (still, &map, GST_MAP_READ);
  fail_unless_equals_int (map.size, info.size);
  int coloured[2] = {0, 0}; /* what was drawn into grey pictures */
  for (int y = 10; y < 350; y++)
    for (int x = 0; x < 960; x++) {
      const guint8 *p = map.data + 4 * (960 * y + x);
      coloured[x / 480] += std::abs (p[0] - p[2]) > 60 && x % 480 > 10 && x % 480 < 470;
    }
  ck_assert_int_gt (coloured[0], 50);
  ck_assert_int_gt (coloured[1], 50);
  gst_buffer_unmap (still, &map);
  gst_buffer_unref (still);
}
GST_END_TEST;

GST_START_TEST (test_what_cannot_be_calibrated_is_one_error_at_eos)
{
  {
    Calibrate c (2);
    for (int pad = 0; pad < 2; pad++)
      c.push_grey (pad, 0);
    c.end ();
    c.expect_error ("sink_0 (view 0, left): no board was found; show one with 9x6 inner corners");
  }
  {
    Calibrate c (1, "min-frames=6");
    c.push_boards (4);
    c.end ();
    c.expect_error (
        "sink_0 (view 0, left): the board was found in 4 frames; show it in at least 6");
  }
  {
    Calibrate c (1);
    c.push_picture (0, 0, std::vector<std::uint8_t> (100));
    c.expect_error ("pad sink_0: a buffer is smaller than its caps require");
  }
  {
    Calibrate c (1); /* caps only */
    c.end ();
    c.expect_error ("pad sink_0: no images arrived");
  }
  Calibrate c (1);
  GstPad *lonely = gst_element_request_pad_simple (c.element, "sink_%u");
  c.push_grey (0, 0);
  gst_pad_send_event (lonely, gst_event_new_stream_start ("lonely"));
  gst_pad_send_event (lonely, gst_event_new_eos ());
  c.end ();
  c.expect_error ("pad sink_1: no images arrived");
  gst_element_release_request_pad (c.element, lonely);
  gst_object_unref (lonely);
}
GST_END_TEST;

GST_START_TEST (test_swapped_cameras_are_one_error)
{
  Calibrate c (2);
  gst_util_set_object_arg (c.child (0), "role", "right");
  gst_util_set_object_arg (c.child (1), "role", "left");
  c.push_boards (12);
  c.end ();
  c.expect_error ("view 0: left and right cameras are swapped: sink_0 (right) stands 0.");
}
GST_END_TEST;

GST_START_TEST (test_new_size_in_the_stream_is_an_error_that_names_the_pad)
{
  Calibrate c (1);
  c.push_boards (1);
  gst_harness_set_src_caps_str (
      c.in[0], "video/x-raw,format=GRAY8,width=64,height=48,framerate=1/1");
  c.push_picture (0, GST_SECOND, std::vector<std::uint8_t> (64 * 48));
  c.expect_error ("pad sink_0: images changed from 320x240 to 64x48");
}
GST_END_TEST;

GST_START_TEST (test_pictures_of_other_times_are_dropped)
{
  Calibrate c (2);
  c.push_grey (0, 0);
  c.push_grey (1, 10 * GST_SECOND);
  c.push_grey (0, 10 * GST_SECOND + 400 * GST_MSECOND); /* within half a frame */
  GstMessage *message = c.message ("rigcalibrate-board");
  guint64 time = 0;
  gst_structure_get_uint64 (gst_message_get_structure (message), "running-time", &time);
  fail_unless_equals_uint64 (time, 10 * GST_SECOND);
  gst_message_unref (message);
  fail_unless_equals_uint64 (c.stat ("dropped"), 1);
}
GST_END_TEST;

GST_START_TEST (test_complete_coverage_ends_the_stream_with_auto_finish)
{
  Calibrate c (1, "auto-finish=true");
  const GstFlowReturn flow = c.show_everywhere ();
  fail_unless_equals_int (flow, GST_FLOW_EOS);
  gst_message_unref (c.message ("rigcalibrate-result"));
}
GST_END_TEST;

/* Without these the work of minutes would be lost in the end. */
GST_START_TEST (test_what_cannot_end_well_does_not_start)
{
  const std::pair<const char *, const char *> cases[] = {
      {"location=/nowhere/rig.yaml", "/nowhere/rig.yaml: its folder does not exist"},
      {"location=rig.txt", "rig.txt: cannot be written; use a name that ends in .yml"},
      {"location=/proc/rig.yaml", "/proc/rig.yaml: cannot be opened for writing"},
      {"near=2 far=1", "set near between 0 and far"},
      {"min-frames=101", "set it to min-frames, 101, or more"},
      {"board=charuco marker-size=0.1", "marker size"},
      {"board=charuco columns=20 rows=20", "4x4-50 has 50 markers"},
  };
  for (const auto &[properties, text] : cases) {
    GstElement *element =
        gst_parse_launch ((std::string ("rigcalibrate ") + properties).c_str (), nullptr);
    GstBus *bus = gst_bus_new ();
    gst_element_set_bus (element, bus);
    fail_unless_equals_int (
        gst_element_set_state (element, GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE);
    const std::string said = next_message_text (bus, GST_MESSAGE_ERROR);
    fail_unless_contains (said, text);
    gst_element_set_state (element, GST_STATE_NULL);
    gst_element_set_bus (element, nullptr);
    gst_object_unref (bus);
    gst_object_unref (element);
  }
}
GST_END_TEST;

GST_START_TEST (test_live_pictures_go_unseen_while_the_last_ones_are_looked_at)
{
  GstElement *pipeline = gst_parse_launch (
      "videotestsrc is-live=true num-buffers=100 pattern=snow ! "
      "video/x-raw,width=640,height=480,framerate=1000/1 ! rigcalibrate name=c ! fakesink",
      nullptr);
  GstElement *element = gst_bin_get_by_name (GST_BIN (pipeline), "c");
  GstBus *bus = gst_element_get_bus (pipeline);
  for (int i = 0; i < 2; i++) { /* and again */
    gst_element_set_state (pipeline, GST_STATE_PLAYING);
    GstMessage *message = gst_bus_timed_pop_filtered (bus, 60 * GST_SECOND, GST_MESSAGE_ERROR);
    fail_unless (message != nullptr); /* no board, told at EOS */
    gst_message_unref (message);
    const guint64 examined = stats_field (element, "examined"),
                  skipped = stats_field (element, "skipped");
    ck_assert_uint_ge (examined, 1);
    fail_unless (skipped >= 1, "nobody looks for boards in a millisecond");
    ck_assert_uint_le (examined + skipped, 100);
    gst_element_set_state (pipeline, GST_STATE_NULL);
    gst_bus_set_flushing (bus, TRUE);
    gst_bus_set_flushing (bus, FALSE);
  }
  gst_object_unref (bus);
  gst_object_unref (element);
  gst_object_unref (pipeline);
}
GST_END_TEST;

/* As by a camera whose images take longer to decode; all of them are late, beyond `latency`. */
GST_START_TEST (test_live_pictures_of_one_moment_stay_together_when_they_arrive_late)
{
  GstElement *pipeline = gst_parse_launch (
      "rigcalibrate name=c ! fakesink videotestsrc is-live=true num-buffers=8 ! "
      "video/x-raw,width=64,height=48,framerate=5/1 ! queue ! identity sleep-time=150000 ! "
      "queue ! identity sleep-time=150000 ! queue ! identity sleep-time=150000 ! tee name=late "
      "late. ! queue ! c.sink_0 late. ! queue ! identity sleep-time=80000 ! c.sink_1",
      nullptr);
  GstElement *element = gst_bin_get_by_name (GST_BIN (pipeline), "c");
  GstBus *bus = gst_element_get_bus (pipeline);
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  std::map<guint64, int> cameras; /* by moment */
  while (true) {
    GstMessage *message = gst_bus_timed_pop_filtered (
        bus, 60 * GST_SECOND, GstMessageType (GST_MESSAGE_ELEMENT | GST_MESSAGE_ERROR));
    fail_unless (message != nullptr);
    const bool end = GST_MESSAGE_TYPE (message) == GST_MESSAGE_ERROR; /* no board, told at EOS */
    if (!end && gst_message_has_name (message, "rigcalibrate-board")) {
      guint64 frame = 0;
      gst_structure_get_uint64 (gst_message_get_structure (message), "frame", &frame);
      cameras[frame]++;
    }
    gst_message_unref (message);
    if (end)
      break;
  }
  fail_unless (!cameras.empty ());
  for (const auto &[frame, number] : cameras)
    fail_unless_equals_int (number, 2);
  gst_element_set_state (pipeline, GST_STATE_NULL);
  gst_object_unref (bus);
  gst_object_unref (element);
  gst_object_unref (pipeline);
}
GST_END_TEST;

/* Whatever the job is at then: looking for a board, or calibrating. */
GST_START_TEST (test_ready_interrupts_a_calibration_without_a_word)
{
  Calibrate c (2);
  for (int i = 0; i < 2; i++) {
    c.push_boards (9, 9 * i);
    c.wait_until_examined (9);
    c.end ();
    g_usleep (gulong (i) * 30000);
    gst_element_set_state (c.element, GST_STATE_READY);
    fail_unless (gst_bus_pop_filtered (c.bus, GST_MESSAGE_ERROR) == nullptr);
    fail_unless (gst_bus_pop_filtered (c.bus, GST_MESSAGE_WARNING) == nullptr);
    c.play_again ();
  }
  c.push_boards (9, 18);
  c.end ();
  gst_message_unref (c.message ("rigcalibrate-result"));
}
GST_END_TEST;

static Suite *
rigcalibrate_suite ()
{
  Suite *suite = suite_create ("rigcalibrate");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_boards_in_two_cameras_become_a_rig_file_at_eos);
  tcase_add_test (tc, test_messages_say_which_camera_saw_the_board);
  tcase_add_test (tc, test_still_pictures_stand_side_by_side);
  tcase_add_test (tc, test_what_cannot_be_calibrated_is_one_error_at_eos);
  tcase_add_test (tc, test_swapped_cameras_are_one_error);
  tcase_add_test (tc, test_new_size_in_the_stream_is_an_error_that_names_the_pad);
  tcase_add_test (tc, test_pictures_of_other_times_are_dropped);
  tcase_add_test (tc, test_complete_coverage_ends_the_stream_with_auto_finish);
  tcase_add_test (tc, test_what_cannot_end_well_does_not_start);
  tcase_add_test (tc, test_live_pictures_go_unseen_while_the_last_ones_are_looked_at);
  tcase_add_test (tc, test_live_pictures_of_one_moment_stay_together_when_they_arrive_late);
  tcase_add_test (tc, test_ready_interrupts_a_calibration_without_a_word);
  return suite;
}

GST_CHECK_MAIN (rigcalibrate);
