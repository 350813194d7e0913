/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Shows a recording or a stream of frame sets in a window. striprender handles the mouse, through
 * navigation events of glimagesink; the viewer adds keys and files. It uses public
 * elements only, so that applications can copy it.
 *
 * Threads: mouse and key events come from glimagesink's thread, frame sets and drawn frames from
 * streaming threads; all of them record what happened, and the main loop acts. */
#include <algorithm>
#include <clocale>
#include <cstdio>

#include "common/dump-graph.hpp"
#include "common/final-signal.hpp"
#include "viewer.hpp"

void
fail (Viewer &viewer, const std::string &text)
{
  g_printerr ("rangecast-viewer: %s\n", text.c_str ());
  viewer.failed = true;
  g_main_loop_quit (viewer.loop);
}

namespace {

/* ---- the command line ---- */

/* @return false after saying what is wrong */
bool
check_options (ViewerOptions &o)
{
  char more = 0;
  const bool has_size =
      !o.size || std::sscanf (o.size, "%5dx%5d%c", &o.width, &o.height, &more) == 2;
  const auto is_port = [] (int port) { return port >= 0 && port <= 65535; };
  const struct {
    bool right;
    const char *needs;
  } rules[] = {
      {(o.inputs ? g_strv_length (o.inputs) : 0) + (o.listen != 0) == 1,
          "needs one file, one URI, or --listen PORT; see --help"},
      {is_port (o.listen), "--listen needs a port from 1 to 65535"},
      {is_port (o.audio), "--audio needs a port from 1 to 65535"},
      {!o.audio || o.listen, "--audio needs --listen, too"},
      {o.latency_ms >= 0 && o.latency_ms <= 10000, "--latency needs 0 to 10000 ms"},
      {has_size && std::min (o.width, o.height) >= 16 && std::max (o.width, o.height) <= 8192,
          "--size needs WIDTHxHEIGHT, 16x16 to 8192x8192"},
      {!o.out || g_file_test (o.out, G_FILE_TEST_IS_DIR), "--out needs a folder that exists"},
  };
  for (const auto &[right, needs] : rules)
    if (!right) {
      g_printerr ("rangecast-viewer: %s\n", needs);
      return false;
    }
  return true;
}

bool
parse_arguments (int *argc, char ***argv, ViewerOptions &o)
{
  const GOptionEntry entries[] = {{"listen", 0, 0, G_OPTION_ARG_INT, &o.listen,
                                      "Show the RTP stream that arrives at this UDP port", "PORT"},
      {"audio", 0, 0, G_OPTION_ARG_INT, &o.audio,
          "Play the audio that arrives at this UDP port, too", "PORT"},
      {"latency", 0, 0, G_OPTION_ARG_INT, &o.latency_ms,
          "Jitter buffer of RTP and RTSP (default 30)", "MS"},
      {"render", 0, 0, G_OPTION_ARG_STRING, &o.render,
          "Properties of striprender, such as 'mode=strips auto-orbit=30'", "PROPERTIES"},
      {"size", 0, 0, G_OPTION_ARG_STRING, &o.size, "Frame size (default 640x480)", "WxH"},
      {"once", 0, 0, G_OPTION_ARG_NONE, &o.once, "Quit at the end of a file (default: loop)",
          nullptr},
      {"out", 0, 0, G_OPTION_ARG_FILENAME, &o.out,
          "Folder for images and point clouds (default: current folder)", "FOLDER"},
      {G_OPTION_REMAINING, 0, 0, G_OPTION_ARG_FILENAME_ARRAY, &o.inputs, nullptr, nullptr}, {}};
  GOptionContext *context =
      g_option_context_new ("FILE | URI | --listen PORT - show frame sets in a window");
  g_option_context_set_description (context, kKeyHelp);
  g_option_context_add_main_entries (context, entries, nullptr);
  g_option_context_add_group (context, gst_init_get_option_group ());
  GError *error = nullptr;
  const bool parsed = g_option_context_parse (context, argc, argv, &error);
  if (!parsed)
    g_printerr ("rangecast-viewer: %s\n", error->message);
  g_clear_error (&error);
  g_option_context_free (context);
  return parsed && check_options (o);
}

/* glimagesink itself would draw off-screen where OpenGL needs no display. */
bool
check_display ()
{
  if (g_getenv ("DISPLAY") || g_getenv ("WAYLAND_DISPLAY"))
    return true;
  g_printerr (
      "rangecast-viewer: no display: neither DISPLAY nor WAYLAND_DISPLAY is set; without one, "
      "rangecast convert makes a film of a recording, and rangecast view --video one of a "
      "stream\n");
  return false;
}

/* ---- messages ---- */

/* Recordings are short: a file is played again from its beginning. */
void
finish (Viewer &viewer)
{
  if (!viewer.is_file || viewer.options.once)
    g_main_loop_quit (viewer.loop);
  else if (!viewer.playback->seek (0, false))
    fail (viewer, "the file cannot be looped: it is not seekable");
}

/* Of an error's debug text: often the only line that names the cause. */
std::string
last_line (const gchar *text)
{
  std::string all = text ? text : "";
  all.erase (all.find_last_not_of ('\n') + 1);
  return all.substr (all.rfind ('\n') + 1);
}

/* A foreign file has no type that GStreamer knows, or one that does not decode to frame sets. */
bool
is_wrong_type (const GError *error)
{
  return g_error_matches (error, GST_STREAM_ERROR, GST_STREAM_ERROR_TYPE_NOT_FOUND) ||
         g_error_matches (error, GST_CORE_ERROR, GST_CORE_ERROR_MISSING_PLUGIN);
}

void
on_error (Viewer &viewer, GstMessage *message)
{
  GError *error = nullptr;
  gchar *details = nullptr;
  gst_message_parse_error (message, &error, &details);
  const bool is_sink = gst_object_has_as_ancestor (message->src, GST_OBJECT (viewer.sink));
  const std::string input = viewer.options.inputs
                                ? std::string (viewer.options.inputs[0])
                                : "port " + std::to_string (viewer.options.listen);
  if (is_sink && g_error_matches (error, GST_RESOURCE_ERROR, GST_RESOURCE_ERROR_NOT_FOUND) &&
      viewer.seen_frames) /* its window was closed */
    g_main_loop_quit (viewer.loop);
  else if (viewer.failed) /* the first error names the cause */
    ;
  else if (viewer.options.inputs && is_wrong_type (error))
    refuse_input (&viewer);
  else
    fail (viewer, (is_sink ? "no window: " : input + ": ") + error->message + " (" +
                      last_line (details) + ")");
  g_free (details);
  g_error_free (error);
}

gboolean
on_message (GstBus *, GstMessage *message, gpointer user_data)
{
  auto &viewer = *static_cast<Viewer *> (user_data);
  dump_graph (message, "rangecast-viewer");
  switch (GST_MESSAGE_TYPE (message)) {
    case GST_MESSAGE_ERROR:
      on_error (viewer, message);
      break;
    case GST_MESSAGE_EOS:
      finish (viewer);
      break;
    case GST_MESSAGE_ASYNC_DONE:
      viewer.playback->seek_done ();
      break;
    case GST_MESSAGE_ELEMENT:
      handle_missed_event (viewer, message);
      break;
    case GST_MESSAGE_LATENCY:
      gst_bin_recalculate_latency (GST_BIN (viewer.pipeline));
      break;
    default:
      break;
  }
  return G_SOURCE_CONTINUE;
}

/* ---- the run ---- */

/* glimagesink reports a closed window only when it draws. */
gboolean
poll_window (gpointer user_data)
{
  static_cast<Viewer *> (user_data)->playback->redraw_if_paused ();
  return G_SOURCE_CONTINUE;
}

gboolean
warn_no_frame_sets (gpointer user_data)
{
  if (!static_cast<Viewer *> (user_data)->seen_frames)
    g_printerr ("rangecast-viewer: no frame sets received yet; is the sender running?\n");
  return G_SOURCE_REMOVE;
}

gboolean
on_signal (gpointer user_data)
{
  g_main_loop_quit (static_cast<Viewer *> (user_data)->loop);
  return G_SOURCE_CONTINUE;
}

void
show (Viewer &viewer)
{
  GstBus *bus = gst_element_get_bus (viewer.pipeline);
  gst_bus_add_watch (bus, on_message, &viewer);
  add_final_signals (on_signal, &viewer);
  g_timeout_add_seconds (5, warn_no_frame_sets, &viewer);
  g_timeout_add (500, poll_window, &viewer);
  gst_element_set_state (viewer.pipeline, GST_STATE_PLAYING); /* errors are on the bus */
  g_main_loop_run (viewer.loop);
  gst_element_set_state (viewer.pipeline, GST_STATE_NULL);
  gst_bus_remove_watch (bus);
  gst_object_unref (bus);
}

} // namespace

int
main (int argc, char **argv)
{
  setlocale (LC_CTYPE, ""); /* arguments are in the user's encoding */
  Viewer viewer;
  if (!parse_arguments (&argc, &argv, viewer.options))
    return 2;
  viewer.loop = g_main_loop_new (nullptr, FALSE);
  const bool built = build_pipeline (viewer) && check_display ();
  if (built)
    show (viewer);
  gst_clear_object (&viewer.pipeline);
  if (viewer.frame_set)
    gst_sample_unref (viewer.frame_set);
  g_main_loop_unref (viewer.loop);
  return built && !viewer.failed ? 0 : 1;
}
