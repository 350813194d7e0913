/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Messages and tokens of rangewebsink without a network, and what hostile peers make of them. */
#include "web/protocol.hpp"

#include <glib/gstdio.h>

#include <cstring>
#include <functional>
#include <memory>
#include <vector>

#include "../rangecast-check.hpp"

using namespace web;

static const std::string kHello =
    R"({"type":"hello","version":1,"token":"s\"e\u00e9cret","want":["stream","stats"]})";

/* Parses a copy that ends where the text ends, so that the address sanitizer sees one byte more. */
static std::optional<JsonMessage>
parse_exactly (std::string_view text)
{
  const std::unique_ptr<char[]> copy (new char[text.size ()]);
  text.copy (copy.get (), text.size ());
  return JsonMessage::parse ({copy.get (), text.size ()});
}

/* The error of a hello, or an empty text. */
static std::string
hello_error (std::string_view text)
{
  const auto message = parse_exactly (text);
  fail_unless (message.has_value (), "%s: not a message", std::string (text).c_str ());
  std::string error;
  const auto hello = parse_hello (*message, error);
  fail_unless_equals_int (hello.has_value (), error.empty ());
  return error;
}

static Hello
hello_of (std::string_view text)
{
  std::string error;
  const auto hello = parse_hello (parse_exactly (text).value (), error);
  fail_unless (hello.has_value (), "%s", error.c_str ());
  return *hello;
}

/* ---- JSON ---- */

GST_START_TEST (test_hello_with_any_byte_changed_is_refused_or_read)
{
  for (std::size_t at = 0; at < kHello.size (); at++)
    for (int byte = 0; byte < 256; byte++) {
      std::string text = kHello;
      text[at] = char (byte);
      std::string error;
      if (const auto message = parse_exactly (text)) {
        const auto hello = parse_hello (*message, error);
        fail_unless_equals_int (hello.has_value (), error.empty ());
      }
    }
}
GST_END_TEST;

GST_START_TEST (test_only_objects_are_messages)
{
  for (const char *text : {"", " ", "null", "true", "1", "\"hello\"", "[]", "[{}]", "{", "}", "{}}",
           "{\"a\"}", "{\"a\":}", "{\"a\":1,}x", "\\", "\"", "{\"a\":\"\\u12\"}"})
    fail_if (parse_exactly (text).has_value (), "'%s' is a message", text);
  fail_unless (parse_exactly ("{}").has_value ());
}
GST_END_TEST;

GST_START_TEST (test_a_message_has_few_brackets)
{
  const auto nested = [] (int depth, char open, char close) {
    return "{\"a\":" + std::string (depth - 1, open) + "1" + std::string (depth - 1, close) + "}";
  };
  fail_unless (parse_exactly (nested (100, '[', ']')).has_value ());
  fail_if (parse_exactly (nested (200, '[', ']')).has_value ());
  /* a parser that recursed would need more than the stack */
  fail_if (parse_exactly (nested (4000000, '[', ']')).has_value ());
  fail_if (parse_exactly (std::string (4000000, '[')).has_value ());
  std::string objects;
  for (int i = 0; i < 400000; i++)
    objects += "{\"a\":";
  fail_if (parse_exactly (objects).has_value ());
}
GST_END_TEST;

GST_START_TEST (test_invalid_utf8_and_bytes_behind_a_nul_are_no_message)
{
  for (const auto text : {std::string_view ("{}\0{", 4), std::string_view ("{\"a\":\"\0\"}", 9)})
    fail_if (parse_exactly (text).has_value ());
  for (const char *bytes : {"\xff", "\xc3", "\xc0\xaf", "\xed\xa0\x80", "\xf8\x88\x80\x80\x80"})
    fail_if (parse_exactly (std::string ("{\"a\":\"") + bytes + "\"}").has_value ());
  fail_unless (parse_exactly ("{\"a\":\"\xc3\xa9\"}").has_value ());
}
GST_END_TEST;

/* ---- hello ---- */

GST_START_TEST (test_hello_is_read)
{
  const Hello hello = hello_of (kHello);
  fail_unless_equals_int (hello.version, 1);
  fail_unless_cmp (hello.token, ==,
      "s\"e\xc3\xa9"
      "cret");
  fail_unless (hello.stream && hello.stats);
}
GST_END_TEST;

GST_START_TEST (test_hello_error_names_the_field)
{
  fail_unless_contains (hello_error (R"({"type":"key","version":1})"), "type");
  fail_unless_contains (hello_error (R"({"type":1,"version":1})"), "type");
  fail_unless_contains (hello_error (R"({"version":1})"), "type");
  for (const char *version : {"\"1\"", "null", "true", "[1]", "{}", "1.5", "-1", "1e999", "1e300",
           "9223372036854775807", "99999999999999999999999999", "4294967297"})
    fail_unless_contains (
        hello_error (std::string (R"({"type":"hello","version":)") + version + "}"), "version");
  fail_unless_contains (hello_error (R"({"type":"hello"})"), "version");
  for (const char *token : {"1", "null", "true", "[\"a\"]", "{\"a\":\"b\"}"})
    fail_unless_contains (
        hello_error (std::string (R"({"type":"hello","version":1,"token":)") + token + "}"),
        "token");
  for (const char *want :
      {"\"stream\"", "null", "1", "{}", "[1]", "[null]", "[[\"stream\"]]", "[\"stream\",{}]"})
    fail_unless_contains (
        hello_error (std::string (R"({"type":"hello","version":1,"want":)") + want + "}"), "want");
}
GST_END_TEST;

/* ---- the header of a frame set's message ---- */

GST_START_TEST (test_header_is_written_as_the_protocol_says)
{
  MessageHeader header;
  header.key = true;
  header.frame_set = 0x03040506;
  header.dropped = 0x0d0e0f10;
  header.delay_us = 0x11121314;
  header.sent_us = 0x15161718191a1b1c;
  const std::vector<guint8> expected = {1, 1, 0, 0, 6, 5, 4, 3, 0x10, 0x0f, 0x0e, 0x0d, 0x14, 0x13,
      0x12, 0x11, 0x1c, 0x1b, 0x1a, 0x19, 0x18, 0x17, 0x16, 0x15};
  std::vector<guint8> bytes (MessageHeader::kSize, 0xee);
  header.write (bytes.data ());
  fail_unless_cmp (bytes, ==, expected);
}
GST_END_TEST;

/* ---- tokens ---- */

GST_START_TEST (test_tokens_are_equal_only_as_a_whole)
{
  const std::string token = "a long token, 32 bytes or so....";
  fail_unless (equal_tokens (token, std::string (token)));
  fail_unless (equal_tokens ("", ""));
  for (std::size_t size = 0; size < token.size (); size++)
    fail_if (equal_tokens (token, token.substr (0, size)));
  for (std::size_t at = 0; at < token.size (); at++) {
    std::string other = token;
    other[at] = char (other[at] ^ 1);
    fail_if (equal_tokens (token, other));
  }
  fail_if (equal_tokens (token, token + " "));
  fail_if (equal_tokens (std::string_view ("a\0b", 3), "a"));
}
GST_END_TEST;

/* Calls with a file of these contents. */
static void
with_file (std::string_view contents, const std::function<void (const std::string &)> &call)
{
  g_autofree gchar *path = nullptr;
  const int fd = g_file_open_tmp ("webprotocol-XXXXXX", &path, nullptr);
  fail_unless (fd >= 0);
  g_close (fd, nullptr);
  fail_unless (g_file_set_contents (path, contents.data (), gssize (contents.size ()), nullptr));
  call (path);
  g_unlink (path);
}

/* Whose token it is; "-" for nobody's. */
static std::string
owner (const std::string &path, std::string_view token)
{
  std::string error;
  const auto name = find_token (path, token, error);
  fail_unless_cmp (error, ==, "");
  return name.value_or ("-");
}

GST_START_TEST (test_token_file_names_the_owner_of_a_token)
{
  with_file ("# users\n\nanna one\n  bert\t two \r\n#carl three\ndora\nemil four # his\nlast five",
      [] (const std::string &path) {
        fail_unless_cmp (owner (path, "one"), ==, "anna");
        fail_unless_cmp (owner (path, "two"), ==, "bert");
        fail_unless_cmp (owner (path, "four"), ==, "emil");
        fail_unless_cmp (owner (path, "five"), ==, "last");
        for (const char *token : {"three", "", " ", "#", "users", "dora", "anna", "anna one", "on",
                 "one ", "two\r", "his", "ONE"})
          fail_unless_cmp (owner (path, token), ==, "-");
      });
}
GST_END_TEST;

static Suite *
webprotocol_suite ()
{
  Suite *suite = suite_create ("webprotocol");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_hello_with_any_byte_changed_is_refused_or_read);
  tcase_add_test (tc, test_only_objects_are_messages);
  tcase_add_test (tc, test_a_message_has_few_brackets);
  tcase_add_test (tc, test_invalid_utf8_and_bytes_behind_a_nul_are_no_message);
  tcase_add_test (tc, test_hello_is_read);
  tcase_add_test (tc, test_hello_error_names_the_field);
  tcase_add_test (tc, test_header_is_written_as_the_protocol_says);
  tcase_add_test (tc, test_tokens_are_equal_only_as_a_whole);
  tcase_add_test (tc, test_token_file_names_the_owner_of_a_token);
  return suite;
}

GST_CHECK_MAIN (webprotocol);
