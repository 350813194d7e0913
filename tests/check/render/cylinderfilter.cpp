/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include <gst/controller/controller.h>

#include "../failing-memory.hpp"

using namespace rangecast;
using namespace rangecast::testing;

/* A harness whose caps carry that rig. */
static GstHarness *
harness_for (const Rig &rig, const char *launch = "cylinderfilter overlap=1")
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

static guint64
stat (GstElement *element, const char *field)
{
  GstStructure *stats = nullptr;
  guint64 value = 0;
  g_object_get (element, "stats", &stats, nullptr);
  fail_unless (gst_structure_get_uint64 (stats, field, &value), "no field %s", field);
  gst_structure_free (stats);
  return value;
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

GST_START_TEST (test_mode_off_passes_everything_and_may_change_while_playing)
{
  const Rig rig = same_place_rig (2);
  GstHarness *h = harness_for (rig, "cylinderfilter overlap=1 mode=off");
  GstBuffer *in = make_frame_set (rig);
  const std::size_t points = points_of_view (in, 1);
  GstBuffer *out = gst_harness_push_and_pull (h, gst_buffer_ref (in));
  ck_assert_ptr_eq (in, out);
  fail_unless_equals_int (points_of_view (out, 1), points);
  gst_buffer_unref (in);
  gst_buffer_unref (out);
  gst_harness_set (h, "cylinderfilter", "mode", 1, nullptr);
  out = gst_harness_push_and_pull (h, make_frame_set (rig));
  ck_assert_uint_lt (points_of_view (out, 1), points_of_view (out, 0) / 20);
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
  fail_unless_equals_uint64 (stat (element, "frames"), 2);
  gst_buffer_unref (out);
  gst_object_unref (element);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_stats_count_frames_points_and_units)
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
  fail_unless_equals_uint64 (stat (element, "frames"), 3);
  fail_unless_equals_uint64 (stat (element, "points-in"), 6 * points);
  fail_unless_equals_uint64 (stat (element, "points-out"), 3 * (points + points_of_view (out, 1)));
  ck_assert_uint_gt (stat (element, "units"), 0);
  fail_unless_equals_uint64 (stat (element, "units"), stat (element, "units-shared"));
  GstStructure *stats = nullptr;
  g_object_get (element, "stats", &stats, nullptr);
  const GValue *direction = gst_structure_get_value (stats, "axis-direction");
  fail_unless_equals_float (g_value_get_double (gst_value_array_get_value (direction, 1)), 1);
  gst_structure_free (stats);
  gst_buffer_unref (out);
  gst_object_unref (element);
  gst_harness_teardown (h);
}
GST_END_TEST;

/* Winners that last frame's winners had a word in. */
static guint64
held_by_frame (
    GstHarness *h, GstElement *element, const Rig &rig, bool discont, GstClockTime time = 0)
{
  const guint64 before = stat (element, "units-held");
  GstBuffer *in = make_frame_set (rig, time);
  if (discont)
    GST_BUFFER_FLAG_SET (in, GST_BUFFER_FLAG_DISCONT);
  gst_buffer_unref (gst_harness_push_and_pull (h, in));
  return stat (element, "units-held") - before;
}

GST_START_TEST (test_forgets_winners_on_discont_flush_and_another_rig)
{
  const Rig rig = same_place_rig (2);
  GstHarness *h = harness_for (rig, "cylinderfilter axis=vertical");
  GstElement *element = gst_harness_find_element (h, "cylinderfilter");
  fail_unless_equals_uint64 (held_by_frame (h, element, rig, false), 0);
  const guint64 all = held_by_frame (h, element, rig, false);
  ck_assert_uint_gt (all, 0);
  fail_unless_equals_uint64 (stat (element, "units-changed"), 0);
  fail_unless_equals_uint64 (held_by_frame (h, element, rig, true), 0);
  fail_unless_equals_uint64 (held_by_frame (h, element, rig, false), all);

  fail_unless (gst_harness_push_event (h, gst_event_new_flush_start ()));
  fail_unless (gst_harness_push_event (h, gst_event_new_flush_stop (TRUE)));
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_TIME);
  fail_unless (gst_harness_push_event (h, gst_event_new_segment (&segment)));
  fail_unless_equals_uint64 (held_by_frame (h, element, rig, false), 0);
  fail_unless_equals_uint64 (held_by_frame (h, element, rig, false), all);

  gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (rig, 15, 1)));
  fail_unless_equals_uint64 (held_by_frame (h, element, rig, false), all); /* the same cameras */
  Rig other = rig;
  other.views[1].world_from_view.translation.x += 1e-9;
  gst_harness_set_src_caps (h, gstrange::make_range_caps (gstrange::make_info (other, 15, 1)));
  fail_unless_equals_uint64 (held_by_frame (h, element, other, false), 0);
  gst_object_unref (element);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_a_lost_packet_is_no_reason_to_forget_but_a_jump_in_time_is)
{
  const Rig rig = same_place_rig (2);
  GstHarness *h = harness_for (rig, "cylinderfilter axis=vertical");
  GstElement *element = gst_harness_find_element (h, "cylinderfilter");
  held_by_frame (h, element, rig, true, 0);
  ck_assert_uint_gt (held_by_frame (h, element, rig, true, GST_SECOND / 30), 0);
  ck_assert_uint_gt (held_by_frame (h, element, rig, true, GST_SECOND / 10), 0);
  fail_unless_equals_uint64 (held_by_frame (h, element, rig, true, 5 * GST_SECOND), 0);
  ck_assert_uint_gt (held_by_frame (h, element, rig, false, 9 * GST_SECOND), 0);
  fail_unless_equals_uint64 (held_by_frame (h, element, rig, true, GST_SECOND), 0);
  gst_object_unref (element);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_another_stream_and_another_unit_height_start_over)
{
  const Rig rig = same_place_rig (2);
  GstHarness *h = harness_for (rig, "cylinderfilter axis=vertical");
  GstElement *element = gst_harness_find_element (h, "cylinderfilter");
  held_by_frame (h, element, rig, false, 0);
  ck_assert_uint_gt (held_by_frame (h, element, rig, false, GST_SECOND / 30), 0);
  gst_harness_push_event (h, gst_event_new_stream_start ("another"));
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_TIME);
  gst_harness_push_event (h, gst_event_new_segment (&segment));
  fail_unless_equals_uint64 (held_by_frame (h, element, rig, false, 2 * GST_SECOND / 30), 0);
  ck_assert_uint_gt (held_by_frame (h, element, rig, false, 3 * GST_SECOND / 30), 0);
  g_object_set (element, "unit-height", 0.006, nullptr);
  fail_unless_equals_uint64 (held_by_frame (h, element, rig, false, 4 * GST_SECOND / 30), 0);
  ck_assert_uint_gt (held_by_frame (h, element, rig, false, 5 * GST_SECOND / 30), 0);
  gst_object_unref (element);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_forgets_winners_while_it_is_off)
{
  const Rig rig = same_place_rig (2);
  GstHarness *h = harness_for (rig, "cylinderfilter axis=vertical");
  GstElement *element = gst_harness_find_element (h, "cylinderfilter");
  held_by_frame (h, element, rig, false, 0);
  g_object_set (element, "mode", 0, nullptr);
  held_by_frame (h, element, rig, false, GST_SECOND / 30);
  g_object_set (element, "mode", 1, nullptr);
  fail_unless_equals_uint64 (held_by_frame (h, element, rig, false, 2 * GST_SECOND / 30), 0);
  ck_assert_uint_gt (held_by_frame (h, element, rig, false, 3 * GST_SECOND / 30), 0);
  gst_object_unref (element);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_jump_in_time_counts_though_its_buffer_is_too_late)
{
  const Rig rig = same_place_rig (2);
  GstHarness *h = harness_for (rig, "cylinderfilter axis=vertical qos=true");
  GstElement *element = gst_harness_find_element (h, "cylinderfilter");
  held_by_frame (h, element, rig, false, 0);
  gst_harness_push_upstream_event (
      h, gst_event_new_qos (GST_QOS_TYPE_UNDERFLOW, 1, GST_SECOND / 2, 5 * GST_SECOND));
  GstBuffer *late = make_frame_set (rig, 5 * GST_SECOND);
  GST_BUFFER_FLAG_SET (late, GST_BUFFER_FLAG_DISCONT);
  fail_unless_equals_int (gst_harness_push (h, late), GST_FLOW_OK);
  fail_unless_equals_int (gst_harness_buffers_in_queue (h), 0);
  fail_unless_equals_uint64 (held_by_frame (h, element, rig, false, 9 * GST_SECOND), 0);
  gst_object_unref (element);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_memory_that_ends_anywhere_is_one_error)
{
  if (!memory_can_end ())
    RANGECAST_SKIP ("operator new is somebody else's");
  /* On one thread: OpenCV's pool waits forever where it has no memory for its own threads. */
  const Rig rig = same_place_rig (2, 32, 24);
  ck_assert_int_gt (run_out_of_memory ("cylinderfilter n-threads=1 mode=blend", rig), 20);
}
GST_END_TEST;

/* All properties but the statistics say that they may change while playing. */
GST_START_TEST (test_every_property_set_while_playing_is_kept_and_read_for_the_next_frame)
{
  const Rig rig = ring_rig (4);
  GstHarness *h = harness_for (rig, "cylinderfilter");
  GstElement *element = gst_harness_find_element (h, "cylinderfilter");
  guint count = 0;
  GParamSpec **specs = g_object_class_list_properties (G_OBJECT_GET_CLASS (element), &count);
  for (guint i = 0; i < count; i++)
    if (specs[i]->owner_type == G_OBJECT_TYPE (element) && (specs[i]->flags & G_PARAM_WRITABLE))
      fail_unless (specs[i]->flags & GST_PARAM_MUTABLE_PLAYING, "%s", specs[i]->name);
  g_free (specs);
  gst_buffer_unref (gst_harness_push_and_pull (h, make_frame_set (rig, 0)));
  const char *changes[][2] = {{"axis", "fixed"}, {"axis-position", "<0.1,0.0,0.0>"},
      {"axis-direction", "<0.0,0.0,2.0>"}, {"layer-gap", "0.2"}, {"smoothing", "0.05"},
      {"overlap", "2.5"}, {"columns", "90"}, {"blend-width", "0.1"}, {"colour-balance", "off"},
      {"n-threads", "1"}};
  GstClockTime time = 0;
  for (const auto &change : changes) {
    gst_util_set_object_arg (G_OBJECT (element), change[0], change[1]);
    time += GST_SECOND / 30;
    gst_buffer_unref (gst_harness_push_and_pull (h, make_frame_set (rig, time)));
  }
  GstStructure *stats = nullptr;
  g_object_get (element, "stats", &stats, nullptr);
  const GValue *position = gst_structure_get_value (stats, "axis-position");
  const GValue *direction = gst_structure_get_value (stats, "axis-direction");
  fail_unless_equals_float (g_value_get_double (gst_value_array_get_value (position, 0)), 0.1);
  fail_unless_equals_float (g_value_get_double (gst_value_array_get_value (direction, 2)), 1);
  gst_structure_free (stats);
  /* Refused where it is set, instead of an error with the next frame. */
  for (const char *value : {"<1e9,0.0,0.0>", "<1.0,2.0>"})
    ASSERT_WARNING (gst_util_set_object_arg (G_OBJECT (element), "axis-position", value));
  for (const char *value : {"<0.0,0.0,0.0>", "<1.0,2.0>", "<>"})
    ASSERT_WARNING (gst_util_set_object_arg (G_OBJECT (element), "axis-direction", value));
  gst_buffer_unref (gst_harness_push_and_pull (h, make_frame_set (rig, time)));
  gst_object_unref (element);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_bodies_and_steadiness_may_change_while_playing)
{
  const Rig rig = same_place_rig (2);
  GstHarness *h = harness_for (rig);
  GstElement *element = gst_harness_find_element (h, "cylinderfilter");
  for (int bodies : {1, 8}) {
    g_object_set (element, "bodies", bodies, "hysteresis", bodies / 8.0, "agreement", 2.0, nullptr);
    gst_buffer_unref (gst_harness_push_and_pull (h, make_frame_set (rig)));
    GstStructure *stats = nullptr;
    gint count = 0;
    g_object_get (element, "stats", &stats, nullptr);
    fail_unless (gst_structure_get_int (stats, "bodies", &count));
    ck_assert_int_ge (count, 1);
    ck_assert_int_le (count, bodies);
    gst_structure_free (stats);
  }
  double hysteresis = 0, agreement = 0;
  int bodies = 0;
  g_object_get (
      element, "bodies", &bodies, "hysteresis", &hysteresis, "agreement", &agreement, nullptr);
  fail_unless_equals_int (bodies, 8);
  fail_unless_equals_float (hysteresis, 1);
  fail_unless_equals_float (agreement, 2);
  gst_object_unref (element);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_views_of_one_pixel_and_64_views_pass)
{
  for (int views : {1, 2, 64}) {
    const Rig rig = ring_rig (views, 16, 16);
    GstHarness *h = harness_for (rig);
    for (int i = 0; i < 3; i++) {
      GstBuffer *out = gst_harness_push_and_pull (h, make_frame_set (rig, 0, {7, 9, 1, 1}));
      fail_unless_equals_int (gst_buffer_n_range_metas (out), views);
      ck_assert_uint_le (points_of_view (out, 0), 1);
      gst_buffer_unref (out);
    }
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

GST_START_TEST (test_axis_is_set_as_an_array)
{
  GstHarness *h = harness_for (ring_rig (2),
      "cylinderfilter axis=fixed axis-position=\"<0.1,0.2,0.3>\" axis-direction=\"<0.0,0.0,2.0>\"");
  GstElement *element = gst_harness_find_element (h, "cylinderfilter");
  gst_buffer_unref (gst_harness_push_and_pull (h, make_frame_set (ring_rig (2))));
  GstStructure *stats = nullptr;
  g_object_get (element, "stats", &stats, nullptr);
  const GValue *position = gst_structure_get_value (stats, "axis-position");
  const GValue *direction = gst_structure_get_value (stats, "axis-direction");
  fail_unless_equals_float (g_value_get_double (gst_value_array_get_value (position, 2)), 0.3);
  fail_unless_equals_float (g_value_get_double (gst_value_array_get_value (direction, 2)), 1);
  gst_structure_free (stats);
  gst_object_unref (element);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_mode_follows_its_controller)
{
  const Rig rig = same_place_rig (2);
  GstHarness *h = harness_for (rig);
  GstElement *element = gst_harness_find_element (h, "cylinderfilter");
  GstControlSource *source = gst_interpolation_control_source_new ();
  g_object_set (source, "mode", GST_INTERPOLATION_MODE_NONE, nullptr);
  auto timed = GST_TIMED_VALUE_CONTROL_SOURCE (source);
  gst_timed_value_control_source_set (timed, 0, 0);
  gst_timed_value_control_source_set (timed, GST_SECOND, 1);
  gst_object_add_control_binding (GST_OBJECT (element),
      gst_direct_control_binding_new_absolute (GST_OBJECT (element), "mode", source));
  for (guint round = 0; round < 2; round++) {
    GstBuffer *out = gst_harness_push_and_pull (h, make_frame_set (rig, round * GST_SECOND));
    fail_unless_equals_int (points_of_view (out, 1) == points_of_view (out, 0) ? 0 : 1, round);
    gst_buffer_unref (out);
  }
  gst_object_unref (source);
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
    fail_unless_equals_uint64 (stat (element, "frames"), 1);
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

GST_START_TEST (test_frame_that_begins_before_the_segment_passes)
{
  const Rig rig = ring_rig (1);
  GstHarness *h = harness_for (rig);
  GstBuffer *out = push_before_the_segment (h, rig, GST_SECOND);
  fail_unless (out != nullptr);
  gst_buffer_unref (out);
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
  tcase_add_test (tc, test_mode_off_passes_everything_and_may_change_while_playing);
  tcase_add_test (tc, test_one_view_and_empty_rois_pass);
  tcase_add_test (tc, test_frame_sets_may_lack_views);
  tcase_add_test (tc, test_caps_may_change_in_the_stream);
  tcase_add_test (tc, test_stats_count_frames_points_and_units);
  tcase_add_test (tc, test_forgets_winners_on_discont_flush_and_another_rig);
  tcase_add_test (tc, test_a_lost_packet_is_no_reason_to_forget_but_a_jump_in_time_is);
  tcase_add_test (tc, test_another_stream_and_another_unit_height_start_over);
  tcase_add_test (tc, test_forgets_winners_while_it_is_off);
  tcase_add_test (tc, test_jump_in_time_counts_though_its_buffer_is_too_late);
  tcase_add_test (tc, test_memory_that_ends_anywhere_is_one_error);
  tcase_add_test (tc, test_every_property_set_while_playing_is_kept_and_read_for_the_next_frame);
  tcase_add_test (tc, test_bodies_and_steadiness_may_change_while_playing);
  tcase_add_test (tc, test_views_of_one_pixel_and_64_views_pass);
  tcase_add_test (tc, test_axis_is_set_as_an_array);
  tcase_add_test (tc, test_mode_follows_its_controller);
  tcase_add_test (tc, test_view_that_the_caps_lack_is_one_error_by_name);
  tcase_add_test (tc, test_caps_without_rig_are_refused_with_an_error);
  tcase_add_test (tc, test_goes_through_all_states_twice_and_flushes);
  tcase_add_test (tc, test_adds_no_latency);
  tcase_add_test (tc, test_frame_that_begins_before_the_segment_passes);
  return suite;
}

GST_CHECK_MAIN (cylinderfilter);
