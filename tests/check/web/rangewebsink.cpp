/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The life of rangewebsink, its errors, and the page it serves. */
#include "web-check.hpp"

using namespace rangecast::testing;

/* ---- life ---- */

/* The answer to a request, with its headers; empty if nobody listens. */
static std::string
answer_to (guint16 port, const std::string &request)
{
  RawClient raw (port);
  if (!raw.is_connected ())
    return "";
  raw.send (request);
  return raw.receive ();
}

static std::string
get (guint16 port, const std::string &path, const char *method = "GET")
{
  return answer_to (port, std::string (method) + " " + path +
                              " HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n");
}

static std::string
url_of (GstElement *element)
{
  g_autofree gchar *url = nullptr;
  g_object_get (element, "url", &url, nullptr);
  return url ? url : "";
}

GST_START_TEST (test_all_state_changes_work_twice)
{
  const GstState states[] = {GST_STATE_READY, GST_STATE_PAUSED, GST_STATE_PLAYING, GST_STATE_PAUSED,
      GST_STATE_READY, GST_STATE_NULL, GST_STATE_PLAYING, GST_STATE_NULL};
  WebSink sink;
  sink.stop ();
  for (int round = 0; round < 2; round++)
    for (const GstState state : states) {
      ck_assert_int_ne (gst_element_set_state (sink.h->element, state), GST_STATE_CHANGE_FAILURE);
      const std::string url = url_of (sink.h->element);
      fail_unless_equals_int (url.empty (), state < GST_STATE_PAUSED);
      if (!url.empty ())
        fail_unless_contains (get (port_of (url), "/"), "HTTP/1.1 200");
    }
}
GST_END_TEST;

GST_START_TEST (test_message_and_property_have_the_address)
{
  WebSink sink;
  GstMessage *message = gst_bus_pop_filtered (sink.bus, GST_MESSAGE_ELEMENT);
  fail_unless (message != nullptr);
  fail_unless (gst_message_has_name (message, "rangewebsink-address"));
  fail_unless (GST_MESSAGE_SRC (message) == GST_OBJECT (sink.h->element));
  fail_unless_equals_string (
      gst_structure_get_string (gst_message_get_structure (message), "url"), sink.url.c_str ());
  gst_message_unref (message);
  fail_unless (gst_bus_pop_filtered (sink.bus, GST_MESSAGE_ELEMENT) == nullptr);
  fail_unless_cmp (sink.url, ==, "http://127.0.0.1:" + std::to_string (sink.port ()) + "/");
  fail_unless_cmp (sink.port (), !=, 0);
  int port = -1; /* what was asked for */
  g_object_get (sink.h->element, "port", &port, nullptr);
  fail_unless_equals_int (port, 0);
  sink.stop ();
  fail_unless_cmp (url_of (sink.h->element), ==, "");
}
GST_END_TEST;

/* ---- errors ---- */

/* Starts a rangewebsink with these properties, which must fail with one error that has the text,
 * and again after it was set to NULL. */
static void
expect_error (const std::string &properties, const std::string &text)
{
  Folder root;
  root.write ("index.html", "page");
  GstElement *element = gst_parse_launch (
      ("rangewebsink port=0 root=" + root.path + " " + properties).c_str (), nullptr);
  fail_unless (element != nullptr);
  GstBus *bus = gst_bus_new ();
  gst_element_set_bus (element, bus);
  for (int round = 0; round < 2; round++) {
    ck_assert_int_eq (gst_element_set_state (element, GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
    const std::string error = next_message_text (bus, GST_MESSAGE_ERROR);
    fail_unless_contains (error, text);
    fail_unless (gst_bus_pop_filtered (bus, GST_MESSAGE_ERROR) == nullptr, "a second error");
    fail_unless_cmp (url_of (element), ==, "");
    gst_element_set_state (element, GST_STATE_NULL);
  }
  gst_element_set_bus (element, nullptr);
  gst_object_unref (bus);
  gst_object_unref (element);
}

GST_START_TEST (test_address_that_others_can_reach_needs_a_token)
{
  expect_error ("address=0.0.0.0", "address=0.0.0.0 can be reached from other machines");
  expect_error ("address=::", "address=:: can be reached");
  Folder folder;
  const std::string file = folder.write ("users.txt", "anna one\n");
  for (const std::string &properties :
      {std::string ("token=right"), "token-file=" + file, std::string ("anonymous=true")}) {
    WebSink sink ("address=0.0.0.0 " + properties);
    fail_unless_contains (get (sink.port (), "/"), "HTTP/1.1 200");
  }
}
GST_END_TEST;

GST_START_TEST (test_wrong_settings_are_named)
{
  Folder folder;
  const std::string garbage = folder.write ("garbage.pem", "garbage");
  const struct {
    std::string properties, error;
  } cases[] = {{"address=nonsense", "is neither an IP address nor a known name"},
      {"address=127.0.0.1:80", "is neither an IP address nor a known name"},
      {"anonymous=true address=192.0.2.1", "address=192.0.2.1 port=0"},
      {"certificate=/nonexistent.pem", "/nonexistent.pem"}, {"certificate=" + garbage, garbage},
      {"certificate=" + garbage + " private-key=/nonexistent.pem", "private-key"},
      {"private-key=" + garbage, "private-key: set certificate, too"},
      {"token-file=/nonexistent", "token-file: there is no file"},
      {"token=abc anonymous=true", "anonymous: set it without token"},
      {"origins=\"https://b.example:8443 foo\"", "'foo' is not"},
      {"origins=ftp://a.example", "'ftp://a.example' is not"}, {"origins=*", "'*' is not"},
      {"frame-ancestors=\"https://a.example;script-src *\"", "frame-ancestors: 'https://a.exam"},
      {"origins=https://a.example/page", "'https://a.example/page' is not"},
      {"root=/nonexistent", "root: name the folder"}, {"root=" + folder.path, folder.path}};
  for (const auto &[properties, error] : cases)
    expect_error (properties, error);
  WebSink sink;
  expect_error ("port=" + std::to_string (sink.port ()), "cannot listen there");
}
GST_END_TEST;

GST_START_TEST (test_stats_address_must_be_a_free_udp_port)
{
  for (const char *address : {"nonsense", "127.0.0.1:5990", "tcp://127.0.0.1:5990",
           "udp://127.0.0.1", "udp://127.0.0.1:65536", "udp://somewhere:5990", "udp://", "udp://:"})
    expect_error (std::string ("stats-address=") + address, "stats-address");
  g_autoptr (GSocket) socket =
      g_socket_new (G_SOCKET_FAMILY_IPV4, G_SOCKET_TYPE_DATAGRAM, G_SOCKET_PROTOCOL_UDP, nullptr);
  g_autoptr (GSocketAddress) any = g_inet_socket_address_new_from_string ("127.0.0.1", 0);
  fail_unless (g_socket_bind (socket, any, FALSE, nullptr));
  g_autoptr (GSocketAddress) taken = g_socket_get_local_address (socket, nullptr);
  const auto port = g_inet_socket_address_get_port (G_INET_SOCKET_ADDRESS (taken));
  const std::string address = "stats-address=udp://127.0.0.1:" + std::to_string (port);
  expect_error (address, address);
}
GST_END_TEST;

/* ---- the page ---- */

GST_START_TEST (test_page_files_are_served_with_their_types)
{
  WebSink sink;
  const struct {
    const char *path, *file, *type;
  } files[] = {{"/", "index.html", "text/html"}, {"/index.html", "index.html", "text/html"},
      {"/rig", "rig.html", "text/html"}, {"/a-b.js", "a-b.js", "text/javascript"},
      {"/style.css", "style.css", "text/css"}, {"/a.wasm", "a.wasm", "application/wasm"},
      {"/a.js?query=1", "a.js", "text/javascript"}};
  for (const auto &one : files) {
    const std::string contents = std::string ("the file ") + one.file;
    sink.root.write (one.file, contents);
    const std::string answer = get (sink.port (), one.path);
    fail_unless_contains (answer, "HTTP/1.1 200");
    fail_unless_contains (answer, std::string ("Content-Type: ") + one.type);
    fail_unless_contains (answer, "X-Content-Type-Options: nosniff");
    fail_unless_contains (answer, "\r\n\r\n" + contents);
    const std::string head = get (sink.port (), one.path, "HEAD");
    fail_unless_contains (head, "HTTP/1.1 200");
    fail_if (head.find (contents) != head.npos, "%s", head.c_str ());
  }
}
GST_END_TEST;

GST_START_TEST (test_page_is_framed_only_where_the_server_allows_it)
{
  static const char *const cases[][2] = {{"", "'none'"}, {"frame-ancestors=*", "*"},
      {"frame-ancestors=\"https://a.example http://b.example:80\"",
          "https://a.example http://b.example:80"}};
  for (const auto &[settings, expected] : cases) {
    WebSink sink (settings);
    fail_unless_contains (
        get (sink.port (), "/"), "; frame-ancestors " + std::string (expected) + "\r\n");
  }
}
GST_END_TEST;

GST_START_TEST (test_nothing_but_files_of_the_page_is_served)
{
  WebSink sink;
  const std::string name = sink.root.path.substr (sink.root.path.rfind ('/') + 1);
  sink.root.write ("sub/inner.html", "secret");
  sink.root.write ("dir.html/index.html", "secret");
  for (const char *file : {".hidden.html", ".html", "notes.txt", "users", "key.pem", "a b.html",
           "a~.html", "x.html~", "x.HTML"})
    sink.root.write (file, "secret");
  Folder outside;
  const std::string other = outside.write ("outside.html", "secret");
  const std::string sibling = other.substr (other.rfind ('/', other.rfind ('/') - 1));
  const std::string paths[] = {"/sub/inner.html", "/sub%2finner.html", "/sub%2Finner.html",
      "/sub\\inner.html", "/sub", "/sub/", "/dir.html", "/dir.html/", "/dir.html/index.html",
      "/.hidden.html", "/%2ehidden.html", "/.html", "/notes.txt", "/users", "/key.pem",
      "/a%20b.html", "/a~.html", "/x.html~", "/x.HTML", "/%00", "/index.html%00.js",
      "/notes.txt%00.html", "/.." + sibling, "/../.." + other, "/%2e%2e" + sibling,
      "/%2e%2e%2f" + sibling.substr (1), "/..%2f" + sibling.substr (1),
      "/%252e%252e%252f" + sibling.substr (1), "/..%5c" + sibling.substr (1),
      "/sub/../.." + sibling, "/sub/../sub/inner.html", "/./sub/inner.html", "/" + other, other,
      "//" + other, "/%2f" + other.substr (1), "file://" + other, "/rig/", "/rig/../sub/inner.html",
      "/" + name + "/sub/inner.html", "/stream/../sub/inner.html", "/server.json/", "*"};
  for (const std::string &path : paths) {
    const std::string answer = get (sink.port (), path);
    fail_unless_contains (answer, "HTTP/1.1 4");
    fail_if (answer.find ("secret") != answer.npos, "%s: %s", path.c_str (), answer.c_str ());
  }
  fail_unless_contains (get (sink.port (), "/index.html"), "HTTP/1.1 200");
}
GST_END_TEST;

GST_START_TEST (test_methods_that_change_things_are_refused)
{
  WebSink sink;
  for (const char *method : {"POST", "PUT", "DELETE", "OPTIONS", "PATCH", "get"}) {
    fail_unless_contains (get (sink.port (), "/", method), "HTTP/1.1 405");
    fail_unless_contains (get (sink.port (), "/server.json", method), "HTTP/1.1 405");
  }
}
GST_END_TEST;

GST_START_TEST (test_garbage_instead_of_requests_harms_nobody)
{
  WebSink sink;
  const std::string requests[] = {"\r\n\r\n", "GET\r\n\r\n", "GET / HTTP/9.9\r\n\r\n",
      "GET / HTTP/1.1\r\n\r\n", std::string ("\0\0\0\0\r\n\r\n", 8),
      "GET /" + std::string (200000, 'a') + " HTTP/1.1\r\nHost: a\r\nConnection: close\r\n\r\n",
      "\x16\x03\x01\x02\x01\x01\r\n\r\n", "GET http://[ HTTP/1.1\r\nHost: a\r\n\r\n",
      "GET a: HTTP/1.1\r\nHost: a\r\n\r\n", "GET a:b HTTP/1.1\r\nHost: a\r\n\r\n",
      "GET http://a HTTP/1.1\r\nHost: a\r\n\r\n", "GET ? HTTP/1.1\r\nHost: a\r\n\r\n",
      "GET http://a?b HTTP/1.1\r\nHost: a\r\n\r\n", "OPTIONS * HTTP/1.1\r\nHost: a\r\n\r\n"};
  for (const std::string &request : requests) {
    RawClient raw (sink.port ());
    raw.send (request);
    fail_unless_contains (get (sink.port (), "/"), "HTTP/1.1 200"); /* meanwhile */
  }
}
GST_END_TEST;

GST_START_TEST (test_state_changes_while_clients_connect)
{
  WebSink sink ("", false);
  for (int round = 0; round < 8; round++) {
    std::vector<std::unique_ptr<RawClient>> clients;
    for (int i = 0; i < 4; i++) {
      clients.push_back (std::make_unique<RawClient> (sink.port ()));
      clients.back ()->send (
          "GET /stream HTTP/1.1\r\nHost: a\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
          "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Protocol: rangecast.v1\r\n"
          "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n");
    }
    g_usleep (gulong (round * 100));
    sink.stop ();
    for (const auto &client : clients)
      client->receive (); /* ends */
    gst_harness_play (sink.h);
    sink.url = url_of (sink.h->element);
  }
}
GST_END_TEST;

static Suite *
rangewebsink_suite ()
{
  Suite *suite = suite_create ("rangewebsink");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_all_state_changes_work_twice);
  tcase_add_test (tc, test_message_and_property_have_the_address);
  tcase_add_test (tc, test_address_that_others_can_reach_needs_a_token);
  tcase_add_test (tc, test_wrong_settings_are_named);
  tcase_add_test (tc, test_stats_address_must_be_a_free_udp_port);
  tcase_add_test (tc, test_page_files_are_served_with_their_types);
  tcase_add_test (tc, test_page_is_framed_only_where_the_server_allows_it);
  tcase_add_test (tc, test_nothing_but_files_of_the_page_is_served);
  tcase_add_test (tc, test_methods_that_change_things_are_refused);
  tcase_add_test (tc, test_garbage_instead_of_requests_harms_nobody);
  tcase_add_test (tc, test_state_changes_while_clients_connect);
  return suite;
}

GST_CHECK_MAIN (rangewebsink);
