/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What the files of the viewer share. */
#pragma once

#include <gst/gst.h>

#include <atomic>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "options.hpp"
#include "overlay.hpp"
#include "playback.hpp"

struct Viewer {
  ViewerOptions options;
  GstElement *pipeline = nullptr;
  GstElement *first = nullptr;           /* what takes frame sets */
  GstElement *render = nullptr;          /* striprender */
  GstElement *size = nullptr;            /* capsfilter behind it */
  GstElement *overlay_element = nullptr; /* overlaycomposition */
  GstElement *sink = nullptr;
  GMainLoop *loop = nullptr;
  bool is_file = false;
  bool failed = false;
  int patience = 0; /* times that write_picture() waits on */
  std::atomic<bool> seen_frames = false;
  std::optional<Overlay> overlay;
  std::optional<Playback> playback;

  std::mutex lock;                             /* guards the frame set */
  GstSample *frame_set = nullptr;              /* the last one drawn */
  GstClockTime last_pts = GST_CLOCK_TIME_NONE; /* streaming thread */
};

/** Says why the viewer ends, and ends it. Main thread. */
void fail (Viewer &viewer, const std::string &text);

/** @name pipeline.cpp @{ */
/** @return false after saying why there is none */
bool build_pipeline (Viewer &viewer);
/** GSourceFunc: fails, because the input holds something else. */
gboolean refuse_input (gpointer viewer);
/** @} */

/** @name snapshots.cpp, main thread @{ */
/** Writes the picture that is shown as PNG; waits two seconds for one. */
void write_picture (Viewer &viewer);
/** Writes the points of the last frame set as PLY. */
void write_points (Viewer &viewer);
/** The last frame set. Returns: (transfer full): nullptr if there was none. Any thread */
GstSample *take_frame_set (Viewer &viewer);
/** @} */

/** @name controls.cpp @{ */
/** The keys of a file, or of a stream, for the overlay. */
std::vector<TextRow> key_rows (bool is_file);
/** Takes the viewer's keys, and the mouse on the time bar, out of what goes up to striprender. */
void watch_controls (Viewer &viewer);
/** Of a message of the window that nobody took an event of mouse or keys. While the pipeline seeks,
 *  events do not reach the elements: those of the viewer are handled now. Main thread. */
void handle_missed_event (Viewer &viewer, GstMessage *message);
/** @} */
