/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <rangecast/neighbourcode/encoder.hpp>
#include <rangecast/neighbourcode/rate/frame_thinning.hpp>
#include <rangecast/neighbourcode/rate/rate_control.hpp>

#include "adaptiverate.hpp"

/** Settings of neighbourcodeenc's bit rate. Any thread, under the element's lock. */
struct NeighbourCodeRateSettings {
  guint target_bitrate = 0; ///< bits/s; 0: thresholds are as configured
  int max_depth_threshold = 32, max_colour_threshold = 32; ///< codes
  bool adaptive = false;            ///< the rate follows the network, up to target_bitrate
  guint min_bitrate = 200000;       ///< bits/s; if adaptive
  int min_fps_n = 5, min_fps_d = 1; ///< frame sets/s; if adaptive
};

/** Rate control: chooses the thresholds of each frame set and leaves frame sets out where that is
 *  not enough. Streaming thread only, except `receivers`. */
class NeighbourCodeRate {
public:
  void reset ();

  /** Begins a frame set.
   *  @param input  its time is the capture time, or else the PTS
   *  @param interval  frame period, ns; used for frame sets without a time
   *  @return false if the frame set is to be left out; settings_for() and record() are not called
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
  /** @return the element message neighbourcodeenc-adaptive-bitrate, for the caller to post, if the
   *  estimated bit rate has changed by more than a tenth, or the frame rate, since the last one;
   *  else nullptr */
  GstMessage *make_message (GstObject *source);
  /** Whether the thresholds have been at their upper limits for 2 s and the bit rate is yet a
   *  quarter above a constant target. */
  [[nodiscard]] bool misses_target () const;

  AdaptiveRate receivers; ///< any thread

private:
  NeighbourCodeRateSettings rate_; /* of the current frame set, with its target */
  rangecast::RateControl control_;
  rangecast::RateMeter meter_;
  rangecast::FrameThinning thinning_;
  bool is_on_ = false;                   /* there is a target */
  GstClockTime time_ = 0, interval_ = 0; /* of the current frame set */
  double reported_bits_per_s_ = -1;      /* by the last message */
  int reported_one_of_ = 1;              /* one of so many frame sets is coded */
  /* Time of the latest frame set with a threshold below its limit. */
  GstClockTime below_limits_ = GST_CLOCK_TIME_NONE;
};
