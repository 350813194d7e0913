/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "stats-sender.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cmath>
#include <cstring>

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

/* ---- the address ---- */

bool
StatsSender::open_socket (const std::string &host, const std::string &port, std::string &error)
{
  addrinfo hints{}, *found = nullptr;
  hints.ai_socktype = SOCK_DGRAM;
  if (const int result = getaddrinfo (host.c_str (), port.c_str (), &hints, &found)) {
    error = host + ":" + port + ": " + gai_strerror (result);
    return false;
  }
  fd_ = socket (found->ai_family, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  std::memcpy (&to_, found->ai_addr, found->ai_addrlen);
  to_size_ = found->ai_addrlen;
  freeaddrinfo (found);
  is_socket_ = true;
  if (fd_ < 0)
    error = std::string ("no socket: ") + g_strerror (errno);
  return fd_ >= 0;
}

std::unique_ptr<StatsSender>
StatsSender::open (const std::string &address, std::string host, std::string &error)
{
  std::unique_ptr<StatsSender> sender (new StatsSender);
  sender->host_ = std::move (host);
  if (address.starts_with ("udp://")) {
    std::string name = address.substr (6);
    const auto colon = name.rfind (':');
    const std::string port = colon == std::string::npos ? "" : name.substr (colon + 1);
    name.resize (std::min (colon, name.size ()));
    if (name.size () > 2 && name.front () == '[' && name.back () == ']') /* IPv6 */
      name = name.substr (1, name.size () - 2);
    const bool numeric =
        !port.empty () && port.find_first_not_of ("0123456789") == std::string::npos;
    if (name.empty () || !numeric || port.size () > 5 || std::stoi (port) < 1 ||
        std::stoi (port) > 65535) {
      error = "expected udp://HOST:PORT or a file, got '" + address + "'";
      return nullptr;
    }
    return sender->open_socket (name, port, error) ? std::move (sender) : nullptr;
  }
  sender->fd_ =
      ::open (address.c_str (), O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC | O_NONBLOCK, 0666);
  if (sender->fd_ < 0) {
    error = address + ": cannot be opened for writing: " + g_strerror (errno);
    return nullptr;
  }
  return sender;
}

StatsSender::~StatsSender ()
{
  if (fd_ >= 0)
    close (fd_);
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
  const ssize_t sent = is_socket_
                           ? sendto (fd_, line.data (), line.size (), MSG_DONTWAIT | MSG_NOSIGNAL,
                                 reinterpret_cast<const sockaddr *> (&to_), to_size_)
                           : write (fd_, line.data (), line.size ());
  (void)sent; /* there may be no receiver */
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
