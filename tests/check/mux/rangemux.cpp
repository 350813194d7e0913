/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include <gst/video/video.h>

#include <rangecast/neighbourcode/bitstream/unit.hpp>

#include "mux-check.hpp"

using namespace rangecast;
using namespace rangecast::testing;

GST_START_TEST (test_views_are_matched_by_capture_time_not_by_arrival_or_pts)
{
  Mux mux (3);
  /* Capture times 0 and 1 frame; PTS of each stream from a clock of its own. */
  mux.push (2, 0, 700 * GST_MSECOND);
  mux.push (0, 0, 100 * GST_MSECOND);
  mux.push (1, kFrame / 4, 500 * GST_MSECOND);
  GstClockTime capture;
  fail_unless_equals_int (mux.pull (&capture), 7);
  fail_unless_equals_uint64 (capture, 0);
  mux.push (1, kFrame, 540 * GST_MSECOND);
  mux.push (0, kFrame + kFrame / 4, 140 * GST_MSECOND);
  mux.push (2, kFrame, 740 * GST_MSECOND);
  fail_unless_equals_int (mux.pull (&capture), 7);
  fail_unless_equals_uint64 (capture, kFrame);
  fail_unless_equals_uint64 (mux.stat ("complete"), 2);
}
GST_END_TEST;

GST_START_TEST (test_skew_beyond_half_a_period_is_another_frame_set)
{
  Mux mux (2);
  mux.push (0, 0, 0);
  mux.push (1, kFrame * 3 / 4, 0);
  mux.push (0, kFrame, kFrame);
  fail_unless_equals_int (mux.pull (), 1);
  fail_unless_equals_int (mux.pull (), 3);
}
GST_END_TEST;

GST_START_TEST (test_caps_are_the_union_and_memory_is_shared)
{
  Mux mux (4);
  GstBuffer *input = make_frame_set (mux.one (3), 5);
  GstMemory *memory = gst_buffer_peek_memory (input, 0);
  gst_harness_push (mux.in[3], input);
  for (int i = 0; i < 3; i++)
    mux.push (i, 5, 5);
  GstBuffer *output = gst_harness_pull (mux.out);
  fail_unless_equals_int (gst_buffer_n_memory (output), 4);
  ck_assert_ptr_eq (gst_buffer_peek_memory (output, 3), memory);
  gst_buffer_unref (output);
  GstCaps *caps = gst_pad_get_current_caps (mux.out->sinkpad);
  gstrange::RangeInfo info;
  fail_unless_ok (gstrange::parse_caps (caps, info));
  fail_unless_cmp (encode_rig (info.rig), ==, encode_rig (mux.rig));
  gst_caps_unref (caps);
}
GST_END_TEST;

GST_START_TEST (test_live_goes_on_without_a_missing_view_after_the_latency_and_takes_it_back)
{
  Mux mux (2, false, true, "latency=20000000");
  mux.push (0, 0, 0);
  mux.push (1, 0, 0);
  fail_unless_equals_int (mux.pull (), 3);
  mux.push (0, kFrame, kFrame);
  /* Its deadline is its running time plus the latency; nothing else moves the clock. */
  fail_unless (gst_harness_wait_for_clock_id_waits (mux.out, 1, 5));
  GstTestClock *clock = gst_harness_get_testclock (mux.out);
  GstClockID waited = nullptr;
  gst_test_clock_wait_for_next_pending_id (clock, &waited);
  fail_unless_equals_uint64 (gst_clock_id_get_time (waited), kFrame + 20 * GST_MSECOND);
  gst_clock_id_unref (waited);
  gst_object_unref (clock);
  fail_unless (gst_harness_crank_single_clock_wait (mux.out));
  fail_unless_equals_int (mux.pull (), 1);
  mux.push (1, 2 * kFrame, 2 * kFrame);
  mux.push (0, 2 * kFrame, 2 * kFrame);
  fail_unless_equals_int (mux.pull (), 3);
  fail_unless_equals_uint64 (mux.stat ("incomplete"), 1);
}
GST_END_TEST;

GST_START_TEST (test_what_comes_after_its_frame_set_is_dropped_and_counted)
{
  Mux mux (2, false, true, "latency=20000000");
  mux.push (0, kFrame, kFrame);
  fail_unless (gst_harness_crank_single_clock_wait (mux.out));
  fail_unless_equals_int (mux.pull (), 1);
  mux.push (1, kFrame, kFrame);
  mux.push (1, 2 * kFrame, 2 * kFrame);
  mux.push (0, 2 * kFrame, 2 * kFrame);
  fail_unless_equals_int (mux.pull (), 3);
  fail_unless_equals_uint64 (mux.stat ("dropped-late"), 1);
}
GST_END_TEST;

GST_START_TEST (test_latency_query_adds_its_own)
{
  Mux mux (1, false, true, "latency=20000000");
  gst_harness_set_upstream_latency (mux.in[0], 5 * GST_MSECOND);
  mux.push (0, 0, 0);
  mux.pull ();
  fail_unless_equals_uint64 (gst_harness_query_latency (mux.out), 25 * GST_MSECOND);
}
GST_END_TEST;

GST_START_TEST (test_gap_lets_the_others_go_on_until_it_is_over)
{
  Mux m (2);
  gst_harness_push_event (m.in[1], gst_event_new_gap (0, 2 * kFrame));
  m.push (0, 0, 0);
  fail_unless_equals_int (m.pull (), 0b01);
  m.push (0, kFrame, kFrame);
  fail_unless_equals_int (m.pull (), 0b01);
  m.push (0, 2 * kFrame, 2 * kFrame);
  m.push (1, 2 * kFrame, 2 * kFrame);
  fail_unless_equals_int (m.pull (), 0b11);
}
GST_END_TEST;

GST_START_TEST (test_frames_before_the_segment_are_left_out)
{
  Mux m (2);
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_TIME);
  segment.start = segment.time = 2 * kFrame;
  for (int i : {0, 1})
    gst_harness_push_event (m.in[i], gst_event_new_segment (&segment));
  for (int frame : {0, 2})
    for (int i : {0, 1})
      m.push (i, frame * kFrame, frame * kFrame);
  GstClockTime capture = 0;
  fail_unless_equals_int (m.pull (&capture), 0b11);
  fail_unless_equals_uint64 (capture, 2 * kFrame);
  fail_unless (gst_harness_try_pull (m.out) == nullptr);
}
GST_END_TEST;

GST_START_TEST (test_two_pads_with_one_view_are_one_error_that_names_both)
{
  Mux mux (2);
  gst_harness_set_src_caps (
      mux.in[1], gstrange::make_range_caps (gstrange::make_info (mux.one (0), 25, 1)));
  mux.push (0, 0, 0);
  gst_harness_push (mux.in[1], make_frame_set (mux.one (0), 0));
  const std::string text = next_message_text (mux.bus, GST_MESSAGE_ERROR);
  fail_unless_contains (text, "sink_0");
  fail_unless_contains (text, "sink_1");
  fail_unless_contains (text, "view-id 0");
}
GST_END_TEST;

GST_START_TEST (test_raw_and_coded_together_are_one_error)
{
  Mux mux (2);
  gst_harness_set_src_caps (mux.in[1],
      gstrange::make_neighbour_code_caps (gstrange::make_info (mux.one (1), 25, 1), "access-unit"));
  mux.push (0, 0, 0);
  gst_harness_push (mux.in[1], gst_buffer_new_memdup ("abc", 3));
  fail_unless_contains (next_message_text (mux.bus, GST_MESSAGE_ERROR), "all coded");
}
GST_END_TEST;

GST_START_TEST (test_refused_caps_are_one_error_and_no_warning)
{
  Mux mux (2);
  GstCaps *caps = gstrange::make_range_caps (gstrange::make_info (mux.one (1), 25, 1));
  gst_caps_set_simple (caps, "rig", G_TYPE_INT, 5, nullptr);
  gst_harness_set_src_caps (mux.in[1], caps);
  gst_harness_push (mux.in[1], make_frame_set (mux.one (1), 0));
  mux.push (0, 0, 0);
  fail_unless_contains (next_message_text (mux.bus, GST_MESSAGE_ERROR), "pad sink_1");
  GstMessage *more = gst_bus_timed_pop_filtered (
      mux.bus, GST_SECOND / 2, GstMessageType (GST_MESSAGE_ERROR | GST_MESSAGE_WARNING));
  fail_unless (more == nullptr);
}
GST_END_TEST;

GST_START_TEST (test_coded_access_units_are_joined)
{
  Mux mux (2, true);
  for (int i = 0; i < 2; i++) {
    guint8 bytes[kSliceHeaderSize];
    SliceHeader header;
    header.view_id = guint8 (i);
    header.depth_bits = 12;
    header.colour_bits = 8;
    write_slice_header (header, sizeof bytes, bytes);
    GstBuffer *buffer = gst_buffer_new_memdup (bytes, sizeof bytes);
    gst_range_buffer_set_capture_time (buffer, 9);
    GST_BUFFER_PTS (buffer) = 0;
    gst_harness_push (mux.in[i], buffer);
  }
  GstBuffer *output = gst_harness_pull (mux.out);
  fail_unless_equals_int (gst_buffer_get_size (output), 2 * kSliceHeaderSize);
  fail_unless_equals_uint64 (gst_range_buffer_get_capture_time (output), 9);
  gst_buffer_unref (output);
}
GST_END_TEST;

GST_START_TEST (test_request_for_a_key_frame_set_goes_to_all_streams)
{
  Mux mux (3, true);
  fail_unless (gst_harness_push_upstream_event (
      mux.out, gst_video_event_new_upstream_force_key_unit (GST_CLOCK_TIME_NONE, TRUE, 7)));
  for (GstHarness *in : mux.in) {
    int requests = 0;
    while (GstEvent *event = gst_harness_try_pull_upstream_event (in)) {
      guint count = 0;
      if (gst_video_event_is_force_key_unit (event)) {
        gst_video_event_parse_upstream_force_key_unit (event, nullptr, nullptr, &count);
        requests += count == 7;
      }
      gst_event_unref (event);
    }
    fail_unless_equals_int (requests, 1);
  }
}
GST_END_TEST;

GST_START_TEST (test_plays_twice)
{
  GstElement *element = gst_element_factory_make ("rangemux", nullptr);
  for (int i = 0; i < 2; i++) {
    GstHarness *h = gst_harness_new_with_element (element, "sink_%u", "src");
    Rig rig = ring_rig (1, 32, 24);
    gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (rig, 25, 1)));
    gst_harness_push (h, make_frame_set (rig, 5));
    GstBuffer *output = gst_harness_pull (h);
    fail_unless_equals_uint64 (gst_range_buffer_get_capture_time (output), 5);
    gst_buffer_unref (output);
    gst_harness_teardown (h);
    gst_element_set_state (element, GST_STATE_NULL);
  }
  gst_object_unref (element);
}
GST_END_TEST;

static Suite *
rangemux_suite ()
{
  Suite *suite = suite_create ("rangemux");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_frames_before_the_segment_are_left_out);
  tcase_add_test (tc, test_gap_lets_the_others_go_on_until_it_is_over);
  tcase_add_test (tc, test_views_are_matched_by_capture_time_not_by_arrival_or_pts);
  tcase_add_test (tc, test_skew_beyond_half_a_period_is_another_frame_set);
  tcase_add_test (tc, test_caps_are_the_union_and_memory_is_shared);
  tcase_add_test (tc, test_live_goes_on_without_a_missing_view_after_the_latency_and_takes_it_back);
  tcase_add_test (tc, test_what_comes_after_its_frame_set_is_dropped_and_counted);
  tcase_add_test (tc, test_latency_query_adds_its_own);
  tcase_add_test (tc, test_two_pads_with_one_view_are_one_error_that_names_both);
  tcase_add_test (tc, test_raw_and_coded_together_are_one_error);
  tcase_add_test (tc, test_refused_caps_are_one_error_and_no_warning);
  tcase_add_test (tc, test_coded_access_units_are_joined);
  tcase_add_test (tc, test_request_for_a_key_frame_set_goes_to_all_streams);
  tcase_add_test (tc, test_plays_twice);
  return suite;
}

GST_CHECK_MAIN (rangemux);
