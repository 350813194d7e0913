/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "../rangecast-check.hpp"

using namespace rangecast;
using namespace rangecast::testing;

/* A harness whose caps carry that rig. */
static GstHarness *
harness_for (const Rig &rig, const char *launch = "cylinderfilter")
{
  GstHarness *h = gst_harness_new_parse (launch);
  gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (rig, 30, 1)));
  return h;
}

/* All cameras at one place: every point but the first view's is seen twice. */
static Rig
same_place_rig (int views, int width = 320, int height = 240)
{
  Rig rig = ring_rig (views, width, height);
  for (View &view : rig.views)
    view.world_from_view = rig.views[0].world_from_view;
  return rig;
}

static std::size_t
points_of_view (GstBuffer *buffer, std::size_t index)
{
  gstrange::RangeFrameMap frame (buffer, GST_MAP_READ);
  fail_unless_ok (frame.status ());
  const RangeImage &image = frame.views ()[index];
  std::size_t n = 0;
  for (int y = 0; y < image.depth.height; y++)
    for (int x = 0; x < image.depth.width; x++)
      n += image.depth.at (x, y) != 0;
  return n;
}

GST_START_TEST (test_clears_what_another_view_sees_and_keeps_times)
{
  const Rig rig = same_place_rig (3);
  GstHarness *h = harness_for (rig);
  GstBuffer *in = make_frame_set (rig, 5 * GST_SECOND);
  GST_BUFFER_DURATION (in) = 7;
  GST_BUFFER_FLAG_SET (in, GST_BUFFER_FLAG_MARKER);
  const std::size_t points = points_of_view (in, 0);
  GstBuffer *out = gst_harness_push_and_pull (h, in);
  fail_unless_equals_int (points_of_view (out, 0), points);
  /* Of views in one place the others keep corners of their outline. */
  ck_assert_uint_lt (points_of_view (out, 1), points / 20);
  ck_assert_uint_lt (points_of_view (out, 2), points / 20);
  fail_unless_equals_uint64 (GST_BUFFER_PTS (out), 5 * GST_SECOND);
  fail_unless_equals_uint64 (GST_BUFFER_DURATION (out), 7);
  fail_unless (GST_BUFFER_FLAG_IS_SET (out, GST_BUFFER_FLAG_MARKER));
  fail_unless_equals_uint64 (gst_range_buffer_get_capture_time (out), 5 * GST_SECOND);
  fail_unless_equals_uint64 (gst_buffer_get_range_meta (out, 2)->capture_time, 5 * GST_SECOND);
  gst_buffer_unref (out);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_works_in_place_and_leaves_shared_buffers_alone)
{
  const Rig rig = same_place_rig (2);
  GstHarness *h = harness_for (rig);
  GstBuffer *in = make_frame_set (rig), *out = gst_harness_push_and_pull (h, in);
  ck_assert_ptr_eq (in, out);
  gst_buffer_unref (out);

  in = make_frame_set (rig);
  const std::size_t points = points_of_view (in, 1);
  out = gst_harness_push_and_pull (h, gst_buffer_ref (in));
  ck_assert_ptr_ne (in, out);
  ck_assert_uint_lt (points_of_view (out, 1), points / 20);
  fail_unless_equals_int (points_of_view (in, 1), points);
  gst_buffer_unref (in);
  gst_buffer_unref (out);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_one_view_and_empty_rois_pass)
{
  GstHarness *h = harness_for (ring_rig (1));
  GstBuffer *in = make_frame_set (ring_rig (1));
  const std::size_t points = points_of_view (in, 0);
  GstBuffer *out = gst_harness_push_and_pull (h, in);
  fail_unless_equals_int (points_of_view (out, 0), points);
  gst_buffer_unref (out);

  const Rig rig = ring_rig (3);
  gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (rig, 30, 1)));
  in = gst_range_buffer_new (3, 320, 240);
  for (guint id = 0; id < 3; id++)
    gst_range_buffer_add_view (in, id, 0, 0, 0, 0, 0);
  out = gst_harness_push_and_pull (h, in);
  fail_unless_equals_int (gst_buffer_n_range_metas (out), 3);
  gst_buffer_unref (out);
  out = gst_harness_push_and_pull (h, gst_range_buffer_new (0, 320, 240));
  gst_buffer_unref (out);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_frame_sets_may_lack_views)
{
  const Rig rig = ring_rig (4);
  Rig some;
  some.views = {rig.views[1], rig.views[3]};
  GstHarness *h = harness_for (rig);
  GstBuffer *out = gst_harness_push_and_pull (h, make_frame_set (some, 0, {100, 80, 50, 40}));
  fail_unless_equals_int (gst_buffer_n_range_metas (out), 2);
  gst_buffer_unref (out);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_caps_may_change_in_the_stream)
{
  GstHarness *h = harness_for (same_place_rig (2));
  GstElement *element = gst_harness_find_element (h, "cylinderfilter");
  gst_buffer_unref (gst_harness_push_and_pull (h, make_frame_set (same_place_rig (2))));
  const Rig larger = same_place_rig (5, 160, 120);
  gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (larger, 15, 1)));
  GstBuffer *out = gst_harness_push_and_pull (h, make_frame_set (larger));
  ck_assert_uint_gt (points_of_view (out, 0), 0);
  ck_assert_uint_lt (points_of_view (out, 4), points_of_view (out, 0) / 10);
  fail_unless_equals_uint64 (stats_field (element, "frames"), 2);
  gst_buffer_unref (out);
  gst_object_unref (element);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_stats_count_frames_points_and_cells)
{
  const Rig rig = same_place_rig (2);
  GstHarness *h = harness_for (rig, "cylinderfilter axis=vertical");
  GstElement *element = gst_harness_find_element (h, "cylinderfilter");
  GstBuffer *out = nullptr;
  for (int i = 0; i < 3; i++) {
    gst_clear_buffer (&out);
    out = gst_harness_push_and_pull (h, make_frame_set (rig, i * GST_SECOND / 30));
  }
  const guint64 points = points_of_view (out, 0);
  fail_unless_equals_uint64 (stats_field (element, "frames"), 3);
  fail_unless_equals_uint64 (stats_field (element, "points-in"), 6 * points);
  fail_unless_equals_uint64 (
      stats_field (element, "points-out"), 3 * (points + points_of_view (out, 1)));
  ck_assert_uint_gt (stats_field (element, "cells"), 0);
  fail_unless_equals_uint64 (stats_field (element, "cells"), stats_field (element, "cells-shared"));
  gst_buffer_unref (out);
  gst_object_unref (element);
  gst_harness_teardown (h);
}
GST_END_TEST;

/* All properties but the statistics say that they may change while playing. */
GST_START_TEST (test_every_property_may_be_set_while_playing)
{
  const Rig rig = ring_rig (4);
  GstHarness *h = harness_for (rig);
  GstElement *element = gst_harness_find_element (h, "cylinderfilter");
  guint count = 0;
  GParamSpec **specs = g_object_class_list_properties (G_OBJECT_GET_CLASS (element), &count);
  for (guint i = 0; i < count; i++)
    if (specs[i]->owner_type == G_OBJECT_TYPE (element) && (specs[i]->flags & G_PARAM_WRITABLE))
      fail_unless (specs[i]->flags & GST_PARAM_MUTABLE_PLAYING, "%s", specs[i]->name);
  g_free (specs);
  guint64 before = 0;
  for (const auto &[name, value] : std::vector<std::pair<const char *, const char *>>{
           {"overlap", "0"}, {"overlap", "16"}, {"axis", "world"}, {"axis", "vertical"},
           {"columns", "90"}, {"slice-height", "0.01"}, {"n-threads", "1"}}) {
    gst_util_set_object_arg (G_OBJECT (element), name, value);
    gst_buffer_unref (gst_harness_push_and_pull (h, make_frame_set (rig)));
    const guint64 points = stats_field (element, "points-out"),
                  cells = stats_field (element, "cells");
    ck_assert_uint_gt (points + cells, before);
    before = points + cells;
  }
  gst_object_unref (element);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_view_that_the_caps_lack_is_one_error_by_name)
{
  GstHarness *h = harness_for (ring_rig (2));
  GstElement *element = gst_harness_find_element (h, "cylinderfilter");
  GstBus *bus = gst_bus_new ();
  gst_element_set_bus (element, bus);
  fail_unless_equals_int (gst_harness_push (h, make_frame_set (ring_rig (3))), GST_FLOW_ERROR);
  fail_unless_contains (next_message_text (bus, GST_MESSAGE_ERROR), "view 2");
  fail_if (gst_bus_have_pending (bus));
  gst_element_set_bus (element, nullptr);
  gst_object_unref (bus);
  gst_object_unref (element);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_caps_without_rig_are_refused_with_an_error)
{
  GstHarness *h = gst_harness_new ("cylinderfilter");
  GstBus *bus = gst_bus_new ();
  gst_element_set_bus (h->element, bus);
  gst_harness_set_src_caps_str (
      h, "video/x-range,format=Z16_RGBx,width=320,height=240,framerate=30/1,views=2");
  gst_harness_push (h, make_frame_set (ring_rig (2)));
  fail_unless_contains (next_message_text (bus, GST_MESSAGE_ERROR), "rig");
  gst_element_set_bus (h->element, nullptr);
  gst_object_unref (bus);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_goes_through_all_states_twice_and_flushes)
{
  const Rig rig = same_place_rig (2);
  GstElement *element =
      GST_ELEMENT (gst_object_ref_sink (gst_element_factory_make ("cylinderfilter", nullptr)));
  for (int round = 0; round < 2; round++) {
    GstHarness *h = gst_harness_new_with_element (element, "sink", "src");
    gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (rig, 30, 1)));
    gst_buffer_unref (gst_harness_push_and_pull (h, make_frame_set (rig)));
    fail_unless_equals_uint64 (stats_field (element, "frames"), 1);
    fail_unless (gst_harness_push_event (h, gst_event_new_flush_start ()));
    fail_unless (gst_harness_push_event (h, gst_event_new_flush_stop (TRUE)));
    GstSegment segment;
    gst_segment_init (&segment, GST_FORMAT_TIME);
    fail_unless (gst_harness_push_event (h, gst_event_new_segment (&segment)));
    gst_buffer_unref (gst_harness_push_and_pull (h, make_frame_set (rig)));
    fail_unless (gst_harness_push_event (h, gst_event_new_gap (0, GST_SECOND / 30)));
    fail_unless (gst_harness_push_event (h, gst_event_new_eos ()));
    gst_harness_teardown (h); /* to NULL */
    fail_unless_equals_int (GST_STATE (element), GST_STATE_NULL);
  }
  gst_object_unref (element);
}
GST_END_TEST;

GST_START_TEST (test_adds_no_latency)
{
  GstHarness *h = harness_for (ring_rig (2));
  gst_harness_set_upstream_latency (h, 30 * GST_MSECOND);
  fail_unless_equals_uint64 (gst_harness_query_latency (h), 30 * GST_MSECOND);
  gst_harness_teardown (h);
}
GST_END_TEST;

static Suite *
cylinderfilter_suite ()
{
  Suite *suite = suite_create ("cylinderfilter");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_clears_what_another_view_sees_and_keeps_times);
  tcase_add_test (tc, test_works_in_place_and_leaves_shared_buffers_alone);
  tcase_add_test (tc, test_one_view_and_empty_rois_pass);
  tcase_add_test (tc, test_frame_sets_may_lack_views);
  tcase_add_test (tc, test_caps_may_change_in_the_stream);
  tcase_add_test (tc, test_stats_count_frames_points_and_cells);
  tcase_add_test (tc, test_every_property_may_be_set_while_playing);
  tcase_add_test (tc, test_view_that_the_caps_lack_is_one_error_by_name);
  tcase_add_test (tc, test_caps_without_rig_are_refused_with_an_error);
  tcase_add_test (tc, test_goes_through_all_states_twice_and_flushes);
  tcase_add_test (tc, test_adds_no_latency);
  return suite;
}

GST_CHECK_MAIN (cylinderfilter);
