/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Runs a launch string as gst-launch-1.0 does, and measures it: frames, latency from capture to
 * the element named "rendered", points, bytes, RTP packets, CPU time. Reads only what any
 * application can read: buffers, their metas, and the elements' `stats` properties.
 *
 * Elements it looks for, by name (all may be missing): "rendered" (frames and latency),
 * "decoder" (a neighbourcodedec), "cylinder" (a cylinderfilter), "view" (a striprender), "snapshot"
 * (a sink whose last sample becomes a PNG); every rtpjitterbuffer, whatever its name. */
#include <glib-unix.h>
#include <gst/gst.h>
#include <gst/video/video.h>
#include <gstrange/gstrange.h>
#include <malloc.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <clocale>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "latency-trace.hpp"
#include "srtp-key.hpp"
#include "stats-sender.hpp"

struct Options {
  gint64 base_time = -1;
  gint frames = 0;
  gint views = 1;
  gboolean turn = FALSE;
  gint timeout_s = 0;
  gboolean progress = FALSE;
  gchar *stats = nullptr, *trace = nullptr;
  gchar *report = nullptr;
  gchar *snapshot = nullptr;
  gchar *frame_log = nullptr;
  gchar *threads_left = nullptr;
  gchar *memory_log = nullptr;
  gchar *srtp_key = nullptr;
  gchar **launch = nullptr;
};

struct Runner {
  Options options;
  GstElement *pipeline = nullptr;
  GMainLoop *loop = nullptr;
  GstElement *turned = nullptr; /* a striprender */
  std::unique_ptr<StatsSender> stats;
  std::unique_ptr<LatencyTrace> trace;
  bool failed = false;
  bool ending = false;

  std::mutex lock; /* guards what the pad probes write */
  std::vector<double> latencies_ms;
  GstClockTime first_frame = GST_CLOCK_TIME_NONE, last_frame = GST_CLOCK_TIME_NONE;
  bool seen_points = false;
  guint64 decoded = 0, whole = 0; /* frame sets; those in which all views have points */
  gint views_now = 0;             /* that have points in the last one decoded */
  FILE *frame_log = nullptr;
  gint64 first_points_us = 0; /* monotonic; 0: none yet */
};

struct StreamStats {
  guint64 frames = 0, views = 0;
  guint64 points_in = 0, points_out = 0, cylinder_frames = 0;
  guint64 raw_bytes = 0, coded_bytes = 0, coded_frames = 0;
  guint64 rtp_packets = 0, rtp_lost = 0;
};

/* ---- reading elements ---- */

static guint64
stat_of (GstElement *element, const char *field)
{
  GstStructure *stats = nullptr;
  guint64 value = 0;
  if (!g_object_class_find_property (G_OBJECT_GET_CLASS (element), "stats"))
    return 0;
  g_object_get (element, "stats", &stats, nullptr);
  if (!stats)
    return 0;
  gst_structure_get_uint64 (stats, field, &value);
  gst_structure_free (stats);
  return value;
}

static void
add_jitterbuffer (const GValue *item, gpointer user_data)
{
  auto stats = static_cast<StreamStats *> (user_data);
  auto element = GST_ELEMENT (g_value_get_object (item));
  GstElementFactory *factory = gst_element_get_factory (element);
  if (!factory || g_strcmp0 (GST_OBJECT_NAME (factory), "rtpjitterbuffer") != 0)
    return;
  const guint64 lost = stat_of (element, "num-lost");
  stats->rtp_packets += stat_of (element, "num-pushed") + lost;
  stats->rtp_lost += lost;
}

static StreamStats
read_stats (Runner &runner)
{
  StreamStats stats;
  auto bin = GST_BIN (runner.pipeline);
  if (GstElement *cylinder = gst_bin_get_by_name (bin, "cylinder")) {
    stats.cylinder_frames = stat_of (cylinder, "frames");
    stats.points_in = stat_of (cylinder, "points-in");
    stats.points_out = stat_of (cylinder, "points-out");
    gst_object_unref (cylinder);
  }
  if (GstElement *decoder = gst_bin_get_by_name (bin, "decoder")) {
    stats.coded_frames = stat_of (decoder, "frames");
    stats.raw_bytes = stat_of (decoder, "raw-bytes");
    stats.coded_bytes = stat_of (decoder, "coded-bytes");
    GstPad *pad = gst_element_get_static_pad (decoder, "src");
    if (GstCaps *caps = gst_pad_get_current_caps (pad)) {
      int views = 0;
      gst_structure_get_int (gst_caps_get_structure (caps, 0), "views", &views);
      stats.views = static_cast<guint64> (views);
      gst_caps_unref (caps);
    }
    gst_object_unref (pad);
    gst_object_unref (decoder);
  }
  GstIterator *elements = gst_bin_iterate_recurse (bin);
  while (gst_iterator_foreach (elements, add_jitterbuffer, &stats) == GST_ITERATOR_RESYNC) {
    stats.rtp_packets = stats.rtp_lost = 0;
    gst_iterator_resync (elements);
  }
  gst_iterator_free (elements);
  std::lock_guard guard (runner.lock);
  stats.frames = runner.latencies_ms.size ();
  return stats;
}

static double
cpu_seconds ()
{
  rusage usage;
  getrusage (RUSAGE_SELF, &usage);
  return usage.ru_utime.tv_sec + usage.ru_stime.tv_sec +
         1e-6 * (usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
}

static double
percentile (std::vector<double> values, double p)
{
  if (values.empty ())
    return 0;
  const auto k = static_cast<std::ptrdiff_t> (p * double (values.size () - 1));
  std::nth_element (values.begin (), values.begin () + k, values.end ());
  return values[k];
}

/* ---- probes, on streaming threads ---- */

/* Until all views see somebody (the hosts are still learning their backgrounds) nothing is drawn,
 * recorded or counted. A view that has nobody in it is not waited for for ever. */
static GstPadProbeReturn
count_views (GstPad *, GstPadProbeInfo *info, gpointer user_data)
{
  auto runner = static_cast<Runner *> (user_data);
  GstBuffer *buffer = GST_PAD_PROBE_INFO_BUFFER (info);
  constexpr gint64 kPatienceUs = 2 * G_USEC_PER_SEC;
  gpointer state = nullptr;
  gint seen = 0;
  while (GstRangeMeta *meta = gst_buffer_iterate_range_meta (buffer, &state))
    seen += meta->width > 0 && meta->height > 0;
  const bool whole = seen >= std::max (1, runner->options.views);
  std::lock_guard guard (runner->lock);
  if (seen > 0 && runner->first_points_us == 0)
    runner->first_points_us = g_get_monotonic_time ();
  const bool tired = seen > 0 && g_get_monotonic_time () - runner->first_points_us > kPatienceUs;
  runner->seen_points |= whole || tired;
  if (runner->seen_points) {
    runner->decoded++;
    runner->whole += whole;
  }
  runner->views_now = seen;
  return runner->seen_points ? GST_PAD_PROBE_OK : GST_PAD_PROBE_DROP;
}

static gboolean
send_eos (gpointer user_data)
{
  auto runner = static_cast<Runner *> (user_data);
  if (!runner->ending)
    gst_element_send_event (runner->pipeline, gst_event_new_eos ());
  runner->ending = true;
  return G_SOURCE_REMOVE;
}

static GstPadProbeReturn
count_rendered (GstPad *, GstPadProbeInfo *info, gpointer user_data)
{
  auto runner = static_cast<Runner *> (user_data);
  GstBuffer *buffer = GST_PAD_PROBE_INFO_BUFFER (info);
  const GstClockTime capture = gst_range_buffer_get_capture_time (buffer);
  GstClock *clock = gst_element_get_clock (runner->pipeline);
  const GstClockTime now = clock ? gst_clock_get_time (clock) : gst_util_get_timestamp ();
  gst_clear_object (&clock);

  gint frames;
  {
    std::lock_guard guard (runner->lock);
    frames = static_cast<gint> (runner->latencies_ms.size ());
    if (runner->options.frames > 0 && frames >= runner->options.frames)
      return GST_PAD_PROBE_DROP;
    if (!GST_CLOCK_TIME_IS_VALID (runner->first_frame))
      runner->first_frame = now;
    runner->last_frame = now;
    runner->latencies_ms.push_back (
        GST_CLOCK_TIME_IS_VALID (capture) ? (double (now) - double (capture)) * 1e-6 : 0);
    if (runner->frame_log)
      std::fprintf (runner->frame_log, "%.6f,%.3f,%d\n", double (now) * 1e-9,
          runner->latencies_ms.back (), runner->views_now);
  }
  if (runner->options.frames > 0 && frames + 1 == runner->options.frames)
    g_idle_add (send_eos, runner);
  if (runner->turned) /* the next picture; the last one is the first view's again */
    g_object_set (runner->turned, "azimuth",
        360.0 * std::min (frames + 2, runner->options.frames) / runner->options.frames, nullptr);
  return GST_PAD_PROBE_OK;
}

static void
add_probe (Runner &runner, const char *element_name, GstPadProbeCallback probe)
{
  GstElement *element = gst_bin_get_by_name (GST_BIN (runner.pipeline), element_name);
  if (!element)
    return;
  GstPad *pad = gst_element_get_static_pad (element, "src");
  gst_pad_add_probe (pad, GST_PAD_PROBE_TYPE_BUFFER, probe, &runner, nullptr);
  gst_object_unref (pad);
  gst_object_unref (element);
}

/* ---- reports ---- */

static double
per_frame (guint64 total, guint64 frames)
{
  return frames ? double (total) / double (frames) : 0;
}

static double
measured_fps (Runner &runner)
{
  std::lock_guard guard (runner.lock);
  const auto n = runner.latencies_ms.size ();
  if (n < 2 || runner.last_frame <= runner.first_frame)
    return 0;
  return double (n - 1) * GST_SECOND / double (runner.last_frame - runner.first_frame);
}

static gboolean
print_progress (gpointer user_data)
{
  auto &runner = *static_cast<Runner *> (user_data);
  const StreamStats stats = read_stats (runner);
  const double fps = measured_fps (runner);
  double latency = 0;
  {
    std::lock_guard guard (runner.lock);
    latency = percentile (runner.latencies_ms, 0.5);
  }
  if (stats.frames == 0)
    std::printf ("  waiting: cameras learn their background\n");
  else
    std::printf ("  frame set %5" G_GUINT64_FORMAT "  %5.1f /s  %7.0f points  %6.1f ms\n",
        stats.frames, fps, per_frame (stats.points_out, stats.cylinder_frames), latency);
  std::fflush (stdout);
  return G_SOURCE_CONTINUE;
}

static bool
write_report (Runner &runner)
{
  const StreamStats s = read_stats (runner);
  const double fps = measured_fps (runner);
  FILE *file = std::fopen (runner.options.report, "w");
  if (!file) {
    g_printerr ("rangecast-run: %s: cannot be opened for writing\n", runner.options.report);
    return false;
  }
  std::fprintf (file,
      "{\n  \"frames\": %" G_GUINT64_FORMAT ",\n  \"whole_frame_sets\": %" G_GUINT64_FORMAT
      ",\n  \"views\": %" G_GUINT64_FORMAT
      ",\n  \"fps\": %.2f,\n  \"points_per_frame_set\": %.1f,\n"
      "  \"points_after_cylinder\": %.1f,\n  \"raw_bytes_per_frame_set\": %.1f,\n"
      "  \"coded_bytes_per_frame_set\": %.1f,\n"
      "  \"latency_ms\": {\"p50\": %.2f, \"p99\": %.2f},\n"
      "  \"rtp_packets\": %" G_GUINT64_FORMAT ",\n  \"rtp_lost\": %" G_GUINT64_FORMAT
      ",\n  \"cpu_seconds\": %.3f\n}\n",
      s.frames, runner.decoded ? s.frames * runner.whole / runner.decoded : 0, s.views, fps,
      per_frame (s.points_in, s.cylinder_frames), per_frame (s.points_out, s.cylinder_frames),
      per_frame (s.raw_bytes, s.coded_frames), per_frame (s.coded_bytes, s.coded_frames),
      percentile (runner.latencies_ms, 0.5), percentile (runner.latencies_ms, 0.99), s.rtp_packets,
      s.rtp_lost, cpu_seconds ());
  std::fclose (file);
  return true;
}

static bool
write_snapshot (Runner &runner)
{
  GstSample *sample = nullptr;
  if (GstElement *sink = gst_bin_get_by_name (GST_BIN (runner.pipeline), "snapshot")) {
    g_object_get (sink, "last-sample", &sample, nullptr);
    gst_object_unref (sink);
  }
  if (!sample) {
    g_printerr ("rangecast-run: no picture was rendered for %s\n", runner.options.snapshot);
    return false;
  }
  GError *error = nullptr;
  GstCaps *png = gst_caps_new_empty_simple ("image/png");
  GstSample *converted = gst_video_convert_sample (sample, png, 10 * GST_SECOND, &error);
  gst_caps_unref (png);
  gst_sample_unref (sample);
  bool written = false;
  GstMapInfo map;
  if (converted && gst_buffer_map (gst_sample_get_buffer (converted), &map, GST_MAP_READ)) {
    written = g_file_set_contents (runner.options.snapshot,
        reinterpret_cast<const gchar *> (map.data), gssize (map.size), &error);
    gst_buffer_unmap (gst_sample_get_buffer (converted), &map);
  }
  if (converted)
    gst_sample_unref (converted);
  if (!written)
    g_printerr ("rangecast-run: %s: %s\n", runner.options.snapshot,
        error ? error->message : "cannot be written");
  g_clear_error (&error);
  return written;
}

static FILE *
open_frame_log (const char *path)
{
  FILE *file = std::fopen (path, "w");
  if (!file) {
    g_printerr ("rangecast-run: %s: cannot be opened for writing\n", path);
    return nullptr;
  }
  std::setvbuf (file, nullptr, _IOLBF, 0); /* whoever watches reads it as it grows */
  std::fprintf (file, "clock_s,latency_ms,views\n");
  return file;
}

/* What the process holds of its heap, without what the allocator keeps of what was given back. */
static gboolean
log_memory (gpointer user_data)
{
  auto runner = static_cast<Runner *> (user_data);
  const auto heap = mallinfo2 ();
  std::ofstream (runner->options.memory_log, std::ios::app)
      << g_get_monotonic_time () / G_USEC_PER_SEC << ',' << (heap.uordblks + heap.hblkhd) / 1024
      << '\n';
  return G_SOURCE_CONTINUE;
}

static std::vector<std::string>
other_threads ()
{
  std::vector<std::string> names;
  std::error_code error;
  const std::string own = std::to_string (getpid ());
  for (const auto &task : std::filesystem::directory_iterator ("/proc/self/task", error)) {
    std::string name;
    std::ifstream (task.path () / "comm") >> name;
    if (task.path ().filename () != own)
      names.push_back (name);
  }
  return names;
}

/* Those that end by themselves get a moment for it. */
static bool
write_threads_left (const char *path)
{
  g_thread_pool_set_max_unused_threads (0); /* else some stay for later use */
  std::vector<std::string> left = other_threads ();
  for (int i = 0; !left.empty () && i < 20; i++) {
    g_usleep (50000);
    left = other_threads ();
  }
  std::ofstream file (path);
  for (const std::string &name : left)
    file << name << '\n';
  if (!file.flush ())
    g_printerr ("rangecast-run: %s: cannot be written\n", path);
  return bool (file);
}

/* ---- the run ---- */

static gboolean
on_message (GstBus *, GstMessage *message, gpointer user_data)
{
  auto runner = static_cast<Runner *> (user_data);
  GError *error = nullptr;
  gchar *details = nullptr;
  switch (GST_MESSAGE_TYPE (message)) {
    case GST_MESSAGE_ERROR:
      gst_message_parse_error (message, &error, &details);
      g_printerr ("ERROR: %s: %s\n%s\n", GST_OBJECT_NAME (message->src), error->message,
          details ? details : "");
      g_free (details);
      g_error_free (error);
      runner->failed = true;
      g_main_loop_quit (runner->loop);
      break;
    case GST_MESSAGE_WARNING:
      gst_message_parse_warning (message, &error, nullptr);
      g_printerr ("WARNING: %s: %s\n", GST_OBJECT_NAME (message->src), error->message);
      g_error_free (error);
      break;
    case GST_MESSAGE_LATENCY:
      gst_bin_recalculate_latency (GST_BIN (runner->pipeline));
      break;
    case GST_MESSAGE_CLOCK_LOST:
      gst_element_set_state (runner->pipeline, GST_STATE_PAUSED);
      gst_element_set_state (runner->pipeline, GST_STATE_PLAYING);
      break;
    case GST_MESSAGE_ELEMENT:
      if (runner->stats)
        runner->stats->take (message);
      break;
    case GST_MESSAGE_EOS:
      g_main_loop_quit (runner->loop);
      break;
    default:
      break;
  }
  return G_SOURCE_CONTINUE;
}

static gboolean
on_timeout (gpointer user_data)
{
  auto runner = static_cast<Runner *> (user_data);
  g_printerr ("ERROR: no end of stream after %d s\n", runner->options.timeout_s);
  runner->failed = true;
  g_main_loop_quit (runner->loop);
  return G_SOURCE_REMOVE;
}

static void
play (Runner &runner)
{
  runner.loop = g_main_loop_new (nullptr, FALSE);
  GstBus *bus = gst_element_get_bus (runner.pipeline);
  gst_bus_add_watch (bus, on_message, &runner);
  g_unix_signal_add (SIGINT, send_eos, &runner);
  g_unix_signal_add (SIGTERM, send_eos, &runner);
  if (runner.options.timeout_s > 0)
    g_timeout_add_seconds (guint (runner.options.timeout_s), on_timeout, &runner);
  if (runner.options.progress)
    g_timeout_add_seconds (2, print_progress, &runner);
  if (runner.options.memory_log)
    g_timeout_add_seconds (5, log_memory, &runner);
  if (runner.options.base_time >= 0) {
    gst_element_set_start_time (runner.pipeline, GST_CLOCK_TIME_NONE);
    gst_element_set_base_time (runner.pipeline, GstClockTime (runner.options.base_time));
  }
  if (runner.options.turn && runner.options.frames > 0)
    runner.turned = gst_bin_get_by_name (GST_BIN (runner.pipeline), "view");
  add_probe (runner, "decoder", count_views);
  add_probe (runner, "rendered", count_rendered);
  if (runner.options.trace)
    runner.trace = std::make_unique<LatencyTrace> (runner.pipeline);

  if (gst_element_set_state (runner.pipeline, GST_STATE_PLAYING) == GST_STATE_CHANGE_FAILURE)
    runner.failed = true; /* the reason is on the bus; on_message() prints it and quits */
  g_main_loop_run (runner.loop);

  if (!runner.failed && runner.options.report)
    runner.failed = !write_report (runner);
  if (!runner.failed && runner.options.snapshot)
    runner.failed = !write_snapshot (runner);
  gst_element_set_state (runner.pipeline, GST_STATE_NULL);
  if (runner.trace && !runner.trace->write (runner.options.trace)) {
    g_printerr ("rangecast-run: %s: cannot be written\n", runner.options.trace);
    runner.failed = true;
  }
  gst_bus_remove_watch (bus);
  gst_clear_object (&runner.turned);
  gst_object_unref (bus);
  g_main_loop_unref (runner.loop);
}

static bool
parse_arguments (int *argc, char ***argv, Options &options)
{
  const GOptionEntry entries[] = {
      {"base-time", 0, 0, G_OPTION_ARG_INT64, &options.base_time,
          "Base time of the pipeline: that running time 0 is at this clock time", "NS"},
      {"frames", 0, 0, G_OPTION_ARG_INT, &options.frames,
          "Stop after N frames at the element named rendered (default 0: run to the end)", "N"},
      {"views", 0, 0, G_OPTION_ARG_INT, &options.views,
          "Begin when N views have points, or 2 s after the first one has (default 1)", "N"},
      {"turn", 0, 0, G_OPTION_ARG_NONE, &options.turn,
          "Turn the striprender named view once round in the N frames", nullptr},
      {"timeout", 0, 0, G_OPTION_ARG_INT, &options.timeout_s,
          "Fail if it has not ended by then (default 0: never)", "SECONDS"},
      {"progress", 0, 0, G_OPTION_ARG_NONE, &options.progress, "Print a line every 2 s", nullptr},
      {"stats", 0, 0, G_OPTION_ARG_STRING, &options.stats,
          "Send the elements' statistics there, for top.sh: udp://HOST:PORT or a file (default: "
          "environment RANGECAST_STATS, else nowhere)",
          "ADDRESS"},
      {"trace-latency", 0, 0, G_OPTION_ARG_FILENAME, &options.trace,
          "Write when each buffer passed each pad", "FILE"},
      {"report", 0, 0, G_OPTION_ARG_FILENAME, &options.report, "Write the measurements", "JSON"},
      {"snapshot", 0, 0, G_OPTION_ARG_FILENAME, &options.snapshot,
          "Write the last picture of the sink named snapshot", "PNG"},
      {"frame-log", 0, 0, G_OPTION_ARG_FILENAME, &options.frame_log,
          "Write a line for each frame: its time, latency and views with points", "CSV"},
      {"memory-log", 0, 0, G_OPTION_ARG_FILENAME, &options.memory_log,
          "Append a line every 5 s: time, KiB of the heap in use", "CSV"},
      {"threads-left", 0, 0, G_OPTION_ARG_FILENAME, &options.threads_left,
          "Write the names of threads that still run when the pipeline is gone", "FILE"},
      {"srtp-key", 0, 0, G_OPTION_ARG_FILENAME, &options.srtp_key,
          "Key of every srtpenc and srtpdec: a file of 60 hexadecimal digits", "FILE"},
      {G_OPTION_REMAINING, 0, 0, G_OPTION_ARG_STRING_ARRAY, &options.launch, nullptr, nullptr}, {}};
  GOptionContext *context =
      g_option_context_new ("LAUNCH-STRING... - run a pipeline and measure it");
  g_option_context_add_main_entries (context, entries, nullptr);
  g_option_context_add_group (context, gst_init_get_option_group ());
  GError *error = nullptr;
  const bool parsed = g_option_context_parse (context, argc, argv, &error);
  if (!parsed)
    g_printerr ("rangecast-run: %s\n", error->message);
  else if (!options.launch)
    g_printerr ("rangecast-run: expected a launch string, see --help\n");
  g_clear_error (&error);
  g_option_context_free (context);
  return parsed && options.launch;
}

/* @return false if there is something wrong with the address */
static bool
open_stats (Runner &runner)
{
  const char *address = runner.options.stats ? runner.options.stats : g_getenv ("RANGECAST_STATS");
  if (!address || !*address)
    return true;
  const char *host = g_getenv ("RANGECAST_HOST");
  std::string error;
  runner.stats = StatsSender::open (address, host && *host ? host : g_get_host_name (), error);
  if (!runner.stats)
    g_printerr ("rangecast-run: statistics: %s\n", error.c_str ());
  return runner.stats != nullptr;
}

int
main (int argc, char **argv)
{
  setlocale (LC_CTYPE, ""); /* arguments are in the user's encoding */
  Runner runner;
  if (!parse_arguments (&argc, &argv, runner.options) || !open_stats (runner))
    return 2;
  GError *error = nullptr;
  GstElement *parsed =
      gst_parse_launchv (const_cast<const gchar **> (runner.options.launch), &error);
  if (!parsed || error) {
    g_printerr ("ERROR: %s\n", error ? error->message : "empty launch string");
    g_clear_error (&error);
    gst_clear_object (&parsed);
    return 1;
  }
  if (GST_IS_PIPELINE (parsed)) {
    runner.pipeline = parsed;
  } else {
    runner.pipeline = gst_pipeline_new (nullptr);
    gst_bin_add (GST_BIN (runner.pipeline), parsed);
  }
  if ((runner.options.frame_log &&
          !(runner.frame_log = open_frame_log (runner.options.frame_log))) ||
      (runner.options.srtp_key && !give_srtp_key (runner.pipeline, runner.options.srtp_key)))
    runner.failed = true;
  else
    play (runner);
  gst_object_unref (runner.pipeline);
  if (runner.frame_log)
    std::fclose (runner.frame_log);
  if (runner.options.threads_left && !write_threads_left (runner.options.threads_left))
    runner.failed = true;
  g_free (runner.options.report);
  g_free (runner.options.stats);
  g_free (runner.options.trace);
  g_free (runner.options.snapshot);
  g_free (runner.options.frame_log);
  g_free (runner.options.threads_left);
  g_free (runner.options.memory_log);
  g_free (runner.options.srtp_key);
  g_strfreev (runner.options.launch);
  gst_deinit (); /* tracers write now what they found */
  return runner.failed ? 1 : 0;
}
