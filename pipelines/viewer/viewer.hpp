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
  GstElement *first = nullptr;           /* gets the frame sets */
  GstElement *render = nullptr;          /* striprender */
  GstElement *size = nullptr;            /* capsfilter behind it */
  GstElement *overlay_element = nullptr; /* overlaycomposition */
  GstElement *sink = nullptr;
  std::atomic<bool> hears = false;            /* one voice */
  std::atomic<GstElement *> volume = nullptr; /* of the speech; nullptr: there is none */
  GMainLoop *loop = nullptr;
  bool is_file = false;
  bool failed = false;
  int patience = 0; /* retries that write_picture() has left */
  std::atomic<bool> seen_frames = false;
  std::optional<Overlay> overlay;
  std::optional<Playback> playback;

  std::mutex lock;                             /* guards the frame set */
  GstSample *frame_set = nullptr;              /* the last one drawn */
  GstClockTime last_pts = GST_CLOCK_TIME_NONE; /* streaming thread */
};

/** Reports an error and quits the main loop. Main thread. */
void fail (Viewer &viewer, const std::string &text);

/** @name pipeline.cpp @{ */
/** Adds an element to the pipeline; exits where its plugin is missing. */
GstElement *add_element (Viewer &viewer, const char *factory);
/** @return false after reporting an error */
bool build_pipeline (Viewer &viewer);
/** GSourceFunc: fails because the input has no frame sets. */
gboolean refuse_input (gpointer viewer);
/** @} */

/** @name speech.cpp @{ */
/** Plays what comes from a pad, decoded. Any thread. @return false if it cannot be, or other speech
 * is heard */
bool hear (Viewer &viewer, GstPad *pad);
/** Receives speech at options.audio, and puts capturesync between the two elements. */
void build_speech_receiver (Viewer &viewer, GstElement *before, GstElement *after);
/** The path of the speech beside the recording that is shown; empty: none. */
std::string find_speech (const Viewer &viewer);
/** Main thread. */
void toggle_mute (Viewer &viewer);
/** @} */

/** @name snapshots.cpp, main thread @{ */
/** Writes the current picture as PNG; waits up to two seconds for one. */
void write_picture (Viewer &viewer);
/** Writes the points of the last frame set as PLY. */
void write_points (Viewer &viewer);
/** The last frame set. Returns: (transfer full): nullptr if there was none. Any thread */
GstSample *last_frame_set (Viewer &viewer);
/** @} */

/** @name controls.cpp @{ */
/** The keys of a file, or of a stream, for the overlay. */
std::vector<TextRow> key_rows (bool is_file);
/** Handles the viewer's keys and the mouse on the time bar, which do not reach striprender. */
void watch_controls (Viewer &viewer);
/** For a message that a mouse or key event was not handled: events do not reach the elements while
 *  the pipeline seeks, so the viewer's own are handled here. Main thread. */
void handle_missed_event (Viewer &viewer, GstMessage *message);
/** @} */
