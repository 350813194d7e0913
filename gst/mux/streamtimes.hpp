/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include "streams.hpp"

/** Times of a frame set, ns. */
struct FrameTimes {
  GstClockTime capture = GST_CLOCK_TIME_NONE; ///< of its oldest buffer
  GstClockTime running = GST_CLOCK_TIME_NONE; ///< of its oldest buffer by that
};

/** Capture times of the streams of a rangemux, of their clocks, and of its output. Streaming
 * thread. In a live pipeline running times of streams can be compared; those of recordings cannot.
 */
class StreamTimes {
public:
  /** Looks at the buffers of all pads, until release() of each stream.
   *  @param base  live: the element's base time */
  void peek (const MuxStreams &streams, bool live, GstClockTime base, GstClockTime tolerance);

  /** Sets `alive`. @return whether it changed for any stream */
  bool find_silent (const MuxStreams &streams);
  /** Live: sets `offset` and `in_sync`. The clock is the pipeline's if any stream has it, else the
   *  same as before. */
  void compare_clocks (const MuxStreams &streams, GstClockTime base);
  /** Sets `late`. Recordings have restarted, as loops do, if all of them go back. */
  void find_late (const MuxStreams &streams, GstClockTime tolerance);

  /** Running time of the oldest buffer that waits, or GST_CLOCK_TIME_NONE; after find_silent(). */
  [[nodiscard]] GstClockTime oldest () const { return oldest_; }
  /** Capture time of the last frame set, or GST_CLOCK_TIME_NONE. */
  [[nodiscard]] GstClockTime last_capture () const { return last_.capture; }
  /** By which the capture times of a stream are ahead of the others', or not live of the last frame
   *  set. */
  [[nodiscard]] GstClockTimeDiff ahead (const MuxStream &stream) const;

  /** Records a frame set. @return its running time
   *  @param period  from one frame set to the next */
  GstClockTime add_frame_set (const FrameTimes &times, GstClockTime period);
  void flush () { *this = {}; }

private:
  bool live_ = false;
  FrameTimes last_;
  GstClockTime oldest_ = GST_CLOCK_TIME_NONE;
  GstClockTimeDiff clock_offset_ = 0; /* live: of streams in sync, ahead of the pipeline clock */
};
