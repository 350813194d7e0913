/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

/* What the files of rangemux share: gstrangemux.cpp is the element, muxmatching.cpp chooses the
 * buffers of each frame set and puts them together. */

#include <atomic>
#include <mutex>
#include <string>
#include <vector>

#include "clockconsensus.hpp"
#include "clockpublisher.hpp"
#include "common/statsreporter.hpp"
#include "frameset.hpp"
#include "gstrangemux.h"
#include "recordings.hpp"
#include "stats.hpp"
#include "streams.hpp"
#include "waiting.hpp"

struct GstRangeMuxPrivate {
  std::mutex lock; /* guards pads (the vector), counters, max_skew and rig_file; never held across a
                      push, message or call into the aggregator */
  MuxPads pads;
  GstClockTime max_skew = 0;
  std::string rig_file;
  MuxCounters sent;

  ClockPublisher clock;   /* has locks of its own */
  StatsReporter reporter; /* as well */

  std::atomic<bool> caps_dirty = true; /* the streams have to be chosen again */

  /* streaming thread only; vectors are kept for their memory */
  bool live = false;
  MuxPads pads_now;       /* while it works on them, see PadsNow */
  WaitingBuffers waiting; /* the same */
  rangecast::Rig rig;     /* of rig_file; empty: any */
  MuxSteps steps;
  FrameSetJoiner joiner;
  std::vector<MuxSteps::Stream> votes;
  std::vector<MuxPad *> voters;
  MuxRecordings recordings;
  GstClockTime now = GST_CLOCK_TIME_NONE; /* running time of the oldest buffer that waits */
  GstClockTime frame_duration = GST_CLOCK_TIME_NONE;
  FrameTimes last; /* of the last frame set */
};

struct _GstRangeMux {
  GstAggregator parent;
  GstRangeMuxPrivate *priv;
};

/* muxmatching.cpp, streaming thread; in the order in which a frame set is made. */

/** Tells what is worth it.
 *  @param running  of the buffer that shows the state, or GST_CLOCK_TIME_NONE */
void set_state (GstRangeMux *self, MuxPad &entry, MuxState state, GstClockTime running);

/** Notes who is there. Who has a buffer is; who has none is silent once the oldest one of the
 *  others is much later than its last one: so a stream whose times jump silences nobody. Who was
 *  left out for a clash may have its turn when somebody has gone. */
void note_arrivals (GstRangeMux *self, const MuxPads &pads, const WaitingBuffers &waiting);

/** Live: compares how far capture times are from the pipeline's clock, so that nobody has to wait
 *  for the others. */
void judge_steps (GstRangeMux *self, const MuxPads &pads, const WaitingBuffers &waiting);
/** Not live: compares capture times. */
void judge_recordings (GstRangeMux *self, const WaitingBuffers &waiting);
/** Not live: tells what has ended and might as well have been played alone. */
void tell_strangers (GstRangeMux *self, const MuxPads &pads);

/** How far the capture times of one frame set may lie apart, ns. */
GstClockTime matching_tolerance (GstRangeMuxPrivate *priv);

/** Drops what can be part of no frame set to come. @return whether anything went */
bool drop_useless (GstRangeMux *self, const WaitingBuffers &waiting, GstClockTime tolerance);

/** @param first    the oldest capture time that waits
 *  @param streams  of a complete frame set */
GstFlowReturn push_frame_set (GstRangeMux *self, const WaitingBuffers &waiting, GstClockTime first,
    GstClockTime tolerance, std::size_t streams);
