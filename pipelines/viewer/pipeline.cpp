/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The viewer's pipeline: a file, a URI or RTP, to the window. */
#include <algorithm>
#include <filesystem>

#include "viewer.hpp"

namespace {

const std::string kAudio =
    "queue max-size-time=2000000000 max-size-buffers=0 ! audioconvert ! audioresample ! "
    "volume name=volume ! autoaudiosink ";

/* ---- frame sets ---- */

GstPadProbeReturn
on_frame_set (GstPad *pad, GstPadProbeInfo *info, gpointer user_data)
{
  auto &viewer = *static_cast<Viewer *> (user_data);
  GstBuffer *buffer = GST_PAD_PROBE_INFO_BUFFER (info);
  GstCaps *caps = gst_pad_get_current_caps (pad);
  GstSample *sample = gst_sample_new (buffer, caps, nullptr, nullptr);
  gst_clear_caps (&caps);
  viewer.seen_frames = true;
  std::unique_lock guard (viewer.lock);
  std::swap (sample, viewer.frame_set);
  guard.unlock ();
  if (sample)
    gst_sample_unref (sample);
  return GST_PAD_PROBE_OK;
}

/* ---- from frame sets to the window ---- */

void
set_picture_size (Viewer &viewer, int width, int height)
{
  GstCaps *caps = gst_caps_new_simple (
      "video/x-raw", "width", G_TYPE_INT, width, "height", G_TYPE_INT, height, nullptr);
  gst_caps_set_features (caps, 0, gst_caps_features_new_any ());
  g_object_set (viewer.size, "caps", caps, nullptr);
  gst_caps_unref (caps);
}

/* Renders at the window's size instead of scaling. */
gboolean
on_reshape (GstElement *, gpointer, guint width, guint height, gpointer user_data)
{
  auto &viewer = *static_cast<Viewer *> (user_data);
  if (viewer.seen_frames && std::min (width, height) >= 16)
    in_main_loop ([&viewer, width, height] {
      set_picture_size (viewer, int (width), int (height));
      viewer.playback->redraw_if_paused ();
    });
  return FALSE; /* glimagesink reshapes, too */
}

void
on_view_changed (GObject *, GParamSpec *, gpointer user_data)
{
  in_main_loop (
      [viewer = static_cast<Viewer *> (user_data)] { viewer->playback->redraw_if_paused (); });
}

GstElement *
find (const Viewer &viewer, const char *name)
{
  GstElement *element = gst_bin_get_by_name (GST_BIN (viewer.pipeline), name);
  if (element)
    gst_object_unref (element); /* the pipeline keeps it */
  return element;
}

void
set_up_view (Viewer &viewer)
{
  const ViewerOptions &options = viewer.options;
  viewer.first = find (viewer, "first");
  viewer.render = find (viewer, "render");
  viewer.size = find (viewer, "size");
  viewer.sink = find (viewer, "sink");
  viewer.volume = find (viewer, "volume");
  set_picture_size (viewer, options.width, options.height);
  GstPad *pad = gst_element_get_static_pad (viewer.render, "sink");
  gst_pad_add_probe (pad, GST_PAD_PROBE_TYPE_BUFFER, on_frame_set, &viewer, nullptr);
  gst_object_unref (pad);
  watch_controls (viewer);
  g_signal_connect (viewer.sink, "client-reshape", G_CALLBACK (on_reshape), &viewer);
  g_signal_connect (viewer.render, "notify", G_CALLBACK (on_view_changed), &viewer);
}

/* From frame sets to the window. A stream is rendered on while it stalls. */
std::string
view (const Viewer &viewer)
{
  const ViewerOptions &options = viewer.options;
  return std::string ("queue name=first max-size-buffers=2 max-size-bytes=0 max-size-time=0 ! "
                      "rangealign ! striprender name=render fit=true background-shade=0.5 ") +
         (viewer.is_file ? "" : "keep-rate=true ") + (options.render ? options.render : "") +
         " ! capsfilter name=size ! glimagesink name=sink ";
}

/* ---- inputs ---- */

/* RTP to the view; with audio, capturesync delays the earlier of both. */
std::string
receiver (const ViewerOptions &options)
{
  const std::string latency = " ! rtpjitterbuffer latency=" + std::to_string (options.latency_ms);
  const auto source = [] (int port, const char *caps) {
    return "udpsrc reuse=false buffer-size=4194304 port=" + std::to_string (port) +
           " caps=\"application/x-rtp," + caps + "\"";
  };
  const std::string video =
      source (options.listen, "media=video,clock-rate=90000,encoding-name=X-NEIGHBOUR-CODE") +
      latency + " ! rtpneighbourcodedepay ! ";
  const std::string view = "queue max-size-buffers=4 leaky=downstream ! neighbourcodedec ! first. ";
  if (!options.audio)
    return video + view;
  return video + "sync.sink_0 capturesync name=sync sync.src_0 ! " + view +
         source (options.audio, "media=audio,clock-rate=48000,encoding-name=OPUS,payload=111,"
                                "extmap-2=(string)urn:ietf:params:rtp-hdrext:ntp-64") +
         " ! rtpneighbourcodeguard" + latency +
         " do-lost=true max-dropout-time=1000 max-misorder-time=500 ! rtpopusdepay ! sync.sink_1 "
         "sync.src_1 ! queue max-size-time=2000000000 max-size-buffers=0 ! "
         "opusdec plc=true tolerance=5000000 ! audioconvert ! audioresample ! mixer. "
         /* silence while no audio arrives, for which the video would wait */
         "audiotestsrc is-live=true wave=silence ! audiomixer name=mixer ! " +
         kAudio;
}

/* Plays decoded audio; of several streams the first one. */
void
play_audio (Viewer &viewer, GstPad *pad)
{
  GstElement *expected = nullptr,
             *bin = gst_parse_bin_from_description (kAudio.c_str (), TRUE, nullptr);
  GstElement *volume = bin ? gst_bin_get_by_name (GST_BIN (bin), "volume") : nullptr;
  if (!volume || !viewer.volume.compare_exchange_strong (expected, volume)) {
    gst_clear_object (&volume);
    gst_clear_object (&bin);
    return;
  }
  gst_object_unref (volume); /* the bin keeps it */
  gst_bin_add (GST_BIN (viewer.pipeline), bin);
  gst_element_sync_state_with_parent (bin);
  GstPad *sink = gst_element_get_static_pad (bin, "sink");
  gst_pad_link (pad, sink);
  gst_object_unref (sink);
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
    play_audio (viewer, pad);
  gst_object_unref (sink);
  gst_clear_caps (&caps);
}

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
connect_opener (Viewer &viewer, const char *name, const char *uri)
{
  GstElement *opener = find (viewer, name);
  if (!opener)
    return;
  g_object_set (opener, "uri", uri, nullptr);
  g_signal_connect (opener, "pad-added", G_CALLBACK (on_pad_added), &viewer);
}

/* The file with the audio of a recording, which rangecast record writes: x.opus next to x.rcnc,
 * and x.opus~ next to x.rcnc~, the recording before. Returns "" if there is none. */
std::string
audio_of (std::string recording)
{
  const bool saved = recording.ends_with ('~');
  if (saved)
    recording.pop_back ();
  const std::string path =
      std::filesystem::path (recording).replace_extension (".opus").string () + (saved ? "~" : "");
  return path != recording && g_file_test (path.c_str (), G_FILE_TEST_IS_REGULAR) ? path : "";
}

/* @return transfer full; nullptr after reporting an error */
gchar *
input_uri (const char *input)
{
  if (gst_uri_is_valid (input)) {
    gchar *scheme = gst_uri_get_protocol (input);
    const bool supported = scheme && gst_uri_protocol_is_supported (GST_URI_SRC, scheme);
    if (!supported)
      g_printerr (
          "rangecast-viewer: %s: no GStreamer plugin for %s://\n", input, scheme ? scheme : "");
    g_free (scheme);
    return supported ? g_strdup (input) : nullptr;
  }
  if (g_file_test (input, G_FILE_TEST_IS_REGULAR))
    return gst_filename_to_uri (input, nullptr);
  g_printerr ("rangecast-viewer: %s: %s\n", input,
      g_file_test (input, G_FILE_TEST_IS_DIR)   ? "is a folder; name a .rcnc recording in it"
      : g_file_test (input, G_FILE_TEST_EXISTS) ? "is not a regular file"
                                                : "no such file");
  return nullptr;
}

} // namespace

gboolean
refuse_input (gpointer user_data)
{
  auto &viewer = *static_cast<Viewer *> (user_data);
  if (!viewer.failed)
    fail (viewer, std::string (viewer.options.inputs[0]) +
                      ": has no range frame sets; name a .rcnc recording, or a stream of them");
  return G_SOURCE_REMOVE;
}

bool
build_pipeline (Viewer &viewer)
{
  gchar *uri = nullptr;
  std::string launch, audio;
  if (viewer.options.inputs) {
    const char *input = viewer.options.inputs[0];
    if (!(uri = input_uri (input)))
      return false;
    viewer.is_file = g_str_has_prefix (uri, "file:");
    audio = viewer.is_file && !gst_uri_is_valid (input) ? audio_of (input) : "";
    launch += "uridecodebin name=opener caps=\"video/x-range; audio/x-raw\" ";
    if (!audio.empty ())
      launch += "uridecodebin name=audio ";
    /* Frame sets are wanted, not the pictures of the element that players plug. */
    if (GstPluginFeature *renderer =
            gst_registry_lookup_feature (gst_registry_get (), "rangerender")) {
      gst_plugin_feature_set_rank (renderer, GST_RANK_NONE);
      gst_object_unref (renderer);
    }
  } else {
    launch += receiver (viewer.options);
  }
  launch = view (viewer) + launch;
  GError *error = nullptr;
  viewer.pipeline =
      gst_parse_launch_full (launch.c_str (), nullptr, GST_PARSE_FLAG_FATAL_ERRORS, &error);
  if (!viewer.pipeline) {
    g_printerr ("rangecast-viewer: %s; GST_PLUGIN_PATH has to name the folder of the plugins of "
                "gst-rangecast, as pipelines/env.sh does\n",
        error->message);
    g_clear_error (&error);
    g_free (uri);
    return false;
  }
  viewer.playback.emplace (viewer.pipeline, viewer.is_file);
  set_up_view (viewer);
  if (uri) {
    connect_opener (viewer, "opener", uri);
    GstElement *opener = find (viewer, "opener");
    g_signal_connect (opener, "no-more-pads", G_CALLBACK (on_no_more_pads), &viewer);
    g_signal_connect (opener, "source-setup", G_CALLBACK (on_source_setup), &viewer);
  }
  if (!audio.empty ()) {
    gchar *audio_uri = gst_filename_to_uri (audio.c_str (), nullptr);
    connect_opener (viewer, "audio", audio_uri);
    g_free (audio_uri);
  }
  g_free (uri);
  return true;
}
