/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "statsboard.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace web {

namespace {

constexpr gsize kMaxText = 300, kMaxFields = 40;
constexpr guint kMaxItems = 64;

std::string
shortened (const char *text)
{
  const std::string_view view (text ? text : "");
  if (view.size () <= kMaxText)
    return std::string (view);
  g_autofree gchar *cut = g_utf8_make_valid (view.data (), kMaxText);
  return cut;
}

/* Copies numbers, texts and arrays of numbers; nothing else is part of a report. */
void
copy_field (JsonObject *, const gchar *name, JsonNode *node, gpointer to)
{
  auto object = static_cast<JsonObject *> (to);
  if (json_object_get_size (object) >= kMaxFields || std::string_view (name).size () > kMaxText)
    return;
  if (JSON_NODE_HOLDS_VALUE (node)) {
    if (json_node_get_value_type (node) == G_TYPE_STRING)
      json_object_set_string_member (
          object, name, shortened (json_node_get_string (node)).c_str ());
    else if (std::isfinite (json_node_get_double (node))) /* JSON has no other numbers */
      json_object_set_member (object, name, json_node_copy (node));
  } else if (JSON_NODE_HOLDS_ARRAY (node)) {
    JsonArray *from = json_node_get_array (node), *array = json_array_new ();
    for (guint i = 0; i < std::min (json_array_get_length (from), kMaxItems); i++)
      if (JsonNode *item = json_array_get_element (from, i);
          JSON_NODE_HOLDS_VALUE (item) && json_node_get_value_type (item) == G_TYPE_INT64)
        json_array_add_int_element (array, json_node_get_int (item));
    json_object_set_array_member (object, name, array);
  }
}

std::shared_ptr<JsonNode>
copy_report (const JsonMessage &message)
{
  JsonObject *object = json_object_new ();
  json_object_foreach_member (message.object (), copy_field, object);
  if (const auto time = message.number ("time"))
    json_object_set_double_member (object, "clock", double (g_get_real_time ()) * 1e-6 - *time);
  JsonNode *node = json_node_alloc ();
  json_node_init_object (node, object);
  json_object_unref (object);
  return {node, json_node_unref};
}

} // namespace

bool
StatsBoard::add (std::string_view datagram)
{
  const auto message =
      datagram.size () <= kMaxDatagram ? JsonMessage::parse (datagram) : std::nullopt;
  if (!message)
    return false;
  const auto host = message->text ("host"), name = message->text ("name");
  if (!host || !name)
    return false;
  if (message->text ("warning")) {
    warnings_.push_back ({copy_report (*message), g_get_monotonic_time (), ++count_});
    if (warnings_.size () > kMaxWarnings)
      warnings_.pop_front ();
    return true;
  }
  if (!message->text ("element"))
    return false;
  const Key key (shortened (host->c_str ()), shortened (name->c_str ()),
      shortened (message->text ("pad").value_or ("").c_str ()));
  if (rows_.size () >= kMaxRows && !rows_.contains (key))
    rows_.erase (std::ranges::min_element (
        rows_, {}, [] (const auto &row) { return row.second.arrived_us; }));
  rows_[key] = {copy_report (*message), g_get_monotonic_time (), ++count_};
  return true;
}

std::string
StatsBoard::message (guint64 &since) const
{
  std::string text;
  const gint64 now = g_get_monotonic_time ();
  const auto write = [&] (const Row &row) {
    if (row.number <= since)
      return;
    JsonObject *object = json_node_get_object (row.node.get ());
    json_object_set_double_member (object, "age", double (now - row.arrived_us) * 1e-6);
    g_autofree gchar *json = json_to_string (row.node.get (), FALSE);
    text += (text.empty () ? "{\"type\":\"stats\",\"rows\":[" : ",") + std::string (json);
  };
  for (const auto &[key, row] : rows_)
    write (row);
  for (const Row &row : warnings_)
    write (row);
  since = count_;
  return text.empty () ? text : text + "]}";
}

} // namespace web
