/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "protocol.hpp"

#include <gst/gst.h>

#include <algorithm>
#include <cmath>
#include <sstream>

namespace web {

/* ---- JSON ---- */

/* The parser recurses; it also takes comments and two kinds of quotes, so all brackets count. */
static bool
may_be_nested_deeply (std::string_view text)
{
  constexpr int kMaxBrackets = 128;
  return std::ranges::count_if (text, [] (char c) { return c == '[' || c == '{'; }) > kMaxBrackets;
}

std::optional<JsonMessage>
JsonMessage::parse (std::string_view text)
{
  JsonMessage message;
  if (may_be_nested_deeply (text) || text.find ('\0') != text.npos)
    return {};
  message.root_.reset (json_from_string (std::string (text).c_str (), nullptr));
  if (!message.root_ || !JSON_NODE_HOLDS_OBJECT (message.root_.get ()))
    return {};
  return message;
}

std::optional<std::string>
JsonMessage::text (const char *name) const
{
  JsonNode *node = json_object_get_member (object (), name);
  if (!node || !JSON_NODE_HOLDS_VALUE (node) || json_node_get_value_type (node) != G_TYPE_STRING)
    return {};
  return json_node_get_string (node);
}

std::optional<double>
JsonMessage::number (const char *name) const
{
  JsonNode *node = json_object_get_member (object (), name);
  if (!node || !JSON_NODE_HOLDS_VALUE (node))
    return {};
  const GType type = json_node_get_value_type (node);
  const double number = json_node_get_double (node);
  if ((type != G_TYPE_INT64 && type != G_TYPE_DOUBLE) || !std::isfinite (number))
    return {};
  return number;
}

std::string
json_string (const std::string &text)
{
  JsonNode *node = json_node_alloc ();
  json_node_init_string (node, text.c_str ());
  g_autofree gchar *quoted = json_to_string (node, FALSE);
  json_node_unref (node);
  return quoted;
}

/* ---- hello ---- */

static bool
parse_want (const JsonMessage &message, Hello &hello)
{
  JsonNode *node = json_object_get_member (message.object (), "want");
  if (!node)
    return true;
  if (!JSON_NODE_HOLDS_ARRAY (node))
    return false;
  JsonArray *array = json_node_get_array (node);
  hello.stream = hello.stats = hello.audio = false;
  for (guint i = 0; i < json_array_get_length (array); i++) {
    JsonNode *item = json_array_get_element (array, i);
    if (!JSON_NODE_HOLDS_VALUE (item) || json_node_get_value_type (item) != G_TYPE_STRING)
      return false;
    const std::string_view name = json_node_get_string (item);
    hello.stream |= name == "stream";
    hello.stats |= name == "stats";
    hello.audio |= name == "audio";
  }
  return true;
}

std::optional<Hello>
parse_hello (const JsonMessage &message, std::string &error)
{
  Hello hello;
  const auto version = message.number ("version");
  const auto token = message.text ("token"), room = message.text ("room");
  if (message.text ("type") != "hello")
    error = "the first message must have type 'hello'";
  else if (!version || *version != static_cast<int> (std::clamp (*version, 0.0, 1e6)))
    error = "version must be a whole number";
  else if (!token && json_object_has_member (message.object (), "token"))
    error = "token must be a string";
  else if (!room && json_object_has_member (message.object (), "room"))
    error = "room must be a string";
  else if (!parse_want (message, hello))
    error = "want must be an array of strings";
  if (!error.empty ())
    return {};
  hello.version = static_cast<int> (*version);
  hello.token = token.value_or ("");
  hello.room = room;
  hello.stream &= !hello.room;
  return hello;
}

/* ---- frame sets ---- */

void
MessageHeader::write (guint8 *to) const
{
  to[0] = 1;
  to[1] = static_cast<guint8> ((key ? 1 : 0) | (discontinuity ? 2 : 0));
  GST_WRITE_UINT16_LE (to + 2, 0);
  GST_WRITE_UINT32_LE (to + 4, frame_set);
  GST_WRITE_UINT32_LE (to + 8, dropped);
  GST_WRITE_UINT32_LE (to + 12, delay_us);
  GST_WRITE_UINT64_LE (to + 16, sent_us);
}

void
AudioHeader::write (guint8 *to) const
{
  to[0] = 2;
  to[1] = 0;
  GST_WRITE_UINT16_LE (to + 2, 0);
  GST_WRITE_UINT32_LE (to + 4, number);
  GST_WRITE_UINT64_LE (to + 8, captured_us);
}

/* ---- tokens ---- */

bool
equal_tokens (std::string_view a, std::string_view b)
{
  guint8 difference = a.size () != b.size ();
  for (gsize i = 0; i < a.size () && !b.empty (); i++)
    difference = guint8 (difference | (a[i] ^ b[i % b.size ()]));
  return difference == 0;
}

std::optional<std::string>
find_token (const std::string &path, std::string_view token, std::string &error)
{
  g_autofree gchar *contents = nullptr;
  g_autoptr (GError) failure = nullptr;
  if (!g_file_get_contents (path.c_str (), &contents, nullptr, &failure)) {
    error = failure->message;
    return {};
  }
  std::istringstream lines (contents);
  std::optional<std::string> found;
  for (std::string line; std::getline (lines, line);) {
    std::istringstream words (line);
    std::string name, word;
    if (words >> name >> word && name.front () != '#' && equal_tokens (word, token)) {
      g_autofree gchar *valid = g_utf8_make_valid (name.data (), gssize (name.size ()));
      found = valid;
    }
  }
  return found;
}

} // namespace web
