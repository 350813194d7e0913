/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The command line of the viewer. */
#pragma once

#include <glib.h>

/** What the command line says. clear_options() frees its strings. */
struct ViewerOptions {
  gint listen = 0; /* UDP port; 0: none */
  gint audio = 0;  /* UDP port of speech; 0: none */
  gint latency_ms = 30;
  gboolean once = FALSE;
  gchar *background = nullptr;
  gchar *size = nullptr;
  gchar *mode = nullptr;
  gdouble auto_orbit = 0;
  gchar *out = nullptr;
  gchar **inputs = nullptr;

  int width = 640, height = 480; /* pixels */
  guint background_argb = 0;     /* if background is given */
};

/** Also takes GStreamer's options, and initialises it.
 *  @param keys  what the keys do, for --help
 *  @return false after saying what is wrong with them */
bool parse_arguments (int *argc, char ***argv, const char *keys, ViewerOptions &options);
void clear_options (ViewerOptions &options);

/** Whether a window can be seen; says why not. */
bool check_display ();
