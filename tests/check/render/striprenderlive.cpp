/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* striprender in time: an output frame rate of its own, live streams that stall, late pictures. */
#include <gst/app/gstappsink.h>
#include <gst/app/gstappsrc.h>
#include <gst/controller/controller.h>

#include "render-check.hpp"

using namespace rangecast;
using namespace rangecast::testing;

/* ---- a stream that is not live: all in one go ---- */

struct Input {
  GstClockTime pts, duration;
};

struct Output {
  GstClockTime pts, duration, shows;
};

/* What comes out of a pipeline that is not live. */
static std::vector<Output>
convert (const char *striprender, const char *output, int fps_n, std::initializer_list<Input> sets,
    guint64 *repeated = nullptr)
{
  const Rig rig = ring_rig (1);
  const std::string launch = std::string ("appsrc name=in format=time ! striprender name=r ") +
                             striprender + " ! video/x-raw,width=64,height=48," + output +
                             " ! appsink name=out sync=false";
  GstElement *pipeline = gst_parse_launch (launch.c_str (), nullptr);
  fail_unless (pipeline != nullptr);
  GstElement *in = gst_bin_get_by_name (GST_BIN (pipeline), "in");
  GstElement *out = gst_bin_get_by_name (GST_BIN (pipeline), "out");
  GstElement *r = gst_bin_get_by_name (GST_BIN (pipeline), "r");
  GstCaps *caps = gstrange::make_range_caps (gstrange::make_info (rig, fps_n, 1));
  gst_app_src_set_caps (GST_APP_SRC (in), caps);
  gst_caps_unref (caps);
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  for (const Input &set : sets) {
    const bool timed = GST_CLOCK_TIME_IS_VALID (set.pts);
    GstBuffer *buffer = make_frame_set (rig, timed ? set.pts : 0);
    GST_BUFFER_PTS (buffer) = set.pts;
    GST_BUFFER_DURATION (buffer) = set.duration;
    gst_app_src_push_buffer (GST_APP_SRC (in), buffer);
  }
  gst_app_src_end_of_stream (GST_APP_SRC (in));
  std::vector<Output> pictures;
  while (GstSample *sample = gst_app_sink_pull_sample (GST_APP_SINK (out))) {
    GstBuffer *buffer = gst_sample_get_buffer (sample);
    pictures.push_back ({GST_BUFFER_PTS (buffer), GST_BUFFER_DURATION (buffer),
        gst_range_buffer_get_capture_time (buffer)});
    gst_sample_unref (sample);
  }
  if (repeated)
    *repeated = stats_field (r, "repeated");
  gst_element_set_state (pipeline, GST_STATE_NULL);
  gst_object_unref (in);
  gst_object_unref (out);
  gst_object_unref (r);
  gst_object_unref (pipeline);
  return pictures;
}

/* Pictures at whole periods, and the milliseconds of the frame sets that they show. */
static void
expect_pictures (const std::vector<Output> &pictures, GstClockTime begin, GstClockTime period,
    std::initializer_list<int> shows_ms)
{
  fail_unless_equals_int (pictures.size (), shows_ms.size ());
  std::size_t i = 0;
  for (int ms : shows_ms) {
    fail_unless_equals_uint64 (pictures[i].pts, begin + i * period);
    fail_unless_equals_uint64 (pictures[i].duration, period);
    fail_unless_equals_uint64 (pictures[i].shows, guint64 (ms) * GST_MSECOND);
    i++;
  }
}

GST_START_TEST (test_faster_output_shows_frame_sets_several_times)
{
  guint64 repeated = 0;
  const GstClockTime d = 200 * GST_MSECOND;
  expect_pictures (convert ("", "framerate=20/1", 5, {{0, d}, {d, d}, {2 * d, d}}, &repeated), 0,
      GST_SECOND / 20, {0, 0, 0, 0, 200, 200, 200, 200, 400, 400, 400, 400});
  fail_unless_equals_uint64 (repeated, 9);
}
GST_END_TEST;

GST_START_TEST (test_slower_output_leaves_frame_sets_out)
{
  const GstClockTime d = 40 * GST_MSECOND;
  expect_pictures (
      convert ("", "framerate=10/1", 25,
          {{0, d}, {d, d}, {2 * d, d}, {3 * d, d}, {4 * d, d}, {5 * d, d}, {6 * d, d}}),
      0, kPeriod, {0, 120, 200});
}
GST_END_TEST;

GST_START_TEST (test_uneven_times_neither_repeat_a_frame_set_nor_skip_one)
{
  const GstClockTime ms = GST_MSECOND, d = kPeriod;
  expect_pictures (convert ("", "framerate=10/1", 0,
                       {{0, d}, {108 * ms, d}, {195 * ms, d}, {317 * ms, d}, {400 * ms, d}}),
      0, kPeriod, {0, 108, 195, 317, 400});
}
GST_END_TEST;

GST_START_TEST (test_hole_in_a_file_is_filled)
{
  const GstClockTime ms = GST_MSECOND, d = 100 * ms;
  const std::initializer_list<Input> sets = {{0, d}, {500 * ms, d}};
  expect_pictures (convert ("", "framerate=10/1", 5, sets), 0, kPeriod, {0, 0, 0, 0, 0, 500});
  const GstClockTime year = 365 * 24 * 3600 * GST_SECOND; /* an error of the stream */
  const auto apart = convert ("", "framerate=10/1", 5, {{0, d}, {year, d}});
  fail_unless_equals_int (apart.size (), 2);
  fail_unless_equals_uint64 (apart[1].pts, year);
  fail_unless_equals_int (
      convert ("", "framerate=1/1", 5, {{0, GST_CLOCK_TIME_NONE - 6}}).size (), 60);
}
GST_END_TEST;

GST_START_TEST (test_without_a_request_every_frame_set_keeps_its_time)
{
  const auto pictures = convert ("", "framerate=(fraction)[0/1,60/1]", 25,
      {{7, 40 * GST_MSECOND}, {13 * GST_MSECOND, GST_CLOCK_TIME_NONE}});
  fail_unless_equals_int (pictures.size (), 2);
  fail_unless_equals_uint64 (pictures[0].pts, 7);
  fail_unless_equals_uint64 (pictures[0].duration, 40 * GST_MSECOND);
  fail_unless_equals_uint64 (pictures[1].pts, 13 * GST_MSECOND);
}
GST_END_TEST;

GST_START_TEST (test_end_of_stream_leaves_no_picture_out_that_begins_before_it)
{
  const GstClockTime ms = GST_MSECOND, d = 33 * ms;
  expect_pictures (convert ("", "framerate=5/1", 30, {{0, d}}), 0, 200 * ms, {0});
  expect_pictures (
      convert ("", "framerate=4/1", 30, {{0, d}, {300 * ms, d}, {480 * ms, d}, {733 * ms, d}}), 0,
      250 * ms, {0, 300, 480, 733});
}
GST_END_TEST;

GST_START_TEST (test_times_that_go_back_or_lack_do_no_harm)
{
  const GstClockTime ms = GST_MSECOND, d = kPeriod;
  const auto pictures = convert ("", "framerate=20/1", 10,
      {{300 * ms, d}, {100 * ms, d}, {GST_CLOCK_TIME_NONE, d}, {500 * ms, 0}});
  ck_assert_uint_ge (pictures.size (), 4);
  for (std::size_t i = 1; i < pictures.size (); i++)
    fail_unless_equals_uint64 (pictures[i].pts, pictures[i - 1].pts + GST_SECOND / 20);
}
GST_END_TEST;

GST_START_TEST (test_frame_sets_without_times_follow_each_other)
{
  guint64 repeated = 0;
  const GstClockTime none = GST_CLOCK_TIME_NONE, d = kPeriod;
  expect_pictures (convert ("", "framerate=20/1", 10, {{none, d}, {none, d}, {none, d}}, &repeated),
      0, GST_SECOND / 20, {0, 0, 0, 0, 0, 0});
  fail_unless_equals_uint64 (repeated, 3);
}
GST_END_TEST;

GST_START_TEST (test_times_that_go_far_back_do_not_freeze_the_picture)
{
  const GstClockTime d = kPeriod;
  expect_pictures (convert ("", "framerate=20/1", 10, {{100 * GST_SECOND, d}, {0, d}, {d, d}}), 0,
      GST_SECOND / 20, {0, 0, 100, 100});
}
GST_END_TEST;

/* ---- live ---- */

GST_START_TEST (test_live_stream_that_stalls_is_drawn_on_and_turns)
{
  Live live ("auto-orbit=45");
  live.push (0);
  RenderedPicture last;
  for (guint64 i = 0; i < 12; i++) {
    RenderedPicture picture = live.next ();
    fail_unless_equals_uint64 (picture.pts, i * kPeriod);
    fail_unless_equals_uint64 (picture.shows, 0);
    fail_if (picture.rgba == last.rgba, "picture %d is as the one before", int (i));
    last = std::move (picture);
  }
  fail_unless_equals_uint64 (stats_field (live.r, "frames"), 12);
  fail_unless_equals_uint64 (stats_field (live.r, "frame-sets"), 1);
  fail_unless_equals_uint64 (stats_field (live.r, "repeated"), 11);
}
GST_END_TEST;

GST_START_TEST (test_held_frame_set_that_turns_is_uploaded_once)
{
  SKIP_WITHOUT_OPENGL ();
  Live live ("auto-orbit=45 tint-views=true", "framerate=10/1", true);
  live.push (0);
  live.next ();
  const guint64 once = stats_field (live.r, "uploaded-total");
  ck_assert_uint_gt (once, 0);
  fail_unless_equals_uint64 (stats_field (live.r, "uploaded-bytes"), once);
  for (int i = 0; i < 3; i++)
    live.next ();
  fail_unless_equals_uint64 (stats_field (live.r, "uploaded-bytes"), 0);
  fail_unless_equals_uint64 (stats_field (live.r, "uploaded-total"), once);
  g_object_set (live.r, "depth-step", 0.01, nullptr); /* other strips */
  live.next ();
  ck_assert_uint_gt (stats_field (live.r, "uploaded-bytes"), once);
  live.push (600 * GST_MSECOND);
  live.next ();
  live.next ();
  const guint64 with_next = stats_field (live.r, "uploaded-total");
  ck_assert_uint_gt (with_next, 2 * once);
}
GST_END_TEST;

GST_START_TEST (test_held_picture_follows_keys_and_properties)
{
  Live live;
  live.push (0);
  const RenderedPicture still = live.next ();
  fail_unless_cmp (live.next ().rgba, ==, still.rgba);
  gst_pad_send_event (
      live.src, gst_navigation_event_new_key_press ("Right", GST_NAVIGATION_MODIFIER_NONE));
  const RenderedPicture turned = live.next ();
  fail_unless_cmp (turned.rgba, !=, still.rgba);
  g_object_set (live.r, "mode", 2, "azimuth", 40.0, nullptr);
  fail_unless_cmp (live.next ().rgba, !=, turned.rgba);
  g_object_set (live.r, "mode", 0, "azimuth", 0.0, nullptr);
  fail_unless (live.next ().rgba == still.rgba, "strips are not made again");
}
GST_END_TEST;

GST_START_TEST (test_controlled_path_goes_on_over_a_held_frame_set)
{
  Live live;
  GstControlSource *source = gst_interpolation_control_source_new ();
  g_object_set (source, "mode", GST_INTERPOLATION_MODE_LINEAR, nullptr);
  gst_object_add_control_binding (GST_OBJECT (live.r),
      gst_direct_control_binding_new_absolute (GST_OBJECT (live.r), "azimuth", source));
  auto values = GST_TIMED_VALUE_CONTROL_SOURCE (source);
  gst_timed_value_control_source_set (values, 0, 0);
  gst_timed_value_control_source_set (values, GST_SECOND, 90);
  gst_object_unref (source);
  live.push (0);
  for (int i = 0; i <= 10; i++) {
    double azimuth = -1;
    live.next ();
    g_object_get (live.r, "azimuth", &azimuth, nullptr);
    fail_unless (std::abs (azimuth - 9 * i) < 1e-6, "picture %d: azimuth %f", i, azimuth);
  }
}
GST_END_TEST;

GST_START_TEST (test_new_frame_set_is_shown_and_times_never_go_back)
{
  Live live;
  live.push (0);
  for (int i = 0; i < 7; i++)
    live.next ();
  live.push (200 * GST_MSECOND); /* long since due */
  const RenderedPicture late = live.next ();
  fail_unless_equals_uint64 (late.pts, 7 * kPeriod);
  fail_unless_equals_uint64 (late.shows, 200 * GST_MSECOND);
  live.push (820 * GST_MSECOND); /* for the next but one: a quarter of a period is its slack */
  fail_unless_equals_uint64 (live.next ().shows, 820 * GST_MSECOND);
  fail_unless_equals_uint64 (live.next ().pts, 9 * kPeriod);
}
GST_END_TEST;

GST_START_TEST (test_picture_waits_for_upstreams_latency_so_that_its_frame_set_is_there)
{
  Live live;
  gst_harness_set_upstream_latency (live.h, 300 * GST_MSECOND);
  live.push (0);
  for (guint64 i = 0; i < 3; i++) {
    fail_unless_equals_uint64 (live.next ().pts, i * kPeriod);
    if (i > 0)
      fail_unless_equals_uint64 (live.now (), i * kPeriod + 300 * GST_MSECOND + kPeriod / 4);
  }
}
GST_END_TEST;

GST_START_TEST (test_latency_is_time_to_draw_in)
{
  Live live;
  g_object_set (live.r, "latency", 40 * GST_MSECOND, nullptr);
  live.push (0);
  for (guint64 i = 0; i < 4; i++) {
    fail_unless_equals_uint64 (live.next ().pts, i * kPeriod);
    if (i > 1)
      fail_unless_equals_uint64 (live.now (), i * kPeriod + kPeriod / 4);
  }
  fail_unless_equals_uint64 (gst_harness_query_latency (live.h), kPeriod + 40 * GST_MSECOND);
}
GST_END_TEST;

GST_START_TEST (test_latency_is_upstreams_where_the_rate_is_the_inputs)
{
  Live live ("", "framerate=5/1");
  gst_harness_set_upstream_latency (live.h, 70 * GST_MSECOND);
  live.push (0);
  gst_buffer_unref (gst_harness_pull (live.h));
  fail_unless_equals_uint64 (gst_harness_query_latency (live.h), 70 * GST_MSECOND);
}
GST_END_TEST;

GST_START_TEST (test_keep_rate_holds_where_the_rate_is_the_inputs)
{
  Live live ("keep-rate=true", "framerate=5/1");
  live.push (0);
  for (guint64 i = 0; i < 3; i++)
    fail_unless_equals_uint64 (live.next ().pts, i * 200 * GST_MSECOND);
}
GST_END_TEST;

GST_START_TEST (test_flush_ends_holding_and_a_new_stream_begins)
{
  Live live;
  for (guint64 round = 0; round < 3; round++) {
    const GstClockTime begin = round * GST_SECOND;
    live.push (begin);
    fail_unless_equals_uint64 (live.next ().pts, begin);
    gst_harness_push_event (live.h, gst_event_new_flush_start ());
    gst_harness_push_event (live.h, gst_event_new_flush_stop (FALSE));
    GstSegment segment;
    gst_segment_init (&segment, GST_FORMAT_TIME);
    gst_harness_push_event (live.h, gst_event_new_segment (&segment));
    gst_test_clock_set_time (live.clock, begin + GST_SECOND / 2);
    g_usleep (50000);
    fail_unless_equals_uint64 (stats_field (live.r, "frames"), round + 1);
  }
}
GST_END_TEST;

GST_START_TEST (test_end_of_stream_shows_the_rest_and_ends_holding)
{
  Live live;
  live.push (0);
  live.next ();
  live.push (200 * GST_MSECOND);
  gst_harness_push_event (live.h, gst_event_new_eos ());
  for (guint64 i = 1; i < 4; i++) {
    const RenderedPicture picture = take_rendered (gst_harness_pull (live.h), 320);
    fail_unless_equals_uint64 (picture.pts, i * kPeriod);
    fail_unless_equals_uint64 (picture.shows, i / 2 * 200 * GST_MSECOND);
  }
  gst_test_clock_advance_time (live.clock, GST_SECOND);
  g_usleep (50000);
  fail_unless (gst_harness_try_pull (live.h) == nullptr);
}
GST_END_TEST;

GST_START_TEST (test_new_rig_while_live_forgets_the_frame_sets_of_the_old_one)
{
  Live live;
  live.push (0);
  live.next ();
  live.rig = ring_rig (3);
  gst_harness_set_src_caps (
      live.h, gstrange::make_range_caps (gstrange::make_info (live.rig, 5, 1)));
  gst_buffer_unref (gst_harness_pull (live.h)); /* what was left of the old one */
  live.push (400 * GST_MSECOND);
  const RenderedPicture picture = live.next ();
  fail_unless_equals_uint64 (picture.pts, 400 * GST_MSECOND);
  fail_unless_equals_uint64 (picture.shows, 400 * GST_MSECOND);
}
GST_END_TEST;

GST_START_TEST (test_pause_and_states_twice_while_holding)
{
  Live live;
  for (int round = 0; round < 2; round++) {
    live.push (10 * GST_SECOND * guint64 (round));
    live.next ();
    gst_element_set_state (live.h->element, GST_STATE_PAUSED);
    gst_test_clock_advance_time (live.clock, GST_SECOND / 2);
    g_usleep (30000);
    const guint64 frames = stats_field (live.r, "frames");
    gst_test_clock_advance_time (live.clock, GST_SECOND / 2);
    g_usleep (30000);
    fail_unless_equals_uint64 (stats_field (live.r, "frames"), frames);
    gst_element_set_state (live.h->element, GST_STATE_NULL);
    while (GstBuffer *buffer = gst_harness_try_pull (live.h))
      gst_buffer_unref (buffer);
    gst_harness_play (live.h);
    gst_harness_set_src_caps (
        live.h, gstrange::make_range_caps (gstrange::make_info (live.rig, 5, 1)));
  }
}
GST_END_TEST;

GST_START_TEST (test_flow_of_the_drawing_thread_comes_back_upstream)
{
  Live live;
  live.push (0);
  live.next ();
  GstPad *peer = gst_pad_get_peer (live.src);
  gst_pad_set_active (peer, FALSE); /* pushes are refused from now on */
  fail_unless (gst_harness_crank_single_clock_wait (live.h));
  GstFlowReturn flow = GST_FLOW_OK;
  for (int tries = 0; tries < 200 && flow == GST_FLOW_OK; tries++) {
    g_usleep (10000);
    flow = gst_harness_push (live.h, make_frame_set (live.rig, GST_SECOND));
  }
  fail_unless_equals_int (flow, GST_FLOW_FLUSHING);
  gst_pad_set_active (peer, TRUE);
  gst_object_unref (peer);
}
GST_END_TEST;

/* ---- late pictures ---- */

GST_START_TEST (test_late_pictures_of_a_held_frame_set_are_left_out_and_counted)
{
  Live live;
  GstBus *bus = gst_bus_new ();
  gst_element_set_bus (live.r, bus);
  live.push (0);
  live.next ();
  gst_harness_push_upstream_event (
      live.h, gst_event_new_qos (GST_QOS_TYPE_UNDERFLOW, 1.5, kPeriod, kPeriod));
  /* earliest: twice as late again, 300 ms */
  for (int i = 1; i < 4; i++)
    fail_unless (gst_harness_crank_single_clock_wait (live.h));
  const RenderedPicture next = live.next ();
  fail_unless_equals_uint64 (next.pts, 4 * kPeriod);
  fail_unless (next.discont);
  fail_if (live.next ().discont);
  fail_unless_equals_uint64 (stats_field (live.r, "dropped"), 3);
  GstMessage *message = gst_bus_pop_filtered (bus, GST_MESSAGE_QOS);
  guint64 running = 0;
  fail_unless (message != nullptr);
  gst_message_parse_qos (message, nullptr, &running, nullptr, nullptr, nullptr);
  fail_unless_equals_uint64 (running, kPeriod);
  gst_message_unref (message);
  gst_element_set_bus (live.r, nullptr);
  gst_object_unref (bus);
}
GST_END_TEST;

/* A frame set whose first pictures are left out is drawn as if they had not been. */
GST_START_TEST (test_thread_that_comes_too_late_leaves_pictures_out)
{
  Live live ("tint-views=false"), direct ("", "framerate=5/1");
  const Roi part = {100, 80, 60, 40};
  live.push (0);
  live.next ();
  gst_harness_push (live.h, make_frame_set (live.rig, 200 * GST_MSECOND, part));
  fail_unless_equals_uint64 (take_rendered (gst_harness_pull (live.h), 320).pts, kPeriod);
  live.sleep (5 * kPeriod);
  const RenderedPicture picture = live.next ();
  fail_unless_equals_uint64 (picture.pts, 6 * kPeriod);
  fail_unless_equals_uint64 (stats_field (live.r, "dropped"), 4);
  GstBuffer *expected = gst_harness_push_and_pull (direct.h, make_frame_set (direct.rig, 0, part));
  fail_unless (picture.rgba == take_rendered (expected, 320).rgba, "it has another's strips");
}
GST_END_TEST;

GST_START_TEST (test_late_frame_sets_are_counted_where_there_is_no_rate_of_its_own)
{
  Live live ("", "framerate=5/1");
  live.push (0);
  gst_buffer_unref (gst_harness_pull (live.h));
  gst_harness_push_upstream_event (
      live.h, gst_event_new_qos (GST_QOS_TYPE_UNDERFLOW, 2, GST_SECOND / 4, GST_SECOND));
  live.push (GST_SECOND);
  live.push (3 * GST_SECOND);
  fail_unless (take_rendered (gst_harness_pull (live.h), 320).discont);
  fail_unless_equals_uint64 (stats_field (live.r, "dropped"), 1);
  fail_unless_equals_uint64 (stats_field (live.r, "frames"), 2);
}
GST_END_TEST;

GST_START_TEST (test_late_frame_set_that_waits_gives_way_to_the_next)
{
  Live live ("", "framerate=5/1");
  const gulong blocked = gst_pad_add_probe (
      live.src, GstPadProbeType (GST_PAD_PROBE_TYPE_BLOCK | GST_PAD_PROBE_TYPE_BUFFER),
      [] (GstPad *, GstPadProbeInfo *, gpointer) { return GST_PAD_PROBE_OK; }, nullptr, nullptr);
  live.push (0);
  while (!gst_pad_is_blocking (live.src))
    g_usleep (1000);
  live.push (GST_SECOND);
  gst_test_clock_set_time (live.clock, 2 * GST_SECOND);
  live.push (2 * GST_SECOND);
  gst_pad_remove_probe (live.src, blocked);
  gst_buffer_unref (gst_harness_pull (live.h));
  const RenderedPicture newest = take_rendered (gst_harness_pull (live.h), 320);
  fail_unless_equals_uint64 (newest.pts, 2 * GST_SECOND);
  fail_unless (newest.discont);
  fail_unless_equals_uint64 (stats_field (live.r, "dropped"), 1);
}
GST_END_TEST;

GST_START_TEST (test_statistics_count_pictures_and_points)
{
  const Rig rig = ring_rig (1, 64, 48);
  GstHarness *h = render_harness (rig, "stats-interval=3600000");
  GstElement *r = gst_bin_get_by_name (GST_BIN (h->element), "r");
  GstBus *bus = gst_bus_new ();
  gst_element_set_bus (r, bus);
  guint64 points = 0, frames = 0, counted = 0;
  for (GstClockTime i = 0; i < 3; i++) {
    gst_buffer_unref (gst_harness_push_and_pull (h, make_frame_set (rig, i * GST_SECOND / 30)));
    points += stats_field (r, "points");
  }
  fail_unless (gst_harness_push_event (h, gst_event_new_eos ()));
  GstMessage *message = gst_bus_timed_pop_filtered (bus, 10 * GST_SECOND, GST_MESSAGE_ELEMENT);
  fail_unless (message && gst_message_has_name (message, "rangecast-stats"));
  const GstStructure *stats = gst_message_get_structure (message);
  gst_structure_get_uint64 (stats, "frames", &frames);
  gst_structure_get_uint64 (stats, "points", &counted);
  fail_unless_equals_uint64 (frames, 3);
  ck_assert_uint_gt (points, 0);
  fail_unless_equals_uint64 (counted, points);
  gst_message_unref (message);
  gst_element_set_bus (r, nullptr);
  gst_object_unref (bus);
  gst_object_unref (r);
  gst_harness_teardown (h);
}
GST_END_TEST;

static Suite *
striprenderlive_suite ()
{
  Suite *suite = suite_create ("striprenderlive");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_faster_output_shows_frame_sets_several_times);
  tcase_add_test (tc, test_slower_output_leaves_frame_sets_out);
  tcase_add_test (tc, test_uneven_times_neither_repeat_a_frame_set_nor_skip_one);
  tcase_add_test (tc, test_hole_in_a_file_is_filled);
  tcase_add_test (tc, test_without_a_request_every_frame_set_keeps_its_time);
  tcase_add_test (tc, test_end_of_stream_leaves_no_picture_out_that_begins_before_it);
  tcase_add_test (tc, test_times_that_go_back_or_lack_do_no_harm);
  tcase_add_test (tc, test_frame_sets_without_times_follow_each_other);
  tcase_add_test (tc, test_times_that_go_far_back_do_not_freeze_the_picture);
  tcase_add_test (tc, test_live_stream_that_stalls_is_drawn_on_and_turns);
  tcase_add_test (tc, test_held_frame_set_that_turns_is_uploaded_once);
  tcase_add_test (tc, test_held_picture_follows_keys_and_properties);
  tcase_add_test (tc, test_controlled_path_goes_on_over_a_held_frame_set);
  tcase_add_test (tc, test_new_frame_set_is_shown_and_times_never_go_back);
  tcase_add_test (tc, test_picture_waits_for_upstreams_latency_so_that_its_frame_set_is_there);
  tcase_add_test (tc, test_latency_is_time_to_draw_in);
  tcase_add_test (tc, test_latency_is_upstreams_where_the_rate_is_the_inputs);
  tcase_add_test (tc, test_keep_rate_holds_where_the_rate_is_the_inputs);
  tcase_add_test (tc, test_flush_ends_holding_and_a_new_stream_begins);
  tcase_add_test (tc, test_end_of_stream_shows_the_rest_and_ends_holding);
  tcase_add_test (tc, test_new_rig_while_live_forgets_the_frame_sets_of_the_old_one);
  tcase_add_test (tc, test_pause_and_states_twice_while_holding);
  tcase_add_test (tc, test_flow_of_the_drawing_thread_comes_back_upstream);
  tcase_add_test (tc, test_late_pictures_of_a_held_frame_set_are_left_out_and_counted);
  tcase_add_test (tc, test_thread_that_comes_too_late_leaves_pictures_out);
  tcase_add_test (tc, test_late_frame_sets_are_counted_where_there_is_no_rate_of_its_own);
  tcase_add_test (tc, test_late_frame_set_that_waits_gives_way_to_the_next);
  tcase_add_test (tc, test_statistics_count_pictures_and_points);
  return suite;
}

GST_CHECK_MAIN (striprenderlive);
