/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* avatartestsrc's streaming: the clock, pads that come and go. */
#include "../rangecast-check.hpp"

#include <gst/check/gsttestclock.h>

using namespace rangecast;
using namespace rangecast::testing;

static constexpr GstClockTime kFrame = 100 * GST_MSECOND;
static const char *const kSmall = "video/x-raw,format=RGBx,width=16,height=16,framerate=10/1";

static GstHarness *
harness_of (GstElement *source, const char *pad)
{
  GstHarness *h = gst_harness_new_with_element (source, nullptr, pad);
  gst_harness_set_sink_caps_str (h, kSmall);
  return h;
}

static GstElement *
make_source (gboolean live)
{
  GstElement *source = gst_element_factory_make ("avatartestsrc", nullptr);
  g_object_set (source, "is-live", live, nullptr);
  return GST_ELEMENT (gst_object_ref_sink (source));
}

/* With a source of its own. */
static GstHarness *
make_harness (gboolean live)
{
  GstElement *source = make_source (live);
  GstHarness *h = harness_of (source, "left");
  gst_object_unref (source);
  return h;
}

static bool
wait_for_frames (GstElement *source, guint64 count)
{
  for (int i = 0; i < 1000 && stats_field (source, "frames") < count; i++)
    g_usleep (10000);
  return stats_field (source, "frames") >= count;
}

static void
expect_buffer (GstHarness *h, GstClockTime pts, bool discont)
{
  GstBuffer *buffer = gst_harness_pull (h);
  fail_unless (buffer != nullptr, "no buffer came");
  fail_unless_equals_uint64 (GST_BUFFER_PTS (buffer), pts);
  fail_unless_equals_int (GST_BUFFER_FLAG_IS_SET (buffer, GST_BUFFER_FLAG_DISCONT), discont);
  gst_buffer_unref (buffer);
}

/* The next event of that type; the others before it go. */
static GstEvent *
expect_event (GstHarness *h, GstEventType type)
{
  for (;;) {
    GstEvent *event = gst_harness_pull_event (h);
    fail_unless (event != nullptr, "no %s came", gst_event_type_get_name (type));
    if (GST_EVENT_TYPE (event) == type)
      return event;
    gst_event_unref (event);
  }
}

static void
expect_eos (GstHarness *h)
{
  gst_event_unref (expect_event (h, GST_EVENT_EOS));
}

/* ---- the clock ---- */

GST_START_TEST (test_live_frames_come_when_the_clock_says_so)
{
  GstHarness *h = make_harness (TRUE);
  gst_harness_set_time (h, 30 * GST_MSECOND);
  gst_harness_play (h);
  for (guint64 i = 1; i <= 3; i++) {
    fail_unless (gst_harness_wait_for_clock_id_waits (h, 1, 10));
    fail_unless_equals_int (gst_harness_buffers_in_queue (h), 0);
    fail_unless (gst_harness_crank_single_clock_wait (h));
    expect_buffer (h, i * kFrame, i == 1);
  }
  fail_unless_equals_uint64 (stats_field (h->element, "skipped"), 0);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_late_live_frames_are_skipped_with_discont)
{
  GstHarness *h = make_harness (TRUE);
  gst_harness_play (h);
  fail_unless (gst_harness_wait_for_clock_id_waits (h, 1, 10));
  gst_harness_set_time (h, 310 * GST_MSECOND); /* we wake at the tick of 0, three ticks later */
  fail_unless (gst_harness_crank_single_clock_wait (h));
  expect_buffer (h, 0, true);
  fail_unless (gst_harness_wait_for_clock_id_waits (h, 1, 10));
  fail_unless (gst_harness_crank_single_clock_wait (h));
  expect_buffer (h, 4 * kFrame, true);
  fail_unless_equals_uint64 (stats_field (h->element, "skipped"), 3);
  fail_unless (gst_harness_crank_single_clock_wait (h));
  expect_buffer (h, 5 * kFrame, false);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_ticks_while_paused_are_no_skipped_ones)
{
  GstHarness *h = make_harness (TRUE);
  gst_harness_play (h);
  fail_unless (gst_harness_crank_single_clock_wait (h));
  expect_buffer (h, 0, true);
  fail_unless_equals_int (
      gst_element_set_state (h->element, GST_STATE_PAUSED), GST_STATE_CHANGE_NO_PREROLL);
  gst_harness_set_time (h, 750 * GST_MSECOND);
  gst_element_set_state (h->element, GST_STATE_PLAYING);
  fail_unless (gst_harness_crank_single_clock_wait (h));
  expect_buffer (h, 8 * kFrame, true);
  fail_unless_equals_uint64 (stats_field (h->element, "skipped"), 0);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_eos_event_ends_a_live_stream_that_waits)
{
  GstHarness *h = make_harness (TRUE);
  gst_harness_play (h);
  fail_unless (gst_harness_wait_for_clock_id_waits (h, 1, 10));
  fail_unless (gst_element_send_event (h->element, gst_event_new_eos ()));
  expect_eos (h);
  gst_harness_teardown (h);
}
GST_END_TEST;

/* ---- pads ---- */

GST_START_TEST (test_every_pad_ends_after_num_buffers)
{
  GstElement *source = make_source (FALSE);
  g_object_set (source, "num-buffers", 3, nullptr);
  GstHarness *harnesses[] = {
      harness_of (source, "left"), harness_of (source, "right"), harness_of (source, "third")};
  gst_harness_play (harnesses[0]);
  for (GstHarness *h : harnesses) {
    expect_eos (h);
    fail_unless_equals_int (gst_harness_buffers_received (h), 3);
  }
  fail_unless_equals_uint64 (stats_field (source, "frames"), 3);
  for (GstHarness *h : harnesses)
    gst_harness_teardown (h);
  gst_object_unref (source);
}
GST_END_TEST;

GST_START_TEST (test_pad_requested_later_joins_the_running_stream)
{
  GstElement *source = make_source (TRUE);
  GstHarness *left = harness_of (source, "left");
  gst_harness_play (left);
  fail_unless (gst_harness_crank_single_clock_wait (left));
  expect_buffer (left, 0, true);
  fail_unless (gst_harness_wait_for_clock_id_waits (left, 1, 10));
  GstHarness *right = gst_harness_new_with_element (source, nullptr, "right");
  gst_harness_set_sink_caps_str (right, kSmall);
  fail_unless (gst_harness_crank_single_clock_wait (left)); /* this frame knows nothing of it */
  fail_unless (gst_harness_crank_single_clock_wait (left));
  expect_buffer (right, 2 * kFrame, true);
  gst_harness_teardown (right);
  gst_harness_teardown (left);
  gst_object_unref (source);
}
GST_END_TEST;

GST_START_TEST (test_released_pad_leaves_the_others_running)
{
  GstElement *source = make_source (FALSE);
  GstElement *pipeline = gst_pipeline_new (nullptr);
  GstElement *sink = gst_element_factory_make ("fakesink", nullptr);
  gst_bin_add_many (GST_BIN (pipeline), source, sink, nullptr);
  fail_unless (gst_element_link_pads (source, "left", sink, "sink"));
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  for (int i = 0; i < 20; i++) {
    GstPad *pad = gst_element_request_pad_simple (source, "right");
    GstElement *other = gst_element_factory_make ("fakesink", nullptr);
    g_object_set (other, "async", FALSE, nullptr);
    gst_bin_add (GST_BIN (pipeline), other);
    gst_element_sync_state_with_parent (other);
    gst_element_link_pads (source, "right", other, "sink");
    g_usleep (3000);
    gst_element_release_request_pad (source, pad); /* in the middle of a push, as often as not */
    gst_object_unref (pad);
    gst_element_set_state (other, GST_STATE_NULL);
    gst_bin_remove (GST_BIN (pipeline), other);
  }
  fail_unless (wait_for_frames (source, stats_field (source, "frames") + 3));
  gst_element_set_state (pipeline, GST_STATE_NULL);
  gst_object_unref (pipeline);
  gst_object_unref (source);
}
GST_END_TEST;

static GstFlowReturn
drop (GstPad *, GstObject *, GstBuffer *buffer)
{
  gst_buffer_unref (buffer);
  return GST_FLOW_OK;
}

static GstPad *
make_sink_pad ()
{
  GstPad *sink = gst_pad_new ("sink", GST_PAD_SINK);
  gst_object_ref_sink (sink);
  gst_pad_set_chain_function (sink, drop);
  gst_pad_set_active (sink, TRUE);
  return sink;
}

GST_START_TEST (test_pad_may_be_linked_and_unlinked_at_leisure)
{
  GstElement *source = make_source (FALSE);
  GstBus *bus = gst_bus_new ();
  gst_element_set_bus (source, bus);
  gst_element_set_state (source, GST_STATE_PLAYING);
  GstPad *pad = gst_element_request_pad_simple (source, "left"), *sink = make_sink_pad ();
  g_usleep (30000);
  for (int i = 0; i < 5; i++) {
    const guint64 before = stats_field (source, "frames");
    fail_unless_equals_int (gst_pad_link (pad, sink), GST_PAD_LINK_OK);
    fail_unless (wait_for_frames (source, before + 2), "link %d", i);
    gst_pad_unlink (pad, sink);
    g_usleep (5000);
  }
  fail_unless (gst_bus_pop_filtered (bus, GST_MESSAGE_ERROR) == nullptr);
  gst_element_release_request_pad (source, pad);
  gst_object_unref (pad);
  gst_element_set_state (source, GST_STATE_NULL);
  gst_element_set_bus (source, nullptr);
  for (gpointer object : {gpointer (bus), gpointer (source), gpointer (sink)})
    gst_object_unref (object);
}
GST_END_TEST;

static gpointer
change_states (gpointer element)
{
  for (int i = 0; i < 10; i++)
    for (GstState state : {GST_STATE_PLAYING, GST_STATE_READY, GST_STATE_PAUSED, GST_STATE_NULL}) {
      gst_element_set_state (GST_ELEMENT (element), state);
      g_usleep (g_random_int_range (0, 2000));
    }
  return nullptr;
}

GST_START_TEST (test_pads_may_come_and_go_while_states_change)
{
  GstElement *source = make_source (FALSE);
  GstPad *sink = make_sink_pad ();
  GThread *thread = g_thread_new ("states", change_states, source);
  for (int i = 0; i < 30; i++) {
    GstPad *left = gst_element_request_pad_simple (source, "left");
    GstPad *range = gst_element_request_pad_simple (source, "src");
    gst_pad_link (left, sink);
    g_usleep (g_random_int_range (0, 3000));
    for (GstPad *pad : {range, left}) {
      gst_element_release_request_pad (source, pad);
      gst_object_unref (pad);
    }
  }
  g_thread_join (thread);
  gst_element_set_state (source, GST_STATE_NULL);
  gst_object_unref (source);
  gst_object_unref (sink);
}
GST_END_TEST;

static Suite *
avatarstream_suite ()
{
  Suite *suite = suite_create ("avatarstream");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_live_frames_come_when_the_clock_says_so);
  tcase_add_test (tc, test_late_live_frames_are_skipped_with_discont);
  tcase_add_test (tc, test_ticks_while_paused_are_no_skipped_ones);
  tcase_add_test (tc, test_eos_event_ends_a_live_stream_that_waits);
  tcase_add_test (tc, test_every_pad_ends_after_num_buffers);
  tcase_add_test (tc, test_pad_requested_later_joins_the_running_stream);
  tcase_add_test (tc, test_released_pad_leaves_the_others_running);
  tcase_add_test (tc, test_pad_may_be_linked_and_unlinked_at_leisure);
  tcase_add_test (tc, test_pads_may_come_and_go_while_states_change);
  return suite;
}

GST_CHECK_MAIN (avatarstream);
