/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What rangedemux makes of frame sets. Its pads and events: rangedemuxpads. */
#include "demux-check.hpp"

#include <gst/app/gstappsink.h>

using namespace rangecast;
using namespace rangecast::testing;

static bool
holds (GstBuffer *buffer, const Units &units)
{
  return units_of (bytes_of (buffer)) == units;
}

static const guint16 *
first_depth (GstBuffer *buffer, guint view_id)
{
  GstRangeView view;
  const GstRangeMeta *meta = gst_buffer_get_range_meta (buffer, view_id);
  fail_unless (meta && gst_range_view_map (&view, buffer, meta, GST_MAP_READ));
  const guint16 *depth = view.depth;
  gst_range_view_unmap (&view);
  return depth;
}

GST_START_TEST (test_each_view_has_a_pad_with_its_own_rig)
{
  Demux demux;
  Rig rig = ring_rig (3);
  rig.views[2].width = 100;
  rig.views[2].height = 80;
  demux.set_caps (range_caps (rig));
  fail_unless_equals_string (demux.told.c_str (), "+src_0+src_1+src_2.");
  for (int id = 0; id < 3; id++) {
    const Rig one = rig_of_pad (demux[id], "video/x-range");
    fail_unless_cmp (encode_rig (one), ==, encode_rig (views_of (rig, {id})));
  }
  GstCaps *caps = gst_pad_get_current_caps (demux[2]->sinkpad);
  int width = 0;
  gst_structure_get_int (gst_caps_get_structure (caps, 0), "width", &width);
  fail_unless_equals_int (width, 100);
  gst_caps_unref (caps);
}
GST_END_TEST;

GST_START_TEST (test_pixels_are_shared_and_the_rest_is_kept)
{
  Demux demux;
  const Rig rig = ring_rig (2);
  demux.set_caps (range_caps (rig));
  GstBuffer *input = make_frame_set (rig, 5 * kFrame, {100, 60, 51, 43});
  GST_BUFFER_DURATION (input) = kFrame;
  gst_buffer_get_range_meta (input, 1)->capture_time = 5 * kFrame + 7;
  GST_BUFFER_FLAG_SET (input, GST_BUFFER_FLAG_MARKER);
  fail_unless_equals_int (demux.push (gst_buffer_ref (input)), GST_FLOW_OK);
  for (guint id : {0u, 1u}) {
    GstBuffer *view = demux.pull (int (id));
    fail_unless_equals_int (gst_buffer_n_range_metas (view), 1);
    ck_assert_ptr_eq (first_depth (view, id), first_depth (input, id));
    const GstRangeMeta *meta = gst_buffer_get_range_meta (view, id);
    fail_unless_equals_int (meta->x, 100);
    fail_unless_equals_int (meta->height, 43);
    ck_assert_uint_lt (gst_buffer_get_size (view), gst_buffer_get_size (input));
    fail_unless_equals_uint64 (GST_BUFFER_PTS (view), 5 * kFrame);
    fail_unless_equals_uint64 (GST_BUFFER_DURATION (view), kFrame);
    fail_unless_equals_uint64 (gst_range_buffer_get_capture_time (view), 5 * kFrame + 7 * id);
    fail_unless (GST_BUFFER_FLAG_IS_SET (view, GST_BUFFER_FLAG_MARKER));
    fail_unless (GST_BUFFER_IS_DISCONT (view)); /* the first of its pad */
    gst_buffer_unref (view);
  }
  gst_buffer_unref (input);
  fail_unless_equals_uint64 (demux.stat ("frames"), 1);
  fail_unless_equals_uint64 (demux.stat ("buffers"), 2);
}
GST_END_TEST;

GST_START_TEST (test_coded_views_have_their_own_units_and_caps)
{
  Demux demux;
  const Rig rig = ring_rig (2, 32, 24);
  demux.set_caps (coded_caps (rig));
  fail_unless_cmp (encode_rig (rig_of_pad (demux[1], "video/x-neighbour-code")), ==,
      encode_rig (views_of (rig, {1})));
  const auto a = slice_unit (0, true, 11, 1, 2), b = slice_unit (1, true, 12, 2, 4),
             c = slice_unit (0, true, 11, 3, 2, 2);
  const Units of_view0 = {a, c}, of_view1 = {b};
  GstBuffer *input = buffer_of ({a, b, c}, kFrame);
  fail_unless_equals_int (demux.push (input), GST_FLOW_OK);
  GstBuffer *view0 = demux.pull (0), *view1 = demux.pull (1);
  fail_unless (holds (view0, of_view0));
  fail_unless (holds (view1, of_view1));
  fail_unless_equals_uint64 (gst_range_buffer_get_capture_time (view0), 11);
  fail_unless_equals_uint64 (gst_range_buffer_get_capture_time (view1), 12);
  gst_buffer_unref (view0);
  gst_buffer_unref (view1);
}
GST_END_TEST;

GST_START_TEST (test_coded_view_that_is_whole_is_a_place_to_begin)
{
  Demux demux;
  demux.set_caps (coded_caps (ring_rig (3, 32, 24)));
  GstBuffer *input = buffer_of ({slice_unit (0, true, 0, 1, 4), slice_unit (1, false, 0, 2, 4),
      slice_unit (2, true, 0, 3, 2)}); /* of view 2 half is missing */
  GST_BUFFER_FLAG_SET (input, GST_BUFFER_FLAG_DELTA_UNIT);
  fail_unless_equals_int (demux.push (input), GST_FLOW_OK);
  for (int id : {0, 1, 2}) {
    GstBuffer *view = demux.pull (id);
    fail_unless_equals_int (
        GST_BUFFER_FLAG_IS_SET (view, GST_BUFFER_FLAG_DELTA_UNIT), id == 0 ? FALSE : TRUE);
    gst_buffer_unref (view);
  }
}
GST_END_TEST;

GST_START_TEST (test_more_pieces_than_a_buffer_holds_keep_their_order)
{
  Demux demux;
  demux.set_caps (coded_caps (ring_rig (2, 32, 24)));
  Units units, of_view[2];
  for (int i = 0; i < 60; i++) {
    units.push_back (slice_unit (i % 2, true, 0, guint8 (i)));
    of_view[i % 2].push_back (units.back ());
  }
  fail_unless_equals_int (demux.push (buffer_of (units)), GST_FLOW_OK);
  for (int id : {0, 1}) {
    GstBuffer *view = demux.pull (id);
    fail_unless (holds (view, of_view[id]));
    gst_buffer_unref (view);
  }
}
GST_END_TEST;

GST_START_TEST (test_unit_across_two_memories_is_found)
{
  Demux demux;
  demux.set_caps (coded_caps (ring_rig (2, 32, 24)));
  const auto a = slice_unit (0, true, 0, 1), b = slice_unit (1, true, 0, 2),
             c = slice_unit (0, true, 0, 3);
  const Units of_view0 = {a, c}, of_view1 = {b};
  GstBuffer *whole = buffer_of ({a, b, c});
  for (gsize cut = 1; cut < gst_buffer_get_size (whole); cut++) {
    GstBuffer *input = gst_buffer_copy_region (whole, GST_BUFFER_COPY_MEMORY, 0, cut);
    gst_buffer_copy_into (input, whole, GST_BUFFER_COPY_MEMORY, cut, gsize (-1));
    GST_BUFFER_PTS (input) = 0;
    fail_unless_equals_int (gst_buffer_n_memory (input), 2);
    fail_unless_equals_int (demux.push (input), GST_FLOW_OK);
    GstBuffer *view0 = demux.pull (0), *view1 = demux.pull (1);
    fail_unless (holds (view0, of_view0));
    fail_unless (holds (view1, of_view1));
    gst_buffer_unref (view0);
    gst_buffer_unref (view1);
  }
  fail_unless_equals_uint64 (demux.stat ("dropped"), 0);
  gst_buffer_unref (whole);
}
GST_END_TEST;

GST_START_TEST (test_damaged_units_are_dropped_and_counted)
{
  Demux demux;
  demux.set_caps (coded_caps (ring_rig (2, 32, 24)));
  const auto good = slice_unit (1, true, 0, 1);
  auto bad = slice_unit (0, true, 0, 1);
  bad[4] = 200; /* view-id */
  fail_unless_equals_int (demux.push (buffer_of ({bad, good})), GST_FLOW_OK);
  gst_buffer_unref (demux.pull (1));
  fail_unless (gst_harness_try_pull (demux[0]) == nullptr);
  fail_unless_equals_uint64 (demux.stat ("dropped"), 1);
  fail_unless_equals_uint64 (demux.stat ("gaps"), 1);
}
GST_END_TEST;

/* Each prefix in a copy of its own size, so that the address sanitizer sees one byte too far. */
GST_START_TEST (test_no_prefix_of_a_frame_set_is_read_beyond_its_end)
{
  Demux demux;
  demux.set_caps (coded_caps (ring_rig (2, 32, 24)));
  const auto bytes = [] {
    GstBuffer *buffer = buffer_of ({slice_unit (0, false, 0, 1), slice_unit (1, true, 0, 2)});
    auto all = bytes_of (buffer);
    gst_buffer_unref (buffer);
    return all;
  }();
  for (gsize size = 1; size <= bytes.size (); size++) {
    GstBuffer *input = gst_buffer_new_memdup (bytes.data (), size);
    GST_BUFFER_PTS (input) = size;
    fail_unless_equals_int (demux.push (input), GST_FLOW_OK);
    for (int id : {0, 1})
      if (GstBuffer *view = gst_harness_try_pull (demux[id]))
        gst_buffer_unref (view);
  }
  fail_unless_equals_uint64 (demux.stat ("buffers"), (bytes.size () - 38 + 1) + 1);
}
GST_END_TEST;

GST_START_TEST (test_planes_outside_their_buffer_are_a_gap)
{
  Demux demux;
  const Rig rig = ring_rig (2);
  demux.set_caps (range_caps (rig));
  GstBuffer *input = make_frame_set (rig);
  gst_buffer_get_range_meta (input, 0)->depth_offset = gst_buffer_get_size (input) - 2;
  fail_unless_equals_int (demux.push (input), GST_FLOW_OK);
  gst_buffer_unref (demux.pull (1));
  fail_unless (gst_harness_try_pull (demux[0]) == nullptr);
  fail_unless_equals_uint64 (demux.stat ("dropped"), 1);
}
GST_END_TEST;

GST_START_TEST (test_views_that_the_rig_does_not_name_are_counted_as_dropped)
{
  for (const bool coded : {false, true}) {
    Demux demux;
    const Rig rig = ring_rig (3, 32, 24), first = views_of (rig, {0});
    demux.set_caps (coded ? coded_caps (first) : range_caps (first));
    GstBuffer *input = coded ? buffer_of ({slice_unit (0, true, 0, 0), slice_unit (1, true, 0, 0),
                                   slice_unit (1, true, 0, 0, 1, 1), slice_unit (2, true, 0, 0)})
                             : make_frame_set (rig);
    fail_unless_equals_int (demux.push (input), GST_FLOW_OK);
    gst_buffer_unref (demux.pull (0));
    fail_unless_equals_uint64 (demux.stat ("dropped"), 2);
    fail_unless_equals_uint64 (demux.stat ("buffers"), 1);
  }
}
GST_END_TEST;

GST_START_TEST (test_64_views)
{
  Demux demux;
  const Rig rig = ring_rig (64, 16, 12);
  demux.set_caps (range_caps (rig));
  GstBuffer *input = make_frame_set (rig);
  fail_unless_equals_int (demux.push (gst_buffer_ref (input)), GST_FLOW_OK);
  for (int id = 0; id < 64; id++) {
    GstBuffer *view = demux.pull (id);
    ck_assert_ptr_eq (first_depth (view, guint (id)), first_depth (input, guint (id)));
    gst_buffer_unref (view);
  }
  gst_buffer_unref (input);
}
GST_END_TEST;

static std::vector<std::vector<guint8>>
all_of (GstElement *pipeline, const char *name)
{
  GstElement *sink = gst_bin_get_by_name (GST_BIN (pipeline), name);
  std::vector<std::vector<guint8>> buffers;
  while (GstSample *sample = gst_app_sink_try_pull_sample (GST_APP_SINK (sink), 0)) {
    buffers.push_back (bytes_of (gst_sample_get_buffer (sample)));
    gst_sample_unref (sample);
  }
  gst_object_unref (sink);
  return buffers;
}

GST_START_TEST (test_rangemux_puts_together_what_came_apart)
{
  for (const char *code : {"", "neighbourcodeenc !"}) {
    const std::string launch =
        std::string ("avatartestsrc views=3 num-buffers=4 ! video/x-range,width=64,height=48 ! ") +
        code +
        " tee name=t t. ! queue ! appsink name=whole sync=false wait-on-eos=false "
        "t. ! queue ! rangedemux name=d d.src_0 ! queue ! mux. d.src_1 ! queue ! mux. "
        "d.src_2 ! queue ! mux. rangemux name=mux ! appsink name=again sync=false "
        "wait-on-eos=false";
    GstElement *pipeline = gst_parse_launch (launch.c_str (), nullptr);
    fail_unless (pipeline != nullptr);
    ck_assert_int_ne (
        gst_element_set_state (pipeline, GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
    GstBus *bus = gst_element_get_bus (pipeline);
    GstMessage *message = gst_bus_timed_pop_filtered (
        bus, 20 * GST_SECOND, GstMessageType (GST_MESSAGE_EOS | GST_MESSAGE_ERROR));
    fail_unless (message);
    ck_assert_int_eq (GST_MESSAGE_TYPE (message), GST_MESSAGE_EOS);
    gst_message_unref (message);
    gst_object_unref (bus);
    const auto whole = all_of (pipeline, "whole"), again = all_of (pipeline, "again");
    fail_unless_equals_int (whole.size (), 4);
    fail_unless_equals_int (again.size (), 4);
    if (*code)
      fail_unless_cmp (whole, ==, again);
    gst_element_set_state (pipeline, GST_STATE_NULL);
    gst_object_unref (pipeline);
  }
}
GST_END_TEST;

static Suite *
rangedemux_suite ()
{
  Suite *suite = suite_create ("rangedemux");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_each_view_has_a_pad_with_its_own_rig);
  tcase_add_test (tc, test_pixels_are_shared_and_the_rest_is_kept);
  tcase_add_test (tc, test_coded_views_have_their_own_units_and_caps);
  tcase_add_test (tc, test_coded_view_that_is_whole_is_a_place_to_begin);
  tcase_add_test (tc, test_more_pieces_than_a_buffer_holds_keep_their_order);
  tcase_add_test (tc, test_unit_across_two_memories_is_found);
  tcase_add_test (tc, test_damaged_units_are_dropped_and_counted);
  tcase_add_test (tc, test_no_prefix_of_a_frame_set_is_read_beyond_its_end);
  tcase_add_test (tc, test_planes_outside_their_buffer_are_a_gap);
  tcase_add_test (tc, test_views_that_the_rig_does_not_name_are_counted_as_dropped);
  tcase_add_test (tc, test_64_views);
  tcase_add_test (tc, test_rangemux_puts_together_what_came_apart);
  return suite;
}

GST_CHECK_MAIN (rangedemux);
