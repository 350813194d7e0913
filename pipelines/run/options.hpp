/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <glib.h>

/** The command line of rangecast-run; --help describes the options. */
struct RunOptions {
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

  RunOptions () = default;
  ~RunOptions ();
  RunOptions (const RunOptions &) = delete;
  RunOptions &operator= (const RunOptions &) = delete;

  /** Reads the command line, and initialises GStreamer.
   *  @return false after reporting what is wrong */
  bool parse (int *argc, char ***argv);
};
