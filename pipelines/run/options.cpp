/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "options.hpp"

#include <gst/gst.h>

#include <initializer_list>

RunOptions::~RunOptions ()
{
  for (gchar *text : {stats, report, snapshot, srtp_key, clock, signal, certificate})
    g_free (text);
  g_strfreev (drop_empty);
  g_strfreev (launch);
}

bool
RunOptions::parse (int *argc, char ***argv)
{
  const GOptionEntry entries[] = {
      {"base-time", 0, 0, G_OPTION_ARG_INT64, &base_time,
          "Base time of the pipeline: the clock time of running time 0", "NS"},
      {"frames", 0, 0, G_OPTION_ARG_INT, &frames,
          "End the streams after N frames at the element named rendered (default 0: no limit)",
          "N"},
      {"views", 0, 0, G_OPTION_ARG_INT, &views,
          "Start when N views have points, or 2 s after the first one (default 1)", "N"},
      {"turn", 0, 0, G_OPTION_ARG_NONE, &turn,
          "Turn the striprender named view by 360 degrees over the N frames", nullptr},
      {"timeout", 0, 0, G_OPTION_ARG_INT, &timeout_s,
          "Fail if the stream has not ended by then (default 0: no limit)", "SECONDS"},
      {"loop", 0, 0, G_OPTION_ARG_NONE, &loop, "Play a file again and again", nullptr},
      {"progress", 0, 0, G_OPTION_ARG_NONE, &progress, "Print a line every 2 s", nullptr},
      {"stats", 0, 0, G_OPTION_ARG_STRING, &stats,
          "Send the elements' statistics to udp://HOST:PORT (default: environment variable "
          "RANGECAST_STATS, or none)",
          "ADDRESS"},
      {"report", 0, 0, G_OPTION_ARG_FILENAME, &report, "Write the measurements", "JSON"},
      {"snapshot", 0, 0, G_OPTION_ARG_FILENAME, &snapshot,
          "Write the last frame of the sink named snapshot", "PNG"},
      {"srtp-key", 0, 0, G_OPTION_ARG_FILENAME, &srtp_key,
          "File with the key (60 hexadecimal digits) of every srtpenc and srtpdec", "FILE"},
      {"drop-empty", 0, 0, G_OPTION_ARG_FILENAME_ARRAY, &drop_empty,
          "Remove this file at the end if nothing was written to it, or a WebM header without "
          "frames; that is an error of the first of several such files",
          "FILE"},
      {"clock", 0, 0, G_OPTION_ARG_STRING, &clock,
          "Clock of the pipeline: system (monotonic), or HOST:PORT, where rangemux publishes one "
          "(default: what its elements provide, such as a sound card's)",
          "CLOCK"},
      {"signal", 0, 0, G_OPTION_ARG_STRING, &signal,
          "Negotiate the webrtcbin named webrtc with the peer that uses the same link", "'LINK'"},
      {"certificate", 0, 0, G_OPTION_ARG_FILENAME, &certificate,
          "Certificate of the server of --signal (default: one that the system trusts)", "PEM"},
      {G_OPTION_REMAINING, 0, 0, G_OPTION_ARG_STRING_ARRAY, &launch, nullptr, nullptr}, {}};
  GOptionContext *context =
      g_option_context_new ("LAUNCH-STRING... - run a pipeline and measure it");
  g_option_context_add_main_entries (context, entries, nullptr);
  g_option_context_add_group (context, gst_init_get_option_group ());
  GError *error = nullptr;
  const bool parsed = g_option_context_parse (context, argc, argv, &error);
  if (!parsed)
    g_printerr ("rangecast-run: %s\n", error->message);
  else if (!launch)
    g_printerr ("rangecast-run: give a launch string, see --help\n");
  g_clear_error (&error);
  g_option_context_free (context);
  return parsed && launch;
}
