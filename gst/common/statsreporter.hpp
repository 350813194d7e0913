/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

/* What all elements tell of their streams, at regular times: the element message `rangecast-stats`
 * of docs/guide/statistics.md. */

#include <gst/gst.h>

#include <memory>
#include <optional>
#include <rangecast/geometry/rig.hpp>
#include <string>
#include <vector>

/** Counters since start, of an element or of one of its pads. Those that it does not have are left
 *  out of the message. */
struct StreamCounters {
  guint64 frames = 0; ///< what one of these is, and what is lost or late: docs/guide/statistics.md
  std::optional<guint64> points = {}, bytes = {}, packets = {}, lost = {}, late = {};
};

/** A message: an element's own, or that of a pad. */
struct StatsRow {
  std::string pad = {}; ///< empty: the element's own
  StreamCounters counters = {};
  guint64 views = 0; ///< bits by view-id; of the element's own: 0, see StatsReporter::set_views()
  /** Where StatsReporter::passed() is not told, ns. */
  std::optional<gint64> latency_p50 = {}, latency_p99 = {};
};

/** Bits by view-id. */
guint64 view_bits (const rangecast::Rig &rig);

/** Posts an element's statistics.
 *
 *  A timer of GStreamer's system clock does it, so that a stream that stalls is seen to: there is
 *  no streaming thread then. Nothing is posted but in PLAYING, and at the end of the stream.
 *  Nothing is allocated but once an interval. start() and finish() may not be called with a
 *  lock held that `collect` takes. */
class StatsReporter {
public:
  /** Reads the counters; on any thread, with locks of the element's own. The element's own row is
   *  the first. */
  using Collect = std::vector<StatsRow> (*) (GstElement *element);

  StatsReporter ();
  ~StatsReporter ();
  StatsReporter (const StatsReporter &) = delete;
  StatsReporter &operator= (const StatsReporter &) = delete;

  /** Installs `stats-interval`. */
  static void install (GObjectClass *object_class, guint property_id);
  /** Milliseconds; 0: off. Any thread, without a lock of the element's: it sets a timer. */
  void set_interval (guint interval_ms);
  [[nodiscard]] guint interval () const;

  /** Counters begin anew. On READY to PAUSED. */
  void start (GstElement *element, Collect collect);
  /** On PAUSED to READY. One message may still be on its way. */
  void stop ();

  /** Those of the stream. Any thread. */
  void set_views (const rangecast::Rig &rig);
  /** Notes how long ago a buffer that is about to go out was taken, if its capture time and the
   *  element's clock tell. Any thread. */
  void passed (GstElement *element, GstBuffer *buffer);
  /** The end of the stream: posts what there is. */
  void finish ();

private:
  struct State;
  std::shared_ptr<State> state_; /* the timer's thread has it, too */
};
