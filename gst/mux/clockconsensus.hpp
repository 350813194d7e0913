/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <span>
#include <vector>

/** Finds which live streams have capture times of one clock: that of most of them. A stream is
 * known by its offset, how much its capture times are ahead of the pipeline's clock when they come:
 * minus the time that pictures are under way if the host's clock is the pipeline's, anything else
 * if not. Streaming thread only. */
class MuxSteps {
public:
  /** Offsets further apart than this are of different clocks, ns. */
  static constexpr GstClockTimeDiff kOutOfStep = 2 * GST_SECOND;
  /** Where the pipeline's clock is that of most hosts, no picture comes before it was taken; ns. */
  static constexpr GstClockTimeDiff kFuture = 100 * GST_MSECOND;

  struct Stream {
    GstClockTimeDiff offset; ///< ns; of its last buffer
    bool in_step = true;     ///< what judge() finds
  };

  /** The offset of a buffer. Foreign capture times may be any number: it is kept within a quarter
   *  of what fits, so that differences of two do not overflow.
   *  @param capture, arrival  ns, of the hosts' clock and of the pipeline's */
  static GstClockTimeDiff offset_of (GstClockTime capture, GstClockTime arrival);

  void reset () { known_ = false; }
  /** Sets `in_step` of each. Of two clocks that equally many have, the pipeline's wins, then the
   * one that won before, then that of the stream that comes first.
   *  @return whether it is another clock than before */
  bool judge (std::span<Stream> streams);
  /** The middle offset of the streams in step, ns; after judge(). */
  [[nodiscard]] GstClockTimeDiff reference () const { return reference_; }

private:
  struct Rank;
  [[nodiscard]] GstClockTimeDiff most_frequent (std::span<const Stream> streams) const;

  bool known_ = false;
  GstClockTimeDiff reference_ = 0;
  std::vector<GstClockTimeDiff> members_; /* kept for its memory */
};
