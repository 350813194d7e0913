/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Shows a recording or a stream of frame sets in a window. striprender handles the mouse, through
 * navigation events of glimagesink; the viewer adds keys, a time bar and files. It uses public
 * elements only, so that applications can copy it.
 *
 * Threads: mouse and key events come from glimagesink's thread, frame sets and pictures from
 * streaming threads; all of them record what happened, and the main loop acts. */
#include <glib-unix.h>

#include <algorithm>
#include <clocale>

#include "common/dump-graph.hpp"
#include "viewer.hpp"

void
fail (Viewer &viewer, const std::string &text)
{
  g_printerr ("rangecast-viewer: %s\n", text.c_str ());
  viewer.failed = true;
  g_main_loop_quit (viewer.loop);
}

namespace {

/* glimagesink reports a closed window only when it draws. */
gboolean
poll_window (gpointer user_data)
{
  static_cast<Viewer *> (user_data)->playback->redraw_if_paused ();
  return G_SOURCE_CONTINUE;
}

/* Overlays fade while the picture stands still, too. */
gboolean
update_overlay (gpointer user_data)
{
  auto &viewer = *static_cast<Viewer *> (user_data);
  if (viewer.playback->is_paused () && viewer.overlay->is_stale ())
    viewer.playback->redraw_if_paused ();
  return G_SOURCE_CONTINUE;
}

/* Recordings are short: a file is played again from its beginning. */
void
finish (Viewer &viewer)
{
  if (!viewer.is_file || viewer.options.once)
    g_main_loop_quit (viewer.loop);
  else if (!viewer.playback->seek (0, false))
    fail (viewer, "the file cannot be looped: it is not seekable");
}

gboolean
warn_no_frame_sets (gpointer user_data)
{
  auto &viewer = *static_cast<Viewer *> (user_data);
  if (!viewer.seen_frames)
    g_printerr ("rangecast-viewer: no frame sets received yet; is the sender running?\n");
  return G_SOURCE_REMOVE;
}

/* ---- the run ---- */

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
      viewer.overlay->set_duration (viewer.is_file ? viewer.playback->duration () : 0);
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
  g_unix_signal_add (SIGINT, on_signal, &viewer);
  g_unix_signal_add (SIGTERM, on_signal, &viewer);
  g_timeout_add_seconds (5, warn_no_frame_sets, &viewer);
  g_timeout_add (500, poll_window, &viewer);
  g_timeout_add (100, update_overlay, &viewer);
  gst_element_set_state (viewer.pipeline, GST_STATE_PLAYING); /* errors are on the bus */
  g_main_loop_run (viewer.loop);
  gst_element_set_state (viewer.pipeline, GST_STATE_NULL);
  gst_bus_remove_watch (bus);
  gst_object_unref (bus);
}

void
clear (Viewer &viewer)
{
  gst_clear_object (&viewer.pipeline);
  if (viewer.frame_set)
    gst_sample_unref (viewer.frame_set);
  g_main_loop_unref (viewer.loop);
  clear_options (viewer.options);
}

/* The keys of a file, for --help. */
std::string
keys_text ()
{
  std::string text = "Keys:\n";
  for (const TextRow &row : key_rows (true))
    text += "  " + row.key +
            std::string (std::max<std::size_t> (14, row.key.size () + 2) - row.key.size (), ' ') +
            row.text + "\n";
  return text;
}

} // namespace

int
main (int argc, char **argv)
{
  setlocale (LC_CTYPE, ""); /* arguments are in the user's encoding */
  Viewer viewer;
  if (!parse_arguments (&argc, &argv, keys_text ().c_str (), viewer.options)) {
    clear_options (viewer.options);
    return 2;
  }
  viewer.loop = g_main_loop_new (nullptr, FALSE);
  const bool built = build_pipeline (viewer) && check_display ();
  if (built)
    show (viewer);
  clear (viewer);
  return built && !viewer.failed ? 0 : 1;
}
