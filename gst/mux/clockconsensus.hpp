/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <span>
#include <vector>

/** Finds which live streams have capture times of the same clock: the clock of most streams. A
 *  stream is characterised by its offset, how far its capture times are ahead of the pipeline clock
 *  when its buffers arrive: minus the transmission delay if its host's clock is the pipeline clock,
 *  anything else if not. Streaming thread only. */
class ClockConsensus {
public:
  /** Offsets further apart than this belong to different clocks, ns. */
  static constexpr GstClockTimeDiff kMaxDifference = 2 * GST_SECOND;
  /** If the pipeline clock is that of most hosts, capture times may be ahead of it by this, ns. */
  static constexpr GstClockTimeDiff kMaxAhead = 100 * GST_MSECOND;

  struct Stream {
    GstClockTimeDiff offset; ///< of its last buffer, ns
    bool in_sync = true;     ///< set by update()
  };

  /** The offset of a buffer. Capture times from the network may be any number: the offset is
   *  clamped to a quarter of its range, so that differences of two do not overflow.
   *  @param capture, arrival  ns, of the host's clock and of the pipeline clock */
  static GstClockTimeDiff offset_of (GstClockTime capture, GstClockTime arrival);

  void reset () { known_ = false; }
  /** Sets `in_sync` of each stream. Between two clocks with as many streams the pipeline clock
   *  wins, then the clock that won before, then that of the first stream.
   *  @return whether another clock has won than before */
  bool update (std::span<Stream> streams);
  /** The median offset of the streams in sync, ns; after update(). */
  [[nodiscard]] GstClockTimeDiff reference () const { return reference_; }

private:
  struct Rank;
  [[nodiscard]] GstClockTimeDiff most_frequent (std::span<const Stream> streams) const;

  bool known_ = false;
  GstClockTimeDiff reference_ = 0;
  std::vector<GstClockTimeDiff> members_; /* kept for its memory */
};
