/* SPDX-License-Identifier: LGPL-2.1-or-later */
#pragma once

#include <gst/gst.h>

#include <rangecast/neighbourcode/encoder.hpp>
#include <rangecast/neighbourcode/rate_control.hpp>

/** What an application wants of neighbourcodeenc's bit rate. Any thread, under the element's lock.
 */
struct NeighbourCodeRateSettings {
  guint target_bitrate = 0; ///< bits/s; 0: thresholds are as configured
  int max_depth_threshold = 32, max_colour_threshold = 32; ///< codes

  /** The first property id that is free for the element's own ones. */
  static constexpr guint kFirstFreeId = 100;
  static void install (GObjectClass *klass);
  /** @return false if the id is none of ours */
  bool set (guint id, const GValue *value);
  bool get (guint id, GValue *value) const;
};

/** Steers the thresholds of an encoder frame set by frame set. Streaming thread only. */
class NeighbourCodeRate {
public:
  void reset ();

  /** The settings for a frame set: those configured, with other thresholds if there is a target.
   *  @param input  gives the time, capture time or else PTS
   *  @param pixels  of all ROIs
   *  @param interval  of frame sets that have no time, and as a guess */
  rangecast::EncoderSettings next (const rangecast::EncoderSettings &configured,
      const NeighbourCodeRateSettings &rate, GstBuffer *input, guint64 pixels,
      GstClockTime interval);
  void coded (const rangecast::CodedFrame &frame);

  /** Bits/s over the last two seconds of frame sets. */
  [[nodiscard]] double bits_per_s () const { return meter_.bits_per_s (interval_); }

private:
  rangecast::RateControl control_;
  rangecast::RateMeter meter_;
  bool is_on_ = false;
  GstClockTime time_ = 0, interval_ = 0; /* of the frame set at hand */
};
