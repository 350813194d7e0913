/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <mutex>
#include <rangecast/neighbourcode/encoder.hpp>
#include <rangecast/neighbourcode/rate/congestion_control.hpp>
#include <rangecast/neighbourcode/rate/frame_thinning.hpp>
#include <rangecast/neighbourcode/rate/rate_control.hpp>
#include <vector>

/** Settings of neighbourcodeenc's bit rate. Any thread, under the element's lock. */
struct NeighbourCodeRateSettings {
  guint target_bitrate = 0; ///< bits/s; 0: thresholds are as configured
  int max_depth_threshold = 32, max_colour_threshold = 32; ///< codes
  bool adaptive = false;            ///< the rate follows the network, up to target_bitrate
  guint min_bitrate = 200000;       ///< bits/s; if adaptive
  int min_fps_n = 5, min_fps_d = 1; ///< frame sets/s; if adaptive
};

/** Rate control: chooses the thresholds of each frame set and drops frame sets where that is not
 *  enough. The rate that the network allows follows from transport-wide feedback: RTPTWCCPackets,
 *  an upstream event of rtpsession. Streaming thread, but handle_event() and add_stats(): any. */
class NeighbourCodeRate {
public:
  void reset ();

  /** Begins a frame set.
   *  @param input  its time is the capture time, or else the PTS
   *  @param interval  frame period, ns; used for frame sets without a time
   *  @return false if the frame set is to be dropped; settings_for() and record() are not called
   *  for it then */
  bool begin (const NeighbourCodeRateSettings &rate, GstBuffer *input, GstClockTime interval);

  /** The settings of the frame set: those configured, with other thresholds if there is a target.
   *  @param pixels  of all ROIs */
  rangecast::EncoderSettings settings_for (
      const rangecast::EncoderSettings &configured, guint64 pixels);
  /** Records the size of the frame set. */
  void record (const rangecast::CodedFrame &frame);

  /** Bits/s over the last 2 s. */
  [[nodiscard]] double bits_per_s () const { return meter_.bits_per_s (interval_); }

  /** Handles feedback, whatever it holds. @return false if it is another event */
  bool handle_event (GstEvent *event);
  /** Adds estimated-bitrate, receiver-reports, receiver-loss and receiver-queue. */
  void add_stats (GstStructure *structure) const;

private:
  void handle_packets (const GstStructure *structure);

  NeighbourCodeRateSettings rate_; /* of the current frame set, with its target */
  rangecast::RateControl control_;
  rangecast::RateMeter meter_;
  rangecast::FrameThinning thinning_;
  bool is_on_ = false;                   /* there is a target */
  GstClockTime time_ = 0, interval_ = 0; /* of the current frame set */

  mutable std::mutex lock_; /* guards what follows */
  rangecast::CongestionControl network_;
  guint64 reports_ = 0;
  std::vector<rangecast::PacketReport> packets_; /* of the current event; kept for its memory */
};
