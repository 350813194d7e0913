/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <optional>
#include <vector>

/** Computes presentation times from capture times, so that what was captured at the same time is
 * due at the same time: the capture time plus the lag of the slowest stream. A lag is the running
 * time of a buffer less its capture time; lags are smoothed, and follow clocks that drift. */
class CaptureAlignment {
public:
  /** What is known of one stream. */
  struct Stream {
    std::optional<gint64> lag; ///< ns, smoothed
    gint64 delay = 0;          ///< ns from the running time of its last buffer until it is due
    guint steps = 0;           ///< of the alignment, when its last buffer was placed
    GstClockTime last = GST_CLOCK_TIME_NONE; ///< running time of its last buffer
  };

  enum class Relation {
    kTogether, ///< all streams are in sync
    kApart,    ///< their lags differ by more than the maximum; none is delayed
  };

  void add (Stream *stream) { streams_.push_back (stream); }
  void remove (const Stream *stream);

  /** Sets the delay of a stream for a buffer. @param max_delay ns. @param[out] stepped whether the
   *  delay has changed all at once since the stream's last buffer: one of the streams has come, has
   *  gone or takes another way. */
  Relation place (Stream &stream, GstClockTime running_time, GstClockTime capture_time,
      GstClockTime max_delay, bool &stepped);

  /** How often all streams were moved at once. */
  guint steps () const { return steps_; }

  /** ns between the quickest and the slowest stream of those that have not ended long before a
   *  running time; 0 with less than two. */
  gint64 spread (GstClockTime running_time) const;

private:
  bool counts (const Stream &stream, GstClockTime running_time) const;

  std::vector<Stream *> streams_;
  std::optional<gint64> common_; /* of all streams in sync, ns from capture to due */
  guint steps_ = 0;
};
