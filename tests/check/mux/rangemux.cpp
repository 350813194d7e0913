/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../coded-check.hpp"
#include "mux-check.hpp"

#include <gst/video/video.h>

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

static GstBuffer *
slice_of_view (int id)
{
  guint8 bytes[kSliceHeaderSize];
  SliceHeader header;
  header.view_id = guint8 (id);
  header.depth_bits = 12;
  header.colour_bits = 8;
  write_slice_header (header, sizeof bytes, bytes);
  GstBuffer *buffer = gst_buffer_new_memdup (bytes, sizeof bytes);
  gst_range_buffer_set_capture_time (buffer, 9);
  GST_BUFFER_PTS (buffer) = 0;
  return buffer;
}

GST_START_TEST (test_coded_access_units_are_joined)
{
  Mux mux (2, true);
  for (int i = 0; i < 2; i++)
    gst_harness_push (mux.in[i], slice_of_view (i));
  GstBuffer *output = gst_harness_pull (mux.out);
  fail_unless_equals_int (slices_of (output).size (), 2);
  fail_unless_equals_uint64 (gst_range_buffer_get_capture_time (output), 9);
  gst_buffer_unref (output);
}
GST_END_TEST;

/* One person twice in a scene. */
static const char *const kTwice[] = {
    "t. ! m.sink_0 t. ! m.sink_1 m. ! ",
    "t. ! neighbourcodeenc ! tee name=c "
    "c. ! m.sink_0 c. ! m.sink_1 m. ! neighbourcodedec ! ",
};

GST_START_TEST (test_equal_rigs_make_one_scene_renumbered_and_moved)
{
  const std::string launch =
      "rangemux name=m sink_1::view-id-offset=4 sink_1::x=1 sink_1::y=2 sink_1::z=3 sink_1::yaw=90 "
      "avatartestsrc views=2 num-buffers=1 empty-frames=0 ! video/x-range,width=64,height=48 ! "
      "tee name=t " +
      std::string (kTwice[__i__]) + "appsink name=sink sync=false";
  GstElement *pipeline = gst_parse_launch (launch.c_str (), nullptr);
  GstElement *sink = gst_bin_get_by_name (GST_BIN (pipeline), "sink");
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  GstSample *sample = nullptr;
  g_signal_emit_by_name (sink, "pull-sample", &sample);
  fail_unless (sample != nullptr);
  gstrange::RangeInfo info;
  fail_unless_ok (gstrange::parse_caps (gst_sample_get_caps (sample), info));
  {
    const gstrange::RangeFrameMap frame (gst_sample_get_buffer (sample), GST_MAP_READ);
    const auto images = frame.views ();
    fail_unless_equals_int (images.size (), 4);
    for (int i = 0; i < 2; i++) {
      const RangeImage &image = images[i], &twin = images[i + 2];
      fail_unless_equals_int (twin.view_id, image.view_id + 4);
      fail_unless_equals_int (twin.roi.width, image.roi.width);
      fail_unless (std::memcmp (twin.depth.row (0), image.depth.row (0), 2 * image.roi.width) == 0);
      const Vec3 from = info.rig.find (i)->world_from_view * Vec3{0.1, 0.2, 0.3};
      const Vec3 to = info.rig.find (i + 4)->world_from_view * Vec3{0.1, 0.2, 0.3};
      fail_unless (norm (to - Vec3{from.z + 1, from.y + 2, 3 - from.x}) < 1e-9);
    }
  }
  gst_sample_unref (sample);
  gst_element_set_state (pipeline, GST_STATE_NULL);
  gst_object_unref (sink);
  gst_object_unref (pipeline);
}
GST_END_TEST;

GST_START_TEST (test_offset_beyond_the_last_view_id_names_the_pad)
{
  Mux mux (2);
  gst_child_proxy_set (GST_CHILD_PROXY (mux.out->element), "sink_1::view-id-offset", 63, nullptr);
  GstCaps *caps = gstrange::make_range_caps (gstrange::make_info (mux.one (1), 30, 1));
  gst_harness_push_event (mux.in[1], gst_event_new_caps (caps));
  gst_caps_unref (caps);
  fail_unless_contains (
      next_message_text (mux.bus, GST_MESSAGE_ERROR), "sink_1: view-id 64: must be 0 to 63");
}
GST_END_TEST;

/* Pad 1 has view 0 as view 4. */
static void
offset_second_view (Mux &mux, bool coded)
{
  const auto info = gstrange::make_info (mux.one (0), 25, 1);
  gst_child_proxy_set (GST_CHILD_PROXY (mux.out->element), "sink_1::view-id-offset", 4, nullptr);
  gst_harness_set_src_caps (mux.in[1],
      coded ? gstrange::make_neighbour_code_caps (info) : gstrange::make_range_caps (info));
}

GST_START_TEST (test_view_ids_that_the_offset_makes_too_large_are_left_out)
{
  const bool coded = __i__;
  for (const int id : {60, 252}) {
    Mux mux (2, coded);
    offset_second_view (mux, coded);
    for (int i = 0; i < 2; i++) {
      GstBuffer *buffer = coded ? slice_of_view (i * id) : make_frame_set (mux.one (0), 9);
      if (!coded)
        gst_buffer_get_range_meta (buffer, 0)->view_id = guint (i * id);
      gst_harness_push (mux.in[i], buffer);
    }
    if (coded) {
      GstBuffer *output = gst_harness_pull (mux.out);
      fail_unless_equals_int (slices_of (output).size (), 1);
      gst_buffer_unref (output);
    } else {
      fail_unless_equals_int (mux.pull (), 1);
    }
  }
}
GST_END_TEST;

/* The view-ids of the regions that were requested. */
static std::vector<guint>
requested_views (GstHarness *h)
{
  std::vector<guint> ids;
  while (GstEvent *event = gst_harness_try_pull_upstream_event (h)) {
    guint id;
    if (gst_event_has_name (event, "GstRangeRoi") &&
        gst_structure_get_uint (gst_event_get_structure (event), "view-id", &id))
      ids.push_back (id);
    gst_event_unref (event);
  }
  return ids;
}

GST_START_TEST (test_region_is_requested_from_the_pad_of_its_view_by_the_id_there)
{
  Mux mux (2);
  offset_second_view (mux, false);
  for (GstHarness *in : mux.in)
    gst_harness_push (in, make_frame_set (mux.one (0), 0));
  fail_unless_equals_int (mux.pull (), 0b10001);
  for (const guint id : {4, 0, 1, 68})
    fail_unless_equals_int (
        gst_harness_push_upstream_event (
            mux.out, gst_event_new_custom (GST_EVENT_CUSTOM_UPSTREAM,
                         gst_structure_new ("GstRangeRoi", "view-id", G_TYPE_UINT, id, nullptr))),
        id == 4 || id == 0);
  for (GstHarness *in : mux.in)
    fail_unless (requested_views (in) == std::vector<guint>{0});
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

static Suite *
rangemux_suite ()
{
  Suite *suite = suite_create ("rangemux");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_gap_lets_the_others_go_on_until_it_is_over);
  tcase_add_test (tc, test_views_are_matched_by_capture_time_not_by_arrival_or_pts);
  tcase_add_test (tc, test_caps_are_the_union_and_memory_is_shared);
  tcase_add_test (tc, test_live_goes_on_without_a_missing_view_after_the_latency_and_takes_it_back);
  tcase_add_test (tc, test_what_comes_after_its_frame_set_is_dropped_and_counted);
  tcase_add_test (tc, test_two_pads_with_one_view_are_one_error_that_names_both);
  tcase_add_test (tc, test_coded_access_units_are_joined);
  tcase_add_loop_test (
      tc, test_equal_rigs_make_one_scene_renumbered_and_moved, 0, G_N_ELEMENTS (kTwice));
  tcase_add_test (tc, test_offset_beyond_the_last_view_id_names_the_pad);
  tcase_add_loop_test (tc, test_view_ids_that_the_offset_makes_too_large_are_left_out, 0, 2);
  tcase_add_test (tc, test_region_is_requested_from_the_pad_of_its_view_by_the_id_there);
  tcase_add_test (tc, test_request_for_a_key_frame_set_goes_to_all_streams);
  return suite;
}

GST_CHECK_MAIN (rangemux);
