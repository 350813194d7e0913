/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* stereodepth with two cameras. With three: stereodepththird. */
#include "stereodepth-check.hpp"

using namespace rangecast;
using namespace rangecast::testing;

GST_START_TEST (test_depth_is_that_of_the_disparity)
{
  Stereo s;
  s.push (s.left, 0);
  s.push (s.right, 0);
  GstBuffer *output = gst_harness_pull (s.left);
  {
    gstrange::RangeFrameMap frame (output, GST_MAP_READ);
    const RangeImage &image = frame.views ()[0];
    fail_unless_cmp (image.roi, ==, (Roi{0, 0, 160, 120}));
    int right = 0;
    for (int y = 10; y < 110; y++)
      for (int x = 40; x < 150; x++)
        right += std::abs (image.depth.at (x, y) - 8000) < 100;
    fail_unless (right > 100 * 110 * 95 / 100, "%d pixels at 0.8 m", right);
  }
  gst_buffer_unref (output);
}
GST_END_TEST;

GST_START_TEST (test_pairs_by_pts_not_by_arrival)
{
  Stereo s;
  s.push (s.left, 0);
  s.push (s.right, kFrame);     /* the right picture of frame 0 was lost */
  s.push (s.left, kFrame + 10); /* within half a frame */
  GstBuffer *output = gst_harness_pull (s.left);
  fail_unless_equals_uint64 (GST_BUFFER_PTS (output), kFrame + 10);
  fail_unless_equals_uint64 (s.stat ("dropped-left"), 1);
  fail_unless_equals_uint64 (s.stat ("dropped-right"), 0);
  gst_buffer_unref (output);
}
GST_END_TEST;

GST_START_TEST (test_capture_time_is_the_left_cameras)
{
  Stereo s;
  GstBuffer *left = Stereo::dots (false, 0);
  gst_range_buffer_set_capture_time (left, 987654321);
  gst_harness_push (s.left, left);
  s.push (s.right, 0);
  GstBuffer *output = gst_harness_pull (s.left);
  fail_unless_equals_uint64 (gst_range_buffer_get_capture_time (output), 987654321);
  fail_unless_equals_uint64 (GST_BUFFER_DURATION (output), kFrame);
  gst_buffer_unref (output);
}
GST_END_TEST;

static std::string
error_of (const std::string &properties, const char *right_caps,
    const char *left_caps = "video/x-raw,format=RGBx,width=160,height=120,framerate=25/1")
{
  Stereo s (properties, left_caps, right_caps);
  s.push (s.left, 0);
  s.push (s.right, 0);
  const std::string text = next_message_text (s.bus, GST_MESSAGE_ERROR);
  GstMessage *another = gst_bus_pop_filtered (s.bus, GST_MESSAGE_ERROR);
  fail_unless (another == nullptr, "a second error after '%s'", text.c_str ());
  return text;
}

static void
want (Stereo &s, guint x, guint y, guint width, guint height)
{
  GstStructure *roi = gst_structure_new ("GstRangeRoi", "view-id", G_TYPE_UINT, 0, "x", G_TYPE_UINT,
      x, "y", G_TYPE_UINT, y, "width", G_TYPE_UINT, width, "height", G_TYPE_UINT, height, nullptr);
  fail_unless (gst_harness_push_upstream_event (
      s.left, gst_event_new_custom (GST_EVENT_CUSTOM_UPSTREAM, roi)));
}

GST_START_TEST (test_only_the_wanted_part_is_matched_until_the_refresh)
{
  Stereo s (std::string (kProperties) + " refresh-interval=3");
  for (int i = 0; i < 5; i++) {
    s.push (s.left, i * kFrame);
    s.push (s.right, i * kFrame);
    GstBuffer *output = gst_harness_pull (s.left);
    const GstRangeMeta *meta = gst_buffer_get_range_meta (output, 0);
    const bool full = i == 0 || i == 3;
    fail_unless_equals_int (meta->width, full ? 160 : 60);
    fail_unless_equals_int (meta->x, full ? 0 : 50);
    gst_buffer_unref (output);
    if (i == 0)
      want (s, 50, 20, 60, 70);
  }
  fail_unless_equals_uint64 (s.stat ("restricted-frames"), 3);
}
GST_END_TEST;

GST_START_TEST (test_everything_is_matched_after_a_break_and_not_after_a_lost_picture)
{
  Stereo s (std::string (kProperties) + " refresh-interval=100");
  struct {
    GstClockTime pts;
    bool full;
  } const frames[] = {{0, true}, {kFrame, false}, {3 * kFrame, false}, {4 * kFrame, false},
      {3 * GST_SECOND, true}, {3 * GST_SECOND + kFrame, false}, {2 * kFrame, true},
      {3 * kFrame, false}};
  for (const auto &frame : frames) {
    s.push (s.left, frame.pts);
    s.push (s.right, frame.pts);
    GstBuffer *output = gst_harness_pull (s.left);
    fail_unless_equals_int (gst_buffer_get_range_meta (output, 0)->width, frame.full ? 160 : 60);
    gst_buffer_unref (output);
    if (frame.pts == 0)
      want (s, 50, 20, 60, 70);
  }
}
GST_END_TEST;

GST_START_TEST (test_a_change_outside_the_wanted_part_is_matched_at_once)
{
  Stereo s (std::string (kProperties) + " refresh-interval=1000");
  for (int i = 0; i < 4; i++) {
    GstBuffer *left = Stereo::dots (false, i * kFrame);
    if (i >= 2) /* somebody comes in at the left */
      gst_buffer_memset (left, 0, 255, 160 * 4 * 60);
    gst_harness_push (s.left, left);
    s.push (s.right, i * kFrame);
    GstBuffer *output = gst_harness_pull (s.left);
    const bool full = i == 0 || i == 2; /* and stays: in picture 3 nothing is new */
    fail_unless_equals_int (gst_buffer_get_range_meta (output, 0)->width, full ? 160 : 60);
    gst_buffer_unref (output);
    if (i == 0)
      want (s, 50, 70, 60, 40);
  }
}
GST_END_TEST;

/* Pushes a pair of that format with rows that are longer than they need be; gives what is seen
 * 0.8 m away, in per cent of the right half, where the right camera sees all. */
static int
seen_right (Stereo &s, GstVideoFormat format, int padding)
{
  for (GstHarness *h : {s.left, s.right}) {
    GstBuffer *rgbx = Stereo::dots (h == s.right, 0);
    GstMapInfo from;
    gst_buffer_map (rgbx, &from, GST_MAP_READ);
    GstVideoInfo info;
    gst_video_info_set_format (&info, format, 160, 120);
    const int n = GST_VIDEO_INFO_COMP_PSTRIDE (&info, 0), stride = 160 * n + padding;
    gsize offset[GST_VIDEO_MAX_PLANES] = {gsize (padding), gsize (padding) + 120 * stride,
        gsize (padding) + 120 * stride + 60 * stride};
    gint strides[GST_VIDEO_MAX_PLANES] = {stride, stride, stride};
    GstBuffer *buffer = gst_buffer_new_allocate (nullptr, padding + 240 * stride, nullptr);
    gst_buffer_memset (buffer, 0, 128, gst_buffer_get_size (buffer));
    for (int y = 0; y < 120; y++)
      for (int x = 0; x < 160; x++)
        for (int c = 0; c < n; c++)
          gst_buffer_fill (
              buffer, offset[0] + y * stride + x * n + c, from.data + 4 * (160 * y + x), 1);
    gst_buffer_add_video_meta_full (buffer, GST_VIDEO_FRAME_FLAG_NONE, format, 160, 120,
        GST_VIDEO_INFO_N_PLANES (&info), offset, strides);
    gst_buffer_unmap (rgbx, &from);
    gst_buffer_unref (rgbx);
    GST_BUFFER_PTS (buffer) = 0;
    gst_harness_push (h, buffer);
  }
  GstBuffer *output = gst_harness_pull (s.left);
  fail_unless (output != nullptr);
  int seen = 0;
  {
    gstrange::RangeFrameMap frame (output, GST_MAP_READ);
    for (int y = 0; y < 120; y++)
      for (int x = 80; x < 160; x++)
        seen += std::abs (frame.views ()[0].depth.at (x, y) - 8000) < 100;
  }
  gst_buffer_unref (output);
  return 100 * seen / (80 * 120);
}

GST_START_TEST (test_every_format_and_padded_rows_give_the_same_depth)
{
  for (GstVideoFormat format :
      {GST_VIDEO_FORMAT_RGBx, GST_VIDEO_FORMAT_BGR, GST_VIDEO_FORMAT_GRAY8, GST_VIDEO_FORMAT_I420})
    for (int padding : {0, 48}) {
      const std::string caps =
          std::string ("video/x-raw,width=160,height=120,framerate=25/1,format=") +
          gst_video_format_to_string (format);
      Stereo s (kProperties, caps.c_str (), caps.c_str ());
      const int seen = seen_right (s, format, padding);
      fail_unless (seen >= 90, "%s, %d bytes padding: %d %%", gst_video_format_to_string (format),
          padding, seen);
    }
}
GST_END_TEST;

GST_START_TEST (test_gap_on_one_pad_costs_the_others_picture_and_nothing_else)
{
  Stereo s;
  gst_harness_push_event (s.right, gst_event_new_gap (0, kFrame));
  s.push (s.left, 0);
  s.push (s.left, kFrame);
  s.push (s.right, kFrame);
  GstBuffer *output = gst_harness_pull (s.left);
  fail_unless_equals_uint64 (GST_BUFFER_PTS (output), kFrame);
  gst_buffer_unref (output);
  fail_unless_equals_uint64 (s.stat ("dropped-left"), 1);
}
GST_END_TEST;

GST_START_TEST (test_latency_is_that_of_the_slower_camera_and_its_own)
{
  Stereo s (std::string (kProperties) + " latency=7000000");
  gst_harness_set_live (s.left, TRUE);
  gst_harness_set_live (s.right, TRUE);
  gst_harness_set_upstream_latency (s.left, 10 * GST_MSECOND);
  gst_harness_set_upstream_latency (s.right, 30 * GST_MSECOND);
  fail_unless_equals_uint64 (gst_harness_query_latency (s.left), 37 * GST_MSECOND);
}
GST_END_TEST;

GST_START_TEST (test_rig_of_another_size_is_scaled_to_the_pictures)
{
  RigFile rig;
  Stereo s (rig.property ());
  s.push (s.left, 0);
  s.push (s.right, 0);
  GstBuffer *output = gst_harness_pull (s.left);
  fail_unless (output != nullptr, "%s", next_message_text (s.bus, GST_MESSAGE_ERROR).c_str ());
  GstCaps *caps = gst_pad_get_current_caps (s.left->sinkpad);
  gstrange::RangeInfo info;
  fail_unless_ok (gstrange::parse_caps (caps, info));
  const View &view = info.rig.views[0];
  fail_unless_equals_int (view.width, 160);
  fail_unless_equals_int (view.height, 120);
  fail_unless_equals_float (view.intrinsics.fx, 160);
  fail_unless_equals_float (view.intrinsics.cx, 79.5); /* (159.5 + 0.5) / 2 - 0.5 */
  {
    gstrange::RangeFrameMap frame (output, GST_MAP_READ);
    ck_assert_int_lt (std::abs (frame.views ()[0].depth.at (100, 60) - 8000), 100);
  }
  gst_caps_unref (caps);
  gst_buffer_unref (output);
}
GST_END_TEST;

GST_START_TEST (test_bad_settings_are_one_error_that_names_them)
{
  const char *same = "video/x-raw,format=RGBx,width=160,height=120,framerate=25/1";
  const char *larger = "video/x-raw,format=RGBx,width=80,height=240,framerate=25/1";
  fail_unless_contains (error_of (kProperties, larger), "pad right is 80x240");
  fail_unless_contains (error_of ("", same), "focal-length");
  fail_unless_contains (error_of ("focal-length=0.8 baseline=0.1", same), "focal-length in pixels");
  fail_unless_contains (error_of ("rig=/no/rig.yaml", same), "/no/rig.yaml");
  fail_unless_contains (error_of ("focal-length=160 baseline=0.1 near=0.05", same), "near");
  RigFile rig;
  fail_unless_contains (error_of (rig.property () + " view-id=7", same), "no view with view-id 7");
  const char *square = "video/x-raw,format=RGBx,width=160,height=160,framerate=25/1";
  fail_unless_contains (error_of (rig.property (), square, square), "160x160");
}
GST_END_TEST;

GST_START_TEST (test_changes_states_twice)
{
  GstElement *pipeline = gst_parse_launch (
      "avatartestsrc name=c num-buffers=2 c.left ! queue ! d.left c.right ! queue ! "
      "d.right stereodepth name=d focal-length=320 baseline=0.1 ! fakesink",
      nullptr);
  for (int i = 0; i < 2; i++)
    play_to_the_end (pipeline);
  gst_object_unref (pipeline);
}
GST_END_TEST;

GST_START_TEST (test_wanted_part_outlives_caps_of_the_same_size)
{
  Stereo s (std::string (kProperties) + " refresh-interval=1000");
  s.push (s.left, 0);
  s.push (s.right, 0);
  gst_buffer_unref (gst_harness_pull (s.left));
  want (s, 50, 20, 60, 70);
  for (GstHarness *h : {s.left, s.right})
    gst_harness_set_src_caps_str (h, "video/x-raw,format=RGBA,width=160,height=120,framerate=25/1");
  for (int i = 1; i < 3; i++) { /* the first one as a whole: nothing is known of it */
    s.push (s.left, i * kFrame);
    s.push (s.right, i * kFrame);
    GstBuffer *output = gst_harness_pull (s.left);
    if (i == 2)
      fail_unless_equals_int (gst_buffer_get_range_meta (output, 0)->width, 60);
    gst_buffer_unref (output);
  }
}
GST_END_TEST;

/* The next GAP that comes out, and nothing but what must be before it. */
static void
expect_gap (Stereo &s, GstClockTime begin, GstClockTime length)
{
  for (;;) {
    GstEvent *event = gst_harness_pull_event (s.left);
    fail_unless (event != nullptr, "no GAP");
    const GstEventType type = GST_EVENT_TYPE (event);
    GstClockTime time = 0, duration = 0;
    if (type == GST_EVENT_GAP)
      gst_event_parse_gap (event, &time, &duration);
    gst_event_unref (event);
    if (type != GST_EVENT_GAP)
      continue;
    GstEvent *segment = gst_pad_get_sticky_event (s.left->sinkpad, GST_EVENT_SEGMENT, 0);
    fail_unless (segment != nullptr, "a GAP before the segment");
    gst_event_unref (segment);
    fail_unless_equals_uint64 (time, begin);
    fail_unless_equals_uint64 (duration, length);
    return;
  }
}

GST_START_TEST (test_gaps_are_gaps_of_the_output)
{
  Stereo s;
  const auto push_pair = [&s] (GstClockTime time) {
    s.push (s.left, time);
    s.push (s.right, time);
    gst_buffer_unref (gst_harness_pull (s.left));
  };
  push_pair (0);
  for (GstHarness *h : {s.left, s.right})
    gst_harness_push_event (h, gst_event_new_gap (kFrame, 9 * kFrame));
  expect_gap (s, kFrame, 9 * kFrame);
  push_pair (10 * kFrame);
  s.push (s.left, 11 * kFrame); /* the GAP takes it with it */
  gst_harness_push_event (s.right, gst_event_new_gap (11 * kFrame, kFrame));
  expect_gap (s, 11 * kFrame, kFrame);
}
GST_END_TEST;

GST_START_TEST (test_gap_after_a_flush_follows_a_segment)
{
  Stereo s;
  s.push (s.left, 0);
  s.push (s.right, 0);
  gst_buffer_unref (gst_harness_pull (s.left));
  const guint32 seek = gst_util_seqnum_next (); /* the same for both: one flush of the element */
  for (const bool start : {true, false})
    for (GstHarness *h : {s.left, s.right}) {
      GstEvent *event = start ? gst_event_new_flush_start () : gst_event_new_flush_stop (TRUE);
      gst_event_set_seqnum (event, seek);
      gst_harness_push_event (h, event);
    }
  while (GstEvent *event = gst_harness_try_pull_event (s.left))
    gst_event_unref (event);
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_TIME);
  for (GstHarness *h : {s.left, s.right}) {
    gst_harness_push_event (h, gst_event_new_segment (&segment));
    gst_harness_push_event (h, gst_event_new_gap (0, kFrame));
  }
  expect_gap (s, 0, kFrame);
}
GST_END_TEST;

GST_START_TEST (test_late_frames_are_dropped_before_matching_and_said)
{
  for (const bool qos : {true, false}) {
    Stereo s (std::string (kProperties) + (qos ? "" : " qos=false"));
    s.push (s.left, 0);
    s.push (s.right, 0);
    gst_buffer_unref (gst_harness_pull (s.left));
    gst_harness_push_upstream_event (
        s.left, gst_event_new_qos (GST_QOS_TYPE_UNDERFLOW, 2.0, kFrame, 0));
    for (int i = 1; i < 4; i++) {
      s.push (s.left, i * kFrame);
      s.push (s.right, i * kFrame);
    }
    GstBuffer *output = gst_harness_pull (s.left);
    /* Not live, twice what is late already is left out. */
    fail_unless_equals_uint64 (GST_BUFFER_PTS (output), (qos ? 3 : 1) * kFrame);
    fail_unless_equals_int (GST_BUFFER_IS_DISCONT (output), qos);
    gst_buffer_unref (output);
    fail_unless_equals_uint64 (s.stat ("dropped-late"), qos ? 2 : 0);
    GstMessage *message = gst_bus_pop_filtered (s.bus, GST_MESSAGE_QOS);
    ck_assert_int_eq ((message != nullptr), qos);
    gst_clear_message (&message);
  }
}
GST_END_TEST;

GST_START_TEST (test_cameras_that_never_take_a_picture_at_once_are_one_warning)
{
  const char *caps = "video/x-raw,format=RGBx,width=160,height=120,framerate=0/1";
  Stereo s (kProperties, caps, caps);
  for (int i = 0; i < 150; i++) {
    s.push (s.left, i * kFrame);
    s.push (s.right, i * kFrame + kFrame / 2);
  }
  const std::string text = next_message_text (s.bus, GST_MESSAGE_WARNING);
  fail_unless (text.find ("do not pair up") != std::string::npos, "'%s'", text.c_str ());
  fail_unless (gst_bus_pop_filtered (s.bus, GST_MESSAGE_WARNING) == nullptr);
}
GST_END_TEST;

static Suite *
stereodepth_suite ()
{
  Suite *suite = suite_create ("stereodepth");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_depth_is_that_of_the_disparity);
  tcase_add_test (tc, test_pairs_by_pts_not_by_arrival);
  tcase_add_test (tc, test_capture_time_is_the_left_cameras);
  tcase_add_test (tc, test_only_the_wanted_part_is_matched_until_the_refresh);
  tcase_add_test (tc, test_everything_is_matched_after_a_break_and_not_after_a_lost_picture);
  tcase_add_test (tc, test_a_change_outside_the_wanted_part_is_matched_at_once);
  tcase_add_test (tc, test_every_format_and_padded_rows_give_the_same_depth);
  tcase_add_test (tc, test_gap_on_one_pad_costs_the_others_picture_and_nothing_else);
  tcase_add_test (tc, test_latency_is_that_of_the_slower_camera_and_its_own);
  tcase_add_test (tc, test_rig_of_another_size_is_scaled_to_the_pictures);
  tcase_add_test (tc, test_bad_settings_are_one_error_that_names_them);
  tcase_add_test (tc, test_changes_states_twice);
  tcase_add_test (tc, test_wanted_part_outlives_caps_of_the_same_size);
  tcase_add_test (tc, test_gaps_are_gaps_of_the_output);
  tcase_add_test (tc, test_gap_after_a_flush_follows_a_segment);
  tcase_add_test (tc, test_late_frames_are_dropped_before_matching_and_said);
  tcase_add_test (tc, test_cameras_that_never_take_a_picture_at_once_are_one_warning);
  return suite;
}

GST_CHECK_MAIN (stereodepth);
