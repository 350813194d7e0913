/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

/* The element message `rangecast-stats`, which elements post every `stats-interval`; its fields
 * are documented in docs/guide/statistics.md. */

#include <gst/gst.h>

#include <memory>
#include <optional>
#include <rangecast/geometry/rig.hpp>
#include <string>
#include <vector>

/** Counters since start, of an element or of one of its pads. The message leaves out those that are
 *  not set. docs/guide/statistics.md says what each element counts. */
struct StreamCounters {
  guint64 frames = 0;
  std::optional<guint64> points = {}, bytes = {}, packets = {}, lost = {}, late = {};
};

/** The contents of one message: of an element, or of one of its pads. */
struct StatsRow {
  std::string pad = {}; ///< pad name; empty: the element itself
  StreamCounters counters = {};
  guint64 views = 0; ///< bits by view-id; 0 for the element itself, see StatsReporter::set_views()
  /** ns; for rows whose buffers are not given to StatsReporter::passed() */
  std::optional<gint64> latency_p50 = {}, latency_p99 = {};
};

/** The view-ids of a rig as a bit mask. */
guint64 view_bits (const rangecast::Rig &rig);

/** Posts an element's statistics, in PLAYING and at the end of the stream.
 *
 *  The timer is one of GStreamer's system clock, not the streaming thread, so that statistics of a
 *  stalled stream are posted, too. Allocates once per interval. Do not call start() or finish()
 *  with a lock held that `collect` takes. */
class StatsReporter {
public:
  /** Reads the counters, on any thread; takes the element's locks itself. The element's own row
   *  comes first. */
  using Collect = std::vector<StatsRow> (*) (GstElement *element);

  StatsReporter ();
  ~StatsReporter ();
  StatsReporter (const StatsReporter &) = delete;
  StatsReporter &operator= (const StatsReporter &) = delete;

  /** Installs `stats-interval`. */
  static void install (GObjectClass *object_class, guint property_id);
  /** Milliseconds; 0: off. Any thread. Call without the element's locks: it (re)starts the timer.
   */
  void set_interval (guint interval_ms);
  [[nodiscard]] guint interval () const;

  /** READY to PAUSED: counters restart from 0. */
  void start (GstElement *element, Collect collect);
  /** PAUSED to READY. A message that is being posted may still arrive afterwards. */
  void stop ();

  /** The stream's views, for the element's own row. Any thread. */
  void set_views (const rangecast::Rig &rig);
  /** Records the time since capture of a buffer that is about to be pushed, if its capture time and
   *  the element's clock are known. Any thread. */
  void passed (GstElement *element, GstBuffer *buffer);
  /** At EOS: posts the statistics of the unfinished interval. */
  void finish ();

private:
  struct State;
  std::shared_ptr<State> state_; /* shared with the timer's thread */
};
