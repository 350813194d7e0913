/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "options.hpp"

#include <gst/gst.h>

#include <cstdio>
#include <string>

namespace {

bool
bad_option (const char *option, const char *expected, const char *got)
{
  g_printerr ("rangecast-viewer: %s: expected %s, got '%s'\n", option, expected, got);
  return false;
}

bool
check_numbers (const ViewerOptions &options)
{
  if (options.listen < 0 || options.listen > 65535)
    return bad_option (
        "--listen", "a port from 1 to 65535", std::to_string (options.listen).c_str ());
  if (options.audio < 0 || options.audio > 65535)
    return bad_option (
        "--audio", "a port from 1 to 65535", std::to_string (options.audio).c_str ());
  if (options.audio && !options.listen)
    return bad_option ("--audio", "--listen, too", std::to_string (options.audio).c_str ());
  if (options.latency_ms < 0 || options.latency_ms > 10000)
    return bad_option ("--latency", "0 to 10000 ms", std::to_string (options.latency_ms).c_str ());
  if (!(options.auto_orbit >= -3600 && options.auto_orbit <= 3600))
    return bad_option ("--auto-orbit", "-3600 to 3600 degrees per second",
        std::to_string (options.auto_orbit).c_str ());
  return true;
}

bool
check_size (ViewerOptions &options)
{
  char more = 0;
  if (options.size &&
      (std::sscanf (options.size, "%5dx%5d%c", &options.width, &options.height, &more) != 2 ||
          options.width < 16 || options.height < 16 || options.width > 8192 ||
          options.height > 8192))
    return bad_option ("--size", "WIDTHxHEIGHT, 16x16 to 8192x8192", options.size);
  return true;
}

bool
check_background (ViewerOptions &options)
{
  if (!options.background)
    return true;
  const std::string text = options.background;
  const bool is_hex = text.find_first_not_of ("0123456789abcdefABCDEF") == text.npos;
  if (!is_hex || (text.size () != 6 && text.size () != 8))
    return bad_option ("--background", "RRGGBB or AARRGGBB in hexadecimal", options.background);
  options.background_argb = guint (std::stoul (text, nullptr, 16));
  if (text.size () == 6)
    options.background_argb |= 0xff000000u;
  return true;
}

bool
check_mode (const ViewerOptions &options)
{
  const std::string mode = options.mode ? options.mode : "blend";
  if (mode != "blend" && mode != "strips" && mode != "rectangles" && mode != "points")
    return bad_option ("--mode", "blend, strips, rectangles or points", options.mode);
  return true;
}

bool
check_out (const ViewerOptions &options)
{
  if (options.out && !g_file_test (options.out, G_FILE_TEST_IS_DIR))
    return bad_option ("--out", "a folder", options.out);
  return true;
}

} // namespace

/* glimagesink itself would draw off-screen where OpenGL needs no display. */
bool
check_display ()
{
  const gchar *window = g_getenv ("GST_GL_WINDOW");
  const bool is_seen =
      g_strcmp0 (window, "egl-device") != 0 && g_strcmp0 (window, "surfaceless") != 0;
  if (!g_getenv ("DISPLAY") && !g_getenv ("WAYLAND_DISPLAY"))
    g_printerr (
        "rangecast-viewer: no display: neither DISPLAY nor WAYLAND_DISPLAY is set; without one, "
        "rangecast play --film and rangecast view --out write videos\n");
  else if (!is_seen)
    g_printerr (
        "rangecast-viewer: GST_GL_WINDOW=%s draws without a window; expected it to be unset\n",
        window);
  else
    return true;
  return false;
}

bool
parse_arguments (int *argc, char ***argv, const char *keys, ViewerOptions &options)
{
  const GOptionEntry entries[] = {{"listen", 0, 0, G_OPTION_ARG_INT, &options.listen,
                                      "Show the RTP stream that arrives at this UDP port", "PORT"},
      {"audio", 0, 0, G_OPTION_ARG_INT, &options.audio,
          "Play the speech that arrives at this UDP port, too", "PORT"},
      {"latency", 0, 0, G_OPTION_ARG_INT, &options.latency_ms,
          "Jitter buffer of RTP and RTSP (default 30)", "MS"},
      {"mode", 0, 0, G_OPTION_ARG_STRING, &options.mode,
          "blend (default), strips, rectangles or points", "MODE"},
      {"background", 0, 0, G_OPTION_ARG_STRING, &options.background, "Background colour", "RRGGBB"},
      {"size", 0, 0, G_OPTION_ARG_STRING, &options.size, "Picture size (default 640x480)", "WxH"},
      {"auto-orbit", 0, 0, G_OPTION_ARG_DOUBLE, &options.auto_orbit,
          "Orbit by itself, degrees per second (default 0)", "DEG"},
      {"once", 0, 0, G_OPTION_ARG_NONE, &options.once, "Quit at the end of a file (default: loop)",
          nullptr},
      {"out", 0, 0, G_OPTION_ARG_FILENAME, &options.out,
          "Folder for pictures and point clouds (default: current folder)", "FOLDER"},
      {G_OPTION_REMAINING, 0, 0, G_OPTION_ARG_FILENAME_ARRAY, &options.inputs, nullptr, nullptr},
      {}};
  GOptionContext *context =
      g_option_context_new ("FILE | URI | --listen PORT - show frame sets in a window");
  g_option_context_set_description (context, keys);
  g_option_context_add_main_entries (context, entries, nullptr);
  g_option_context_add_group (context, gst_init_get_option_group ());
  GError *error = nullptr;
  bool parsed = g_option_context_parse (context, argc, argv, &error);
  const guint inputs = options.inputs ? g_strv_length (options.inputs) : 0;
  if (!parsed)
    g_printerr ("rangecast-viewer: %s\n", error->message);
  else if (inputs + (options.listen != 0) != 1) {
    g_printerr ("rangecast-viewer: expected one file, one URI, or --listen PORT, see --help\n");
    parsed = false;
  }
  g_clear_error (&error);
  g_option_context_free (context);
  return parsed && check_numbers (options) && check_size (options) && check_background (options) &&
         check_mode (options) && check_out (options);
}

void
clear_options (ViewerOptions &options)
{
  g_free (options.background);
  g_free (options.size);
  g_free (options.mode);
  g_free (options.out);
  g_strfreev (options.inputs);
}
