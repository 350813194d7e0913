/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Whom rangewebsink lets in, and how it ends the connections of others. */
#include "web-check.hpp"

using namespace rangecast::testing;

/* A client that is in, to see that the server goes on. */
struct Witness {
  WebSink &sink;
  WebClient client;
  int count = 0;

  explicit Witness (WebSink &server, const std::string &fields = "")
      : sink (server), client (server)
  {
    client.enter (fields);
  }
  /* Pushes a frame set and waits until the server has sent it to all. */
  void go_on ()
  {
    const std::string units = "witness " + std::to_string (count++);
    sink.push (units);
    client.wait_for (units);
  }
};

/* What a client's connection ends with after it sent this message. */
static int
code_after (WebSink &sink, const std::string &message)
{
  WebClient client (sink);
  client.send (message);
  return client.close_code ();
}

/* ---- tokens ---- */

GST_START_TEST (test_nothing_of_the_stream_comes_before_the_welcome)
{
  WebSink sink ("token=right");
  Witness witness (sink, R"("token":"right")");
  WebClient late (sink), stranger (sink);
  RawClient raw (sink.port ());
  raw.upgrade ();
  for (int i = 0; i < 5; i++)
    witness.go_on ();
  stranger.send (R"({"type":"key"})");
  fail_unless_equals_int (stranger.close_code (), 4400);
  late.enter (R"("token":"right")");
  witness.go_on ();
  late.wait_for ("witness 5");
  fail_unless_equals_int (late.frames_before_texts, 0);
  fail_unless_equals_int (late.frames.size (), 1);
  fail_unless_equals_int (stranger.frames.size () + stranger.texts.size (), 0);
  raw.send (masked_frame (0x81, R"({"type":"hello","version":1,"token":"wrong"})"));
  const std::string rest = raw.receive ("wrong or missing token");
  fail_unless_equals_int (guint8 (rest.at (0)), 0x88); /* what comes first is the end */
  fail_unless (rest.find ("witness") == rest.npos);
}
GST_END_TEST;

GST_START_TEST (test_wrong_and_missing_tokens_are_refused)
{
  WebSink sink ("token=right");
  for (const char *fields : {"", R"(,"token":"")", R"(,"token":"wrong")", R"(,"token":"right ")",
           R"(,"token":"righ")", R"(,"token":"Right")"})
    fail_unless_equals_int (
        code_after (sink, std::string (R"({"type":"hello","version":1)") + fields + "}"), 4401);
  fail_unless_equals_int (sink.stat ("refused"), 6);
  fail_unless_equals_int (sink.stat ("connections"), 6);
  WebClient client (sink);
  client.enter (R"("token":"right")");
  fail_unless_equals_int (sink.stat ("refused"), 6);
}
GST_END_TEST;

GST_START_TEST (test_users_of_the_token_file_come_and_go_while_the_server_runs)
{
  Folder folder;
  const std::string file = folder.write ("users.txt", "anna one\nbert two\n");
  WebSink sink ("token-file=" + file);
  const auto hello = [] (const char *token) {
    return std::string (R"({"type":"hello","version":1,"token":")") + token + "\"}";
  };
  WebClient anna (sink), bert (sink);
  anna.enter (R"("token":"one")");
  bert.enter (R"("token":"two")");
  fail_unless_equals_int (code_after (sink, hello ("three")), 4401);

  folder.write ("users.txt", "carl three\n");
  fail_unless_equals_int (code_after (sink, hello ("one")), 4401);
  WebClient carl (sink);
  carl.enter (R"("token":"three")");
  anna.round_trip (); /* is still there */

  g_remove (file.c_str ());
  fail_unless_equals_int (code_after (sink, hello ("three")), 4401);
  fail_unless_equals_int (code_after (sink, hello ("")), 4401);
}
GST_END_TEST;

/* ---- what is no hello ---- */

GST_START_TEST (test_first_message_that_is_no_hello_ends_the_connection)
{
  WebSink sink;
  Witness witness (sink);
  for (const char *message :
      {"", "hello", "[]", "{}", "{\"type\":1}", R"({"type":"ack","frameSet":0})",
          R"({"type":"hello"})", R"({"type":"hello","version":"1"})",
          R"({"type":"hello","version":1,"token":7})", R"({"type":"hello","version":1,"room":7})",
          R"({"type":"hello","version":1,"want":"x"})"})
    fail_unless_equals_int (code_after (sink, message), 4400);
  fail_unless_equals_int (code_after (sink, R"({"type":"hello","version":2})"), 4406);
  fail_unless_equals_int (code_after (sink, R"({"type":"hello","version":0})"), 4406);
  witness.go_on ();
  fail_unless_equals_int (sink.stat ("clients"), 1);
}
GST_END_TEST;

GST_START_TEST (test_damaged_messages_after_the_welcome_end_the_connection)
{
  WebSink sink;
  const std::string many_brackets = R"({"type":"ack","frameSet":0,"x":)" + std::string (9000, '[');
  Witness witness (sink);
  for (const char *message : {"", "no JSON", "{\"type\":null}", many_brackets.c_str (),
           R"({"type":"ack"})", R"({"type":"ack","frameSet":-1})",
           R"({"type":"ack","frameSet":4294967296})", R"({"type":"ack","frameSet":1e999})",
           R"({"type":"ack","frameSet":null})", R"({"type":"ack","frameSet":0.5})",
           R"({"type":"ping"})", R"({"type":"ping","time":12345678901234567890})",
           R"({"type":"ping","time":"1"})", R"({"type":"ping","time":1e999})"}) {
    WebClient client (sink);
    client.enter ();
    client.send (message);
    fail_unless_equals_int (client.close_code (), 4400);
  }
  witness.go_on ();
}
GST_END_TEST;

/* ---- limits ---- */

GST_START_TEST (test_message_of_more_than_16384_bytes_ends_the_connection)
{
  WebSink sink;
  const std::string hello = R"({"type":"hello","version":1,"x":")";
  const auto padded = [&] (gsize size) {
    return hello + std::string (size - hello.size () - 2, 'x') + "\"}";
  };
  WebClient largest (sink);
  largest.send (padded (16384));
  largest.round_trip ();
  fail_unless_equals_int (code_after (sink, padded (16385)), 1009);
  fail_unless_equals_int (code_after (sink, padded (60000)), 1009);
  largest.round_trip ();
}
GST_END_TEST;

GST_START_TEST (test_more_than_200_messages_in_a_second_end_the_connection)
{
  WebSink sink;
  Witness witness (sink);
  RawClient fast (sink.port ());
  fast.upgrade ();
  std::string messages = masked_frame (0x81, R"({"type":"hello","version":1})");
  for (int i = 0; i < 1000; i++)
    messages += masked_frame (0x81, R"({"type":"anything"})");
  fast.send (messages);
  const std::string answer = fast.receive ("messages a second");
  fail_unless_contains (answer, "\x11\x4d" /* 4429 */ "at most 200 messages a second");
  witness.go_on ();
}
GST_END_TEST;

GST_START_TEST (test_pings_count_as_messages)
{
  WebSink sink;
  RawClient fast (sink.port ());
  fast.upgrade ();
  std::string pings;
  for (int i = 0; i < 1000; i++)
    pings += masked_frame (0x89, "");
  fast.send (pings);
  fail_unless_contains (fast.receive ("messages a second"), "\x11\x4d" /* 4429 */);
}
GST_END_TEST;

GST_START_TEST (test_fragments_of_a_message_are_at_most_16384_bytes_together)
{
  WebSink sink;
  Witness witness (sink);
  const std::string hello = R"({"type":"hello","version":1})";
  const auto in_fragments = [&] (gsize size) {
    std::string frames = masked_frame (0x01, hello);
    for (size -= hello.size (); size > 1000; size -= 1000)
      frames += masked_frame (0x00, std::string (1000, ' '));
    return frames + masked_frame (0x80, std::string (size, ' '));
  };
  RawClient largest (sink.port ()), larger (sink.port ()), endless (sink.port ()),
      announced (sink.port ()), ping (sink.port ());
  for (RawClient *client : {&largest, &larger, &endless, &announced, &ping})
    client->upgrade ();
  largest.send (in_fragments (16384));
  largest.receive ("welcome");
  larger.send (in_fragments (16385));
  fail_unless_contains (larger.receive ("16384 bytes"), "\x03\xf1" /* 1009 */);
  endless.send (masked_frame (0x01, hello));
  for (int i = 0; i < 17; i++)
    endless.send (masked_frame (0x00, std::string (1000, ' ')));
  fail_unless_contains (endless.receive ("16384 bytes"), "\x03\xf1");
  announced.send (masked_frame (0x81, std::string (200000, 'x')).substr (0, 1000));
  announced.receive (); /* ends */
  ping.send (masked_frame (0x89, std::string (126, 'x')));
  fail_unless_contains (ping.receive ("125"), "\x03\xf1");
  witness.go_on ();
}
GST_END_TEST;

GST_START_TEST (test_pongs_do_not_add_up)
{
  WebSink sink;
  RawClient client (sink.port ());
  client.upgrade ();
  client.send (masked_frame (0x81, R"({"type":"hello","version":1})"));
  for (int i = 0; i < 150; i++)
    client.send (masked_frame (0x8a, std::string (125, 'x')));
  client.send (masked_frame (0x81, R"({"type":"ping","time":1})"));
  fail_unless_contains (client.receive ("pong"), "pong");
}
GST_END_TEST;

GST_START_TEST (test_client_without_hello_is_closed_after_its_time)
{
  WebSink sink;
  Witness witness (sink); /* who was quick enough stays */
  WebClient silent (sink);
  fail_unless_equals_int (silent.close_code (), 4408);
  witness.go_on ();
  fail_unless_happens (sink.stat ("clients") == 1);
}
GST_END_TEST;

GST_START_TEST (test_clients_beyond_the_maximum_are_refused_until_one_leaves)
{
  WebSink sink ("max-clients=2");
  WebClient one (sink), two (sink);
  one.enter ();
  two.enter ();
  for (int i = 0; i < 3; i++) {
    WebClient third (sink);
    fail_unless_equals_int (third.close_code (), 4429);
  }
  fail_unless_equals_int (sink.stat ("refused"), 3);
  fail_unless_equals_int (sink.stat ("clients"), 2);
  two.close ();
  fail_unless_happens (sink.stat ("clients") == 1);
  WebClient next (sink);
  next.enter ();
  one.round_trip ();
}
GST_END_TEST;

GST_START_TEST (test_clients_without_hello_do_not_keep_others_out)
{
  WebSink sink ("max-clients=2");
  WebClient one (sink);
  one.enter ();
  for (int i = 0; i < 5; i++) {
    WebClient silent (sink);
    WebClient next (sink);
    next.enter ();
    fail_unless_equals_int (silent.close_code (), 4429);
    next.close ();
    fail_unless_happens (sink.stat ("clients") == 1);
  }
  one.round_trip ();
}
GST_END_TEST;

/* ---- the handshake ---- */

GST_START_TEST (test_names_that_others_may_own_are_refused_without_a_token)
{
  const auto status = [] (const WebSink &sink, const std::string &host,
                          const std::string &path = "/server.json") {
    RawClient client (sink.port ());
    client.send (
        "GET " + path + " HTTP/1.1\r\nHost: " + host + "\r\nOrigin: http://" + host + "\r\n\r\n");
    return client.receive ("\r\n").substr (9, 3);
  };
  WebSink open ("origins=http://studio.example.org:8080"), closed ("token=right");
  for (const char *host : {"evil.example", "evil.example:8080", "localhost.evil.example",
           "studio.example.org", "127.0.0.1.evil.example"})
    for (const char *path : {"/server.json", "/stream", "/"})
      fail_unless_cmp (status (open, host, path), ==, "421");
  for (const char *host : {"127.0.0.1:1", "localhost", "localhost:8080", "[::1]:8080", "studio",
           "studio.local:80", "studio.example.org:8080"})
    fail_unless_cmp (status (open, host), ==, "200");
  fail_unless_cmp (status (closed, "studio.example.org"), ==, "200");
}
GST_END_TEST;

GST_START_TEST (test_pages_of_other_origins_are_refused)
{
  WebSink sink ("origins=\"https://example.org http://localhost:1\"");
  const std::string own = "http://127.0.0.1:" + std::to_string (sink.port ());
  const std::string others[] = {"http://127.0.0.1", "http://127.0.0.1:1", own + "/", own + "0",
      "http://localhost:" + std::to_string (sink.port ()), "https://example.org:443",
      "http://example.org", "https://example.or", "https://example.org.evil", "null", "://", "x"};
  for (const std::string &origin : others) {
    WebClient client (sink, origin.c_str ());
    fail_unless_equals_int (client.status, 403);
    fail_if (client.is_open ());
  }
  for (const std::string &origin :
      {own, std::string ("https://example.org"), std::string ("http://localhost:1")}) {
    WebClient client (sink, origin.c_str ());
    client.enter ();
  }
  fail_unless_equals_int (sink.stat ("connections"), 3);
}
GST_END_TEST;

GST_START_TEST (test_subprotocol_must_be_offered)
{
  WebSink sink;
  for (const char *protocol :
      {"rangecast.v2", "rangecast", "other", static_cast<const char *> (nullptr)}) {
    WebClient client (sink, nullptr, protocol);
    fail_unless_equals_int (client.status, 400);
    fail_if (client.is_open ());
  }
  fail_unless_equals_int (sink.stat ("connections"), 0);
}
GST_END_TEST;

/* ---- garbage and ends ---- */

GST_START_TEST (test_frames_against_the_websocket_rules_end_their_connection_only)
{
  WebSink sink;
  Witness witness (sink);
  const std::string frames[] = {std::string ("\x81\x02{}", 4), /* not masked */
      masked_frame (0x83, "{}"), masked_frame (0x8f, ""), masked_frame (0xc1, "{}"),
      masked_frame (0x80, "{}"), masked_frame (0x08, "x"), masked_frame (0x81, "\xff\xff"),
      masked_frame (0x88, "x"), masked_frame (0x88, std::string ("\x03\xed", 2)),
      std::string ("\x81\xff\x7f\xff\xff\xff\xff\xff\xff\xff", 10),
      std::string ("\x81\xff\xff\xff\xff\xff\xff\xff\xff\xff\0\0\0\0", 14),
      std::string ("\x81\xfe\x00\x01\0\0\0\0x", 9),
      masked_frame (0x01, "{") + masked_frame (0x81, "}")};
  for (const std::string &frame : frames) {
    RawClient raw (sink.port ());
    raw.upgrade ();
    raw.send (frame);
    raw.receive (); /* ends */
    witness.go_on ();
  }
  fail_unless_happens (sink.stat ("clients") == 1);
}
GST_END_TEST;

/* Sockets and files that this process has open. */
static int
descriptors ()
{
  int n = 0;
  g_autoptr (GDir) dir = g_dir_open ("/proc/self/fd", 0, nullptr);
  while (dir && g_dir_read_name (dir))
    n++;
  return n;
}

GST_START_TEST (test_connections_that_ended_leave_no_descriptors)
{
  if (descriptors () == 0)
    RANGECAST_SKIP ("no /proc/self/fd");
  WebSink sink ("token=right max-clients=3");
  Witness witness (sink, R"("token":"right")");
  const std::string get = "GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n";
  const auto use = [&] {
    for (int i = 0; i < 10; i++) {
      RawClient idle (sink.port ()), page (sink.port ()), half (sink.port ()), raw (sink.port ());
      page.send (get);
      page.receive ("page</title>");
      half.send (get.substr (0, 9));
      raw.upgrade ();
      fail_unless_equals_int (code_after (sink, R"({"type":"hello","version":1})"), 4401);
      WebClient client (sink);
      client.enter (R"("token":"right")");
      WebClient refused (sink);
      refused.enter (R"("token":"right")");
    }
    fail_unless_happens (sink.stat ("clients") == 1);
    witness.go_on ();
  };
  use ();
  const int before = descriptors ();
  use ();
  fail_unless_happens (descriptors () <= before + 3);
  fail_unless_cmp (descriptors (), <=, before + 3);
}
GST_END_TEST;

GST_START_TEST (test_client_that_does_not_read_holds_up_nobody)
{
  WebSink sink ("window=1000");
  Witness witness (sink);
  RawClient deaf (sink.port ());
  deaf.upgrade ();
  deaf.send (masked_frame (0x81, R"({"type":"hello","version":1})"));
  deaf.receive ("}"); /* the welcome; from here on nothing is read */
  for (int i = 0; i < 30; i++) {
    const std::string units = std::string (1000000, 'x') + std::to_string (i);
    sink.push (units);
    witness.client.wait_for (units);
  }
  fail_unless_equals_int (witness.client.frames.size (), 30);
  fail_unless_equals_int (witness.client.frames.back ().dropped (), 0);
}
GST_END_TEST;

GST_START_TEST (test_server_that_stops_says_so)
{
  WebSink sink;
  WebClient one (sink), two (sink), silent (sink);
  one.enter ();
  two.enter ();
  sink.push ("one");
  GThread *thread = g_thread_new (
      "stop",
      [] (gpointer element) -> gpointer {
        gst_element_set_state (GST_ELEMENT (element), GST_STATE_NULL);
        return nullptr;
      },
      sink.h->element);
  fail_unless_equals_int (silent.close_code (), 1001);
  for (WebClient *client : {&one, &two}) /* which an acknowledgement may have crossed */
    fail_unless (client->close_code () == 1001 || client->code == 1006);
  g_thread_join (thread);
  fail_unless_equals_int (sink.stat ("clients"), 0);
}
GST_END_TEST;

GST_START_TEST (test_server_starts_at_its_port_again_before_clients_have_left)
{
  WebSink sink;
  RawClient deaf (sink.port ());
  deaf.upgrade ();
  fail_unless_happens (sink.stat ("clients") == 1);
  g_object_set (sink.h->element, "port", guint (sink.port ()), nullptr);
  for (int i = 0; i < 3; i++) {
    sink.stop ();
    fail_unless_equals_int (sink.stat ("clients"), 0);
    gst_harness_play (sink.h);
    sink.set_caps ();
    WebClient client (sink);
    client.enter ();
    sink.push ("again");
    client.wait_for ("again");
  }
  deaf.receive ();
}
GST_END_TEST;

/* ---- statistics ---- */

GST_START_TEST (test_reports_of_hosts_reach_those_who_want_them)
{
  g_autoptr (GSocket) probe =
      g_socket_new (G_SOCKET_FAMILY_IPV4, G_SOCKET_TYPE_DATAGRAM, G_SOCKET_PROTOCOL_UDP, nullptr);
  g_autoptr (GSocketAddress) any = g_inet_socket_address_new_from_string ("127.0.0.1", 0);
  fail_unless (g_socket_bind (probe, any, FALSE, nullptr));
  g_autoptr (GSocketAddress) address = g_socket_get_local_address (probe, nullptr);
  const guint16 port = g_inet_socket_address_get_port (G_INET_SOCKET_ADDRESS (address));
  g_socket_close (probe, nullptr); /* free again, for the server */

  WebSink sink ("stats-address=udp://127.0.0.1:" + std::to_string (port));
  WebClient dashboard (sink), viewer (sink);
  dashboard.enter (R"("want":["stats"])");
  viewer.enter ();
  g_autoptr (GSocket) host =
      g_socket_new (G_SOCKET_FAMILY_IPV4, G_SOCKET_TYPE_DATAGRAM, G_SOCKET_PROTOCOL_UDP, nullptr);
  for (const std::string &datagram : {std::string ("\xff"), std::string (20000, '['),
           std::string (R"({"host":"camera0","element":"stereodepth","name":"depth0","n":7})")})
    fail_unless (
        g_socket_send_to (host, address, datagram.data (), datagram.size (), nullptr, nullptr) > 0);
  fail_unless_happens (dashboard.texts.size () == 2);
  fail_unless_contains (dashboard.texts[1], R"({"type":"stats","reports":[{"received":)");
  fail_unless_contains (dashboard.texts[1], R"("report":"{\"host\":\"camera0\",)");
  sink.push ("one");
  viewer.wait_for ("one");
  fail_unless_equals_int (viewer.texts.size (), 1);
  dashboard.round_trip ();
  fail_unless_equals_int (dashboard.frames.size (), 0);
}
GST_END_TEST;

/* ---- calls ---- */

GST_START_TEST (test_two_clients_of_a_room_talk_to_each_other_only)
{
  WebSink sink;
  WebClient anna (sink), viewer (sink);
  anna.enter (R"("room":"a")");
  viewer.enter ();
  anna.send (R"({"type":"call","to":"nobody"})");
  WebClient other (sink);
  other.enter (R"("room":"b")");
  auto otto = std::make_unique<WebClient> (sink);
  otto->enter (R"("room":"a")");
  fail_unless_happens (anna.texts.size () == 2);
  fail_unless_equals_string (anna.texts[1].c_str (), R"({"type":"joined"})");
  anna.send (R"({"type":"call","offer":"x \"y\""})");
  otto->send (R"({"type":"call","answer":"z"})");
  fail_unless_happens (anna.texts.size () == 3 && otto->texts.size () == 2);
  fail_unless_equals_string (anna.texts[2].c_str (), R"({"type":"call","answer":"z"})");
  fail_unless_equals_string (otto->texts[1].c_str (), R"({"type":"call","offer":"x \"y\""})");
  fail_unless_equals_int (code_after (sink, R"({"type":"hello","version":1,"room":"a"})"), 4429);
  otto.reset ();
  fail_unless_happens (anna.texts.size () == 4);
  fail_unless_equals_string (anna.texts[3].c_str (), R"({"type":"left"})");
  WebClient third (sink);
  third.enter (R"("room":"a")");
  fail_unless_happens (anna.texts.size () == 5);
  sink.push ("one");
  viewer.wait_for ("one");
  for (WebClient *client : {&anna, &other, &third}) {
    client->round_trip ();
    fail_unless_equals_int (client->frames.size (), 0);
  }
  fail_unless_equals_int (other.texts.size () + viewer.texts.size () + third.texts.size (), 3);
}
GST_END_TEST;

static Suite *
rangewebsinkclients_suite ()
{
  Suite *suite = suite_create ("rangewebsinkclients");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_nothing_of_the_stream_comes_before_the_welcome);
  tcase_add_test (tc, test_wrong_and_missing_tokens_are_refused);
  tcase_add_test (tc, test_users_of_the_token_file_come_and_go_while_the_server_runs);
  tcase_add_test (tc, test_first_message_that_is_no_hello_ends_the_connection);
  tcase_add_test (tc, test_damaged_messages_after_the_welcome_end_the_connection);
  tcase_add_test (tc, test_message_of_more_than_16384_bytes_ends_the_connection);
  tcase_add_test (tc, test_more_than_200_messages_in_a_second_end_the_connection);
  tcase_add_test (tc, test_pings_count_as_messages);
  tcase_add_test (tc, test_fragments_of_a_message_are_at_most_16384_bytes_together);
  tcase_add_test (tc, test_pongs_do_not_add_up);
  tcase_add_test (tc, test_client_without_hello_is_closed_after_its_time);
  tcase_add_test (tc, test_clients_beyond_the_maximum_are_refused_until_one_leaves);
  tcase_add_test (tc, test_clients_without_hello_do_not_keep_others_out);
  tcase_add_test (tc, test_names_that_others_may_own_are_refused_without_a_token);
  tcase_add_test (tc, test_pages_of_other_origins_are_refused);
  tcase_add_test (tc, test_subprotocol_must_be_offered);
  tcase_add_test (tc, test_frames_against_the_websocket_rules_end_their_connection_only);
  tcase_add_test (tc, test_connections_that_ended_leave_no_descriptors);
  tcase_add_test (tc, test_client_that_does_not_read_holds_up_nobody);
  tcase_add_test (tc, test_server_that_stops_says_so);
  tcase_add_test (tc, test_server_starts_at_its_port_again_before_clients_have_left);
  tcase_add_test (tc, test_reports_of_hosts_reach_those_who_want_them);
  tcase_add_test (tc, test_two_clients_of_a_room_talk_to_each_other_only);
  return suite;
}

GST_CHECK_MAIN (rangewebsinkclients);
