/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* before check.h, whose fail() is a macro */
#include <atomic>
#include <cmath>
#include <thread>

#include "../rangecast-check.hpp"

#include <gst/video/video.h>

using namespace rangecast;
using namespace rangecast::testing;

static GstHarness *
split_harness (const Rig &rig, const char *src_pad)
{
  GstHarness *h = gst_harness_new_with_padnames ("rangesplit", "sink", src_pad);
  gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (rig, 30, 1)));
  return h;
}

static guint16
depth_at (GstBuffer *buffer, GstCaps *caps, int x, int y)
{
  GstVideoInfo info;
  GstVideoFrame frame;
  fail_unless (gst_video_info_from_caps (&info, caps));
  fail_unless (gst_video_frame_map (&frame, &info, buffer, GST_MAP_READ));
  auto row = static_cast<const guint8 *> (GST_VIDEO_FRAME_PLANE_DATA (&frame, 0)) +
             y * GST_VIDEO_FRAME_PLANE_STRIDE (&frame, 0);
  const guint16 depth = GST_READ_UINT16_LE (row + 2 * x);
  gst_video_frame_unmap (&frame);
  return depth;
}

GST_START_TEST (test_depth_has_the_full_size_with_the_roi_in_its_place)
{
  const Rig rig = ring_rig (2, 322, 241); /* rows of GRAY16 are padded to 4 bytes */
  GstBuffer *input = make_frame_set (rig, 123, {100, 60, 51, 43});
  guint16 middle;
  {
    gstrange::RangeFrameMap frame (input, GST_MAP_READ);
    middle = frame.views ()[1].depth.at (25, 21);
  }
  GstHarness *h = split_harness (rig, "depth_1");
  GstBuffer *output = gst_harness_push_and_pull (h, input);
  GstCaps *caps = gst_pad_get_current_caps (h->sinkpad);
  ck_assert_int_gt (middle, 0);
  fail_unless_equals_int (depth_at (output, caps, 125, 81), middle);
  fail_unless_equals_int (depth_at (output, caps, 99, 81), 0);
  fail_unless_equals_int (depth_at (output, caps, 125, 59), 0);
  fail_unless_equals_int (depth_at (output, caps, 321, 240), 0);
  fail_unless_equals_uint64 (GST_BUFFER_PTS (output), 123);
  fail_unless_equals_uint64 (gst_range_buffer_get_capture_time (output), 123);
  gst_caps_unref (caps);
  gst_buffer_unref (output);
  gst_harness_teardown (h);
}
GST_END_TEST;

/* The pixel of a depth pad's picture at the middle of a frame set, as bytes, and the caps' format.
 */
static std::string
middle_pixel (const char *properties, const char *sink_caps, std::size_t bytes, guint16 &depth,
    GstVideoFormat &format)
{
  const Rig rig = ring_rig (1);
  GstBuffer *input = make_frame_set (rig);
  {
    gstrange::RangeFrameMap frame (input, GST_MAP_READ);
    depth = frame.views ()[0].depth.at (160, 120);
  }
  GstHarness *h = split_harness (rig, "depth");
  if (sink_caps)
    gst_harness_set_sink_caps_str (h, sink_caps);
  gst_util_set_object_arg (G_OBJECT (h->element), "depth-map", properties);
  GstBuffer *output = gst_harness_push_and_pull (h, input);
  GstCaps *caps = gst_pad_get_current_caps (h->sinkpad);
  GstVideoInfo info;
  fail_unless (gst_video_info_from_caps (&info, caps));
  format = GST_VIDEO_INFO_FORMAT (&info);
  std::string pixel (bytes, '\0');
  const gsize at = 120 * gsize (GST_VIDEO_INFO_PLANE_STRIDE (&info, 0)) + 160 * bytes;
  fail_unless_equals_int (gst_buffer_extract (output, at, pixel.data (), bytes), bytes);
  gst_caps_unref (caps);
  gst_buffer_unref (output);
  gst_harness_teardown (h);
  return pixel;
}

GST_START_TEST (test_depth_is_big_endian_only_where_downstream_wants_it)
{
  guint16 depth;
  GstVideoFormat format;
  std::string pixel = middle_pixel ("none", "video/x-raw,format=GRAY16_BE", 2, depth, format);
  fail_unless_equals_int (format, GST_VIDEO_FORMAT_GRAY16_BE);
  ck_assert_int_gt (depth, 255);
  fail_unless_equals_int (GST_READ_UINT16_BE (pixel.data ()), depth);
  pixel =
      middle_pixel ("none", "video/x-raw,format={ GRAY16_BE, GRAY16_LE, RGBx }", 2, depth, format);
  fail_unless_equals_int (format, GST_VIDEO_FORMAT_GRAY16_LE);
  fail_unless_equals_int (GST_READ_UINT16_LE (pixel.data ()), depth);
}
GST_END_TEST;

GST_START_TEST (test_depth_maps_are_pictures_between_near_and_far)
{
  const View view = ring_rig (1).views[0];
  guint16 depth;
  GstVideoFormat format;
  const std::string grey = middle_pixel ("grey", nullptr, 1, depth, format);
  fail_unless_equals_int (format, GST_VIDEO_FORMAT_GRAY8);
  const double part =
      (view.far_m - depth * view.depth_unit_m) / (view.far_m - view.near_m); /* 1 at near */
  fail_unless_equals_int (guint8 (grey[0]), int (std::lround (1 + 254 * part)));
  const std::string turbo = middle_pixel ("turbo", nullptr, 4, depth, format);
  fail_unless_equals_int (format, GST_VIDEO_FORMAT_RGBx);
  fail_unless (guint8 (turbo[0]) != guint8 (turbo[1]) || guint8 (turbo[1]) != guint8 (turbo[2]));
}
GST_END_TEST;

GST_START_TEST (test_eight_bits_of_depth_are_one_error_that_names_the_property)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = split_harness (rig, "depth");
  gst_harness_set_sink_caps_str (h, "video/x-raw,format=GRAY8");
  GstBus *bus = gst_bus_new ();
  gst_element_set_bus (h->element, bus);
  for (int i = 0; i < 2; i++)
    fail_unless_equals_int (gst_harness_push (h, make_frame_set (rig)), GST_FLOW_NOT_NEGOTIATED);
  fail_unless_contains (next_message_text (bus, GST_MESSAGE_ERROR), "depth-map");
  fail_unless (gst_bus_pop_filtered (bus, GST_MESSAGE_ERROR) == nullptr);
  gst_element_set_bus (h->element, nullptr);
  gst_object_unref (bus);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_depth_map_changes_while_playing)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = split_harness (rig, "depth");
  for (const auto &[map, bytes] : {std::pair{"none", 2}, {"grey", 1}, {"turbo", 4}, {"none", 2}}) {
    gst_util_set_object_arg (G_OBJECT (h->element), "depth-map", map);
    GstBuffer *output = gst_harness_push_and_pull (h, make_frame_set (rig));
    fail_unless_equals_int (gst_buffer_get_size (output), 320 * 240 * bytes);
    gst_buffer_unref (output);
  }
  gst_harness_teardown (h);
}
GST_END_TEST;

static guint8
red_at_edge (gboolean mask)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = split_harness (rig, "colour");
  g_object_set (h->element, "mask", mask, nullptr);
  GstBuffer *output = gst_harness_push_and_pull (h, make_frame_set (rig));
  guint8 rgbx[4];
  gst_buffer_extract (output, 200 * 4, rgbx, 4); /* row 0 lies outside the bump: no depth */
  gst_buffer_unref (output);
  gst_harness_teardown (h);
  return rgbx[0];
}

GST_START_TEST (test_colour_without_depth_is_black_unless_unmasked)
{
  fail_unless_equals_int (red_at_edge (TRUE), 0);
  fail_unless_equals_int (red_at_edge (FALSE), 200);
}
GST_END_TEST;

GST_START_TEST (test_view_missing_in_a_frame_set_is_an_empty_picture)
{
  const Rig rig = ring_rig (2);
  GstHarness *h = split_harness (rig, "depth_1");
  GstBuffer *output = gst_harness_push_and_pull (h, make_frame_set (ring_rig (1)));
  GstCaps *caps = gst_pad_get_current_caps (h->sinkpad);
  fail_unless_equals_int (depth_at (output, caps, 160, 120), 0);
  gst_caps_unref (caps);
  gst_buffer_unref (output);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_view_that_the_rig_lacks_is_one_error)
{
  const Rig rig = ring_rig (2);
  GstHarness *h = split_harness (rig, "depth_5");
  GstBus *bus = gst_bus_new ();
  gst_element_set_bus (h->element, bus);
  fail_unless_equals_int (gst_harness_push (h, make_frame_set (rig)), GST_FLOW_ERROR);
  fail_unless_contains (next_message_text (bus, GST_MESSAGE_ERROR), "view 5");
  gst_element_set_bus (h->element, nullptr);
  gst_object_unref (bus);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_new_caps_reach_the_video_pads)
{
  GstHarness *h = split_harness (ring_rig (1), "depth");
  gst_buffer_unref (gst_harness_push_and_pull (h, make_frame_set (ring_rig (1))));
  const Rig larger = ring_rig (1, 640, 480);
  gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (larger, 30, 1)));
  GstBuffer *output = gst_harness_push_and_pull (h, make_frame_set (larger));
  fail_unless_equals_int (gst_buffer_get_size (output), 640 * 480 * 2);
  gst_buffer_unref (output);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_flush_and_eos_reach_the_video_pads)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = split_harness (rig, "depth");
  gst_buffer_unref (gst_harness_push_and_pull (h, make_frame_set (rig)));
  fail_unless (gst_harness_push_event (h, gst_event_new_flush_start ()));
  fail_unless (gst_harness_push_event (h, gst_event_new_flush_stop (TRUE)));
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_TIME);
  fail_unless (gst_harness_push_event (h, gst_event_new_segment (&segment)));
  gst_buffer_unref (gst_harness_push_and_pull (h, make_frame_set (rig)));
  fail_unless (gst_harness_push_event (h, gst_event_new_eos ()));
  bool eos = false;
  while (GstEvent *event = gst_harness_try_pull_event (h)) {
    eos |= GST_EVENT_TYPE (event) == GST_EVENT_EOS;
    gst_event_unref (event);
  }
  fail_unless (eos);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_unlinked_pad_does_not_stop_the_others)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = split_harness (rig, "depth");
  GstPad *unlinked = gst_element_request_pad_simple (h->element, "colour");
  gst_buffer_unref (gst_harness_push_and_pull (h, make_frame_set (rig)));
  gst_element_release_request_pad (h->element, unlinked);
  gst_object_unref (unlinked);
  gst_buffer_unref (gst_harness_push_and_pull (h, make_frame_set (rig)));
  gst_harness_teardown (h);
}
GST_END_TEST;

struct Pusher {
  GstHarness *h;
  const Rig &rig;
  std::atomic<bool> ends = false;
  GstFlowReturn flow = GST_FLOW_OK;

  void push ()
  {
    for (GstClockTime t = 0; !ends && flow == GST_FLOW_OK; t += 33 * GST_MSECOND)
      flow = gst_harness_push (h, make_frame_set (rig, t));
  }
};

GST_START_TEST (test_pads_that_come_and_go_leave_the_others_running)
{
  const Rig rig = ring_rig (2, 16, 16);
  GstHarness *h = split_harness (rig, "depth_0");
  gst_harness_set_drop_buffers (h, TRUE);
  Pusher pusher = {h, rig};
  std::thread thread (&Pusher::push, &pusher);
  for (int i = 0; i < 300; i++) {
    GstElement *sink = gst_element_factory_make ("fakesink", nullptr);
    g_object_set (sink, "async", FALSE, nullptr);
    gst_element_set_state (sink, GST_STATE_PLAYING);
    GstPad *pad = gst_element_request_pad_simple (h->element, "colour_1"),
           *peer = gst_element_get_static_pad (sink, "sink");
    fail_unless_equals_int (gst_pad_link (pad, peer), GST_PAD_LINK_OK);
    g_usleep (500);
    gst_element_release_request_pad (
        h->element, pad); /* in the middle of a push, as often as not */
    gst_object_unref (peer);
    gst_object_unref (pad);
    gst_element_set_state (sink, GST_STATE_NULL);
    gst_object_unref (sink);
  }
  pusher.ends = true;
  thread.join ();
  fail_unless_equals_int (pusher.flow, GST_FLOW_OK);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_frame_set_without_capture_time_gives_a_picture_without)
{
  const Rig rig = ring_rig (1, 16, 16);
  GstHarness *h = split_harness (rig, "depth");
  GstBuffer *input = make_frame_set (rig, 0);
  gst_range_buffer_set_capture_time (input, GST_CLOCK_TIME_NONE);
  gpointer state = nullptr;
  while (GstRangeMeta *meta = gst_buffer_iterate_range_meta (input, &state))
    meta->capture_time = GST_CLOCK_TIME_NONE;
  GstBuffer *output = gst_harness_push_and_pull (h, input);
  fail_unless (!gst_buffer_get_reference_timestamp_meta (output, nullptr));
  gst_buffer_unref (output);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_plays_twice)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = split_harness (rig, "depth");
  gst_buffer_unref (gst_harness_push_and_pull (h, make_frame_set (rig)));
  gst_element_set_state (h->element, GST_STATE_NULL);
  gst_harness_play (h);
  gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (rig, 30, 1)));
  gst_buffer_unref (gst_harness_push_and_pull (h, make_frame_set (rig)));
  gst_harness_teardown (h);
}
GST_END_TEST;

static Suite *
rangesplit_suite ()
{
  Suite *suite = suite_create ("rangesplit");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_depth_has_the_full_size_with_the_roi_in_its_place);
  tcase_add_test (tc, test_depth_is_big_endian_only_where_downstream_wants_it);
  tcase_add_test (tc, test_depth_maps_are_pictures_between_near_and_far);
  tcase_add_test (tc, test_eight_bits_of_depth_are_one_error_that_names_the_property);
  tcase_add_test (tc, test_depth_map_changes_while_playing);
  tcase_add_test (tc, test_colour_without_depth_is_black_unless_unmasked);
  tcase_add_test (tc, test_view_missing_in_a_frame_set_is_an_empty_picture);
  tcase_add_test (tc, test_view_that_the_rig_lacks_is_one_error);
  tcase_add_test (tc, test_new_caps_reach_the_video_pads);
  tcase_add_test (tc, test_flush_and_eos_reach_the_video_pads);
  tcase_add_test (tc, test_unlinked_pad_does_not_stop_the_others);
  tcase_add_test (tc, test_pads_that_come_and_go_leave_the_others_running);
  tcase_add_test (tc, test_frame_set_without_capture_time_gives_a_picture_without);
  tcase_add_test (tc, test_plays_twice);
  return suite;
}

GST_CHECK_MAIN (rangesplit);
