/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <array>
#include <cstdio>
#include <functional>
#include <mutex>

#include "latency-samples.hpp"
#include "options.hpp"

/** What the elements of a pipeline have counted. */
struct StreamStats {
  guint64 frames = 0, views = 0;
  guint64 points = 0, raw_bytes = 0, coded_bytes = 0, coded_frames = 0;
  guint64 rtp_packets = 0, rtp_lost = 0;
};

/** Measures a pipeline by its elements named "rendered" and "decoder", by probes on their source
 *  pads and by their statistics, and turns the one named "view". Its memory does not
 *  grow. */
class RunMeasure {
public:
  /** @param on_last  called on a streaming thread once the frames asked for have passed */
  RunMeasure (GstElement *pipeline, const RunOptions &options, std::function<void ()> on_last);
  ~RunMeasure ();
  RunMeasure (const RunMeasure &) = delete;
  RunMeasure &operator= (const RunMeasure &) = delete;

  /** Writes a line a frame to a file. @return false after reporting that it cannot be opened */
  bool log_frames (const char *path);
  /** Adds the probes; before the pipeline runs. */
  void start ();

  /* Any thread: */
  [[nodiscard]] StreamStats stats ();
  [[nodiscard]] double fps ();
  /** From capture time to "rendered". @param p  0 to 1 */
  [[nodiscard]] double latency_ms (double p);
  /** Of so many frame sets, as many as have had points in all views. */
  [[nodiscard]] guint64 whole_of (guint64 frames);
  /** The last picture of a frame set that had points in all views; transfer full. nullptr if there
   *  was none, or without the option snapshot. */
  [[nodiscard]] GstSample *last_whole_picture ();

private:
  static GstPadProbeReturn count_views (GstPad *, GstPadProbeInfo *info, gpointer self);
  static GstPadProbeReturn count_rendered (GstPad *, GstPadProbeInfo *info, gpointer self);
  void add_probe (const char *element_name, GstPadProbeCallback probe);
  bool record_rendered (GstClockTime capture, gint &frames);
  void keep_if_whole (GstPad *pad, GstBuffer *picture);

  GstElement *pipeline_;
  const RunOptions &options_;
  std::function<void ()> on_last_;
  GstElement *turned_ = nullptr; /* a striprender */

  std::mutex lock_; /* guards what the pad probes write */
  LatencySamples latencies_ms_;
  GstClockTime first_frame_ = GST_CLOCK_TIME_NONE, last_frame_ = GST_CLOCK_TIME_NONE;
  bool seen_points_ = false;
  guint64 decoded_ = 0, whole_ = 0; /* frame sets; those in which all views have points */
  gint views_now_ = 0;              /* that have points in the last one decoded */
  std::array<GstClockTime, 8> whole_captures_{}; /* of the latest whole ones, in turns */
  GstSample *whole_picture_ = nullptr;
  std::FILE *frame_log_ = nullptr;
  gint64 first_points_us_ = 0; /* monotonic; 0: none yet */
};
