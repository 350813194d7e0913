/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "report.hpp"

#include <cstdio>
#include <gst/video/video.h>
#include <sys/resource.h>

namespace {

double
cpu_seconds ()
{
  rusage usage;
  getrusage (RUSAGE_SELF, &usage);
  return usage.ru_utime.tv_sec + usage.ru_stime.tv_sec +
         1e-6 * (usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
}

double
per_frame (guint64 total, guint64 frames)
{
  return frames ? double (total) / double (frames) : 0;
}

} // namespace

void
print_progress (RunMeasure &measure)
{
  const StreamStats stats = measure.stats ();
  if (stats.frames == 0)
    std::printf ("  waiting: cameras are learning their background\n");
  else
    std::printf ("  frame set %5" G_GUINT64_FORMAT
                 "  %d view%s  %5.1f /s  %7.0f points  %6.1f ms\n",
        stats.frames, stats.views_now, stats.views_now == 1 ? "" : "s", measure.fps (),
        per_frame (stats.points, stats.coded_frames), measure.latency_ms (0.5));
  std::fflush (stdout);
}

bool
write_report (RunMeasure &measure, const char *path)
{
  const StreamStats s = measure.stats ();
  FILE *file = std::fopen (path, "w");
  if (!file) {
    g_printerr ("rangecast-run: %s: cannot be opened for writing\n", path);
    return false;
  }
  std::fprintf (file,
      "{\n  \"frames\": %" G_GUINT64_FORMAT ",\n  \"whole_frame_sets\": %" G_GUINT64_FORMAT
      ",\n  \"views\": %" G_GUINT64_FORMAT
      ",\n  \"fps\": %.2f,\n  \"points_per_frame_set\": %.1f,\n"
      "  \"raw_bytes_per_frame_set\": %.1f,\n"
      "  \"coded_bytes_per_frame_set\": %.1f,\n"
      "  \"latency_ms\": {\"p50\": %.2f, \"p99\": %.2f},\n"
      "  \"rtp_packets\": %" G_GUINT64_FORMAT ",\n  \"rtp_lost\": %" G_GUINT64_FORMAT
      ",\n  \"cpu_seconds\": %.3f\n}\n",
      s.frames, measure.whole_of (s.frames), s.views, measure.fps (),
      per_frame (s.points, s.coded_frames), per_frame (s.raw_bytes, s.coded_frames),
      per_frame (s.coded_bytes, s.coded_frames), measure.latency_ms (0.5),
      measure.latency_ms (0.99), s.rtp_packets, s.rtp_lost, cpu_seconds ());
  const bool failed = std::ferror (file) != 0;
  if (std::fclose (file) == 0 && !failed)
    return true;
  g_printerr ("rangecast-run: %s: cannot be written\n", path);
  return false;
}

namespace {

/* ---- the last frame ---- */

/* @return transfer full; null after reporting that there is none, or that it cannot be converted */
GstSample *
last_picture (GstElement *pipeline, const char *path)
{
  GstElement *sink = gst_bin_get_by_name (GST_BIN (pipeline), "snapshot");
  GstSample *sample = nullptr;
  if (sink)
    g_object_get (sink, "last-sample", &sample, nullptr);
  gst_clear_object (&sink);
  if (!sample) {
    g_printerr ("rangecast-run: no frame was rendered for %s\n", path);
    return nullptr;
  }
  g_autoptr (GError) error = nullptr;
  GstCaps *png = gst_caps_new_empty_simple ("image/png");
  GstSample *converted = gst_video_convert_sample (sample, png, 10 * GST_SECOND, &error);
  gst_caps_unref (png);
  gst_sample_unref (sample);
  if (!converted)
    g_printerr ("rangecast-run: %s: %s\n", path, error->message);
  return converted;
}

} // namespace

bool
write_snapshot (GstElement *pipeline, const char *path)
{
  GstSample *picture = last_picture (pipeline, path);
  if (!picture)
    return false;
  g_autoptr (GError) error = nullptr;
  gpointer png = nullptr;
  gsize size = 0;
  gst_buffer_extract_dup (gst_sample_get_buffer (picture), 0, gsize (-1), &png, &size);
  const bool written =
      g_file_set_contents (path, static_cast<const gchar *> (png), gssize (size), &error);
  g_free (png);
  gst_sample_unref (picture);
  if (!written)
    g_printerr ("rangecast-run: %s: %s\n", path, error->message);
  return written;
}
