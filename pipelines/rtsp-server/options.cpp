/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "options.hpp"

#include <gio/gio.h>
#include <gst/gst.h>

#include <cstdio>
#include <cstring>

namespace {

bool
bad_option (const char *option, const char *expected, const std::string &got)
{
  g_printerr ("rtsp-server: %s: expected %s, got '%s'\n", option, expected, got.c_str ());
  return false;
}

/* ---- who may watch ---- */

/* What it has instead of NAME:PASSWORD; never shows what may be a password. */
std::string
fault_of_user (const std::string &text)
{
  const auto colon = text.find (':');
  if (colon == text.npos)
    return "no colon";
  return colon == 0 ? "no name before the colon"
                    : "no password for '" + text.substr (0, colon) + "'";
}

/* @param place  the option or its line, for messages */
bool
add_user (const std::string &text, const std::string &place, RtspOptions &options)
{
  const auto colon = text.find (':');
  if (colon == 0 || colon == text.npos || colon + 1 == text.size ()) {
    g_printerr ("rtsp-server: %s: expected NAME:PASSWORD, got %s\n", place.c_str (),
        fault_of_user (text).c_str ());
    return false;
  }
  const std::string name = text.substr (0, colon);
  for (const RtspUser &user : options.users)
    if (user.name == name) {
      g_printerr ("rtsp-server: %s: expected each name once, got '%s' again\n", place.c_str (),
          name.c_str ());
      return false;
    }
  options.users.push_back ({name, text.substr (colon + 1)});
  return true;
}

/* A line for each: NAME:PASSWORD. Empty ones and those with # first are none. */
bool
read_users (const char *path, RtspOptions &options)
{
  gchar *text = nullptr;
  GError *error = nullptr;
  if (!g_file_get_contents (path, &text, nullptr, &error)) {
    g_printerr ("rtsp-server: --users: %s\n", error->message);
    g_error_free (error);
    return false;
  }
  const std::size_t before = options.users.size ();
  const std::string file = std::string ("--users: ") + path + ":";
  bool good = true;
  gchar **lines = g_strsplit (text, "\n", -1);
  for (int i = 0; lines[i] && good; i++) {
    g_strchomp (lines[i]);
    if (*lines[i] && *lines[i] != '#')
      good = add_user (lines[i], file + std::to_string (i + 1), options);
  }
  g_strfreev (lines);
  g_free (text);
  if (good && options.users.size () == before) {
    /* An empty file must not let everybody in. */
    g_printerr ("rtsp-server: --users: expected lines NAME:PASSWORD in %s, found none\n", path);
    return false;
  }
  return good;
}

/* Other users of this machine can read the arguments of a process. */
void
wipe_passwords (int argc, char **argv)
{
  for (int i = 1; i < argc && std::strcmp (argv[i], "--") != 0; i++) {
    char *value = nullptr;
    if (std::strcmp (argv[i], "--user") == 0 && i + 1 < argc)
      value = argv[i + 1];
    else if (std::strncmp (argv[i], "--user=", 7) == 0)
      value = argv[i] + 7;
    if (char *colon = value ? std::strchr (value, ':') : nullptr)
      std::memset (colon + 1, '*', std::strlen (colon + 1));
  }
}

/* ---- where to ---- */

bool
is_multicast (const std::string &text)
{
  GInetAddress *address = g_inet_address_new_from_string (text.c_str ());
  const bool is = address && g_inet_address_get_is_multicast (address);
  g_clear_object (&address);
  return is;
}

/* Whether they are of one kind, and the last is not before the first. */
bool
is_range (const MulticastRange &range)
{
  GInetAddress *first = g_inet_address_new_from_string (range.first.c_str ());
  GInetAddress *last = g_inet_address_new_from_string (range.last.c_str ());
  const bool is = first && last &&
                  g_inet_address_get_family (first) == g_inet_address_get_family (last) &&
                  std::memcmp (g_inet_address_to_bytes (first), g_inet_address_to_bytes (last),
                      g_inet_address_get_native_size (first)) <= 0;
  g_clear_object (&first);
  g_clear_object (&last);
  return is;
}

/* ADDRESS[-ADDRESS]:PORT-PORT[/TTL], both of IPv4: an IPv6 address has colons of its own. */
bool
parse_multicast (const char *text, MulticastRange &range)
{
  static const char kExpected[] =
      "ADDRESS[-ADDRESS]:PORT-PORT[/TTL], two ports at least, the first even, e.g. "
      "239.1.2.3:5000-5001/1";
  const char *colon = std::strchr (text, ':');
  char more = 0;
  const int parsed = colon ? std::sscanf (colon, ":%5d-%5d/%3d%c", &range.first_port,
                                 &range.last_port, &range.ttl, &more)
                           : 0;
  const bool has_ttl = std::strchr (text, '/') != nullptr;
  const bool ends_with_port = has_ttl || g_ascii_isdigit (text[std::strlen (text) - 1]);
  if (parsed != (has_ttl ? 3 : 2) || !ends_with_port)
    return bad_option ("--multicast", kExpected, text);
  const std::string addresses (text, colon);
  const auto dash = addresses.find ('-');
  range.first = addresses.substr (0, dash);
  range.last = dash == addresses.npos ? range.first : addresses.substr (dash + 1);
  if (!is_multicast (range.first) || !is_multicast (range.last) || range.first_port < 1 ||
      range.first_port % 2 != 0 || range.last_port <= range.first_port || range.last_port > 65535 ||
      range.ttl < 1 || range.ttl > 255)
    return bad_option ("--multicast", kExpected, text);
  return is_range (range) ||
         bad_option ("--multicast", "the first address before the second", text);
}

bool
parse_transports (const char *text, RtspOptions &options)
{
  gchar **names = g_strsplit (text, ",", -1);
  bool good = *names != nullptr, multicast = false;
  options.udp = options.tcp = false;
  for (gchar **name = names; *name && good; name++) {
    if (g_str_equal (*name, "udp"))
      options.udp = true;
    else if (g_str_equal (*name, "tcp"))
      options.tcp = true;
    else if (g_str_equal (*name, "multicast"))
      multicast = true;
    else
      good = false;
  }
  g_strfreev (names);
  if (!good)
    return bad_option ("--transports", "udp, tcp, multicast, or several with commas", text);
  return !multicast || !options.multicast.first.empty () ||
         bad_option ("--transports", "--multicast ADDRESS:PORT-PORT with multicast", text);
}

/* ---- all of them ---- */

struct Strings {
  gchar *address = nullptr, *mount = nullptr, *realm = nullptr, *users = nullptr;
  gchar *certificate = nullptr, *key = nullptr, *multicast = nullptr, *transports = nullptr;
  gchar **user = nullptr, **launch = nullptr;
  gboolean always = FALSE;

  ~Strings ()
  {
    for (gchar *text : {address, mount, realm, users, certificate, key, multicast, transports})
      g_free (text);
    g_strfreev (user);
    g_strfreev (launch);
  }
};

bool
check_numbers (const RtspOptions &options)
{
  struct {
    const char *option;
    int value, min, max;
  } const numbers[] = {{"--port", options.port, 0, 65535},
      {"--retransmission", options.retransmission_ms, 0, 10000},
      {"--max-viewers", options.max_viewers, 1, 100000},
      {"--send-buffer", options.send_buffer_kb, 4, 65536},
      {"--timeout", options.timeout_s, 5, 86400}, {"--linger", options.linger_s, 0, 86400},
      {"--stats", options.stats_s, 0, 3600}};
  for (const auto &number : numbers)
    if (number.value < number.min || number.value > number.max) {
      const std::string expected = "a whole number from " + std::to_string (number.min) + " to " +
                                   std::to_string (number.max);
      return bad_option (number.option, expected.c_str (), std::to_string (number.value));
    }
  return true;
}

bool
assign_strings (const Strings &strings, RtspOptions &options)
{
  const auto assign = [] (const gchar *from, std::string &to) {
    if (from)
      to = from;
  };
  assign (strings.address, options.address);
  assign (strings.mount, options.mount);
  assign (strings.realm, options.realm);
  if (options.realm.find_first_of ("\"\\") != std::string::npos)
    return bad_option ("--realm", "a name without quotation marks and backslashes", options.realm);
  for (const auto &[option, file] :
      {std::pair ("--cert", strings.certificate), {"--key", strings.key}})
    if (file && !*file)
      return bad_option (option, "a file", file);
  assign (strings.certificate, options.certificate_file);
  assign (strings.key, options.key_file);
  options.always = strings.always;
  if (options.mount.size () < 2 || options.mount[0] != '/')
    return bad_option ("--mount", "a path that begins with /", options.mount);
  if (options.key_file.empty ())
    options.key_file = options.certificate_file; /* one file with both */
  else if (options.certificate_file.empty ())
    return bad_option ("--key", "--cert with it", options.key_file);
  for (gchar **user = strings.user; user && *user; user++)
    if (!add_user (*user, "--user", options))
      return false;
  if (strings.users && !read_users (strings.users, options))
    return false;
  if (strings.multicast && !parse_multicast (strings.multicast, options.multicast))
    return false;
  if (strings.transports && !parse_transports (strings.transports, options))
    return false;
  if (!strings.transports && !options.certificate_file.empty ())
    options.udp = false; /* with TLS all that need not be SRTP */
  if (!strings.launch) {
    g_printerr ("rtsp-server: expected a launch string behind --, see --help\n");
    return false;
  }
  gchar *launch = g_strjoinv (" ", strings.launch);
  options.launch = g_strstrip (launch);
  g_free (launch);
  return true;
}

} // namespace

bool
parse_arguments (int argc, char **argv, RtspOptions &options)
{
  Strings strings;
  const GOptionEntry entries[] = {{"address", 0, 0, G_OPTION_ARG_STRING, &strings.address,
                                      "Address to listen at (default 0.0.0.0, all of IPv4)", "A"},
      {"port", 0, 0, G_OPTION_ARG_INT, &options.port, "TCP port (default 8554; 0: any)", "N"},
      {"mount", 0, 0, G_OPTION_ARG_STRING, &strings.mount, "Path of the URL (default /live)",
          "/PATH"},
      {"user", 0, 0, G_OPTION_ARG_STRING_ARRAY, &strings.user,
          "Who may watch; several times if need be (default: everybody)", "NAME:PASSWORD"},
      {"users", 0, 0, G_OPTION_ARG_FILENAME, &strings.users,
          "The same from a file, a line NAME:PASSWORD each", "FILE"},
      {"realm", 0, 0, G_OPTION_ARG_STRING, &strings.realm,
          "What players say when they ask for the password (default rangecast)", "TEXT"},
      {"cert", 0, 0, G_OPTION_ARG_FILENAME, &strings.certificate,
          "TLS certificate (PEM): the URL is rtsps://, and frame sets come inside TLS, too",
          "FILE"},
      {"key", 0, 0, G_OPTION_ARG_FILENAME, &strings.key,
          "Its private key (PEM; default: in the file of --cert)", "FILE"},
      {"transports", 0, 0, G_OPTION_ARG_STRING, &strings.transports,
          "udp, tcp, multicast, with commas (default: all; with --cert: tcp)", "LIST"},
      {"multicast", 0, 0, G_OPTION_ARG_STRING, &strings.multicast,
          "Offer multicast to these addresses and ports, TTL 1 by default",
          "ADDRESS[-ADDRESS]:PORT-PORT[/TTL]"},
      {"retransmission", 0, 0, G_OPTION_ARG_INT, &options.retransmission_ms,
          "Keep packets so long to send them again to who asks (default 0: none)", "MS"},
      {"max-viewers", 0, 0, G_OPTION_ARG_INT, &options.max_viewers,
          "Viewers at a time; more are refused (default 64)", "N"},
      {"send-buffer", 0, 0, G_OPTION_ARG_INT, &options.send_buffer_kb,
          "Bytes that may wait for a slow TCP viewer; frame sets beyond are left out (default 256)",
          "KB"},
      {"timeout", 0, 0, G_OPTION_ARG_INT, &options.timeout_s,
          "Forget viewers that have been silent for so long (default 30)", "S"},
      {"linger", 0, 0, G_OPTION_ARG_INT, &options.linger_s,
          "Go on for so long after the last viewer left (default 5)", "S"},
      {"always", 0, 0, G_OPTION_ARG_NONE, &strings.always,
          "Run from the start and without viewers, not only for them", nullptr},
      {"stats", 0, 0, G_OPTION_ARG_INT, &options.stats_s, "Print a line of numbers so often", "S"},
      {G_OPTION_REMAINING, 0, 0, G_OPTION_ARG_STRING_ARRAY, &strings.launch, nullptr, nullptr}, {}};
  GOptionContext *context =
      g_option_context_new ("-- LAUNCH STRING - serve coded frame sets over RTSP");
  g_option_context_set_description (context,
      "The launch string ends in coded frame sets (neighbourcodeenc, rangemux), or its payloader "
      "is named pay0.\n");
  g_option_context_add_main_entries (context, entries, nullptr);
  g_option_context_add_group (context, gst_init_get_option_group ());
  gchar **arguments = g_strdupv (argv); /* the parser takes what it knows out of it */
  GError *error = nullptr;
  const bool parsed = g_option_context_parse_strv (context, &arguments, &error);
  if (!parsed)
    g_printerr ("rtsp-server: %s\n", error->message);
  g_clear_error (&error);
  g_option_context_free (context);
  g_strfreev (arguments);
  wipe_passwords (argc, argv);
  return parsed && assign_strings (strings, options) && check_numbers (options);
}
