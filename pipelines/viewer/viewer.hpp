/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What the files of the viewer share. */
#pragma once

#include <gst/gst.h>

#include <atomic>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "playback.hpp"

/** What the command line says. */
struct ViewerOptions {
  gint listen = 0; /* UDP port; 0: none */
  gint audio = 0;  /* UDP port of audio; 0: none */
  gint latency_ms = 30;
  gboolean once = FALSE;
  gchar *render = nullptr, *size = nullptr, *out = nullptr;
  gchar **inputs = nullptr;

  int width = 640, height = 480; /* pixels */
};

struct Viewer {
  ViewerOptions options;
  GstElement *pipeline = nullptr;
  /* Of the pipeline: it has the references. */
  GstElement *first = nullptr, *render = nullptr, *size = nullptr, *sink = nullptr;
  std::atomic<GstElement *> volume = nullptr; /* nullptr: no audio */
  GMainLoop *loop = nullptr;
  bool is_file = false;
  bool failed = false;
  std::atomic<bool> seen_frames = false;
  std::optional<Playback> playback;

  std::mutex lock;                /* guards the frame set */
  GstSample *frame_set = nullptr; /* the last one drawn */
};

/** Calls it in the main thread, soon. Any thread. */
inline void
in_main_loop (std::function<void ()> call)
{
  using Call = std::function<void ()>;
  g_idle_add_full (
      G_PRIORITY_DEFAULT, [] (gpointer made) { return (*static_cast<Call *> (made)) (), FALSE; },
      new Call (std::move (call)), [] (gpointer made) { delete static_cast<Call *> (made); });
}

/** Reports an error and quits the main loop. Main thread. */
void fail (Viewer &viewer, const std::string &text);

/** @name pipeline.cpp @{ */
/** @return false after reporting an error */
bool build_pipeline (Viewer &viewer);
/** GSourceFunc: fails because the input has no frame sets. */
gboolean refuse_input (gpointer viewer);
/** @} */

/** @name snapshots.cpp, main thread @{ */
/** Writes the current frame as PNG; waits up to two seconds for one. */
void write_picture (Viewer &viewer);
/** Writes the points of the last frame set as PLY. */
void write_points (Viewer &viewer);
/** The last frame set. Returns: (transfer full): nullptr if there was none. Any thread */
GstSample *last_frame_set (Viewer &viewer);
/** @} */

/** @name controls.cpp @{ */
/** What the keys do. */
extern const char kKeyHelp[];
/** Handles the viewer's keys, which do not reach striprender. */
void watch_controls (Viewer &viewer);
/** For a message that a navigation event was not handled: events do not reach the elements while
 *  the pipeline seeks, so the viewer's own are handled here. Main thread. */
void handle_missed_event (Viewer &viewer, GstMessage *message);
/** @} */
