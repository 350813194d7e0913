/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Messages, tokens and statistics of rangewebsink without a network, and what hostile peers make of
 * them. */
#include "web/protocol.hpp"

#include <glib/gstdio.h>

#include <cstring>
#include <functional>
#include <memory>
#include <vector>

#include "../rangecast-check.hpp"
#include "web/guesslimiter.hpp"
#include "web/limitedinput.h"
#include "web/statsboard.hpp"

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

GST_START_TEST (test_members_are_read_by_type)
{
  const auto message = parse_exactly (
      R"({"text":"a","number":-7,"fraction":0.5,"no":false,"nothing":null,"of":[1]})");
  fail_unless (message.has_value ());
  fail_unless_cmp (message->text ("text").value_or (""), ==, "a");
  fail_unless_cmp (message->number ("number").value_or (0), ==, -7.0);
  fail_unless_cmp (message->number ("fraction").value_or (0), ==, 0.5);
  for (const char *name : {"number", "fraction", "no", "nothing", "of", "missing"})
    fail_if (message->text (name).has_value (), "%s is no text", name);
  for (const char *name : {"text", "no", "nothing", "of", "missing"})
    fail_if (message->number (name).has_value (), "%s is no number", name);
  fail_unless (message->has ("nothing"));
  fail_if (message->has ("missing"));
}
GST_END_TEST;

GST_START_TEST (test_no_truncated_prefix_of_a_hello_is_a_message)
{
  fail_unless (parse_exactly (kHello).has_value ());
  for (std::size_t size = 0; size < kHello.size (); size++)
    fail_if (parse_exactly (std::string_view (kHello).substr (0, size)).has_value (),
        "%d bytes are a message", int (size));
}
GST_END_TEST;

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

GST_START_TEST (test_brackets_in_strings_are_no_nesting)
{
  const std::string brackets (50, '[');
  const auto message = parse_exactly ("{\"a\":\"" + brackets + "\\\"" + brackets + "\"}");
  fail_unless (message.has_value ());
  fail_unless_cmp (message->text ("a").value_or (""), ==, brackets + "\"" + brackets);
  /* what the parser takes for a comment or a string does not hide others */
  const std::string many (200, '[');
  for (const char *beginning : {"{\"a\":\"\\\\\",\"b\":", "{\"a\":/*\"*/", "{\"a\":'\"',\"b\":"})
    fail_if (parse_exactly (beginning + many).has_value ());
}
GST_END_TEST;

GST_START_TEST (test_bytes_behind_a_nul_do_not_go_unseen)
{
  fail_if (parse_exactly (std::string_view ("{}\0{", 4)).has_value ());
  fail_if (parse_exactly (std::string_view ("{}\0", 3)).has_value ());
  fail_if (parse_exactly (std::string_view ("\0{}", 3)).has_value ());
  fail_if (parse_exactly (std::string_view ("{\"a\":\"\0\"}", 9)).has_value ());
}
GST_END_TEST;

GST_START_TEST (test_invalid_utf8_is_no_message)
{
  for (const char *bytes : {"\xff", "\xc3", "\xc0\xaf", "\xed\xa0\x80", "\xf8\x88\x80\x80\x80"})
    fail_if (parse_exactly (std::string ("{\"a\":\"") + bytes + "\"}").has_value ());
  fail_unless (parse_exactly ("{\"a\":\"\xc3\xa9\"}").has_value ());
}
GST_END_TEST;

GST_START_TEST (test_infinite_numbers_are_no_numbers)
{
  for (const char *number : {"1e999", "-1e999", "1e99999999999999999999"}) {
    const auto message = parse_exactly (std::string ("{\"a\":") + number + "}");
    fail_if (message && message->number ("a").has_value (), "%s", number);
  }
  fail_unless_cmp (parse_exactly ("{\"a\":1e300}")->number ("a").value_or (0), ==, 1e300);
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

GST_START_TEST (test_hello_without_want_wants_the_stream)
{
  const Hello hello = hello_of (R"({"type":"hello","version":1,"unknown":[{"a":null}]})");
  fail_unless_cmp (hello.token, ==, "");
  fail_unless (hello.stream && !hello.stats);
}
GST_END_TEST;

GST_START_TEST (test_hello_wants_no_more_than_it_says)
{
  const Hello stats = hello_of (R"({"type":"hello","version":1,"want":["stats","more"]})");
  fail_unless (stats.stats && !stats.stream);
  const Hello nothing = hello_of (R"({"type":"hello","version":1,"want":[]})");
  fail_unless (!nothing.stats && !nothing.stream);
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

GST_START_TEST (test_hello_of_another_version_is_read)
{
  fail_unless_equals_int (hello_of (R"({"type":"hello","version":2})").version, 2);
  fail_unless_equals_int (hello_of (R"({"type":"hello","version":0})").version, 0);
}
GST_END_TEST;

/* ---- the header of a frame set's message ---- */

GST_START_TEST (test_header_is_written_as_the_protocol_says)
{
  MessageHeader header;
  header.key = true;
  header.count = 0x0102;
  header.frame_set = 0x03040506;
  header.index = 0x0708;
  header.message = 0x090a0b0c;
  header.dropped = 0x0d0e0f10;
  header.delay_us = 0x11121314;
  header.sent_us = 0x15161718191a1b1c;
  const std::vector<guint8> expected = {1, 1, 2, 1, 6, 5, 4, 3, 8, 7, 0, 0, 0x0c, 0x0b, 0x0a, 9,
      0x10, 0x0f, 0x0e, 0x0d, 0x14, 0x13, 0x12, 0x11, 0x1c, 0x1b, 0x1a, 0x19, 0x18, 0x17, 0x16,
      0x15};
  std::vector<guint8> bytes (MessageHeader::kSize, 0xee);
  header.write (bytes.data ());
  fail_unless_cmp (bytes, ==, expected);
}
GST_END_TEST;

GST_START_TEST (test_header_flags)
{
  guint8 bytes[MessageHeader::kSize];
  for (const int flags : {0, 1, 2, 3}) {
    MessageHeader header;
    header.key = flags & 1;
    header.discontinuity = flags & 2;
    header.write (bytes);
    fail_unless_equals_int (bytes[1], flags);
  }
  /* a delay that is not known, one message */
  fail_unless_equals_int (GST_READ_UINT32_LE (bytes + 20), -1);
  fail_unless_equals_int (GST_READ_UINT16_LE (bytes + 2), 1);
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

GST_START_TEST (test_guesses_are_allowed_in_a_burst_and_then_at_a_rate)
{
  GuessLimiter limiter;
  gint64 now = 5 * G_USEC_PER_SEC;
  const auto use_burst = [&] {
    for (int i = 0; i < GuessLimiter::kBurst; i++) {
      fail_unless (limiter.allows ("192.0.2.1", now), "%d", i);
      limiter.add_failure ("192.0.2.1", now);
    }
    fail_if (limiter.allows ("192.0.2.1", now));
  };
  use_burst ();
  for (int i = 0; i < 3; i++) {
    now += GuessLimiter::kInterval_us - 1;
    fail_if (limiter.allows ("192.0.2.1", now));
    now++;
    fail_unless (limiter.allows ("192.0.2.1", now));
    limiter.add_failure ("192.0.2.1", now);
  }
  now += GuessLimiter::kBurst * GuessLimiter::kInterval_us;
  use_burst ();
}
GST_END_TEST;

GST_START_TEST (test_guesses_are_counted_by_network)
{
  GuessLimiter limiter;
  const auto exhaust = [&] (const char *address) {
    for (int i = 0; i < GuessLimiter::kBurst; i++)
      limiter.add_failure (address, 0);
  };
  exhaust ("192.0.2.1");
  fail_if (limiter.allows ("::ffff:192.0.2.1", 0)); /* a socket for IPv6 sees IPv4 like that */
  fail_unless (limiter.allows ("192.0.2.2", 0) && limiter.allows ("::ffff:192.0.2.2", 0));
  exhaust ("2001:db8:0:1::1");
  fail_if (limiter.allows ("2001:db8:0:1:ffff::2", 0));
  fail_unless (limiter.allows ("2001:db8:0:2::1", 0));
  exhaust ("no address");
  fail_if (limiter.allows ("no address", 0));
}
GST_END_TEST;

GST_START_TEST (test_guesses_of_many_addresses_take_limited_memory)
{
  GuessLimiter limiter;
  for (int i = 0; i < GuessLimiter::kBurst; i++)
    limiter.add_failure ("192.0.2.1", 0);
  for (guint i = 0; i < GuessLimiter::kMaxAddresses + 500; i++)
    limiter.add_failure ("10.0." + std::to_string (i / 256) + "." + std::to_string (i % 256), 0);
  fail_unless_equals_int (limiter.addresses (), GuessLimiter::kMaxAddresses);
  fail_if (limiter.allows ("192.0.2.1", 0)); /* who tried most is remembered */
  limiter.add_failure ("192.0.2.9", gint64 (3600) * G_USEC_PER_SEC);
  fail_unless_equals_int (limiter.addresses (), 1); /* all others are free again */
}
GST_END_TEST;

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

GST_START_TEST (test_token_file_that_is_empty_or_binary_admits_nobody)
{
  for (const auto contents :
      {std::string_view (""), std::string_view ("\n\n"), std::string_view ("\0\0 \0", 4),
          std::string_view ("\xff\xfe \xff"), std::string_view ("name-without-end")})
    with_file (contents, [] (const std::string &path) {
      for (const auto token : {std::string_view (""), std::string_view ("\0", 1)})
        fail_unless_cmp (owner (path, token), ==, "-");
    });
}
GST_END_TEST;

GST_START_TEST (test_token_file_that_cannot_be_read_admits_nobody_and_says_why)
{
  for (const char *path : {"/nonexistent/users.txt", "/", ""}) {
    std::string error;
    fail_if (find_token (path, "", error).has_value ());
    fail_if (error.empty (), "'%s'", path);
  }
}
GST_END_TEST;

/* ---- statistics ---- */

/* The rows of a stats message, which must be JSON; null if it is empty. */
struct Rows {
  std::shared_ptr<JsonNode> node;

  explicit Rows (const std::string &message)
  {
    if (message.empty ())
      return;
    g_autoptr (GError) error = nullptr;
    node.reset (json_from_string (message.c_str (), &error), json_node_unref);
    fail_if (error != nullptr, "%s: %s", message.c_str (), error ? error->message : "");
    fail_unless_equals_string (
        json_object_get_string_member (json_node_get_object (node.get ()), "type"), "stats");
  }
  JsonArray *array () const
  {
    return json_object_get_array_member (json_node_get_object (node.get ()), "rows");
  }
  guint size () const { return node ? json_array_get_length (array ()) : 0; }
  JsonObject *row (guint i) const { return json_array_get_object_element (array (), i); }
};

static std::string
report (const std::string &name, const std::string &fields = "\"frames\":1")
{
  return R"({"host":"camera0","element":"stereodepth","name":")" + name + "\"," + fields + "}";
}

GST_START_TEST (test_board_keeps_the_last_report_of_each_element_and_pad)
{
  StatsBoard board;
  fail_unless (board.add (report ("a", "\"frames\":1")));
  fail_unless (board.add (report ("a", "\"frames\":2,\"pad\":\"src_0\"")));
  fail_unless (board.add (report ("a", "\"frames\":3")));
  guint64 since = 0;
  const Rows rows (board.message (since));
  fail_unless_equals_int (rows.size (), 2);
  fail_unless_equals_int (json_object_get_int_member (rows.row (0), "frames"), 3);
  fail_unless_equals_int (json_object_get_int_member (rows.row (1), "frames"), 2);
  fail_unless_cmp (json_object_get_double_member (rows.row (0), "age"), >=, 0);
}
GST_END_TEST;

GST_START_TEST (test_board_gives_each_reader_what_is_new_for_it)
{
  StatsBoard board;
  guint64 early = 0, late = 0;
  fail_unless_cmp (board.message (early), ==, "");
  fail_unless (board.add (report ("a")));
  fail_unless_equals_int (Rows (board.message (early)).size (), 1);
  fail_unless_cmp (board.message (early), ==, "");
  fail_unless (board.add (report ("b")));
  fail_unless_equals_int (Rows (board.message (early)).size (), 1);
  fail_unless_equals_int (Rows (board.message (late)).size (), 2);
}
GST_END_TEST;

GST_START_TEST (test_board_keeps_the_last_warnings)
{
  StatsBoard board;
  for (int i = 0; i < 25; i++)
    fail_unless (board.add (report ("a", "\"warning\":\"w" + std::to_string (i) + "\"")));
  guint64 since = 0;
  const Rows rows (board.message (since));
  fail_unless_equals_int (rows.size (), StatsBoard::kMaxWarnings);
  fail_unless_equals_string (json_object_get_string_member (rows.row (0), "warning"), "w5");
  fail_unless_equals_string (json_object_get_string_member (rows.row (19), "warning"), "w24");
}
GST_END_TEST;

GST_START_TEST (test_board_forgets_the_oldest_row_beyond_its_limit)
{
  StatsBoard board;
  for (gsize i = 0; i < StatsBoard::kMaxRows; i++)
    fail_unless (board.add (report (std::to_string (i))));
  g_usleep (1000);
  fail_unless (board.add (report ("one more", "\"frames\":77")));
  guint64 since = StatsBoard::kMaxRows; /* what came last */
  const Rows rows (board.message (since));
  fail_unless_equals_int (rows.size (), 1);
  fail_unless_equals_int (json_object_get_int_member (rows.row (0), "frames"), 77);
  since = 0;
  fail_unless_equals_int (Rows (board.message (since)).size (), StatsBoard::kMaxRows);
}
GST_END_TEST;

GST_START_TEST (test_board_ignores_what_is_no_report)
{
  StatsBoard board;
  const std::string sound = report ("a");
  for (std::size_t size = 0; size < sound.size (); size++) {
    const std::unique_ptr<char[]> copy (new char[size]);
    sound.copy (copy.get (), size);
    fail_if (board.add ({copy.get (), size}));
  }
  for (const char *text :
      {"[]", "{}", R"({"host":"a","name":"b"})", R"({"host":"a","element":"b"})",
          R"({"name":"a","element":"b"})", R"({"host":1,"name":"a","element":"b"})",
          R"({"host":"a","name":null,"element":"b"})", R"({"host":"a","name":"b","element":[]})"})
    fail_if (board.add (text), "%s", text);
  fail_if (board.add (report ("a", "\"text\":\"" + std::string (9000, 'x') + "\"")));
  guint64 since = 0;
  fail_unless_cmp (board.message (since), ==, "");
}
GST_END_TEST;

GST_START_TEST (test_board_drops_and_shortens_what_no_report_has)
{
  StatsBoard board;
  std::string many = "\"long\":\"" + std::string (299, 'x') + "\xc3\xa9" + std::string (99, 'x') +
                     "\",\"object\":{\"a\":1},\"nothing\":null,\"list\":[\"a\",[1],7";
  for (int i = 0; i < 100; i++)
    many += ",7";
  many += "],\"" + std::string (301, 'n') + "\":1";
  for (int i = 0; i < 100; i++)
    many += ",\"f" + std::to_string (i) + "\":1";
  fail_unless (board.add (report ("a", many)));
  guint64 since = 0;
  const Rows rows (board.message (since));
  JsonObject *row = rows.row (0);
  fail_unless_cmp (json_object_get_size (row), <=, 42);
  fail_if (json_object_has_member (row, "object") || json_object_has_member (row, "nothing"));
  fail_if (json_object_has_member (row, std::string (301, 'n').c_str ()));
  const std::string text = json_object_get_string_member (row, "long");
  fail_unless_cmp (text.size (), <=, 302); /* U+FFFD for half a character */
  fail_unless_cmp (json_array_get_length (json_object_get_array_member (row, "list")), <=, 64);
}
GST_END_TEST;

GST_START_TEST (test_board_writes_json_whatever_numbers_a_report_has)
{
  StatsBoard board;
  fail_unless (
      board.add (report ("a", "\"frames\":1e999,\"rate\":-1e999,\"time\":1e999,\"age\":\"x\","
                              "\"big\":99999999999999999999,\"small\":1e-320")));
  fail_unless (board.add (report ("b", "\"frames\":1")));
  guint64 since = 0;
  const std::string message = board.message (since);
  for (const char *word : {"inf", "Inf", "nan", "NaN"})
    fail_if (message.find (word) != message.npos, "%s", message.c_str ());
  fail_unless_equals_int (Rows (message).size (), 2);
}
GST_END_TEST;

/* ---- the limited input ---- */

struct Input {
  GInputStream *base;
  WebLimitedInput *limited;

  Input (std::size_t size, gsize limit)
      : base (g_memory_input_stream_new_from_data (g_malloc0 (size), gssize (size), g_free)),
        limited (web_limited_input_new (base, limit))
  {
  }
  Input (const Input &) = delete;
  Input &operator= (const Input &) = delete;
  ~Input ()
  {
    g_object_unref (limited);
    g_object_unref (base);
  }
  /* Bytes read; -1: too many, in which case the error must say so. */
  gssize read (gsize size, bool pollable)
  {
    const std::unique_ptr<guint8[]> to (new guint8[size]);
    g_autoptr (GError) error = nullptr;
    const gssize got =
        pollable ? g_pollable_input_stream_read_nonblocking (
                       G_POLLABLE_INPUT_STREAM (limited), to.get (), size, nullptr, &error)
                 : g_input_stream_read (G_INPUT_STREAM (limited), to.get (), size, nullptr, &error);
    fail_unless_equals_int (got < 0, error != nullptr);
    if (error)
      fail_unless (g_error_matches (error, G_IO_ERROR, G_IO_ERROR_MESSAGE_TOO_LARGE));
    return got;
  }
};

GST_START_TEST (test_input_fails_with_the_first_byte_beyond_its_limit)
{
  for (const bool pollable : {false, true}) {
    Input input (1000, 100);
    fail_unless_equals_int (input.read (60, pollable), 60);
    fail_unless_equals_int (input.read (40, pollable), 40);
    fail_unless_equals_int (input.read (1, pollable), -1);
    fail_unless_equals_int (input.read (1, pollable), -1); /* and goes on failing */
  }
}
GST_END_TEST;

GST_START_TEST (test_input_counts_from_the_last_restart)
{
  for (const bool pollable : {false, true}) {
    Input input (1000, 100);
    for (int i = 0; i < 5; i++) {
      fail_unless_equals_int (input.read (100, pollable), 100);
      web_limited_input_restart (input.limited);
    }
    fail_unless_equals_int (input.read (101, pollable), -1);
  }
}
GST_END_TEST;

GST_START_TEST (test_input_passes_the_end_and_reports_data_as_its_base_does)
{
  Input input (10, 100);
  const auto pollable = G_POLLABLE_INPUT_STREAM (input.limited);
  fail_unless (g_pollable_input_stream_can_poll (pollable));
  fail_unless (g_pollable_input_stream_is_readable (pollable));
  fail_unless_equals_int (input.read (50, true), 10);
  fail_unless_equals_int (input.read (50, true), 0);
  fail_unless_equals_int (input.read (50, false), 0);
}
GST_END_TEST;

static Suite *
webprotocol_suite ()
{
  Suite *suite = suite_create ("webprotocol");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_members_are_read_by_type);
  tcase_add_test (tc, test_no_truncated_prefix_of_a_hello_is_a_message);
  tcase_add_test (tc, test_hello_with_any_byte_changed_is_refused_or_read);
  tcase_add_test (tc, test_only_objects_are_messages);
  tcase_add_test (tc, test_a_message_has_few_brackets);
  tcase_add_test (tc, test_brackets_in_strings_are_no_nesting);
  tcase_add_test (tc, test_bytes_behind_a_nul_do_not_go_unseen);
  tcase_add_test (tc, test_invalid_utf8_is_no_message);
  tcase_add_test (tc, test_infinite_numbers_are_no_numbers);
  tcase_add_test (tc, test_hello_is_read);
  tcase_add_test (tc, test_hello_without_want_wants_the_stream);
  tcase_add_test (tc, test_hello_wants_no_more_than_it_says);
  tcase_add_test (tc, test_hello_error_names_the_field);
  tcase_add_test (tc, test_hello_of_another_version_is_read);
  tcase_add_test (tc, test_header_is_written_as_the_protocol_says);
  tcase_add_test (tc, test_header_flags);
  tcase_add_test (tc, test_tokens_are_equal_only_as_a_whole);
  tcase_add_test (tc, test_guesses_are_allowed_in_a_burst_and_then_at_a_rate);
  tcase_add_test (tc, test_guesses_are_counted_by_network);
  tcase_add_test (tc, test_guesses_of_many_addresses_take_limited_memory);
  tcase_add_test (tc, test_token_file_names_the_owner_of_a_token);
  tcase_add_test (tc, test_token_file_that_is_empty_or_binary_admits_nobody);
  tcase_add_test (tc, test_token_file_that_cannot_be_read_admits_nobody_and_says_why);
  tcase_add_test (tc, test_board_keeps_the_last_report_of_each_element_and_pad);
  tcase_add_test (tc, test_board_gives_each_reader_what_is_new_for_it);
  tcase_add_test (tc, test_board_keeps_the_last_warnings);
  tcase_add_test (tc, test_board_forgets_the_oldest_row_beyond_its_limit);
  tcase_add_test (tc, test_board_ignores_what_is_no_report);
  tcase_add_test (tc, test_board_drops_and_shortens_what_no_report_has);
  tcase_add_test (tc, test_board_writes_json_whatever_numbers_a_report_has);
  tcase_add_test (tc, test_input_fails_with_the_first_byte_beyond_its_limit);
  tcase_add_test (tc, test_input_counts_from_the_last_restart);
  tcase_add_test (tc, test_input_passes_the_end_and_reports_data_as_its_base_does);
  return suite;
}

GST_CHECK_MAIN (webprotocol);
