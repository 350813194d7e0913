/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "stats-sender.hpp"

#include <cmath>

namespace {

/* ---- JSON ---- */

void
append_string (std::string &json, const char *text)
{
  json += '"';
  for (const char *c = text; *c; c++)
    if (*c == '"' || *c == '\\')
      (json += '\\') += *c;
    else if (static_cast<unsigned char> (*c) < 0x20)
      json += ' ';
    else
      json += *c;
  json += '"';
}

void
append_number (std::string &json, double number)
{
  char text[G_ASCII_DTOSTR_BUF_SIZE];
  json += std::isfinite (number) ? g_ascii_formatd (text, sizeof text, "%.3f", number) : "null";
}

void
append_value (std::string &json, const GValue *value)
{
  if (G_VALUE_HOLDS_STRING (value))
    return append_string (json, g_value_get_string (value) ? g_value_get_string (value) : "");
  if (G_VALUE_HOLDS_UINT64 (value))
    json += std::to_string (g_value_get_uint64 (value));
  else if (G_VALUE_HOLDS_INT64 (value))
    json += std::to_string (g_value_get_int64 (value));
  else if (G_VALUE_HOLDS_INT (value))
    json += std::to_string (g_value_get_int (value));
  else if (G_VALUE_HOLDS_UINT (value))
    json += std::to_string (g_value_get_uint (value));
  else if (G_VALUE_HOLDS_BOOLEAN (value))
    json += g_value_get_boolean (value) ? "true" : "false";
  else if (G_VALUE_HOLDS_DOUBLE (value))
    append_number (json, g_value_get_double (value));
  else if (GST_VALUE_HOLDS_ARRAY (value)) {
    json += '[';
    for (guint i = 0; i < gst_value_array_get_size (value); i++) {
      json += i ? "," : "";
      append_value (json, gst_value_array_get_value (value, i));
    }
    json += ']';
  } else
    json += "null";
}

gboolean
append_field (GQuark field, const GValue *value, gpointer json)
{
  auto &line = *static_cast<std::string *> (json);
  line += ',';
  append_string (line, g_quark_to_string (field));
  line += ':';
  append_value (line, value);
  return TRUE;
}

} // namespace

std::unique_ptr<StatsSender>
StatsSender::open (const std::string &address, std::string host, std::string &error)
{
  std::unique_ptr<StatsSender> sender (new StatsSender);
  sender->host_ = std::move (host);
  g_autoptr (GError) failure = nullptr;
  g_autoptr (GSocketConnectable) to =
      address.starts_with ("udp://") ? g_network_address_parse_uri (address.c_str (), 0, nullptr)
                                     : nullptr;
  if (!to || g_network_address_get_port (G_NETWORK_ADDRESS (to)) == 0) {
    error = "'" + address + "' is not udp://HOST:PORT";
    return nullptr;
  }
  g_autoptr (GSocketAddressEnumerator) addresses = g_socket_connectable_enumerate (to);
  sender->to_ = g_socket_address_enumerator_next (addresses, nullptr, &failure);
  if (sender->to_)
    sender->socket_ = g_socket_new (g_socket_address_get_family (sender->to_),
        G_SOCKET_TYPE_DATAGRAM, G_SOCKET_PROTOCOL_UDP, &failure);
  if (!sender->socket_) {
    error = address + ": " + (failure ? failure->message : "no such host");
    return nullptr;
  }
  g_socket_set_blocking (sender->socket_, FALSE);
  return sender;
}

StatsSender::~StatsSender ()
{
  g_clear_object (&socket_);
  g_clear_object (&to_);
}

std::string
StatsSender::begin_line (GstMessage *message) const
{
  std::string line = "{\"host\":";
  append_string (line, host_.c_str ());
  line += ",\"name\":";
  append_string (line, GST_MESSAGE_SRC_NAME (message));
  line += ",\"time\":";
  append_number (line, double (g_get_real_time ()) * 1e-6);
  return line;
}

void
StatsSender::send (std::string line)
{
  line += "}\n";
  g_socket_send_to (socket_, to_, line.data (), line.size (), nullptr, nullptr); /* or it is lost */
}

void
StatsSender::take (GstMessage *message)
{
  const GstStructure *structure = gst_message_get_structure (message);
  if (!structure || !gst_structure_has_name (structure, "rangecast-stats"))
    return;
  std::string line = begin_line (message);
  gst_structure_foreach (structure, append_field, &line);
  send (std::move (line));
}

void
StatsSender::take_warning (GstMessage *message, const char *text)
{
  std::string line = begin_line (message) + ",\"warning\":";
  append_string (line, text);
  send (std::move (line));
}
