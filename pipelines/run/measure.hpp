/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <mutex>
#include <vector>

/** What the elements of a pipeline have counted. */
struct StreamStats {
  guint64 frames = 0, views = 0;
  int views_now = 0; ///< that have points in the last frame set
  guint64 points = 0, raw_bytes = 0, coded_bytes = 0, coded_frames = 0;
  guint64 rtp_packets = 0, rtp_lost = 0;
};

/** Measures a pipeline by its elements named "rendered" and "decoder", by probes on their source
 *  pads and by their statistics, and turns the one named "view". Its memory does not
 *  grow. */
class RunMeasure {
public:
  /** @param views   to wait for, for 2 s after the first one has points
   *  @param frames  to end the streams after; 0: no limit */
  RunMeasure (GstElement *pipeline, int views, int frames);
  ~RunMeasure ();
  RunMeasure (const RunMeasure &) = delete;
  RunMeasure &operator= (const RunMeasure &) = delete;

  /** Adds the probes; before the pipeline runs. @param turn  "view" by 360 degrees */
  void start (bool turn);

  /** Prints a line: frames, rate, points, latency. */
  void print_progress ();
  /** Writes what was measured, JSON; `rangecast demo` reads it. @return false after reporting why
   *  not */
  bool write_report (const char *path);

private:
  static GstPadProbeReturn count_views (GstPad *, GstPadProbeInfo *info, gpointer self);
  static GstPadProbeReturn count_rendered (GstPad *, GstPadProbeInfo *info, gpointer self);
  void add_probe (const char *element_name, GstPadProbeCallback probe);
  static constexpr std::size_t kMaxLatencies = 65536;

  StreamStats read_stats ();
  double fps ();
  /** From capture time to "rendered", of the last kMaxLatencies frames. @param p  0 to 1 */
  double latency_ms (double p);
  /** Of so many frame sets, as many as have had points in all views. */
  guint64 whole_of (guint64 frames);
  bool record_rendered (GstClockTime capture, gint &frames);

  GstElement *pipeline_;
  const int views_, frames_;
  GstElement *turned_ = nullptr; /* a striprender */

  std::mutex lock_;                  /* guards what the pad probes write */
  guint64 rendered_ = 0;             /* frames */
  std::vector<double> latencies_ms_; /* of frame i at i % kMaxLatencies */
  GstClockTime first_frame_ = GST_CLOCK_TIME_NONE, last_frame_ = GST_CLOCK_TIME_NONE;
  bool seen_points_ = false;
  guint64 decoded_ = 0, whole_ = 0; /* frame sets; those in which all views have points */
  gint views_now_ = 0;              /* that have points in the last one decoded */
  gint64 first_points_us_ = 0;      /* monotonic; 0: none yet */
};
