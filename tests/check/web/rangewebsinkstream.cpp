/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What clients of rangewebsink receive: frame sets within their acknowledgement windows, rigs, the
 * ends of streams. */
#include <condition_variable>
#include <mutex>

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

GST_START_TEST (test_first_frame_set_of_a_client_begins_with_the_rig)
{
  WebSink sink;
  WebClient client (sink);
  client.enter ();
  push_to (sink, client, "one");
  push_to (sink, client, "two");
  fail_unless_equals_int (client.frames.size (), 2);
  fail_unless_cmp (client.frames[0].units (), ==, sink.rig_units () + "one");
  fail_unless_cmp (client.frames[1].units (), ==, "two");
  const WebFrame &one = client.frames[0], &two = client.frames[1];
  fail_unless (one.kind () == 1 && one.key () && one.discontinuity ());
  fail_unless (two.kind () == 1 && two.key () && !two.discontinuity ());
  fail_unless_equals_int (two.number () - one.number (), 1);
  fail_unless_equals_int (one.message (), 0);
  fail_unless_equals_int (two.message (), 1);
  fail_unless_equals_int (two.dropped (), 0);
}
GST_END_TEST;

GST_START_TEST (test_frame_sets_have_the_same_number_for_all_clients)
{
  WebSink sink;
  WebClient one (sink);
  one.enter ();
  for (int i = 0; i < 3; i++)
    push_to (sink, one, tag (i));
  WebClient late (sink);
  late.enter ();
  sink.push ("for both");
  one.wait_for ("for both");
  late.wait_for ("for both");
  fail_unless_equals_int (late.frames.size (), 1);
  fail_unless_equals_int (late.frames[0].number (), one.frames[3].number ());
  fail_unless_equals_int (late.frames[0].message (), 0);
  fail_unless_equals_int (late.frames[0].dropped (), 0); /* what came before it does not count */
  fail_unless_cmp (late.frames[0].units (), ==, sink.rig_units () + "for both");
}
GST_END_TEST;

GST_START_TEST (test_welcome_comes_before_there_is_a_stream)
{
  WebSink sink ("window=7", false);
  WebClient early (sink);
  early.enter ();
  fail_unless_contains (early.texts[0], R"("version":1)");
  fail_unless_contains (early.texts[0], R"("window":7)");
  sink.set_caps ();
  push_to (sink, early, "one");
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

GST_START_TEST (test_frame_sets_arrive_whole_whatever_size_they_have)
{
  WebSink sink ("max-queued-bytes=1"); /* one goes, however large */
  WebClient client (sink);
  client.enter ();
  for (const std::size_t size : {0, 1, 92, 93, 94, 65503, 65504, 65535, 65536, 3000000}) {
    std::string units (size, 'x');
    for (std::size_t i = 0; i < size; i++)
      units[i] = char (i * 31 >> 3);
    sink.push (units);
    const std::size_t count = client.frames.size () + 1;
    fail_unless_happens (client.frames.size () == count);
    client.round_trip ();
    fail_unless_cmp (
        client.frames.back ().units (), ==, (count == 1 ? sink.rig_units () : "") + units);
  }
}
GST_END_TEST;

GST_START_TEST (test_memories_of_a_buffer_arrive_as_one)
{
  WebSink sink;
  WebClient client (sink);
  client.enter ();
  GstBuffer *buffer = gst_buffer_new ();
  std::string expected = sink.rig_units ();
  for (int i = 0; i < 40; i++) { /* more than a buffer has places for */
    const std::string part = "part " + std::to_string (i) + ";";
    GstMemory *memory = gst_allocator_alloc (nullptr, part.size () + 5, nullptr);
    gst_memory_resize (memory, 3, gssize (part.size ()));
    GstMapInfo map;
    gst_memory_map (memory, &map, GST_MAP_WRITE);
    part.copy (reinterpret_cast<char *> (map.data), map.size);
    gst_memory_unmap (memory, &map);
    gst_buffer_append_memory (buffer, memory);
    expected += part;
  }
  GST_BUFFER_PTS (buffer) = 0;
  fail_unless_equals_int (gst_harness_push (sink.h, buffer), GST_FLOW_OK);
  client.wait_for ("part 39;");
  fail_unless_cmp (client.frames[0].units (), ==, expected);
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
  fail_unless_equals_int (after.message (), 3);
  fail_unless (after.discontinuity ());
  fail_unless_cmp (after.units (), ==, tag (12)); /* it has the rig already */
  fail_if (silent.frames[4].discontinuity ());
  fail_unless_equals_int (silent.frames[4].dropped (), 9);
}
GST_END_TEST;

GST_START_TEST (test_window_is_exact)
{
  for (const guint window : {1, 2, 5}) {
    WebSink sink ("window=" + std::to_string (window));
    WebClient silent (sink), other (sink);
    silent.acknowledges = false;
    silent.enter ();
    other.enter ();
    for (guint i = 0; i < window + 3; i++)
      push_to (sink, other, tag (int (i)));
    silent.round_trip ();
    fail_unless_equals_int (silent.frames.size (), window);
    /* the first of them alone makes room for one */
    silent.acknowledge (silent.frames[0].number ());
    silent.round_trip ();
    for (guint i = 0; i < 3; i++)
      push_to (sink, other, tag (100 + int (i)));
    silent.round_trip ();
    fail_unless_equals_int (silent.frames.size (), window + 1);
  }
}
GST_END_TEST;

GST_START_TEST (test_bytes_without_acknowledgement_are_limited)
{
  WebSink sink ("window=100 max-queued-bytes=100000");
  WebClient silent (sink), other (sink);
  silent.acknowledges = false;
  silent.enter ();
  other.enter ();
  for (int i = 0; i < 8; i++)
    push_to (sink, other, std::string (30000, 'x') + tag (i));
  silent.round_trip ();
  fail_unless_equals_int (silent.frames.size (), 3);
}
GST_END_TEST;

GST_START_TEST (test_acknowledgement_of_what_was_not_sent_makes_no_room)
{
  WebSink sink ("window=2");
  WebClient silent (sink), other (sink);
  silent.acknowledges = false;
  silent.enter ();
  other.enter ();
  for (int i = 0; i < 2; i++)
    push_to (sink, other, tag (i));
  silent.round_trip ();
  const guint32 one = silent.frames.at (0).number ();
  silent.acknowledge (one - 1);
  silent.acknowledge (one + 0x80000001);
  silent.round_trip ();
  push_to (sink, other, tag (2));
  silent.round_trip ();
  fail_unless_equals_int (silent.frames.size (), 2);
}
GST_END_TEST;

GST_START_TEST (test_stats_say_what_a_client_got)
{
  WebSink sink ("window=2");
  WebClient silent (sink), other (sink);
  silent.acknowledges = false;
  silent.enter ();
  for (int i = 0; i < 2; i++)
    sink.push (tag (i));
  silent.round_trip ();
  other.enter ();
  for (int i = 2; i < 7; i++)
    push_to (sink, other, tag (i));
  fail_unless_happens (
      sink.client_stat ("frame-sets") == "2" && sink.client_stat ("dropped") == "5");
  fail_unless_cmp (sink.client_stat ("unacknowledged"), ==, "2");
  fail_unless_cmp (sink.client_stat ("address"), ==, "127.0.0.1");
  fail_unless_cmp (sink.client_stat ("transport"), ==, "websocket");
  fail_unless_equals_int (sink.stat ("frame-sets"), 7);
  fail_unless_equals_int (sink.stat ("clients"), 2);
  fail_unless_equals_int (sink.stat ("connections"), 2);
  fail_unless_equals_int (sink.stat ("refused"), 0);
  gsize bytes = 0;
  for (const WebClient *client : {&silent, &other})
    for (const WebFrame &frame : client->frames)
      bytes += frame.bytes.size ();
  fail_unless_happens (sink.stat ("bytes") == bytes);
  other.close (); /* what it got goes on to count */
  fail_unless_happens (sink.stat ("clients") == 1);
  fail_unless_happens (sink.client_stat ("dropped") == "5");
  fail_unless_equals_int (sink.stat ("bytes"), bytes);
}
GST_END_TEST;

/* ---- temporal prediction ---- */

GST_START_TEST (test_clients_wait_for_a_key_frame_set_that_is_requested_once)
{
  WebSink sink ("key-unit-interval=600000");
  WebClient one (sink), two (sink);
  one.enter ();
  two.enter ();
  sink.key_requests ();
  for (int i = 0; i < 5; i++) {
    sink.push (tag (i), false);
    one.round_trip ();
    two.round_trip ();
  }
  fail_unless_equals_int (one.frames.size () + two.frames.size (), 0);
  fail_unless_equals_int (sink.key_requests (), 1);
  fail_unless_equals_int (sink.stat ("key-requests"), 1);
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

GST_START_TEST (test_key_frame_sets_are_requested_again_after_the_interval)
{
  WebSink sink ("key-unit-interval=0");
  WebClient client (sink);
  client.enter ();
  sink.key_requests ();
  for (int i = 1; i <= 3; i++) {
    sink.push (tag (i), false);
    client.round_trip ();
    fail_unless_equals_int (sink.key_requests (), 1);
    fail_unless_equals_int (sink.stat ("key-requests"), i);
  }
}
GST_END_TEST;

GST_START_TEST (test_client_that_fell_behind_gets_no_frame_set_that_refers_to_a_missing_one)
{
  WebSink sink ("window=2 key-unit-interval=600000");
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

GST_START_TEST (test_client_may_ask_for_a_key_frame_set)
{
  WebSink sink ("key-unit-interval=600000");
  WebClient client (sink);
  client.enter ();
  push_to (sink, client, "one");
  sink.key_requests ();
  for (int i = 0; i < 5; i++)
    client.send (R"({"type":"key"})");
  client.round_trip ();
  fail_unless_equals_int (sink.key_requests (), 1);
}
GST_END_TEST;

GST_START_TEST (test_client_that_does_not_want_the_stream_asks_for_no_key_frame_set)
{
  WebSink sink ("key-unit-interval=0");
  WebClient stats (sink);
  stats.enter (R"("want":["stats"])");
  sink.key_requests ();
  for (int i = 0; i < 3; i++)
    sink.push (tag (i), false);
  sink.push ("key");
  stats.round_trip ();
  fail_unless_equals_int (stats.frames.size (), 0);
  fail_unless_equals_int (sink.key_requests (), 0);
}
GST_END_TEST;

/* ---- streams ---- */

GST_START_TEST (test_new_rig_comes_first_when_the_rig_changes)
{
  WebSink sink;
  WebClient client (sink);
  client.enter ();
  push_to (sink, client, "old");
  sink.rig = ring_rig (3, 32, 24);
  sink.set_caps ();
  push_to (sink, client, "new");
  push_to (sink, client, "next");
  fail_unless_cmp (client.frames[1].units (), ==, sink.rig_units () + "new");
  fail_unless (client.frames[1].discontinuity ());
  fail_unless_cmp (client.frames[2].units (), ==, "next");
  fail_if (client.frames[2].discontinuity ());
}
GST_END_TEST;

GST_START_TEST (test_client_that_missed_the_change_of_the_rig_gets_it_later)
{
  WebSink sink ("window=1");
  WebClient slow (sink), other (sink);
  slow.acknowledges = false;
  slow.enter ();
  other.enter ();
  push_to (sink, other, "old");
  sink.rig = ring_rig (3, 32, 24);
  sink.set_caps ();
  push_to (sink, other, "new");
  slow.round_trip ();
  fail_unless_equals_int (slow.frames.size (), 1);
  slow.acknowledge (slow.frames[0].number ());
  slow.round_trip ();
  push_to (sink, other, "later");
  slow.wait_for ("later");
  fail_unless_cmp (slow.frames[1].units (), ==, sink.rig_units () + "later");
}
GST_END_TEST;

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
    fail_unless_cmp (one.units (), ==, sink.rig_units () + tag (stream));
    fail_unless (one.key () && one.discontinuity ());
    fail_unless_cmp (client.frames.at (2 * stream + 1).units (), ==, "last");
  }
  fail_unless_equals_int (client.frames[5].number () - client.frames[0].number (), 5);
}
GST_END_TEST;

GST_START_TEST (test_eos_before_any_frame_set_is_sent_too)
{
  WebSink sink;
  WebClient client (sink), stranger (sink);
  client.enter ();
  fail_unless (gst_harness_push_event (sink.h, gst_event_new_eos ()));
  fail_unless_happens (client.texts.size () == 2);
  fail_unless_cmp (client.texts[1], ==, R"({"type":"end"})");
  stranger.enter (); /* who was not let in by then learns nothing of it */
  stranger.round_trip ();
  fail_unless_equals_int (stranger.texts.size (), 1);
}
GST_END_TEST;

GST_START_TEST (test_frame_sets_go_on_after_a_flush)
{
  WebSink sink;
  WebClient client (sink);
  client.enter ();
  for (int i = 0; i < 3; i++) {
    push_to (sink, client, tag (i));
    flush (sink.h);
  }
  push_to (sink, client, "after");
  fail_unless_equals_int (client.frames.size (), 4);
  fail_unless_equals_int (client.frames[3].dropped (), 0);
  fail_unless_equals_int (client.texts.size (), 1); /* a flush is no end */
}
GST_END_TEST;

GST_START_TEST (test_flush_is_a_discontinuity)
{
  WebSink sink ("key-unit-interval=0");
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

GST_START_TEST (test_discont_that_jumps_in_time_is_a_discontinuity)
{
  WebSink sink ("key-unit-interval=0");
  WebClient client (sink);
  client.enter ();
  const auto push = [&] (const std::string &units, GstClockTime pts, bool key) {
    GstBuffer *buffer = gst_buffer_new_memdup (units.data (), units.size ());
    GST_BUFFER_PTS (buffer) = pts;
    GST_BUFFER_FLAG_SET (buffer, GST_BUFFER_FLAG_DISCONT);
    if (!key)
      GST_BUFFER_FLAG_SET (buffer, GST_BUFFER_FLAG_DELTA_UNIT);
    fail_unless_equals_int (gst_harness_push (sink.h, buffer), GST_FLOW_OK);
  };
  push ("one", 0, true);
  client.wait_for ("one");
  push ("after a lost packet", GST_SECOND, false);
  client.wait_for ("after a lost packet");
  fail_if (client.frames[1].discontinuity ());
  for (const GstClockTime pts :
      {GstClockTime (3 * GST_SECOND), GstClockTime (0), GST_CLOCK_TIME_NONE}) {
    const std::size_t count = client.frames.size ();
    push ("delta", pts, false);
    client.round_trip ();
    fail_unless_equals_int (client.frames.size (), count);
    push ("key", pts, true);
    client.wait_for ("key");
    fail_unless (client.frames.back ().discontinuity ());
  }
}
GST_END_TEST;

GST_START_TEST (test_key_request_that_upstream_holds_up_delays_no_client)
{
  struct Gate {
    std::mutex lock;
    std::condition_variable changed;
    bool entered = false, open = false;
  } gate;
  const GstPadProbeCallback hold = [] (GstPad *, GstPadProbeInfo *info, gpointer data) {
    auto gate = static_cast<Gate *> (data);
    if (gst_video_event_is_force_key_unit (GST_PAD_PROBE_INFO_EVENT (info))) {
      std::unique_lock guard (gate->lock);
      gate->entered = true;
      gate->changed.wait (guard, [gate] { return gate->open; });
    }
    return GST_PAD_PROBE_OK;
  };
  WebSink sink ("key-unit-interval=0");
  gst_pad_add_probe (sink.h->srcpad, GST_PAD_PROBE_TYPE_EVENT_UPSTREAM, hold, &gate, nullptr);
  WebClient client (sink);
  client.enter ();
  push_to (sink, client, "one");
  client.send (R"({"type":"key"})");
  fail_unless_happens ([&] {
    std::lock_guard guard (gate.lock);
    return gate.entered;
  }());
  for (int i = 0; i < 5; i++) {
    client.send (R"({"type":"key"})"); /* is not queued behind the one that waits */
    push_to (sink, client, tag (i));
  }
  fail_unless_equals_int (sink.stat ("key-requests"), 1);
  {
    std::lock_guard guard (gate.lock);
    gate.open = true;
  }
  gate.changed.notify_all ();
  fail_unless_equals_int (sink.key_requests (), 1);
}
GST_END_TEST;

GST_START_TEST (test_gap_is_not_sent_and_does_not_disturb)
{
  WebSink sink;
  WebClient client (sink);
  client.enter ();
  fail_unless (gst_harness_push_event (sink.h, gst_event_new_gap (0, GST_SECOND)));
  push_to (sink, client, "one");
  fail_unless (gst_harness_push_event (sink.h, gst_event_new_gap (GST_SECOND, GST_SECOND)));
  push_to (sink, client, "two");
  fail_unless_equals_int (client.frames.size (), 2);
  fail_unless_equals_int (client.frames[1].number () - client.frames[0].number (), 1);
  fail_unless_equals_int (client.texts.size (), 1);
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
  WebClient client (sink);
  client.enter ();
  sink.set_caps ();
  push_to (sink, client, "sound");
  fail_unless_equals_int (client.frames.size (), 1);
}
GST_END_TEST;

GST_START_TEST (test_caps_of_other_streams_are_refused)
{
  WebSink sink ("", false);
  GstPad *pad = gst_element_get_static_pad (sink.h->element, "sink");
  GstCaps *others[] = {coded_caps (sink.rig, "slice"), range_caps (sink.rig),
      gst_caps_from_string ("video/x-raw,width=32,height=24")};
  for (GstCaps *caps : others) {
    fail_if (gst_pad_query_accept_caps (pad, caps));
    gst_caps_unref (caps);
  }
  GstCaps *caps = coded_caps (sink.rig);
  fail_unless (gst_pad_query_accept_caps (pad, caps));
  gst_caps_unref (caps);
  gst_object_unref (pad);
}
GST_END_TEST;

static Suite *
rangewebsinkstream_suite ()
{
  Suite *suite = suite_create ("rangewebsinkstream");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_first_frame_set_of_a_client_begins_with_the_rig);
  tcase_add_test (tc, test_frame_sets_have_the_same_number_for_all_clients);
  tcase_add_test (tc, test_welcome_comes_before_there_is_a_stream);
  tcase_add_test (tc, test_clients_that_want_to_hear_are_told_when_speech_begins_and_ends);
  tcase_add_test (tc, test_frame_sets_arrive_whole_whatever_size_they_have);
  tcase_add_test (tc, test_memories_of_a_buffer_arrive_as_one);
  tcase_add_test (tc, test_delay_is_since_the_capture_time_if_that_is_known);
  tcase_add_test (tc, test_client_that_does_not_acknowledge_gets_its_window_and_others_go_on);
  tcase_add_test (tc, test_window_is_exact);
  tcase_add_test (tc, test_bytes_without_acknowledgement_are_limited);
  tcase_add_test (tc, test_acknowledgement_of_what_was_not_sent_makes_no_room);
  tcase_add_test (tc, test_stats_say_what_a_client_got);
  tcase_add_test (tc, test_clients_wait_for_a_key_frame_set_that_is_requested_once);
  tcase_add_test (tc, test_key_frame_sets_are_requested_again_after_the_interval);
  tcase_add_test (tc, test_client_that_fell_behind_gets_no_frame_set_that_refers_to_a_missing_one);
  tcase_add_test (tc, test_client_may_ask_for_a_key_frame_set);
  tcase_add_test (tc, test_client_that_does_not_want_the_stream_asks_for_no_key_frame_set);
  tcase_add_test (tc, test_new_rig_comes_first_when_the_rig_changes);
  tcase_add_test (tc, test_client_that_missed_the_change_of_the_rig_gets_it_later);
  tcase_add_test (tc, test_end_is_sent_behind_the_last_frame_set_and_another_stream_may_follow);
  tcase_add_test (tc, test_eos_before_any_frame_set_is_sent_too);
  tcase_add_test (tc, test_frame_sets_go_on_after_a_flush);
  tcase_add_test (tc, test_flush_is_a_discontinuity);
  tcase_add_test (tc, test_discont_that_jumps_in_time_is_a_discontinuity);
  tcase_add_test (tc, test_key_request_that_upstream_holds_up_delays_no_client);
  tcase_add_test (tc, test_gap_is_not_sent_and_does_not_disturb);
  tcase_add_test (tc, test_caps_without_a_rig_are_refused_with_an_error);
  tcase_add_test (tc, test_caps_of_other_streams_are_refused);
  return suite;
}

GST_CHECK_MAIN (rangewebsinkstream);
