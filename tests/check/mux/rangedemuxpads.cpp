/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The pads of rangedemux: when they come and go, gaps, events, flow and states. */
#include "demux-check.hpp"

#include <gst/video/video.h>

using namespace rangecast;
using namespace rangecast::testing;

static bool
pulls_gap (GstHarness *h, GstClockTime expected, GstClockTime expected_duration)
{
  while (GstEvent *event = gst_harness_try_pull_event (h)) {
    GstClockTime time = 0, duration = 0;
    const bool gap = GST_EVENT_TYPE (event) == GST_EVENT_GAP;
    if (gap)
      gst_event_parse_gap (event, &time, &duration);
    gst_event_unref (event);
    if (gap)
      return time == expected && duration == expected_duration;
  }
  return false;
}

GST_START_TEST (test_view_that_a_frame_set_lacks_is_a_gap_on_its_pad)
{
  for (bool coded : {false, true}) {
    Demux demux;
    const Rig rig = ring_rig (2, 32, 24);
    demux.set_caps (coded ? coded_caps (rig) : range_caps (rig));
    const auto frame = [&] (std::initializer_list<int> ids, GstClockTime time) {
      if (!coded)
        return make_frame_set (views_of (rig, ids), time);
      Units units;
      for (int id : ids)
        units.push_back (slice_unit (id, true, time, 0));
      return buffer_of (units, time);
    };
    fail_unless_equals_int (demux.push (frame ({0, 1}, 0)), GST_FLOW_OK);
    fail_unless_equals_int (demux.push (frame ({0}, kFrame)), GST_FLOW_OK);
    fail_unless_equals_int (demux.push (frame ({0, 1}, 2 * kFrame)), GST_FLOW_OK);
    fail_unless_equals_int (gst_harness_buffers_received (demux[0]), 3);
    fail_unless_equals_int (gst_harness_buffers_received (demux[1]), 2);
    fail_unless (pulls_gap (demux[1], kFrame, kFrame));
    fail_if (pulls_gap (demux[0], kFrame, kFrame));
    fail_unless_equals_uint64 (demux.stat ("gaps"), 1);
  }
}
GST_END_TEST;

GST_START_TEST (test_views_come_and_go_with_the_rig)
{
  Demux demux;
  const Rig rig = ring_rig (3, 32, 24);
  demux.set_caps (range_caps (views_of (rig, {0, 1})));
  fail_unless_equals_int (demux.push (make_frame_set (views_of (rig, {0, 1}))), GST_FLOW_OK);
  demux.told.clear ();
  GstHarness *old = demux[0];
  demux.set_caps (range_caps (views_of (rig, {1, 2})));
  fail_unless_equals_string (demux.told.c_str (), "+src_2-src_0.");
  fail_unless (pulls_event (old, GST_EVENT_EOS));
  fail_unless_equals_int (
      demux.push (make_frame_set (views_of (rig, {1, 2}), kFrame)), GST_FLOW_OK);
  fail_unless_equals_int (gst_harness_buffers_received (demux[1]), 2);
  fail_unless_equals_int (gst_harness_buffers_received (demux[2]), 1);
  demux.set_caps (range_caps (rig)); /* back again, on a new pad */
  fail_unless_equals_int (demux.push (make_frame_set (rig, 2 * kFrame)), GST_FLOW_OK);
  fail_unless_equals_int (gst_harness_buffers_received (demux[0]), 1);
  fail_unless_equals_int (gst_harness_buffers_received (demux[1]), 3);
}
GST_END_TEST;

static int
count_events (GstHarness *h, GstEventType type)
{
  int n = 0;
  while (GstEvent *event = gst_harness_try_pull_event (h)) {
    n += GST_EVENT_TYPE (event) == type;
    gst_event_unref (event);
  }
  return n;
}

GST_START_TEST (test_new_calibration_is_told_to_its_view_alone)
{
  Demux demux;
  Rig rig = ring_rig (2);
  demux.set_caps (range_caps (rig));
  for (int id : {0, 1})
    fail_unless_equals_int (count_events (demux[id], GST_EVENT_CAPS), 1);
  rig.views[1].intrinsics.fx += 1;
  demux.set_caps (range_caps (rig));
  fail_unless_equals_int (count_events (demux[0], GST_EVENT_CAPS), 0);
  fail_unless_equals_int (count_events (demux[1], GST_EVENT_CAPS), 1);
  fail_unless_equals_int (int (rig_of_pad (demux[1], "video/x-range").views[0].intrinsics.fx), 321);
}
GST_END_TEST;

GST_START_TEST (test_what_sticks_reaches_pads_that_come_later)
{
  Demux demux;
  const Rig rig = ring_rig (2);
  demux.set_caps (range_caps (views_of (rig, {0})));
  GstTagList *tags = gst_tag_list_new (GST_TAG_TITLE, "somebody", nullptr);
  fail_unless (gst_harness_push_event (demux.in, gst_event_new_tag (tags)));
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_TIME);
  segment.start = segment.time = 5 * GST_SECOND;
  fail_unless (gst_harness_push_event (demux.in, gst_event_new_segment (&segment)));
  GstCaps *caps = range_caps (rig); /* the harness would begin a segment of its own with them */
  fail_unless (gst_harness_push_event (demux.in, gst_event_new_caps (caps)));
  gst_caps_unref (caps);
  fail_unless_equals_int (demux.push (make_frame_set (rig, 5 * GST_SECOND)), GST_FLOW_OK);
  std::vector<GstEventType> order;
  GstClockTime start = 0;
  while (GstEvent *event = gst_harness_try_pull_event (demux[1])) {
    order.push_back (GST_EVENT_TYPE (event));
    const GstSegment *told;
    if (order.back () == GST_EVENT_SEGMENT) {
      gst_event_parse_segment (event, &told);
      start = told->start;
    }
    gst_event_unref (event);
  }
  const std::vector<GstEventType> expected = {
      GST_EVENT_STREAM_START, GST_EVENT_CAPS, GST_EVENT_SEGMENT, GST_EVENT_TAG};
  fail_unless_cmp (order, ==, expected);
  fail_unless_equals_uint64 (start, 5 * GST_SECOND);
}
GST_END_TEST;

GST_START_TEST (test_flush_reaches_all_pads_and_data_go_on)
{
  Demux demux;
  const Rig rig = ring_rig (2);
  demux.set_caps (range_caps (rig));
  fail_unless_equals_int (demux.push (make_frame_set (rig)), GST_FLOW_OK);
  flush (demux.in);
  fail_unless_equals_int (demux.push (make_frame_set (rig, kFrame)), GST_FLOW_OK);
  for (int id : {0, 1}) {
    fail_unless (pulls_event (demux[id], GST_EVENT_FLUSH_STOP));
    fail_unless_equals_int (gst_harness_buffers_received (demux[id]), 2);
  }
}
GST_END_TEST;

GST_START_TEST (test_end_reaches_all_pads_and_another_stream_may_follow)
{
  Demux demux;
  const Rig rig = ring_rig (2);
  demux.set_caps (range_caps (rig));
  fail_unless_equals_int (demux.push (make_frame_set (rig)), GST_FLOW_OK);
  fail_unless (gst_harness_push_event (demux.in, gst_event_new_eos ()));
  fail_unless (pulls_event (demux[0], GST_EVENT_EOS));
  fail_unless (pulls_event (demux[1], GST_EVENT_EOS));
  fail_unless (gst_harness_push_event (demux.in, gst_event_new_stream_start ("again")));
  demux.set_caps (range_caps (rig));
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_TIME);
  fail_unless (gst_harness_push_event (demux.in, gst_event_new_segment (&segment)));
  fail_unless_equals_int (demux.push (make_frame_set (rig)), GST_FLOW_OK);
  fail_unless_equals_int (gst_harness_buffers_received (demux[1]), 2);
}
GST_END_TEST;

GST_START_TEST (test_end_without_caps_is_one_error)
{
  Demux demux;
  ErrorCounter errors (demux.in);
  gst_harness_push_event (demux.in, gst_event_new_eos ());
  fail_unless_equals_int (errors.take (), 1);
}
GST_END_TEST;

GST_START_TEST (test_bad_caps_are_an_error)
{
  Demux demux;
  ErrorCounter errors (demux.in);
  demux.set_caps (gst_caps_from_string ("video/x-range, format=(string)Z16_RGBx, width=(int)32, "
                                        "height=(int)24, framerate=(fraction)30/1, views=(int)1"));
  ck_assert_int_ge (errors.take (), 1);
  ck_assert_int_ne (demux.push (make_frame_set (ring_rig (1))), GST_FLOW_OK);
}
GST_END_TEST;

GST_START_TEST (test_unlinked_pad_does_not_stop_the_others)
{
  Demux demux;
  const Rig rig = ring_rig (2);
  demux.set_caps (range_caps (rig));
  GstPad *src = gst_pad_get_peer (demux[0]->sinkpad);
  gst_pad_unlink (src, demux[0]->sinkpad);
  fail_unless_equals_int (demux.push (make_frame_set (rig)), GST_FLOW_OK);
  gst_buffer_unref (demux.pull (1));
  gst_pad_link (src, demux[0]->sinkpad);
  fail_unless_equals_int (demux.push (make_frame_set (rig)), GST_FLOW_OK);
  gst_buffer_unref (demux.pull (0));
  gst_object_unref (src);
}
GST_END_TEST;

GST_START_TEST (test_a_pad_that_is_linked_late_is_linked_though_a_gap_comes_first)
{
  Demux demux;
  const Rig rig = ring_rig (2);
  demux.set_caps (range_caps (views_of (rig, {0})));
  GstPad *src = gst_pad_get_peer (demux[0]->sinkpad);
  gst_pad_unlink (src, demux[0]->sinkpad);
  fail_unless_equals_int (demux.push (make_frame_set (views_of (rig, {0}))), GST_FLOW_NOT_LINKED);
  fail_unless_equals_int (
      demux.push (make_frame_set (views_of (rig, {1}), kFrame)), GST_FLOW_NOT_LINKED);
  gst_pad_link (src, demux[0]->sinkpad);
  fail_unless_equals_int (
      demux.push (make_frame_set (views_of (rig, {1}), 2 * kFrame)), GST_FLOW_OK);
  fail_unless (pulls_gap (demux[0], 2 * kFrame, kFrame));
  gst_object_unref (src);
}
GST_END_TEST;

GST_START_TEST (test_nothing_linked_is_told_upstream)
{
  Demux demux (false);
  const Rig rig = ring_rig (2);
  demux.set_caps (range_caps (rig));
  fail_unless_equals_int (demux.push (make_frame_set (rig)), GST_FLOW_NOT_LINKED);
}
GST_END_TEST;

static int
upstream_events (GstHarness *h, GstEventType type)
{
  int n = 0;
  while (GstEvent *event = gst_harness_try_pull_upstream_event (h)) {
    n += GST_EVENT_TYPE (event) == type;
    gst_event_unref (event);
  }
  return n;
}

GST_START_TEST (test_seek_of_all_sinks_goes_upstream_once_and_others_each)
{
  Demux demux;
  demux.set_caps (range_caps (ring_rig (2)));
  upstream_events (demux.in, GST_EVENT_SEEK);
  for (int again : {1, 2}) {
    GstEvent *seek = gst_event_new_seek (1, GST_FORMAT_TIME, GST_SEEK_FLAG_NONE, GST_SEEK_TYPE_SET,
        again * GST_SECOND, GST_SEEK_TYPE_NONE, 0);
    for (int id : {0, 1})
      fail_unless (gst_harness_push_upstream_event (demux[id], gst_event_ref (seek)));
    gst_event_unref (seek);
    fail_unless_equals_int (upstream_events (demux.in, GST_EVENT_SEEK), 1);
  }
  for (int id : {0, 1})
    gst_harness_push_upstream_event (
        demux[id], gst_event_new_qos (GST_QOS_TYPE_UNDERFLOW, 2, 5, kFrame));
  fail_unless_equals_int (upstream_events (demux.in, GST_EVENT_QOS), 2);
  gst_harness_push_upstream_event (
      demux[1], gst_video_event_new_upstream_force_key_unit (GST_CLOCK_TIME_NONE, FALSE, 0));
  fail_unless_equals_int (upstream_events (demux.in, GST_EVENT_CUSTOM_UPSTREAM), 1);
}
GST_END_TEST;

GST_START_TEST (test_plays_twice)
{
  Demux demux;
  const Rig rig = ring_rig (2);
  for (int round : {1, 2}) {
    demux.set_caps (range_caps (rig));
    fail_unless_equals_int (demux.push (make_frame_set (rig)), GST_FLOW_OK);
    gst_buffer_unref (demux.pull (1));
    fail_unless_equals_uint64 (demux.stat ("frames"), 1);
    demux.told.clear ();
    gst_element_set_state (demux.in->element, GST_STATE_NULL);
    fail_unless_equals_string (demux.told.c_str (), "-src_0-src_1");
    if (round == 1)
      gst_harness_play (demux.in);
  }
}
GST_END_TEST;

static Suite *
rangedemuxpads_suite ()
{
  Suite *suite = suite_create ("rangedemuxpads");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_view_that_a_frame_set_lacks_is_a_gap_on_its_pad);
  tcase_add_test (tc, test_views_come_and_go_with_the_rig);
  tcase_add_test (tc, test_new_calibration_is_told_to_its_view_alone);
  tcase_add_test (tc, test_what_sticks_reaches_pads_that_come_later);
  tcase_add_test (tc, test_flush_reaches_all_pads_and_data_go_on);
  tcase_add_test (tc, test_end_reaches_all_pads_and_another_stream_may_follow);
  tcase_add_test (tc, test_end_without_caps_is_one_error);
  tcase_add_test (tc, test_bad_caps_are_an_error);
  tcase_add_test (tc, test_unlinked_pad_does_not_stop_the_others);
  tcase_add_test (tc, test_a_pad_that_is_linked_late_is_linked_though_a_gap_comes_first);
  tcase_add_test (tc, test_nothing_linked_is_told_upstream);
  tcase_add_test (tc, test_seek_of_all_sinks_goes_upstream_once_and_others_each);
  tcase_add_test (tc, test_plays_twice);
  return suite;
}

GST_CHECK_MAIN (rangedemuxpads);
