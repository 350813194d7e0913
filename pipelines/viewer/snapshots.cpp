/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include <gst/app/gstappsrc.h>
#include <gst/video/video.h>

#include <cstdio>

#include "viewer.hpp"

namespace {

/* The first name in the folder that is free. */
std::string
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

void
write_file (const std::string &path, GstBuffer *buffer)
{
  GstMapInfo map;
  if (!gst_buffer_map (buffer, &map, GST_MAP_READ)) {
    g_printerr ("rangecast-viewer: %s: cannot map the buffer to write\n", path.c_str ());
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

/* As striprender drew it: without what is laid over it. */
GstSample *
last_picture (Viewer &viewer)
{
  GstSample *sample = nullptr;
  g_object_get (viewer.sink, "last-sample", &sample, nullptr);
  if (!sample)
    return nullptr;
  GstCaps *caps = gst_caps_copy (gst_sample_get_caps (sample));
  gst_caps_set_features (caps, 0, gst_caps_features_new ("memory:GLMemory", nullptr));
  GstSample *picture = gst_sample_new (gst_sample_get_buffer (sample), caps, nullptr, nullptr);
  gst_caps_unref (caps);
  gst_sample_unref (sample);
  return picture;
}

bool
write_last_picture (Viewer &viewer)
{
  GstSample *sample = last_picture (viewer);
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
    g_printerr ("rangecast-viewer: cannot encode the picture as PNG: %s\n",
        error ? error->message : "unknown error");
  }
  g_clear_error (&error);
  return true;
}

/* There is no picture before the first one, and for a moment where a file starts over. */
gboolean
try_to_write_picture (gpointer user_data)
{
  auto &viewer = *static_cast<Viewer *> (user_data);
  if (write_last_picture (viewer))
    return G_SOURCE_REMOVE;
  if (viewer.patience-- > 0)
    return G_SOURCE_CONTINUE;
  g_printerr ("rangecast-viewer: no picture yet\n");
  return G_SOURCE_REMOVE;
}

} // namespace

GstSample *
last_frame_set (Viewer &viewer)
{
  std::lock_guard guard (viewer.lock);
  return viewer.frame_set ? gst_sample_ref (viewer.frame_set) : nullptr;
}

namespace {

/* Says how the writing of a file ended. */
void
report_end (GstElement *pipeline, const std::string &path)
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
    g_printerr (
        "rangecast-viewer: %s: %s\n", path.c_str (), error ? error->message : "writing timed out");
  std::fflush (stdout);
  g_clear_error (&error);
  if (message)
    gst_message_unref (message);
  gst_object_unref (bus);
}

} // namespace

void
write_picture (Viewer &viewer)
{
  viewer.patience = 20;
  if (try_to_write_picture (&viewer))
    g_timeout_add (100, try_to_write_picture, &viewer);
}

/* Another pipeline, for the one frame set. */
void
write_points (Viewer &viewer)
{
  GstSample *sample = last_frame_set (viewer);
  if (!sample) {
    g_printerr ("rangecast-viewer: no points yet\n");
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
    report_end (encoder, path);
    gst_element_set_state (encoder, GST_STATE_NULL);
    gst_object_unref (in);
    gst_object_unref (out);
    gst_object_unref (encoder);
  } else {
    g_printerr ("rangecast-viewer: cannot write a point cloud: %s\n", error->message);
  }
  g_clear_error (&error);
  gst_sample_unref (sample);
}
