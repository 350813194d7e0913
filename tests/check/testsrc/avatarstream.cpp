/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* avatartestsrc's streaming: the clock, pads that come and go, flushes, seeks. */
#include "../rangecast-check.hpp"

#include <gst/check/gsttestclock.h>
#include <gst/video/gstvideopool.h>

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

static guint64
stat (GstElement *source, const char *name)
{
  GstStructure *stats = nullptr;
  guint64 value = G_MAXUINT64;
  g_object_get (source, "stats", &stats, nullptr);
  gst_structure_get_uint64 (stats, name, &value);
  gst_structure_free (stats);
  return value;
}

static bool
wait_for_frames (GstElement *source, guint64 count)
{
  for (int i = 0; i < 1000 && stat (source, "frames") < count; i++)
    g_usleep (10000);
  return stat (source, "frames") >= count;
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

static void
expect_some_buffer (GstHarness *h)
{
  GstBuffer *buffer = gst_harness_pull (h);
  fail_unless (buffer != nullptr, "no buffer came");
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
  fail_unless_equals_uint64 (stat (h->element, "skipped"), 0);
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
  fail_unless_equals_uint64 (stat (h->element, "skipped"), 3);
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
  fail_unless_equals_uint64 (stat (h->element, "skipped"), 0);
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
  fail_unless_equals_uint64 (stat (source, "frames"), 3);
  for (GstHarness *h : harnesses)
    gst_harness_teardown (h);
  gst_object_unref (source);
}
GST_END_TEST;

GST_START_TEST (test_first_pad_requested_while_playing_is_fed)
{
  GstElement *source = make_source (FALSE);
  gst_element_set_state (source, GST_STATE_PLAYING);
  GstHarness *h = harness_of (source, "left");
  expect_buffer (h, 0, true);
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
  fail_unless (wait_for_frames (source, stat (source, "frames") + 3));
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

/* @param caps  what it takes; nullptr: anything */
static GstPad *
make_sink_pad (const char *caps = nullptr)
{
  GstPad *sink;
  if (caps) {
    GstCaps *taken = gst_caps_from_string (caps);
    GstPadTemplate *pad_template =
        gst_pad_template_new ("sink", GST_PAD_SINK, GST_PAD_ALWAYS, taken);
    sink = gst_pad_new_from_template (pad_template, "sink");
    gst_object_unref (pad_template);
    gst_caps_unref (taken);
  } else {
    sink = gst_pad_new ("sink", GST_PAD_SINK);
  }
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
    const guint64 before = stat (source, "frames");
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
  for (int i = 0; i < 30; i++)
    for (GstState state : {GST_STATE_PLAYING, GST_STATE_READY, GST_STATE_PAUSED, GST_STATE_NULL}) {
      gst_element_set_state (GST_ELEMENT (element), state);
      g_usleep (g_random_int_range (0, 2000));
    }
  return nullptr;
}

/* Live, a link changes while the source waits for the next tick. */
GST_START_TEST (test_live_pads_may_be_linked_to_peers_of_another_size)
{
  GstElement *source = make_source (TRUE), *pipeline = gst_pipeline_new (nullptr);
  gst_bin_add (GST_BIN (pipeline), GST_ELEMENT (gst_object_ref (source)));
  GstPad *left = gst_element_request_pad_simple (source, "left");
  GstPad *right = gst_element_request_pad_simple (source, "right");
  GstPad *small = make_sink_pad ("video/x-raw,width=32,height=24,framerate=50/1");
  GstPad *large = make_sink_pad ("video/x-raw,width=64,height=48,framerate=50/1");
  gst_element_set_state (pipeline, GST_STATE_PLAYING);
  for (int i = 0; i < 6; i++) { /* another pad each time, and another peer */
    GstPad *pad = i % 2 ? right : left, *sink = i % 3 ? small : large;
    const guint64 before = stat (source, "frames");
    fail_unless_equals_int (
        gst_pad_link_full (
            pad, sink, i < 3 ? GST_PAD_LINK_CHECK_DEFAULT : GST_PAD_LINK_CHECK_NO_RECONFIGURE),
        GST_PAD_LINK_OK);
    fail_unless (wait_for_frames (source, before + 3), "link %d", i);
    g_usleep (5000);
    gst_pad_unlink (pad, sink);
  }
  GstBus *bus = gst_element_get_bus (pipeline);
  fail_unless (gst_bus_pop_filtered (bus, GST_MESSAGE_ERROR) == nullptr);
  gst_element_set_state (pipeline, GST_STATE_NULL);
  for (gpointer object : {gpointer (bus), gpointer (left), gpointer (right), gpointer (small),
           gpointer (large), gpointer (source), gpointer (pipeline)})
    gst_object_unref (object);
}
GST_END_TEST;

static int refusals; /* that are left */

static GstFlowReturn
refuse_or_drop (GstPad *, GstObject *, GstBuffer *buffer)
{
  gst_buffer_unref (buffer);
  return refusals-- > 0 ? GST_FLOW_NOT_NEGOTIATED : GST_FLOW_OK;
}

/* As a peer does that is linked during a push and so gets the caps of the one before. */
GST_START_TEST (test_frame_refused_once_is_negotiated_again_and_twice_is_an_error)
{
  for (const int times : {1, 2}) {
    GstElement *source = make_source (FALSE);
    GstBus *bus = gst_bus_new ();
    gst_element_set_bus (source, bus);
    GstPad *pad = gst_element_request_pad_simple (source, "left"), *sink = make_sink_pad ();
    gst_pad_set_chain_function (sink, refuse_or_drop);
    refusals = times;
    gst_pad_link (pad, sink);
    gst_element_set_state (source, GST_STATE_PLAYING);
    if (times == 1) {
      fail_unless (wait_for_frames (source, 3));
      fail_unless (gst_bus_pop_filtered (bus, GST_MESSAGE_ERROR) == nullptr);
    } else {
      fail_unless_contains (next_message_text (bus, GST_MESSAGE_ERROR), "Internal data stream");
      fail_unless_equals_uint64 (stat (source, "frames"), 0);
    }
    gst_element_set_state (source, GST_STATE_NULL);
    gst_element_set_bus (source, nullptr);
    for (gpointer object : {gpointer (pad), gpointer (bus), gpointer (source), gpointer (sink)})
      gst_object_unref (object);
  }
}
GST_END_TEST;

GST_START_TEST (test_pads_may_come_and_go_while_states_change)
{
  GstElement *source = make_source (FALSE);
  GstPad *sink = make_sink_pad ();
  GThread *thread = g_thread_new ("states", change_states, source);
  for (int i = 0; i < 60; i++) {
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

/* ---- flushes and seeks ---- */

GST_START_TEST (test_flush_events_go_through_and_restart_running_time)
{
  GstElement *source = make_source (FALSE);
  GstHarness *left = harness_of (source, "left"), *right = harness_of (source, "right");
  gst_harness_play (left);
  expect_some_buffer (left);
  expect_some_buffer (right);
  fail_if (gst_element_send_event (source, gst_event_new_flush_stop (TRUE)), "nothing to stop");
  fail_unless (gst_element_send_event (source, gst_event_new_flush_start ()));
  fail_unless (gst_element_send_event (source, gst_event_new_flush_stop (TRUE)));
  for (GstHarness *h : {left, right}) {
    gst_event_unref (expect_event (h, GST_EVENT_SEGMENT));
    gst_event_unref (expect_event (h, GST_EVENT_FLUSH_START));
    gst_event_unref (expect_event (h, GST_EVENT_FLUSH_STOP));
    GstEvent *event = expect_event (h, GST_EVENT_SEGMENT);
    const GstSegment *segment = nullptr;
    gst_event_parse_segment (event, &segment);
    GstBuffer *buffer = gst_harness_pull (h); /* some are from before */
    while (GST_BUFFER_PTS (buffer) != segment->start ||
           !GST_BUFFER_FLAG_IS_SET (buffer, GST_BUFFER_FLAG_DISCONT)) {
      gst_buffer_unref (buffer);
      buffer = gst_harness_pull (h);
      fail_unless (buffer != nullptr);
    }
    fail_unless_equals_uint64 (
        gst_segment_to_running_time (segment, GST_FORMAT_TIME, GST_BUFFER_PTS (buffer)), 0);
    gst_buffer_unref (buffer);
    gst_event_unref (event);
  }
  gst_harness_teardown (right);
  gst_harness_teardown (left);
  gst_object_unref (source);
}
GST_END_TEST;

static GstEvent *
make_seek (GstSeekFlags flags, GstClockTime start, GstClockTime stop)
{
  return gst_event_new_seek (1, GST_FORMAT_TIME, flags, GST_SEEK_TYPE_SET,
      static_cast<gint64> (start), GST_SEEK_TYPE_SET, static_cast<gint64> (stop));
}

GST_START_TEST (test_flush_seek_gives_the_frames_of_its_segment_once)
{
  GstElement *source = make_source (FALSE);
  GstHarness *left = harness_of (source, "left"), *right = harness_of (source, "right");
  gst_harness_play (left);
  expect_some_buffer (right);
  GstEvent *seek = make_seek (GST_SEEK_FLAG_FLUSH, 50 * kFrame, 53 * kFrame);
  for (GstHarness *h : {left, right}) /* as a pipeline with two sinks */
    fail_unless (gst_harness_push_upstream_event (h, gst_event_ref (seek)));
  for (GstHarness *h : {left, right}) {
    gst_event_unref (expect_event (h, GST_EVENT_FLUSH_STOP));
    GstEvent *segment = expect_event (h, GST_EVENT_SEGMENT);
    fail_unless_equals_int (gst_event_get_seqnum (segment), gst_event_get_seqnum (seek));
    gst_event_unref (segment);
    GstEvent *next = gst_harness_pull_event (h);
    fail_unless_equals_int (GST_EVENT_TYPE (next), GST_EVENT_EOS);
    gst_event_unref (next);
    guint64 frames = 0;
    while (GstBuffer *buffer = gst_harness_try_pull (h)) {
      const bool first = GST_BUFFER_FLAG_IS_SET (buffer, GST_BUFFER_FLAG_DISCONT);
      const GstClockTime pts = GST_BUFFER_PTS (buffer);
      fail_unless (!first || pts == 0 || pts == 50 * kFrame);
      frames = first ? 1 : frames + 1;
      gst_buffer_unref (buffer);
    }
    fail_unless_equals_uint64 (frames, 3);
  }
  gst_event_unref (seek);
  gst_harness_teardown (right);
  gst_harness_teardown (left);
  gst_object_unref (source);
}
GST_END_TEST;

GST_START_TEST (test_segment_seek_ends_with_segment_done)
{
  GstElement *source = make_source (FALSE);
  GstBus *bus = gst_bus_new ();
  gst_element_set_bus (source, bus);
  GstHarness *h = harness_of (source, "left");
  gst_harness_play (h);
  expect_some_buffer (h);
  const auto flags = GstSeekFlags (GST_SEEK_FLAG_FLUSH | GST_SEEK_FLAG_SEGMENT);
  fail_unless (gst_harness_push_upstream_event (h, make_seek (flags, 0, 2 * kFrame)));
  gst_event_unref (expect_event (h, GST_EVENT_SEGMENT_DONE));
  GstMessage *message = gst_bus_timed_pop_filtered (bus, 5 * GST_SECOND, GST_MESSAGE_SEGMENT_DONE);
  fail_unless (message != nullptr);
  gint64 position = 0;
  gst_message_parse_segment_done (message, nullptr, &position);
  fail_unless_equals_int64 (position, 2 * kFrame);
  gst_message_unref (message);
  gst_element_set_bus (source, nullptr);
  gst_object_unref (bus);
  gst_harness_teardown (h);
  gst_object_unref (source);
}
GST_END_TEST;

GST_START_TEST (test_live_stream_refuses_seeks_and_says_so)
{
  GstHarness *h = make_harness (TRUE);
  gst_harness_play (h);
  fail_unless (gst_harness_wait_for_clock_id_waits (h, 1, 10));
  fail_if (gst_harness_push_upstream_event (h, make_seek (GST_SEEK_FLAG_FLUSH, 0, kFrame)));
  GstQuery *query = gst_query_new_seeking (GST_FORMAT_TIME);
  fail_unless (gst_pad_peer_query (h->sinkpad, query));
  gboolean seekable = TRUE;
  gst_query_parse_seeking (query, nullptr, &seekable, nullptr, nullptr);
  fail_if (seekable);
  gst_query_unref (query);
  gst_harness_teardown (h);
}
GST_END_TEST;

/* ---- waits ---- */

static GstPadProbeReturn
offer_pool (GstPad *, GstPadProbeInfo *info, gpointer pool)
{
  GstQuery *query = GST_PAD_PROBE_INFO_QUERY (info);
  if (GST_QUERY_TYPE (query) != GST_QUERY_ALLOCATION)
    return GST_PAD_PROBE_OK;
  gst_query_add_allocation_pool (query, GST_BUFFER_POOL (pool), 16 * 16 * 4, 2, 2);
  return GST_PAD_PROBE_HANDLED;
}

GST_START_TEST (test_stop_and_flush_end_the_wait_for_a_buffer_of_downstreams_pool)
{
  GstHarness *h = make_harness (FALSE);
  GstBufferPool *pool = gst_video_buffer_pool_new ();
  gst_pad_add_probe (h->sinkpad, GST_PAD_PROBE_TYPE_QUERY_DOWNSTREAM, offer_pool, pool, nullptr);
  gst_harness_play (h);
  GstBuffer *first = gst_harness_pull (h), *second = gst_harness_pull (h);
  g_usleep (50000); /* there is no third: the thread waits now */
  fail_unless_equals_int (gst_harness_buffers_in_queue (h), 0);
  fail_unless (gst_element_send_event (h->element, gst_event_new_flush_start ()));
  fail_unless (gst_element_send_event (h->element, gst_event_new_flush_stop (TRUE)));
  g_usleep (50000); /* it waits again */
  fail_unless_equals_int (
      gst_element_set_state (h->element, GST_STATE_NULL), GST_STATE_CHANGE_SUCCESS);
  gst_buffer_unref (first);
  gst_buffer_unref (second);
  gst_harness_teardown (h);
  gst_object_unref (pool);
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
  tcase_add_test (tc, test_first_pad_requested_while_playing_is_fed);
  tcase_add_test (tc, test_pad_requested_later_joins_the_running_stream);
  tcase_add_test (tc, test_released_pad_leaves_the_others_running);
  tcase_add_test (tc, test_pad_may_be_linked_and_unlinked_at_leisure);
  tcase_add_test (tc, test_live_pads_may_be_linked_to_peers_of_another_size);
  tcase_add_test (tc, test_frame_refused_once_is_negotiated_again_and_twice_is_an_error);
  tcase_add_test (tc, test_pads_may_come_and_go_while_states_change);
  tcase_add_test (tc, test_flush_events_go_through_and_restart_running_time);
  tcase_add_test (tc, test_flush_seek_gives_the_frames_of_its_segment_once);
  tcase_add_test (tc, test_segment_seek_ends_with_segment_done);
  tcase_add_test (tc, test_live_stream_refuses_seeks_and_says_so);
  tcase_add_test (tc, test_stop_and_flush_end_the_wait_for_a_buffer_of_downstreams_pool);
  return suite;
}

GST_CHECK_MAIN (avatarstream);
