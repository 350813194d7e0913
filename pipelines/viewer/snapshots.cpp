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
  const std::string folder = viewer.options.out ? viewer.options.out : ".";
  for (int i = 1;; i++) {
    char name[40];
    std::snprintf (name, sizeof name, "/rangecast-%04d.%s", i, extension);
    if (!g_file_test ((folder + name).c_str (), G_FILE_TEST_EXISTS))
      return folder + name;
  }
}

/* Writes a sample with a pipeline of its own, from "appsrc name=in ! " on. */
void
write_sample (const std::string &path, const char *encoder, GstSample *sample)
{
  GError *error = nullptr;
  const std::string launch =
      std::string ("appsrc name=in format=time ! ") + encoder + " ! filesink name=out";
  GstElement *pipeline =
      gst_parse_launch_full (launch.c_str (), nullptr, GST_PARSE_FLAG_FATAL_ERRORS, &error);
  GstMessage *message = nullptr;
  if (pipeline) {
    GstElement *in = gst_bin_get_by_name (GST_BIN (pipeline), "in"),
               *out = gst_bin_get_by_name (GST_BIN (pipeline), "out");
    GstBus *bus = gst_element_get_bus (pipeline);
    g_object_set (out, "location", path.c_str (), nullptr);
    gst_element_set_state (pipeline, GST_STATE_PLAYING);
    gst_app_src_push_sample (GST_APP_SRC (in), sample);
    gst_app_src_end_of_stream (GST_APP_SRC (in));
    message = gst_bus_timed_pop_filtered (
        bus, 10 * GST_SECOND, GstMessageType (GST_MESSAGE_EOS | GST_MESSAGE_ERROR));
    if (message && GST_MESSAGE_TYPE (message) == GST_MESSAGE_ERROR)
      gst_message_parse_error (message, &error, nullptr);
    gst_element_set_state (pipeline, GST_STATE_NULL);
    gst_object_unref (bus);
    gst_object_unref (in);
    gst_object_unref (out);
    gst_object_unref (pipeline);
  }
  if (message && !error)
    std::printf ("wrote %s\n", path.c_str ());
  else
    g_printerr (
        "rangecast-viewer: %s: %s\n", path.c_str (), error ? error->message : "writing timed out");
  std::fflush (stdout);
  g_clear_error (&error);
  if (message)
    gst_message_unref (message);
}

/* There is no frame at first, and for a moment where a file starts over: the picture is then the
 * first one. */
gboolean
try_to_write_picture (gpointer user_data)
{
  auto &viewer = *static_cast<Viewer *> (user_data);
  GstSample *sample = nullptr;
  g_object_get (viewer.sink, "last-sample", &sample, nullptr);
  if (!sample)
    return G_SOURCE_CONTINUE;
  write_sample (free_name (viewer, "png"), "gldownload ! videoconvert ! pngenc", sample);
  gst_sample_unref (sample);
  return G_SOURCE_REMOVE;
}

} // namespace

GstSample *
last_frame_set (Viewer &viewer)
{
  std::lock_guard guard (viewer.lock);
  return viewer.frame_set ? gst_sample_ref (viewer.frame_set) : nullptr;
}

void
write_picture (Viewer &viewer)
{
  if (try_to_write_picture (&viewer))
    g_timeout_add (100, try_to_write_picture, &viewer);
}

void
write_points (Viewer &viewer)
{
  GstSample *sample = last_frame_set (viewer);
  if (!sample) {
    g_printerr ("rangecast-viewer: no points yet\n");
    return;
  }
  write_sample (free_name (viewer, "ply"), "plyenc normals=true view-id=true", sample);
  gst_sample_unref (sample);
}
