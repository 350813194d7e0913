/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Shows a recording or a stream of frame sets in a window. The mouse turns, moves and zooms (that
 * is striprender's doing: glimagesink sends it what the mouse and keys do); keys write pictures and
 * point clouds. Everything goes through public elements, so it can be copied into an application.
 *
 * Threads: keys arrive in glimagesink's, frame sets in a streaming thread; both only leave word,
 * and the main loop acts. Of what they share, `lock` guards the last frame set. */
#include <glib-unix.h>
#include <gst/app/gstappsrc.h>
#include <gst/gst.h>
#include <gst/video/video.h>

#include <algorithm>
#include <atomic>
#include <clocale>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <mutex>
#include <string>

#include "viewer-options.hpp"

static const char kRtpCaps[] =
    "application/x-rtp,media=application,clock-rate=90000,encoding-name=X-NEIGHBOUR-CODE";

struct Viewer {
  ViewerOptions options;
  GstElement *pipeline = nullptr;
  GstElement *first = nullptr;  /* what takes frame sets */
  GstElement *render = nullptr; /* striprender */
  GstElement *size = nullptr;   /* capsfilter behind it */
  GstElement *sink = nullptr;
  GMainLoop *loop = nullptr;
  bool is_file = false;
  bool failed = false;
  bool paused = false;
  bool seeking = false, redraw_again = false; /* redrawing while paused, see redraw() */
  int patience = 0;                           /* times that write_picture() waits on */
  std::atomic<bool> seen_frames = false;

  std::mutex lock;
  GstSample *frame_set = nullptr; /* the last one drawn */
  GstClockTime last_pts = GST_CLOCK_TIME_NONE;
};

static void
fail (Viewer &viewer, const std::string &text)
{
  g_printerr ("rangecast-viewer: %s\n", text.c_str ());
  viewer.failed = true;
  g_main_loop_quit (viewer.loop);
}

/* ---- files on a key ---- */

/* The first name in the folder that is free. */
static std::string
free_name (const Viewer &viewer, const char *extension)
{
  const char *folder = viewer.options.out ? viewer.options.out : ".";
  for (int i = 1;; i++) {
    gchar *name = g_strdup_printf ("%s/rangecast-%04d.%s", folder, i, extension);
    const std::string path = name;
    g_free (name);
    if (!g_file_test (path.c_str (), G_FILE_TEST_EXISTS))
      return path;
  }
}

static void
write_file (const std::string &path, GstBuffer *buffer)
{
  GstMapInfo map;
  if (!gst_buffer_map (buffer, &map, GST_MAP_READ)) {
    g_printerr ("rangecast-viewer: %s: cannot read what was to be written\n", path.c_str ());
    return;
  }
  GError *error = nullptr;
  if (g_file_set_contents (
          path.c_str (), reinterpret_cast<const gchar *> (map.data), gssize (map.size), &error))
    std::printf ("wrote %s\n", path.c_str ());
  else
    g_printerr ("rangecast-viewer: %s\n", error->message);
  std::fflush (stdout);
  g_clear_error (&error);
  gst_buffer_unmap (buffer, &map);
}

static bool
write_last_picture (Viewer &viewer)
{
  GstSample *sample = nullptr;
  g_object_get (viewer.sink, "last-sample", &sample, nullptr);
  if (!sample)
    return false;
  GError *error = nullptr;
  GstCaps *png = gst_caps_new_empty_simple ("image/png");
  GstSample *converted = gst_video_convert_sample (sample, png, 10 * GST_SECOND, &error);
  gst_caps_unref (png);
  gst_sample_unref (sample);
  if (converted) {
    write_file (free_name (viewer, "png"), gst_sample_get_buffer (converted));
    gst_sample_unref (converted);
  } else {
    g_printerr (
        "rangecast-viewer: no PNG of the picture: %s\n", error ? error->message : "unknown error");
  }
  g_clear_error (&error);
  return true;
}

/* Before the first picture, and where a file begins again, there is none for a moment. */
static gboolean
write_picture (gpointer user_data)
{
  auto &viewer = *static_cast<Viewer *> (user_data);
  if (write_last_picture (viewer))
    return G_SOURCE_REMOVE;
  if (viewer.patience-- > 0)
    return G_SOURCE_CONTINUE;
  g_printerr ("rangecast-viewer: there is no picture yet\n");
  return G_SOURCE_REMOVE;
}

static GstSample *
take_frame_set (Viewer &viewer)
{
  std::lock_guard guard (viewer.lock);
  return viewer.frame_set ? gst_sample_ref (viewer.frame_set) : nullptr;
}

/* Says how the writing of a file ended. */
static void
tell_end (GstElement *pipeline, const std::string &path)
{
  GstBus *bus = gst_element_get_bus (pipeline);
  GstMessage *message = gst_bus_timed_pop_filtered (
      bus, 10 * GST_SECOND, GstMessageType (GST_MESSAGE_EOS | GST_MESSAGE_ERROR));
  GError *error = nullptr;
  if (message && GST_MESSAGE_TYPE (message) == GST_MESSAGE_ERROR)
    gst_message_parse_error (message, &error, nullptr);
  if (message && !error)
    std::printf ("wrote %s\n", path.c_str ());
  else
    g_printerr ("rangecast-viewer: %s: %s\n", path.c_str (),
        error ? error->message : "writing takes too long");
  std::fflush (stdout);
  g_clear_error (&error);
  if (message)
    gst_message_unref (message);
  gst_object_unref (bus);
}

/* Another pipeline, for the one frame set. */
static void
write_points (Viewer &viewer)
{
  GstSample *sample = take_frame_set (viewer);
  if (!sample) {
    g_printerr ("rangecast-viewer: there are no points yet\n");
    return;
  }
  GError *error = nullptr;
  GstElement *encoder = gst_parse_launch_full (
      "appsrc name=in format=time ! plyenc normals=true view-id=true ! filesink name=out", nullptr,
      GST_PARSE_FLAG_FATAL_ERRORS, &error);
  if (encoder) {
    GstElement *in = gst_bin_get_by_name (GST_BIN (encoder), "in");
    GstElement *out = gst_bin_get_by_name (GST_BIN (encoder), "out");
    const std::string path = free_name (viewer, "ply");
    g_object_set (out, "location", path.c_str (), nullptr);
    gst_element_set_state (encoder, GST_STATE_PLAYING);
    gst_app_src_push_sample (GST_APP_SRC (in), sample);
    gst_app_src_end_of_stream (GST_APP_SRC (in));
    tell_end (encoder, path);
    gst_element_set_state (encoder, GST_STATE_NULL);
    gst_object_unref (in);
    gst_object_unref (out);
    gst_object_unref (encoder);
  } else {
    g_printerr ("rangecast-viewer: no point cloud: %s\n", error->message);
  }
  g_clear_error (&error);
  gst_sample_unref (sample);
}

/* ---- playing ---- */

/* While a file is paused nothing is drawn. So that the view can be turned all the same, the file is
 * sought to where it is: the frame set there comes again. */
static void
redraw (Viewer &viewer)
{
  gint64 position = 0;
  if (viewer.seeking) {
    viewer.redraw_again = true;
    return;
  }
  viewer.redraw_again = false;
  if (gst_element_query_position (viewer.pipeline, GST_FORMAT_TIME, &position))
    viewer.seeking = gst_element_seek_simple (viewer.pipeline, GST_FORMAT_TIME,
        GstSeekFlags (GST_SEEK_FLAG_FLUSH | GST_SEEK_FLAG_ACCURATE), position);
}

static gboolean
redraw_if_paused (gpointer user_data)
{
  auto &viewer = *static_cast<Viewer *> (user_data);
  if (viewer.paused)
    redraw (viewer);
  return G_SOURCE_REMOVE;
}

static void
on_view_changed (GObject *, GParamSpec *, gpointer user_data)
{
  g_idle_add (redraw_if_paused, user_data);
}

/* That its window was closed glimagesink tells with its next picture only. */
static gboolean
look_for_window (gpointer user_data)
{
  auto &viewer = *static_cast<Viewer *> (user_data);
  if (viewer.paused && !viewer.seeking)
    redraw (viewer);
  return G_SOURCE_CONTINUE;
}

static void
toggle_pause (Viewer &viewer)
{
  if (!viewer.is_file)
    return;
  viewer.paused = !viewer.paused;
  gst_element_set_state (viewer.pipeline, viewer.paused ? GST_STATE_PAUSED : GST_STATE_PLAYING);
}

/* Recordings are short: at its end a file begins again. */
static void
finish (Viewer &viewer)
{
  if (!viewer.is_file || viewer.options.once)
    g_main_loop_quit (viewer.loop);
  else if (!gst_element_seek_simple (viewer.pipeline, GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH, 0))
    fail (viewer, "the file cannot be played again: it has no times to go back to");
}

/* ---- keys ---- */

struct KeyPress {
  Viewer *viewer;
  std::string key;
};

static gboolean
act_on_key (gpointer user_data)
{
  auto press = static_cast<KeyPress *> (user_data);
  Viewer &viewer = *press->viewer;
  if (press->key == "s") {
    viewer.patience = 20;
    if (write_picture (&viewer))
      g_timeout_add (100, write_picture, &viewer);
  } else if (press->key == "p")
    write_points (viewer);
  else if (press->key == "space")
    toggle_pause (viewer);
  else if (press->key == "h")
    std::printf ("%s", kViewerKeys);
  else
    g_main_loop_quit (viewer.loop);
  std::fflush (stdout);
  return G_SOURCE_REMOVE;
}

/* Takes our keys out of what goes up to striprender. */
static GstPadProbeReturn
on_event (GstPad *, GstPadProbeInfo *info, gpointer user_data)
{
  GstEvent *event = GST_PAD_PROBE_INFO_EVENT (info);
  if (GST_EVENT_TYPE (event) != GST_EVENT_NAVIGATION)
    return GST_PAD_PROBE_OK;
  const GstNavigationEventType type = gst_navigation_event_get_type (event);
  const gchar *name = nullptr;
  if ((type != GST_NAVIGATION_EVENT_KEY_PRESS && type != GST_NAVIGATION_EVENT_KEY_RELEASE) ||
      !gst_navigation_event_parse_key_event (event, &name) || !name)
    return GST_PAD_PROBE_OK;
  const std::string key = name;
  const char *ours[] = {"s", "p", "space", "h", "q", "Escape"};
  if (std::find (std::begin (ours), std::end (ours), key) == std::end (ours))
    return GST_PAD_PROBE_OK;
  if (type == GST_NAVIGATION_EVENT_KEY_PRESS)
    g_idle_add_full (G_PRIORITY_DEFAULT, act_on_key,
        new KeyPress{static_cast<Viewer *> (user_data), key},
        [] (gpointer press) { delete static_cast<KeyPress *> (press); });
  gst_event_unref (event);
  return GST_PAD_PROBE_HANDLED;
}

/* ---- frame sets ---- */

/* Turns on by the time that has passed in the file, so that it neither jumps where the file begins
 * anew nor goes on while it is paused, as striprender's auto-orbit would. */
static void
turn_on (Viewer &viewer, GstClockTime pts)
{
  const GstClockTime last = viewer.last_pts;
  viewer.last_pts = pts;
  if (viewer.options.auto_orbit == 0 || !GST_CLOCK_TIME_IS_VALID (last) ||
      !GST_CLOCK_TIME_IS_VALID (pts) || pts <= last || pts - last > GST_SECOND)
    return;
  gdouble azimuth = 0;
  g_object_get (viewer.render, "azimuth", &azimuth, nullptr);
  azimuth += viewer.options.auto_orbit * double (pts - last) / GST_SECOND;
  g_object_set (viewer.render, "azimuth", std::remainder (azimuth, 360.0), nullptr);
}

static GstPadProbeReturn
on_frame_set (GstPad *pad, GstPadProbeInfo *info, gpointer user_data)
{
  auto &viewer = *static_cast<Viewer *> (user_data);
  GstBuffer *buffer = GST_PAD_PROBE_INFO_BUFFER (info);
  GstCaps *caps = gst_pad_get_current_caps (pad);
  GstSample *sample = gst_sample_new (buffer, caps, nullptr, nullptr);
  gst_clear_caps (&caps);
  viewer.seen_frames = true;
  if (viewer.is_file)
    turn_on (viewer, GST_BUFFER_PTS (buffer));
  std::unique_lock guard (viewer.lock);
  std::swap (sample, viewer.frame_set);
  guard.unlock ();
  if (sample)
    gst_sample_unref (sample);
  return GST_PAD_PROBE_OK;
}

static gboolean
say_that_nothing_comes (gpointer user_data)
{
  auto &viewer = *static_cast<Viewer *> (user_data);
  if (!viewer.seen_frames)
    g_printerr ("rangecast-viewer: nothing to show yet; is somebody sending?\n");
  return G_SOURCE_REMOVE;
}

/* ---- the pipeline ---- */

static GstElement *
add (Viewer &viewer, const char *factory)
{
  GstElement *element = gst_element_factory_make (factory, nullptr);
  if (!element) {
    g_printerr ("rangecast-viewer: there is no element %s: expected GST_PLUGIN_PATH to lead to the "
                "plugins of "
                "gst-rangecast, as pipelines/env.sh does, and gst-plugins-base and -good\n",
        factory);
    std::exit (1);
  }
  gst_bin_add (GST_BIN (viewer.pipeline), element);
  return element;
}

static void
set_picture_size (Viewer &viewer, int width, int height)
{
  GstCaps *caps = gst_caps_new_simple (
      "video/x-raw", "width", G_TYPE_INT, width, "height", G_TYPE_INT, height, nullptr);
  gst_caps_set_features (caps, 0, gst_caps_features_new ("memory:GLMemory", nullptr));
  g_object_set (viewer.size, "caps", caps, nullptr);
  gst_caps_unref (caps);
}

struct Reshape {
  Viewer *viewer;
  int width, height; /* pixels */
};

static gboolean
follow_window (gpointer user_data)
{
  auto reshape = static_cast<Reshape *> (user_data);
  set_picture_size (*reshape->viewer, reshape->width, reshape->height);
  redraw_if_paused (reshape->viewer);
  return G_SOURCE_REMOVE;
}

/* A larger window shows a larger picture, not a stretched one. */
static gboolean
on_reshape (GstElement *, gpointer, guint width, guint height, gpointer user_data)
{
  auto &viewer = *static_cast<Viewer *> (user_data);
  if (viewer.seen_frames && std::min (width, height) >= 16)
    g_idle_add_full (G_PRIORITY_DEFAULT, follow_window,
        new Reshape{&viewer, int (width), int (height)},
        [] (gpointer reshape) { delete static_cast<Reshape *> (reshape); });
  return FALSE; /* glimagesink does its own part */
}

static void
add_probe (GstElement *element, const char *pad_name, GstPadProbeType type,
    GstPadProbeCallback probe, Viewer &viewer)
{
  GstPad *pad = gst_element_get_static_pad (element, pad_name);
  gst_pad_add_probe (pad, type, probe, &viewer, nullptr);
  gst_object_unref (pad);
}

/* Frame sets to the window. */
static void
build_view (Viewer &viewer)
{
  const ViewerOptions &options = viewer.options;
  viewer.first = add (viewer, "queue");
  viewer.render = add (viewer, "striprender");
  viewer.size = add (viewer, "capsfilter");
  viewer.sink = add (viewer, "glimagesink");
  g_object_set (viewer.first, "max-size-buffers", 2, "max-size-bytes", 0, "max-size-time",
      guint64 (0), nullptr);
  set_picture_size (viewer, options.width, options.height);
  if (options.background)
    g_object_set (viewer.render, "background", options.background_argb, nullptr);
  if (options.mode)
    gst_util_set_object_arg (G_OBJECT (viewer.render), "mode", options.mode);
  if (!viewer.is_file)
    g_object_set (viewer.render, "auto-orbit", options.auto_orbit, nullptr);
  if (!viewer.is_file) /* the view turns while the stream stalls, too */
    g_object_set (viewer.render, "keep-rate", TRUE, nullptr);
  GstElement *before = viewer.first;
  if (!options.no_filter) {
    before = add (viewer, "cylinderfilter");
    gst_element_link (viewer.first, before);
  }
  gst_element_link_many (before, viewer.render, viewer.size, viewer.sink, nullptr);
  add_probe (viewer.render, "sink", GST_PAD_PROBE_TYPE_BUFFER, on_frame_set, viewer);
  add_probe (viewer.render, "src", GST_PAD_PROBE_TYPE_EVENT_UPSTREAM, on_event, viewer);
  g_signal_connect (viewer.sink, "client-reshape", G_CALLBACK (on_reshape), &viewer);
  g_signal_connect (viewer.render, "notify", G_CALLBACK (on_view_changed), &viewer);
}

static void
build_receiver (Viewer &viewer)
{
  GstElement *source = add (viewer, "udpsrc"), *jitter = add (viewer, "rtpjitterbuffer"),
             *depayloader = add (viewer, "rtpneighbourcodedepay"), *queue = add (viewer, "queue"),
             *decoder = add (viewer, "neighbourcodedec");
  GstCaps *caps = gst_caps_from_string (kRtpCaps);
  g_object_set (source, "port", viewer.options.listen, "reuse", FALSE, "buffer-size", 4 << 20,
      "caps", caps, nullptr);
  gst_caps_unref (caps);
  g_object_set (jitter, "latency", viewer.options.latency_ms, nullptr);
  g_object_set (queue, "max-size-buffers", 4, nullptr);
  gst_util_set_object_arg (G_OBJECT (queue), "leaky", "downstream");
  gst_element_link_many (source, jitter, depayloader, queue, decoder, viewer.first, nullptr);
}

static void
on_pad_added (GstElement *, GstPad *pad, gpointer user_data)
{
  auto &viewer = *static_cast<Viewer *> (user_data);
  GstPad *sink = gst_element_get_static_pad (viewer.first, "sink");
  GstCaps *caps = gst_pad_get_current_caps (pad);
  const GstStructure *structure = caps ? gst_caps_get_structure (caps, 0) : nullptr;
  if (structure && gst_structure_has_name (structure, "video/x-range") && !gst_pad_is_linked (sink))
    gst_pad_link (pad, sink);
  gst_object_unref (sink);
  gst_clear_caps (&caps);
}

static gboolean
refuse_input (gpointer user_data)
{
  auto &viewer = *static_cast<Viewer *> (user_data);
  if (!viewer.failed)
    fail (viewer, std::string (viewer.options.inputs[0]) +
                      ": expected range frame sets (a .rcnc recording, or a stream of them)");
  return G_SOURCE_REMOVE;
}

static void
on_no_more_pads (GstElement *, gpointer user_data)
{
  auto &viewer = *static_cast<Viewer *> (user_data);
  GstPad *sink = gst_element_get_static_pad (viewer.first, "sink");
  if (!gst_pad_is_linked (sink))
    g_idle_add (refuse_input, &viewer);
  gst_object_unref (sink);
}

static void
on_source_setup (GstElement *, GstElement *source, gpointer user_data)
{
  auto &viewer = *static_cast<Viewer *> (user_data);
  if (g_object_class_find_property (G_OBJECT_GET_CLASS (source), "latency"))
    g_object_set (source, "latency", viewer.options.latency_ms, nullptr);
}

static void
build_opener (Viewer &viewer, const char *uri)
{
  GstElement *opener = add (viewer, "uridecodebin");
  GstCaps *caps = gst_caps_new_empty_simple ("video/x-range");
  g_object_set (opener, "uri", uri, "caps", caps, nullptr);
  gst_caps_unref (caps);
  g_signal_connect (opener, "pad-added", G_CALLBACK (on_pad_added), &viewer);
  g_signal_connect (opener, "no-more-pads", G_CALLBACK (on_no_more_pads), &viewer);
  g_signal_connect (opener, "source-setup", G_CALLBACK (on_source_setup), &viewer);
}

/* Whether a plugin opens such URIs; says it if not. */
static bool
is_supported (const char *uri)
{
  gchar *scheme = gst_uri_get_protocol (uri);
  const bool supported = scheme && gst_uri_protocol_is_supported (GST_URI_SRC, scheme);
  if (!supported)
    g_printerr (
        "rangecast-viewer: %s: no plugin of GStreamer opens %s://\n", uri, scheme ? scheme : "");
  g_free (scheme);
  return supported;
}

/* The input as a URI; nullptr after saying why there is none. */
static gchar *
input_uri (const char *input)
{
  if (gst_uri_is_valid (input))
    return is_supported (input) ? g_strdup (input) : nullptr;
  if (g_file_test (input, G_FILE_TEST_IS_REGULAR))
    return gst_filename_to_uri (input, nullptr);
  g_printerr ("rangecast-viewer: %s: %s\n", input,
      g_file_test (input, G_FILE_TEST_IS_DIR)   ? "is a folder; expected a .rcnc recording in it"
      : g_file_test (input, G_FILE_TEST_EXISTS) ? "is no ordinary file; expected a .rcnc recording"
                                                : "no such file");
  return nullptr;
}

static bool
build (Viewer &viewer)
{
  viewer.pipeline = gst_pipeline_new (nullptr);
  gchar *uri = nullptr;
  if (viewer.options.inputs) {
    uri = input_uri (viewer.options.inputs[0]);
    if (!uri)
      return false;
    viewer.is_file = g_str_has_prefix (uri, "file:");
  }
  build_view (viewer);
  if (uri)
    build_opener (viewer, uri);
  else
    build_receiver (viewer);
  g_free (uri);
  return true;
}

/* ---- the run ---- */

/* The last line of what an element says to those who debug it: often the only one that names names.
 */
static std::string
last_line (const gchar *text)
{
  std::string all = text ? text : "";
  all.erase (all.find_last_not_of ('\n') + 1);
  return all.substr (all.rfind ('\n') + 1);
}

/* What is not a file of ours either has no type that GStreamer knows, or one that does not lead to
 * range frame sets. */
static bool
is_wrong_type (const GError *error)
{
  return g_error_matches (error, GST_STREAM_ERROR, GST_STREAM_ERROR_TYPE_NOT_FOUND) ||
         g_error_matches (error, GST_CORE_ERROR, GST_CORE_ERROR_MISSING_PLUGIN);
}

static void
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
  else if (viewer.failed) /* the first error is the one that tells */
    ;
  else if (viewer.options.inputs && is_wrong_type (error))
    refuse_input (&viewer);
  else
    fail (viewer, (is_sink ? "no window: " : input + ": ") + error->message + " (" +
                      last_line (details) + ")");
  g_free (details);
  g_error_free (error);
}

static gboolean
on_message (GstBus *, GstMessage *message, gpointer user_data)
{
  auto &viewer = *static_cast<Viewer *> (user_data);
  switch (GST_MESSAGE_TYPE (message)) {
    case GST_MESSAGE_ERROR:
      on_error (viewer, message);
      break;
    case GST_MESSAGE_EOS:
      finish (viewer);
      break;
    case GST_MESSAGE_ASYNC_DONE:
      viewer.seeking = false;
      if (viewer.redraw_again)
        redraw (viewer);
      break;
    case GST_MESSAGE_LATENCY:
      gst_bin_recalculate_latency (GST_BIN (viewer.pipeline));
      break;
    default:
      break;
  }
  return G_SOURCE_CONTINUE;
}

static gboolean
on_signal (gpointer user_data)
{
  g_main_loop_quit (static_cast<Viewer *> (user_data)->loop);
  return G_SOURCE_CONTINUE;
}

static void
show (Viewer &viewer)
{
  GstBus *bus = gst_element_get_bus (viewer.pipeline);
  gst_bus_add_watch (bus, on_message, &viewer);
  g_unix_signal_add (SIGINT, on_signal, &viewer);
  g_unix_signal_add (SIGTERM, on_signal, &viewer);
  g_timeout_add_seconds (5, say_that_nothing_comes, &viewer);
  g_timeout_add (500, look_for_window, &viewer);
  gst_element_set_state (viewer.pipeline, GST_STATE_PLAYING); /* errors are on the bus */
  g_main_loop_run (viewer.loop);
  gst_element_set_state (viewer.pipeline, GST_STATE_NULL);
  gst_bus_remove_watch (bus);
  gst_object_unref (bus);
}

static void
clear (Viewer &viewer)
{
  gst_clear_object (&viewer.pipeline);
  if (viewer.frame_set)
    gst_sample_unref (viewer.frame_set);
  g_main_loop_unref (viewer.loop);
  clear_options (viewer.options);
}

int
main (int argc, char **argv)
{
  setlocale (LC_CTYPE, ""); /* arguments are in the user's encoding */
  Viewer viewer;
  if (!parse_arguments (&argc, &argv, viewer.options)) {
    clear_options (viewer.options);
    return 2;
  }
  viewer.loop = g_main_loop_new (nullptr, FALSE);
  const bool built = build (viewer) && check_display ();
  if (built)
    show (viewer);
  clear (viewer);
  return built && !viewer.failed ? 0 : 1;
}
