/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The viewer's pipeline: a file, a URI or RTP, to the window. */
#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "viewer.hpp"

namespace {

const char kRtpCaps[] =
    "application/x-rtp,media=video,clock-rate=90000,encoding-name=X-NEIGHBOUR-CODE";

const char kHint[] = "drag to turn, wheel to zoom, h for all keys";

/* ---- frame sets ---- */

/* Orbits by stream time. striprender's auto-orbit goes by running time: it would jump where a file
 * begins again, and go on while it is paused. */
void
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

GstPadProbeReturn
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

} // namespace

GstElement *
add_element (Viewer &viewer, const char *factory)
{
  GstElement *element = gst_element_factory_make (factory, nullptr);
  if (!element) {
    g_printerr ("rangecast-viewer: no element %s: expected GST_PLUGIN_PATH to name the folder of "
                "the plugins "
                "of gst-rangecast, as pipelines/env.sh does, and gst-plugins-base and -good\n",
        factory);
    std::exit (1);
  }
  gst_bin_add (GST_BIN (viewer.pipeline), element);
  return element;
}

namespace {

/* ---- from frame sets to the window ---- */

void
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

gboolean
follow_window (gpointer user_data)
{
  auto reshape = static_cast<Reshape *> (user_data);
  set_picture_size (*reshape->viewer, reshape->width, reshape->height);
  reshape->viewer->playback->redraw_if_paused ();
  return G_SOURCE_REMOVE;
}

/* Renders at the window's size instead of scaling. */
gboolean
on_reshape (GstElement *, gpointer, guint width, guint height, gpointer user_data)
{
  auto &viewer = *static_cast<Viewer *> (user_data);
  if (viewer.seen_frames && std::min (width, height) >= 16)
    g_idle_add_full (G_PRIORITY_DEFAULT, follow_window,
        new Reshape{&viewer, int (width), int (height)},
        [] (gpointer reshape) { delete static_cast<Reshape *> (reshape); });
  return FALSE; /* glimagesink reshapes, too */
}

void
add_probe (GstElement *element, const char *pad_name, GstPadProbeType type,
    GstPadProbeCallback probe, Viewer &viewer)
{
  GstPad *pad = gst_element_get_static_pad (element, pad_name);
  gst_pad_add_probe (pad, type, probe, &viewer, nullptr);
  gst_object_unref (pad);
}

gboolean
redraw_if_paused (gpointer user_data)
{
  static_cast<Viewer *> (user_data)->playback->redraw_if_paused ();
  return G_SOURCE_REMOVE;
}

void
on_view_changed (GObject *, GParamSpec *, gpointer user_data)
{
  g_idle_add (redraw_if_paused, user_data);
}

GstVideoOverlayComposition *
on_draw (GstElement *, GstSample *sample, gpointer user_data)
{
  return static_cast<Viewer *> (user_data)->overlay->draw (sample);
}

void
build_view (Viewer &viewer)
{
  const ViewerOptions &options = viewer.options;
  viewer.first = add_element (viewer, "queue");
  viewer.render = add_element (viewer, "striprender");
  viewer.size = add_element (viewer, "capsfilter");
  viewer.overlay_element = add_element (viewer, "overlaycomposition");
  viewer.sink = add_element (viewer, "glimagesink");
  g_object_set (viewer.first, "max-size-buffers", 2, "max-size-bytes", 0, "max-size-time",
      guint64 (0), nullptr);
  set_picture_size (viewer, options.width, options.height);
  g_object_set (viewer.render, "fit", TRUE, nullptr);
  if (options.background)
    g_object_set (viewer.render, "background", options.background_argb, nullptr);
  else
    g_object_set (viewer.render, "background-shade", 0.5, nullptr);
  if (options.mode)
    gst_util_set_object_arg (G_OBJECT (viewer.render), "mode", options.mode);
  if (!viewer.is_file)
    g_object_set (viewer.render, "auto-orbit", options.auto_orbit, nullptr);
  if (!viewer.is_file) /* renders on while the stream stalls */
    g_object_set (viewer.render, "keep-rate", TRUE, nullptr);
  gst_element_link_many (viewer.first, add_element (viewer, "rangealign"), viewer.render,
      viewer.size, viewer.overlay_element, viewer.sink, nullptr);
  add_probe (viewer.render, "sink", GST_PAD_PROBE_TYPE_BUFFER, on_frame_set, viewer);
  watch_controls (viewer);
  g_signal_connect (viewer.overlay_element, "draw", G_CALLBACK (on_draw), &viewer);
  g_signal_connect (viewer.sink, "client-reshape", G_CALLBACK (on_reshape), &viewer);
  g_signal_connect (viewer.render, "notify", G_CALLBACK (on_view_changed), &viewer);
}

void
build_receiver (Viewer &viewer)
{
  GstElement *source = add_element (viewer, "udpsrc"),
             *jitter = add_element (viewer, "rtpjitterbuffer"),
             *depayloader = add_element (viewer, "rtpneighbourcodedepay"),
             *queue = add_element (viewer, "queue"),
             *decoder = add_element (viewer, "neighbourcodedec");
  GstCaps *caps = gst_caps_from_string (kRtpCaps);
  g_object_set (source, "port", viewer.options.listen, "reuse", FALSE, "buffer-size", 4 << 20,
      "caps", caps, nullptr);
  gst_caps_unref (caps);
  g_object_set (jitter, "latency", viewer.options.latency_ms, nullptr);
  g_object_set (queue, "max-size-buffers", 4, nullptr);
  gst_util_set_object_arg (G_OBJECT (queue), "leaky", "downstream");
  gst_element_link_many (source, jitter, depayloader, nullptr);
  gst_element_link_many (queue, decoder, viewer.first, nullptr);
  if (viewer.options.audio)
    build_speech_receiver (viewer, depayloader, queue);
  else
    gst_element_link (depayloader, queue);
}

void
on_pad_added (GstElement *, GstPad *pad, gpointer user_data)
{
  auto &viewer = *static_cast<Viewer *> (user_data);
  GstPad *sink = gst_element_get_static_pad (viewer.first, "sink");
  GstCaps *caps = gst_pad_get_current_caps (pad);
  const GstStructure *structure = caps ? gst_caps_get_structure (caps, 0) : nullptr;
  if (structure && gst_structure_has_name (structure, "video/x-range") && !gst_pad_is_linked (sink))
    gst_pad_link (pad, sink);
  else if (structure && gst_structure_has_name (structure, "audio/x-raw"))
    hear (viewer, pad);
  gst_object_unref (sink);
  gst_clear_caps (&caps);
}

} // namespace

gboolean
refuse_input (gpointer user_data)
{
  auto &viewer = *static_cast<Viewer *> (user_data);
  if (!viewer.failed)
    fail (viewer, std::string (viewer.options.inputs[0]) +
                      ": expected range frame sets (a .rcnc recording, or a stream of them)");
  return G_SOURCE_REMOVE;
}

namespace {

void
on_no_more_pads (GstElement *, gpointer user_data)
{
  auto &viewer = *static_cast<Viewer *> (user_data);
  GstPad *sink = gst_element_get_static_pad (viewer.first, "sink");
  if (!gst_pad_is_linked (sink))
    g_idle_add (refuse_input, &viewer);
  gst_object_unref (sink);
}

void
on_source_setup (GstElement *, GstElement *source, gpointer user_data)
{
  auto &viewer = *static_cast<Viewer *> (user_data);
  if (g_object_class_find_property (G_OBJECT_GET_CLASS (source), "latency"))
    g_object_set (source, "latency", viewer.options.latency_ms, nullptr);
}

void
build_opener (Viewer &viewer, const char *uri)
{
  /* Frame sets are wanted, not the pictures of the element that players plug. */
  if (GstPluginFeature *renderer =
          gst_registry_lookup_feature (gst_registry_get (), "rangerender")) {
    gst_plugin_feature_set_rank (renderer, GST_RANK_NONE);
    gst_object_unref (renderer);
  }
  GstElement *opener = add_element (viewer, "uridecodebin");
  GstCaps *caps = gst_caps_from_string ("video/x-range; audio/x-raw");
  g_object_set (opener, "uri", uri, "caps", caps, nullptr);
  gst_caps_unref (caps);
  g_signal_connect (opener, "pad-added", G_CALLBACK (on_pad_added), &viewer);
  g_signal_connect (opener, "no-more-pads", G_CALLBACK (on_no_more_pads), &viewer);
  g_signal_connect (opener, "source-setup", G_CALLBACK (on_source_setup), &viewer);
}

/* The speech beside a recording. */
void
build_speech_opener (Viewer &viewer, const std::string &path)
{
  gchar *uri = gst_filename_to_uri (path.c_str (), nullptr);
  GstElement *opener = add_element (viewer, "uridecodebin");
  g_object_set (opener, "uri", uri, nullptr);
  g_signal_connect (opener, "pad-added", G_CALLBACK (on_pad_added), &viewer);
  g_free (uri);
}

/* Reports it if no plugin opens such URIs. */
bool
is_supported (const char *uri)
{
  gchar *scheme = gst_uri_get_protocol (uri);
  const bool supported = scheme && gst_uri_protocol_is_supported (GST_URI_SRC, scheme);
  if (!supported)
    g_printerr ("rangecast-viewer: %s: no GStreamer plugin for %s://\n", uri, scheme ? scheme : "");
  g_free (scheme);
  return supported;
}

/* @return transfer full; nullptr after reporting an error */
gchar *
input_uri (const char *input)
{
  if (gst_uri_is_valid (input))
    return is_supported (input) ? g_strdup (input) : nullptr;
  if (g_file_test (input, G_FILE_TEST_IS_REGULAR))
    return gst_filename_to_uri (input, nullptr);
  g_printerr ("rangecast-viewer: %s: %s\n", input,
      g_file_test (input, G_FILE_TEST_IS_DIR) ? "is a folder; expected a .rcnc recording in it"
      : g_file_test (input, G_FILE_TEST_EXISTS)
          ? "is not a regular file; expected a .rcnc recording"
          : "no such file");
  return nullptr;
}

} // namespace

bool
build_pipeline (Viewer &viewer)
{
  viewer.pipeline = gst_pipeline_new (nullptr);
  gchar *uri = nullptr;
  if (viewer.options.inputs) {
    uri = input_uri (viewer.options.inputs[0]);
    if (!uri)
      return false;
    viewer.is_file = g_str_has_prefix (uri, "file:");
  }
  viewer.overlay.emplace (key_rows (viewer.is_file), kHint);
  viewer.playback.emplace (viewer.pipeline, viewer.is_file);
  build_view (viewer);
  if (uri)
    build_opener (viewer, uri);
  if (const std::string speech = find_speech (viewer); !speech.empty ())
    build_speech_opener (viewer, speech);
  if (!uri)
    build_receiver (viewer);
  g_free (uri);
  return true;
}
