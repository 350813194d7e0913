/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What clients of rangewebsink receive: frame sets within their acknowledgement windows, rigs, the
 * ends of streams. */
#include "web-check.hpp"

using namespace rangecast::testing;

/* Pushes a frame set, which a client that acknowledges must get. */
static void
push_to (WebSink &sink, WebClient &client, const std::string &units, bool key = true)
{
  sink.push (units, key);
  client.wait_for (units);
}

static std::string
tag (int i)
{
  return "frame set " + std::to_string (i) + ".";
}

/* ---- the first frame set ---- */

GST_START_TEST (test_first_frame_set_of_a_client_is_a_key_one_and_begins_the_stream)
{
  WebSink sink;
  WebClient client (sink);
  client.enter ();
  push_to (sink, client, "one");
  push_to (sink, client, "two");
  fail_unless_equals_int (client.frames.size (), 2);
  fail_unless_cmp (client.frames[0].units (), ==, "one");
  fail_unless_cmp (client.frames[1].units (), ==, "two");
  const WebFrame &one = client.frames[0], &two = client.frames[1];
  fail_unless (one.kind () == 1 && one.key () && one.discontinuity ());
  fail_unless (two.kind () == 1 && two.key () && !two.discontinuity ());
  fail_unless_equals_int (two.number () - one.number (), 1);
  fail_unless_equals_int (two.dropped (), 0);
}
GST_END_TEST;

GST_START_TEST (test_clients_that_want_to_hear_are_told_when_speech_begins_and_ends)
{
  WebSink sink;
  WebClient hears (sink), deaf (sink);
  hears.enter (R"("want":["stream","audio"])");
  deaf.enter ();
  fail_unless_contains (hears.texts[0], R"("audio":false)");
  GstPad *pad = gst_element_request_pad_simple (sink.h->element, "audio");
  fail_unless_happens (hears.texts.size () == 2);
  fail_unless_equals_string (hears.texts[1].c_str (), R"({"type":"audio","available":true})");
  WebClient late (sink);
  late.enter ();
  fail_unless_contains (late.texts[0], R"("audio":true)");
  gst_element_release_request_pad (sink.h->element, pad);
  gst_object_unref (pad);
  fail_unless_happens (hears.texts.size () == 3);
  fail_unless_equals_string (hears.texts[2].c_str (), R"({"type":"audio","available":false})");
  deaf.round_trip ();
  fail_unless_equals_int (deaf.texts.size (), 1);
}
GST_END_TEST;

GST_START_TEST (test_delay_is_since_the_capture_time_if_that_is_known)
{
  WebSink sink;
  WebClient client (sink);
  client.enter ();
  push_to (sink, client, "unknown");
  fail_unless_equals_int (client.frames[0].delay_us (), -1);

  gst_harness_use_systemclock (sink.h);
  GstClock *clock = gst_element_get_clock (sink.h->element);
  const GstClockTime now = gst_clock_get_time (clock);
  gst_object_unref (clock);
  const auto push = [&] (const char *units, GstClockTime captured) {
    GstBuffer *buffer = gst_buffer_new_memdup (units, strlen (units));
    gst_range_buffer_set_capture_time (buffer, captured);
    fail_unless_equals_int (gst_harness_push (sink.h, buffer), GST_FLOW_OK);
    client.wait_for (units);
  };
  push ("five seconds", now - 5 * GST_SECOND);
  fail_unless_cmp (client.frames[1].delay_us (), >=, 5000000u);
  fail_unless_cmp (client.frames[1].delay_us (), <, 5000000u + kPatience_us);
  push ("of another clock", now + 100 * GST_SECOND);
  fail_unless_equals_int (client.frames[2].delay_us (), -1);
}
GST_END_TEST;

/* ---- acknowledgements ---- */

GST_START_TEST (test_client_that_does_not_acknowledge_gets_its_window_and_others_go_on)
{
  WebSink sink ("window=3");
  WebClient silent (sink), other (sink);
  silent.acknowledges = false;
  silent.enter ();
  other.enter ();
  for (int i = 0; i < 12; i++)
    push_to (sink, other, tag (i));
  silent.round_trip ();
  fail_unless_equals_int (silent.frames.size (), 3);
  fail_unless_equals_int (other.frames.size (), 12);
  fail_unless_equals_int (other.frames.back ().dropped (), 0);

  /* one acknowledgement covers all before it */
  silent.acknowledge (silent.frames.back ().number ());
  silent.round_trip ();
  for (int i = 12; i < 18; i++)
    push_to (sink, other, tag (i));
  silent.round_trip ();
  fail_unless_equals_int (silent.frames.size (), 6);
  const WebFrame &after = silent.frames[3];
  fail_unless_equals_int (after.dropped (), 9);
  fail_unless_equals_int (after.number () - silent.frames[2].number (), 10);
  fail_unless (after.discontinuity ());
  fail_unless_cmp (after.units (), ==, tag (12));
  fail_if (silent.frames[4].discontinuity ());
  fail_unless_equals_int (silent.frames[4].dropped (), 9);
}
GST_END_TEST;

/* ---- temporal prediction ---- */

GST_START_TEST (test_clients_wait_for_a_key_frame_set_that_is_requested_once)
{
  WebSink sink;
  WebClient one (sink), two (sink);
  one.enter ();
  two.enter ();
  const gint64 begin = g_get_monotonic_time ();
  for (int i = 0; i < 5; i++) {
    sink.push (tag (i), false);
    one.round_trip ();
    two.round_trip ();
  }
  fail_unless_equals_int (one.frames.size () + two.frames.size (), 0);
  const int requests = sink.key_requests (); /* at most one a second */
  fail_unless_cmp (requests, >=, 1);
  fail_unless_cmp (requests, <=, 1 + (g_get_monotonic_time () - begin) / G_USEC_PER_SEC);
  sink.push ("key");
  one.wait_for ("key");
  two.wait_for ("key");
  fail_unless (one.frames[0].key () && one.frames[0].discontinuity ());
  fail_unless_equals_int (one.frames[0].dropped (), 5);
  push_to (sink, one, "delta", false);
  two.wait_for ("delta");
  fail_if (two.frames[1].key () || two.frames[1].discontinuity ());
  fail_unless_equals_int (sink.key_requests (), 0);
}
GST_END_TEST;

GST_START_TEST (test_client_that_fell_behind_gets_no_frame_set_that_refers_to_a_missing_one)
{
  WebSink sink ("window=2");
  WebClient slow (sink), other (sink);
  slow.acknowledges = false;
  slow.enter ();
  other.enter ();
  push_to (sink, other, "key");
  for (int i = 0; i < 3; i++)
    push_to (sink, other, tag (i), false);
  slow.round_trip ();
  fail_unless_equals_int (slow.frames.size (), 2);
  sink.key_requests ();
  slow.acknowledge (slow.frames.back ().number ());
  slow.round_trip ();
  push_to (sink, other, tag (3), false);
  slow.round_trip ();
  fail_unless_equals_int (slow.frames.size (), 2);
  fail_unless_equals_int (sink.key_requests (), 1);
  push_to (sink, other, "next key");
  slow.wait_for ("next key");
  fail_unless_equals_int (slow.frames.size (), 3);
  fail_unless (slow.frames[2].key () && slow.frames[2].discontinuity ());
  fail_unless_equals_int (slow.frames[2].dropped (), 3);
  fail_if (other.frames.back ().discontinuity ());
}
GST_END_TEST;

/* ---- streams ---- */

/* After the end sinks take what follows a flush. */
static void
begin_stream (WebSink &sink, const char *id)
{
  fail_unless (gst_harness_push_event (sink.h, gst_event_new_flush_start ()));
  fail_unless (gst_harness_push_event (sink.h, gst_event_new_flush_stop (TRUE)));
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_TIME);
  fail_unless (gst_harness_push_event (sink.h, gst_event_new_stream_start (id)));
  GstCaps *caps = coded_caps (sink.rig);
  fail_unless (gst_harness_push_event (sink.h, gst_event_new_caps (caps)));
  gst_caps_unref (caps);
  fail_unless (gst_harness_push_event (sink.h, gst_event_new_segment (&segment)));
}

GST_START_TEST (test_end_is_sent_behind_the_last_frame_set_and_another_stream_may_follow)
{
  WebSink sink;
  WebClient client (sink);
  client.enter ();
  for (int stream = 0; stream < 3; stream++) {
    if (stream == 2)
      sink.rig = ring_rig (3, 32, 24);
    if (stream > 0)
      begin_stream (sink, tag (stream).c_str ());
    push_to (sink, client, tag (stream));
    push_to (sink, client, "last");
    fail_unless_equals_int (client.texts.size (), stream + 1);
    fail_unless (gst_harness_push_event (sink.h, gst_event_new_eos ()));
    fail_unless_happens (client.texts.size () == guint (stream + 2));
    fail_unless_cmp (client.texts.back (), ==, R"({"type":"end"})");
    const WebFrame &one = client.frames.at (2 * stream);
    fail_unless_cmp (one.units (), ==, tag (stream));
    fail_unless (one.key () && one.discontinuity ());
    fail_unless_cmp (client.frames.at (2 * stream + 1).units (), ==, "last");
  }
  fail_unless_equals_int (client.frames[5].number () - client.frames[0].number (), 5);
}
GST_END_TEST;

GST_START_TEST (test_flush_is_a_discontinuity)
{
  WebSink sink;
  WebClient client (sink);
  client.enter ();
  push_to (sink, client, "one");
  push_to (sink, client, "two");
  fail_if (client.frames[1].discontinuity ());
  flush (sink.h);
  sink.key_requests ();
  sink.push ("delta", false); /* refers to a frame set before the flush */
  client.round_trip ();
  fail_unless_equals_int (client.frames.size (), 2);
  fail_unless_equals_int (sink.key_requests (), 1);
  push_to (sink, client, "key");
  fail_unless (client.frames[2].discontinuity ());
  push_to (sink, client, "delta of it", false);
  fail_if (client.frames[3].discontinuity ());
}
GST_END_TEST;

GST_START_TEST (test_caps_without_a_rig_are_refused_with_an_error)
{
  WebSink sink ("", false);
  GstCaps *caps = coded_caps (sink.rig);
  gst_structure_remove_field (gst_caps_get_structure (caps, 0), "rig");
  gst_harness_set_src_caps (sink.h, caps);
  GstBuffer *buffer = gst_buffer_new_memdup ("one", 3);
  fail_unless_equals_int (gst_harness_push (sink.h, buffer), GST_FLOW_NOT_NEGOTIATED);
  fail_unless_contains (next_message_text (sink.bus, GST_MESSAGE_ERROR), "rig");
  sink.errors (); /* GStreamer sends refused caps again with each buffer */
  WebClient client (sink);
  client.enter ();
  sink.set_caps ();
  push_to (sink, client, "sound");
  fail_unless_equals_int (client.frames.size (), 1);
}
GST_END_TEST;

static Suite *
rangewebsinkstream_suite ()
{
  Suite *suite = suite_create ("rangewebsinkstream");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_first_frame_set_of_a_client_is_a_key_one_and_begins_the_stream);
  tcase_add_test (tc, test_clients_that_want_to_hear_are_told_when_speech_begins_and_ends);
  tcase_add_test (tc, test_delay_is_since_the_capture_time_if_that_is_known);
  tcase_add_test (tc, test_client_that_does_not_acknowledge_gets_its_window_and_others_go_on);
  tcase_add_test (tc, test_clients_wait_for_a_key_frame_set_that_is_requested_once);
  tcase_add_test (tc, test_client_that_fell_behind_gets_no_frame_set_that_refers_to_a_missing_one);
  tcase_add_test (tc, test_end_is_sent_behind_the_last_frame_set_and_another_stream_may_follow);
  tcase_add_test (tc, test_flush_is_a_discontinuity);
  tcase_add_test (tc, test_caps_without_a_rig_are_refused_with_an_error);
  return suite;
}

GST_CHECK_MAIN (rangewebsinkstream);
