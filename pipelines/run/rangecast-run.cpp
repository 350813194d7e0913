/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Runs a launch string as gst-launch-1.0 does, and measures it: frames, latency from capture to
 * the element named "rendered", points, bytes, RTP packets, CPU time. Reads only what any
 * application can read: buffers, their metas, and the elements' `stats` properties.
 *
 * Elements it looks for, by name (all may be missing): "rendered" (frames and latency),
 * "decoder" (a neighbourcodedec), "view" (a striprender), "snapshot"
 * (a sink whose last sample becomes a PNG), "microphone" (a volume, which SIGUSR1 mutes and
 * unmutes); every rtpjitterbuffer, whatever its name. */
#include <glib/gstdio.h>
#include <gst/gst.h>
#include <gst/net/gstnet.h>
#include <gst/video/video.h>

#include <clocale>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <utility>

#include "call.hpp"
#include "common/dump-graph.hpp"
#include "common/final-signal.hpp"
#include "common/for-each.hpp"
#include "measure.hpp"
#include "srtp-key.hpp"
#include "stats-sender.hpp"

namespace {

/* The command line; --help describes the options. */
struct Options {
  gint64 base_time = -1; ///< ns, < 0: the pipeline's own
  gint frames = 0;
  gint views = 1;
  gboolean turn = FALSE;
  gint timeout_s = 0;
  gboolean loop = FALSE;
  gboolean progress = FALSE;
  gchar *stats = nullptr;
  gchar *report = nullptr;
  gchar *snapshot = nullptr;
  gchar *srtp_key = nullptr;
  gchar *clock = nullptr;
  gchar *signal = nullptr;
  gchar *certificate = nullptr;
  gchar **drop_empty = nullptr;
  gchar **launch = nullptr;
};

struct Runner {
  Options options;
  GstElement *pipeline = nullptr;
  GMainLoop *loop = nullptr;
  std::unique_ptr<RunMeasure> measure;
  std::unique_ptr<StatsSender> stats;
  std::unique_ptr<Call> call;
  std::set<int> learning; /* view-ids whose background is being learnt */
  bool failed = false;
  bool ending = false;
  bool looping = false;
  bool again = false; /* with another pipeline: the other end of a call left */
  bool muted = false;
};

gboolean
on_no_end (gpointer user_data)
{
  auto runner = static_cast<Runner *> (user_data);
  g_printerr ("ERROR: the streams do not end; files may be incomplete\n");
  runner->failed = true;
  g_main_loop_quit (runner->loop);
  return G_SOURCE_REMOVE;
}

/* From another thread: a source may keep this one waiting. Files have their first bytes before the
 * pipeline plays; until sinks are prerolled, sources hold locks that EOS needs. */
void
send_eos (GstElement *pipeline, gpointer loop)
{
  GstState state = GST_STATE_NULL;
  gst_element_get_state (pipeline, &state, nullptr, kPatience_ms / 3 * GST_MSECOND);
  if (state == GST_STATE_PLAYING)
    gst_element_send_event (pipeline, gst_event_new_eos ());
  else
    g_main_loop_quit (static_cast<GMainLoop *> (loop));
}

gboolean
on_interrupt (gpointer user_data)
{
  auto runner = static_cast<Runner *> (user_data);
  if (runner->call) {
    g_main_loop_quit (runner->loop);
  } else if (!std::exchange (runner->ending, true)) {
    gst_element_call_async (runner->pipeline, send_eos, g_main_loop_ref (runner->loop),
        reinterpret_cast<GDestroyNotify> (g_main_loop_unref));
    g_timeout_add (kPatience_ms * 2 / 3, on_no_end, runner);
  }
  return G_SOURCE_REMOVE;
}

/* Warnings say when rangemux lost a stream or stereocamsrc its cameras; only an element message
 * says that they are back, or that udpsrc receives nothing. */
void
report_element_message (GstMessage *message)
{
  const GstStructure *structure = gst_message_get_structure (message);
  const gchar *name = GST_OBJECT_NAME (message->src);
  if (gst_structure_has_name (structure, "stereocamsrc-back")) {
    g_printerr ("%s: the cameras are back\n", name);
  } else if (gst_structure_has_name (structure, "GstUDPSrcTimeout")) {
    int port = 0;
    guint64 time = 0;
    g_object_get (message->src, "port", &port, "timeout", &time, nullptr);
    g_printerr ("%s: no packets on UDP port %d for %g s\n", name, port, double (time) / GST_SECOND);
  } else if (gst_structure_has_name (structure, "rangemux-stream") &&
             g_strcmp0 (gst_structure_get_string (structure, "state"), "in") == 0) {
    int view_id = -1;
    gst_structure_get_int (structure, "view-id", &view_id);
    g_printerr ("%s: pad %s (view %d) is back\n", name, gst_structure_get_string (structure, "pad"),
        view_id);
  }
}

/* When nobody should be in view, and when people may come back. While roiextract skips
 * frames before it learns, it posts 0 frames. */
void
report_learning (Runner &runner, GstMessage *message)
{
  const GstStructure *structure = gst_message_get_structure (message);
  int view_id = 0, frames = 0, of = 0;
  if (!gst_structure_has_name (structure, "roiextract-learning") ||
      !gst_structure_get (structure, "view-id", G_TYPE_INT, &view_id, "frames", G_TYPE_INT, &frames,
          "of", G_TYPE_INT, &of, nullptr))
    return;
  if (frames >= of) {
    g_print ("view %d: the background is learnt\n", view_id);
    runner.learning.erase (view_id);
  } else if (frames > 0 && runner.learning.insert (view_id).second) {
    g_print (
        "view %d: learning the background from %d frames; nobody should be in view\n", view_id, of);
  }
}

/* Where browsers find the stream. */
void
report_address (GstMessage *message)
{
  if (gst_message_has_name (message, "rangewebsink-address"))
    g_print ("serving %s\n", gst_structure_get_string (gst_message_get_structure (message), "url"));
}

/* From the beginning, as a segment, so that another one follows without an end of stream. */
void
play_again (Runner &runner)
{
  const auto flags = GstSeekFlags (
      GST_SEEK_FLAG_SEGMENT | (runner.looping ? GST_SEEK_FLAG_NONE : GST_SEEK_FLAG_FLUSH));
  runner.looping = true;
  if (gst_element_seek_simple (runner.pipeline, GST_FORMAT_TIME, flags, 0))
    return;
  g_printerr ("ERROR: --loop: this stream cannot be played from its beginning again\n");
  runner.failed = true;
  g_main_loop_quit (runner.loop);
}

/* The file or port of an element, which GStreamer's errors do not always name. */
std::string
subject_of (GstObject *element)
{
  std::string subject;
  for (const char *name : {"location", "port"})
    if (g_object_class_find_property (G_OBJECT_GET_CLASS (element), name)) {
      GValue value = G_VALUE_INIT;
      g_object_get_property (G_OBJECT (element), name, g_value_init (&value, G_TYPE_STRING));
      if (const gchar *text = g_value_get_string (&value))
        subject += std::string (" ") + name + "=" + text;
      g_value_unset (&value);
    }
  return subject;
}

gboolean
on_message (GstBus *, GstMessage *message, gpointer user_data)
{
  auto runner = static_cast<Runner *> (user_data);
  GError *error = nullptr;
  gchar *details = nullptr;
  dump_graph (message, "rangecast-run");
  switch (GST_MESSAGE_TYPE (message)) {
    case GST_MESSAGE_ERROR:
      gst_message_parse_error (message, &error, &details);
      g_printerr ("ERROR: %s%s: %s\n%s\n", GST_OBJECT_NAME (message->src),
          subject_of (message->src).c_str (), error->message, details ? details : "");
      if (runner->stats)
        runner->stats->take_warning (message, error->message);
      g_free (details);
      g_error_free (error);
      runner->failed = true;
      g_main_loop_quit (runner->loop);
      break;
    case GST_MESSAGE_WARNING:
      gst_message_parse_warning (message, &error, nullptr);
      g_printerr ("WARNING: %s: %s\n", GST_OBJECT_NAME (message->src), error->message);
      if (runner->stats)
        runner->stats->take_warning (message, error->message);
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
      report_element_message (message);
      report_address (message);
      report_learning (*runner, message);
      if (runner->stats)
        runner->stats->take (message);
      break;
    case GST_MESSAGE_APPLICATION:
      if (runner->call && runner->call->handle (message)) {
        runner->again = gst_message_has_name (message, "call-left");
        g_main_loop_quit (runner->loop);
      }
      break;
    case GST_MESSAGE_ASYNC_DONE: /* the pipeline can be asked to seek */
      if (runner->options.loop && !runner->looping)
        play_again (*runner);
      break;
    case GST_MESSAGE_SEGMENT_DONE:
      if (runner->ending)
        g_main_loop_quit (runner->loop);
      else
        play_again (*runner);
      break;
    case GST_MESSAGE_EOS:
      g_main_loop_quit (runner->loop);
      break;
    default:
      break;
  }
  return G_SOURCE_CONTINUE;
}

/* The pipeline did not start. Some elements fail without a message. */
void
report_failure (Runner &runner, GstBus *bus)
{
  runner.failed = true;
  if (GstMessage *message = gst_bus_pop_filtered (bus, GST_MESSAGE_ERROR)) {
    on_message (bus, message, &runner);
    gst_message_unref (message);
  } else {
    g_printerr (
        "ERROR: the pipeline does not start, and no element posted an error; try GST_DEBUG=2\n");
  }
}

gboolean
on_timeout (gpointer user_data)
{
  auto runner = static_cast<Runner *> (user_data);
  g_printerr ("ERROR: no end of stream after %d s\n", runner->options.timeout_s);
  runner->failed = true;
  g_main_loop_quit (runner->loop);
  return G_SOURCE_REMOVE;
}

/* Mutes or unmutes the volume element named microphone. */
void
set_microphone (Runner &runner, bool muted)
{
  GstElement *microphone = gst_bin_get_by_name (GST_BIN (runner.pipeline), "microphone");
  if (!microphone || !g_object_class_find_property (G_OBJECT_GET_CLASS (microphone), "mute")) {
    g_printerr ("rangecast-run: no volume element named microphone to mute\n");
  } else {
    runner.muted = muted;
    g_object_set (microphone, "mute", gboolean (muted), nullptr);
    g_print ("the microphone is %s\n", muted ? "muted" : "on");
  }
  gst_clear_object (&microphone);
}

/* Timers and signals of the main loop. */
void
add_sources (Runner &runner)
{
  const auto toggle_microphone = [] (gpointer data) -> gboolean {
    auto runner = static_cast<Runner *> (data);
    set_microphone (*runner, !runner->muted);
    return G_SOURCE_CONTINUE;
  };
  add_final_signals (on_interrupt, &runner);
  g_unix_signal_add (SIGUSR1, toggle_microphone, &runner);
  if (const int limit_s = runner.options.timeout_s; limit_s > 0) {
    g_timeout_add_seconds (guint (limit_s), on_timeout, &runner);
    end_process_after (1000L * limit_s + kPatience_ms);
  }
  const auto progress = [] (gpointer data) -> gboolean {
    static_cast<Runner *> (data)->measure->print_progress ();
    return G_SOURCE_CONTINUE;
  };
  if (runner.options.progress)
    g_timeout_add_seconds (2, progress, &runner);
}

/* A file without a byte, or WebM without a cluster: webmmux writes a header even without frames. */
bool
is_empty (const char *path)
{
  constexpr goffset kMaxHeader = 4096;
  GStatBuf file;
  gchar *contents = nullptr;
  gsize size = 0;
  if (g_stat (path, &file) != 0 || !S_ISREG (file.st_mode) || file.st_size > kMaxHeader ||
      !g_file_get_contents (path, &contents, &size, nullptr))
    return false;
  const std::string_view bytes (contents, size);
  const bool empty = bytes.empty () || (bytes.starts_with ("\x1a\x45\xdf\xa3") &&
                                           bytes.find ("\x1f\x43\xb6\x75") == bytes.npos);
  g_free (contents);
  return empty;
}

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

/* Writes the last frame of the sink named "snapshot" as a PNG. @return false after reporting why
 * not */
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

/* Reads the results while the pipeline still has them, and stops it. */
void
finish (Runner &runner)
{
  const Options &options = runner.options;
  if (!runner.failed && options.report)
    runner.failed = !runner.measure->write_report (options.report);
  if (!runner.failed && options.snapshot)
    runner.failed = !write_snapshot (runner.pipeline, options.snapshot);
  gst_element_set_state (runner.pipeline, GST_STATE_NULL);
  for (gchar **path = options.drop_empty; path && *path; path++)
    if (is_empty (*path)) {
      g_remove (*path);
      if (path == options.drop_empty && !std::exchange (runner.failed, true))
        g_printerr ("ERROR: %s: nothing came to write, so there is no file\n", *path);
    }
}

/* Has an element post its statistics every second, unless its launch string says how often. */
void
request_stats (GstElement *element)
{
  GParamSpec *spec = g_object_class_find_property (G_OBJECT_GET_CLASS (element), "stats-interval");
  guint interval = 0;
  if (spec)
    g_object_get (element, "stats-interval", &interval, nullptr);
  if (spec && interval == 0)
    g_object_set (element, "stats-interval", 1000u, nullptr);
}

void
play (Runner &runner)
{
  if (!runner.loop) {
    runner.loop = g_main_loop_new (nullptr, FALSE);
    add_sources (runner);
  }
  GstBus *bus = gst_element_get_bus (runner.pipeline);
  gst_bus_add_watch (bus, on_message, &runner);
  if (runner.options.base_time >= 0) {
    gst_element_set_start_time (runner.pipeline, GST_CLOCK_TIME_NONE);
    gst_element_set_base_time (runner.pipeline, GstClockTime (runner.options.base_time));
  }
  if (runner.stats)
    for_each (gst_bin_iterate_recurse (GST_BIN (runner.pipeline)), request_stats);
  if (runner.muted)
    set_microphone (runner, true);
  runner.measure->start (runner.options.turn);

  if (gst_element_set_state (runner.pipeline, GST_STATE_PLAYING) == GST_STATE_CHANGE_FAILURE)
    report_failure (runner, bus);
  else if (runner.call && !runner.call->join (runner.pipeline))
    runner.failed = true;
  else
    g_main_loop_run (runner.loop);
  finish (runner);
  gst_bus_remove_watch (bus);
  gst_object_unref (bus);
}

/* @return false after reporting a wrong address */
bool
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

/* @return false after reporting what is wrong */
bool
make_call (Runner &runner)
{
  if (const char *url = runner.options.signal)
#ifdef RANGECAST_CALLS
    return (runner.call = Call::make (url, runner.options.certificate)) != nullptr;
#else
    return g_printerr ("rangecast-run: --signal %s: built without libsoup or webrtc\n", url), false;
#endif
  return true;
}

/* @return transfer full; nullptr after reporting what is wrong with it */
GstElement *
parse_pipeline (gchar **launch)
{
  GError *error = nullptr;
  /* Of a number out of range GObject only warns (later GLib calls that critical), and the default
   * stays. Here it is an error, also where G_DEBUG would abort. */
  const auto fail = [] (const gchar *, GLogLevelFlags, const gchar *message, gpointer error) {
    if (!*static_cast<GError **> (error))
      g_set_error_literal (static_cast<GError **> (error), GST_PARSE_ERROR,
          GST_PARSE_ERROR_COULD_NOT_SET_PROPERTY, message);
  };
  GError *warning = nullptr;
  const guint handler = g_log_set_handler (
      "GLib-GObject", GLogLevelFlags (G_LOG_LEVEL_WARNING | G_LOG_LEVEL_CRITICAL), fail, &warning);
  const GLogLevelFlags fatal = g_log_set_always_fatal (G_LOG_LEVEL_ERROR);
  GstElement *parsed = gst_parse_launchv (const_cast<const gchar **> (launch), &error);
  g_log_set_always_fatal (fatal);
  g_log_remove_handler ("GLib-GObject", handler);
  if (error)
    g_clear_error (&warning);
  else
    error = warning;
  if (!parsed || error) {
    g_printerr ("ERROR: %s\n", error ? error->message : "empty launch string");
    g_clear_error (&error);
    gst_clear_object (&parsed);
    return nullptr;
  }
  if (GST_IS_PIPELINE (parsed))
    return parsed;
  GstElement *pipeline = gst_pipeline_new (nullptr);
  gst_bin_add (GST_BIN (pipeline), parsed);
  return pipeline;
}

/* ---- the clock ---- */

/* @return transfer full; nullptr after reporting a wrong name */
GstClock *
open_net_clock (const std::string &name)
{
  g_autoptr (GSocketConnectable) parsed = g_network_address_parse (name.c_str (), 0, nullptr);
  auto address = parsed ? G_NETWORK_ADDRESS (parsed) : nullptr;
  if (!address || g_network_address_get_port (address) == 0) {
    g_printerr ("rangecast-run: --clock: '%s' is neither system nor HOST:PORT\n", name.c_str ());
    return nullptr;
  }
  GstClock *clock = gst_net_client_clock_new (
      nullptr, g_network_address_get_hostname (address), g_network_address_get_port (address), 0);
  bool told = false;
  while (!gst_clock_wait_for_sync (clock, 2 * GST_SECOND))
    if (!std::exchange (told, true))
      g_printerr ("rangecast-run: waiting for the clock at %s\n", name.c_str ());
  return clock;
}

/* Makes the pipeline use a clock instead of what its elements provide: "system" (monotonic), or
 * HOST:PORT, where rangemux clock-port publishes one; waits until that is known. @return false
 * after reporting what is wrong with the name */
bool
use_clock (GstElement *pipeline, const char *name)
{
  GstClock *clock =
      g_strcmp0 (name, "system") == 0 ? gst_system_clock_obtain () : open_net_clock (name);
  if (!clock)
    return false;
  gst_pipeline_use_clock (GST_PIPELINE (pipeline), clock);
  gst_object_unref (clock);
  return true;
}

/* Releases the pipeline. @return false after reporting an error */
bool
run (Runner &runner)
{
  const Options &options = runner.options;
  runner.measure = std::make_unique<RunMeasure> (runner.pipeline, options.views, options.frames);
  if ((options.clock && !use_clock (runner.pipeline, options.clock)) ||
      (options.srtp_key && !give_srtp_key (runner.pipeline, options.srtp_key)))
    runner.failed = true;
  else
    play (runner);
  runner.measure.reset ();
  gst_object_unref (runner.pipeline);
  return !runner.failed;
}

/* Reads the command line, and initialises GStreamer. @return false after reporting what is wrong */
bool
parse_arguments (int argc, char **argv, Options &o)
{
  const GOptionEntry entries[] = {
      {"base-time", 0, 0, G_OPTION_ARG_INT64, &o.base_time,
          "Base time of the pipeline: the clock time of running time 0", "NS"},
      {"frames", 0, 0, G_OPTION_ARG_INT, &o.frames,
          "End the streams after N frames at the element named rendered (default 0: no limit)",
          "N"},
      {"views", 0, 0, G_OPTION_ARG_INT, &o.views,
          "Start when N views have points, or 2 s after the first one (default 1)", "N"},
      {"turn", 0, 0, G_OPTION_ARG_NONE, &o.turn,
          "Turn the striprender named view by 360 degrees over the N frames", nullptr},
      {"timeout", 0, 0, G_OPTION_ARG_INT, &o.timeout_s,
          "Fail if the stream has not ended by then (default 0: no limit)", "SECONDS"},
      {"loop", 0, 0, G_OPTION_ARG_NONE, &o.loop, "Play a file again and again", nullptr},
      {"progress", 0, 0, G_OPTION_ARG_NONE, &o.progress, "Print a line every 2 s", nullptr},
      {"stats", 0, 0, G_OPTION_ARG_STRING, &o.stats,
          "Send the elements' statistics to udp://HOST:PORT (default: environment variable "
          "RANGECAST_STATS, or none)",
          "ADDRESS"},
      {"report", 0, 0, G_OPTION_ARG_FILENAME, &o.report, "Write the measurements", "JSON"},
      {"snapshot", 0, 0, G_OPTION_ARG_FILENAME, &o.snapshot,
          "Write the last frame of the sink named snapshot", "PNG"},
      {"srtp-key", 0, 0, G_OPTION_ARG_FILENAME, &o.srtp_key,
          "File with the key (60 hexadecimal digits) of every srtpenc and srtpdec", "FILE"},
      {"drop-empty", 0, 0, G_OPTION_ARG_FILENAME_ARRAY, &o.drop_empty,
          "Remove this file at the end if nothing was written to it, or a WebM header without "
          "frames; that is an error of the first of several such files",
          "FILE"},
      {"clock", 0, 0, G_OPTION_ARG_STRING, &o.clock,
          "Clock of the pipeline: system (monotonic), or HOST:PORT, where rangemux publishes one "
          "(default: what its elements provide, such as a sound card's)",
          "CLOCK"},
      {"signal", 0, 0, G_OPTION_ARG_STRING, &o.signal,
          "Negotiate the webrtcbin named webrtc with the peer that uses the same link", "'LINK'"},
      {"certificate", 0, 0, G_OPTION_ARG_FILENAME, &o.certificate,
          "Certificate of the server of --signal (default: one that the system trusts)", "PEM"},
      {G_OPTION_REMAINING, 0, 0, G_OPTION_ARG_STRING_ARRAY, &o.launch, nullptr, nullptr}, {}};
  GOptionContext *context =
      g_option_context_new ("LAUNCH-STRING... - run a pipeline and measure it");
  g_option_context_add_main_entries (context, entries, nullptr);
  g_option_context_add_group (context, gst_init_get_option_group ());
  GError *error = nullptr;
  const bool parsed = g_option_context_parse (context, &argc, &argv, &error);
  if (!parsed)
    g_printerr ("rangecast-run: %s\n", error->message);
  else if (!o.launch)
    g_printerr ("rangecast-run: give a launch string, see --help\n");
  g_clear_error (&error);
  g_option_context_free (context);
  return parsed && o.launch;
}

} // namespace

int
main (int argc, char **argv)
{
  setlocale (LC_CTYPE, ""); /* arguments are in the user's encoding */
  static Runner runner;     /* its options are never freed */
  if (!parse_arguments (argc, argv, runner.options) || !open_stats (runner))
    return 2;
  bool good = make_call (runner);
  do {
    runner.pipeline = good ? parse_pipeline (runner.options.launch) : nullptr;
    good = runner.pipeline && run (runner);
  } while (std::exchange (runner.again, false) && good);
  runner.call.reset ();
  g_clear_pointer (&runner.loop, g_main_loop_unref);
  gst_deinit (); /* tracers write now what they found */
  return good ? 0 : 1;
}
