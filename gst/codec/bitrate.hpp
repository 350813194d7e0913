/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <rangecast/neighbourcode/encoder.hpp>
#include <rangecast/neighbourcode/rate/frame_thinning.hpp>
#include <rangecast/neighbourcode/rate/rate_control.hpp>

#include "adaptiverate.hpp"

/** What an application wants of neighbourcodeenc's bit rate. Any thread, under the element's lock.
 */
struct NeighbourCodeRateSettings {
  guint target_bitrate = 0; ///< bits/s; 0: thresholds are as configured
  int max_depth_threshold = 32, max_colour_threshold = 32; ///< codes
  bool adaptive = false;                                   ///< the rate follows receivers
  guint min_bitrate = 200000;                              ///< bits/s, then
  int min_fps_n = 5, min_fps_d = 1;                        ///< frame sets a second, then
};

/** Steers the thresholds of an encoder frame set by frame set, and leaves some out where that does
 *  not do. Streaming thread only, but for `receivers`. */
class NeighbourCodeRate {
public:
  void reset ();

  /** A frame set comes. With `adaptive` its target is what receivers let it have.
   *  @param input  gives the time, capture time or else PTS
   *  @param interval  of frame sets that have no time, and as a guess
   *  @return false: it is to be left out, and what follows is not called for it */
  bool begin (const NeighbourCodeRateSettings &rate, GstBuffer *input, GstClockTime interval);

  /** The settings for the frame set: those configured, with other thresholds if there is a target.
   *  @param pixels  of all ROIs */
  rangecast::EncoderSettings next (const rangecast::EncoderSettings &configured, guint64 pixels);
  void coded (const rangecast::CodedFrame &frame);

  /** Bits/s over the last two seconds of frame sets. */
  [[nodiscard]] double bits_per_s () const { return meter_.bits_per_s (interval_); }
  /** One of so many frame sets is coded. */
  [[nodiscard]] int one_of () const { return thinning_.one_of (); }
  /** If bit rate or frame rate of an adaptive stream have changed by much since it was asked last:
   *  the message that says so, for the caller to post; else nullptr. */
  GstMessage *take_news (GstObject *source);

  AdaptiveRate receivers; ///< any thread

private:
  NeighbourCodeRateSettings rate_; /* of the frame set at hand, with the target that it has */
  rangecast::RateControl control_;
  rangecast::RateMeter meter_;
  rangecast::FrameThinning thinning_;
  bool is_on_ = false;
  GstClockTime time_ = 0, interval_ = 0; /* of the frame set at hand */
  double told_bits_per_s_ = -1;          /* by the last message */
  int told_one_of_ = 1;
};
