/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* How rangewebsink signals data channels, and what hostile clients can do there. What goes over
 * them is tests/web/rtc.test.js's. */
#include <json-glib/json-glib.h>

#include "web-check.hpp"

using namespace rangecast::testing;

/* A client that was let in; without webrtcbin the test is skipped. */
#define ENTER_OR_SKIP(client)                                                                      \
  do {                                                                                             \
    (client).enter ();                                                                             \
    if ((client).texts[0].find (R"("rtc":true)") == std::string::npos)                             \
      RANGECAST_SKIP ("no webrtcbin, or one of its plugins is missing");                           \
  } while (0)

/* Waits for the server's offer. @return its SDP, as JSON has it */
static std::string
wait_for_offer (WebClient &client)
{
  std::string offer;
  fail_unless_happens ([&] {
    for (const std::string &text : client.texts)
      if (text.starts_with (R"({"type":"offer","sdp":")"))
        offer = text;
    return !offer.empty () || client.closed;
  }());
  fail_if (client.closed, "%d %s", client.code, client.reason.c_str ());
  return offer;
}

GST_START_TEST (test_client_that_asks_gets_an_offer_and_frame_sets_go_on)
{
  WebSink sink;
  WebClient client (sink), other (sink);
  ENTER_OR_SKIP (client);
  other.enter ();
  client.send (R"({"type":"rtc"})");
  const std::string offer = wait_for_offer (client);
  fail_unless_contains (offer, "m=application");
  fail_unless_contains (offer, "a=fingerprint:sha-256");
  for (const char *units : {"one", "two", "three"}) {
    sink.push (units);
    client.wait_for (units);
    other.wait_for (units);
  }
  client.send (R"({"type":"rtc-stop"})");
  sink.push ("four");
  client.wait_for ("four"); /* again with all that a client needs */
  fail_unless_equals_int (other.texts.size (), 1);
}
GST_END_TEST;

GST_START_TEST (test_frame_set_after_a_stopped_channel_begins_with_the_rig)
{
  WebSink sink;
  WebClient client (sink);
  ENTER_OR_SKIP (client);
  sink.push ("one");
  client.wait_for ("one");
  client.send (R"({"type":"rtc"})");
  client.send (R"({"type":"rtc-stop"})");
  client.round_trip ();
  sink.push ("two");
  client.wait_for ("two");
  fail_unless_cmp (client.frames[1].units (), ==, sink.rig_units () + "two");
  fail_unless (client.frames[1].key () && client.frames[1].discontinuity ());
}
GST_END_TEST;

GST_START_TEST (test_signalling_without_a_channel_is_ignored)
{
  WebSink sink;
  WebClient client (sink);
  ENTER_OR_SKIP (client);
  for (const char *message : {R"({"type":"rtc-stop"})", R"({"type":"answer","sdp":"v=0"})",
           R"({"type":"candidate","candidate":"candidate:1"})", R"({"type":"answer"})",
           R"({"type":"offer","sdp":"v=0"})"})
    client.send (message);
  client.round_trip ();
  fail_unless_equals_int (client.texts.size (), 1);
}
GST_END_TEST;

GST_START_TEST (test_no_channel_is_offered_where_it_is_switched_off)
{
  WebSink sink ("webrtc=false");
  WebClient client (sink);
  client.enter ();
  fail_unless_contains (client.texts[0], R"("rtc":false)");
  client.send (R"({"type":"rtc"})");
  client.round_trip ();
  sink.push ("one");
  client.wait_for ("one");
  fail_unless_equals_int (client.texts.size (), 1);
}
GST_END_TEST;

GST_START_TEST (test_answers_that_are_none_end_the_connection)
{
  WebSink sink;
  WebClient witness (sink);
  ENTER_OR_SKIP (witness);
  const std::string complete =
      "v=0\r\no=- 1 1 IN IP4 0.0.0.0\r\ns=-\r\nt=0 0\r\nm=application 9 UDP/DTLS/SCTP "
      "webrtc-datachannel\r\nc=IN IP4 0.0.0.0\r\na=mid:application0\r\na=ice-ufrag:a\r\n"
      "a=ice-pwd:aaaaaaaaaaaaaaaaaaaaaaaa\r\na=setup:active\r\n"; /* but for the fingerprint */
  std::string two = complete + "a=fingerprint:sha-256 00\r\n";
  two += two.substr (two.find ("m="));
  for (const std::string &sdp : {std::string (), std::string ("rubbish"), std::string ("v=0\r\n"),
           std::string ("v=0\r\nm=\r\n"), std::string ("m=video 9 RTP/AVP 96\r\n"), complete, two,
           std::string (15000, 'v')}) {
    WebClient client (sink);
    client.enter ();
    client.send (R"({"type":"rtc"})");
    wait_for_offer (client);
    JsonNode *node = json_node_init_string (json_node_alloc (), sdp.c_str ());
    g_autofree gchar *text = json_to_string (node, FALSE);
    json_node_unref (node);
    client.send (std::string (R"({"type":"answer","sdp":)") + text + "}");
    fail_unless_equals_int (client.close_code (), 4400);
  }
  witness.round_trip ();
}
GST_END_TEST;

GST_START_TEST (test_candidates_may_be_rubbish_but_not_many)
{
  WebSink sink;
  WebClient client (sink), many (sink), wrong (sink);
  ENTER_OR_SKIP (client);
  many.enter ();
  wrong.enter ();
  for (WebClient *one : {&client, &many, &wrong}) {
    one->send (R"({"type":"rtc"})");
    wait_for_offer (*one);
  }
  for (const char *candidate : {"", "rubbish", "candidate:", "candidate:1 1 UDP 1 127.0.0.1 9 typ",
           "candidate:1 1 UDP 99999999999 256.1.1.1 99999 typ host", "a=candidate:\\r\\n"})
    client.send (std::string (R"({"type":"candidate","candidate":")") + candidate +
                 R"(","sdpMLineIndex":-7})");
  client.round_trip ();
  for (int i = 0; i < 100; i++)
    many.send (R"({"type":"candidate","candidate":"candidate:1","sdpMLineIndex":0})");
  fail_unless_equals_int (many.close_code (), 4429);
  wrong.send (R"({"type":"candidate","candidate":7})");
  fail_unless_equals_int (wrong.close_code (), 4400);
  client.round_trip ();
}
GST_END_TEST;

GST_START_TEST (test_a_client_may_try_few_channels)
{
  WebSink sink;
  WebClient client (sink);
  ENTER_OR_SKIP (client);
  for (int i = 0; i < 10; i++)
    client.send (R"({"type":"rtc"})");
  fail_unless_equals_int (client.close_code (), 4429);
}
GST_END_TEST;

GST_START_TEST (test_clients_leave_and_the_server_stops_while_channels_open)
{
  for (int round = 0; round < 6; round++) {
    WebSink sink;
    WebClient leaves (sink), stays (sink);
    ENTER_OR_SKIP (leaves);
    stays.enter ();
    leaves.send (R"({"type":"rtc"})");
    stays.send (R"({"type":"rtc"})");
    if (round % 2)
      wait_for_offer (stays);
    else
      stays.round_trip ();
    leaves.close ();
    if (round % 3 == 0)
      fail_unless_happens (sink.stat ("clients") == 1);
  }
}
GST_END_TEST;

static Suite *
rangewebsinkrtc_suite ()
{
  Suite *suite = suite_create ("rangewebsinkrtc");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_client_that_asks_gets_an_offer_and_frame_sets_go_on);
  tcase_add_test (tc, test_frame_set_after_a_stopped_channel_begins_with_the_rig);
  tcase_add_test (tc, test_signalling_without_a_channel_is_ignored);
  tcase_add_test (tc, test_no_channel_is_offered_where_it_is_switched_off);
  tcase_add_test (tc, test_answers_that_are_none_end_the_connection);
  tcase_add_test (tc, test_candidates_may_be_rubbish_but_not_many);
  tcase_add_test (tc, test_a_client_may_try_few_channels);
  tcase_add_test (tc, test_clients_leave_and_the_server_stops_while_channels_open);
  return suite;
}

GST_CHECK_MAIN (rangewebsinkrtc);
