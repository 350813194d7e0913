/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

/** Notes when each buffer passes each source pad of a pipeline (and the sinks' pads), so that
 *  tests/bench/latency-budget.py can tell where the time goes. Costs about a microsecond a buffer
 *  and pad. Of a long run the first kMaxPassages are kept: some 200 MB, ten minutes of four views
 *  at 30/s; write() says so. */
class LatencyTrace {
public:
  static constexpr std::size_t kMaxPassages = 4000000;

  /** Pads that there are now; the pipeline must outlive the trace. */
  explicit LatencyTrace (GstElement *pipeline);
  LatencyTrace (const LatencyTrace &) = delete;
  LatencyTrace &operator= (const LatencyTrace &) = delete;

  /** A line a buffer: factory, element.pad, capture time of its frame set (or of the last one on
   *  that thread; -1: none), RTP time (-1: none), when it passed, thread, CPU time of the
   *  thread; ns.
   *  @return false if the file cannot be written. After the pipeline has stopped. */
  bool write (const char *path) const;

private:
  struct Point {
    LatencyTrace *trace;
    std::string name;
    bool is_rtp_known = false, is_rtp = false; /* streaming thread of that pad */
  };
  struct Passage {
    const Point *point;
    GstClockTime capture, now;
    gint64 rtp_time; /* -1: none */
    gint64 thread, cpu_ns;
  };
  void add_pad (GstPad *pad);
  static GstPadProbeReturn note (GstPad *pad, GstPadProbeInfo *info, gpointer point);

  GstElement *pipeline_;
  std::vector<std::unique_ptr<Point>> points_;
  std::mutex lock_;              /* guards what follows */
  std::deque<Passage> passages_; /* to kMaxPassages; grows without moving what is there */
  bool is_full_ = false;
};
