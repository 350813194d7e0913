/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "bitrate.hpp"

#include <algorithm>
#include <cmath>
#include <gstrange/gstrange.h>

using rangecast::EncoderSettings;
using rangecast::Profile;

namespace {

/* Initial guess, until the first frame set is coded: bits per point of noisy cameras at a colour
 * threshold of 10, and how they fall with the threshold (measured). */
double
usual_bits_per_point (Profile profile, int colour_threshold)
{
  const double finer = 10.5 / (colour_threshold + 0.5);
  switch (profile) {
    case Profile::kPlain:
      return 13 * std::cbrt (finer);
    case Profile::kPacked:
      return 3.5 * std::sqrt (finer);
    default:
      return 2.5 * std::sqrt (finer);
  }
}

} // namespace

void
NeighbourCodeRate::reset ()
{
  control_.reset ();
  meter_.reset ();
  thinning_.reset ();
  receivers.reset ();
  is_on_ = false;
  time_ = interval_ = 0;
  reported_bits_per_s_ = -1;
  reported_one_of_ = 1;
  below_limits_ = GST_CLOCK_TIME_NONE;
}

bool
NeighbourCodeRate::begin (
    const NeighbourCodeRateSettings &rate, GstBuffer *input, GstClockTime interval)
{
  const GstClockTime capture = gst_range_buffer_get_capture_time (input),
                     time = GST_CLOCK_TIME_IS_VALID (capture) ? capture : GST_BUFFER_PTS (input);
  time_ = GST_CLOCK_TIME_IS_VALID (time) ? time : time_ + interval;
  interval_ = interval;
  rate_ = rate;
  if (!rate.adaptive) {
    thinning_.reset ();
    return true;
  }
  const double bits_per_s = receivers.update (
      {double (rate.min_bitrate), double (rate.target_bitrate)}, meter_.bits_per_s (interval));
  rate_.target_bitrate = guint (std::min (bits_per_s, double (G_MAXUINT)));
  return thinning_.keep ({time_, interval, bits_per_s, is_on_ ? control_.min_bits () : 0,
      double (rate.min_fps_n) / rate.min_fps_d});
}

EncoderSettings
NeighbourCodeRate::settings_for (const EncoderSettings &configured, guint64 pixels)
{
  if (rate_.target_bitrate == 0) {
    if (is_on_)
      control_.reset ();
    is_on_ = false;
    below_limits_ = GST_CLOCK_TIME_NONE;
    return configured;
  }
  is_on_ = true;
  control_.configure (
      {double (rate_.target_bitrate), {configured.depth_threshold, configured.colour_threshold},
          {rate_.max_depth_threshold, rate_.max_colour_threshold},
          usual_bits_per_point (configured.profile, configured.colour_threshold),
          double (interval_) / GST_SECOND});
  EncoderSettings settings = configured;
  const rangecast::Thresholds thresholds = control_.next (time_, pixels);
  const bool is_new = !GST_CLOCK_TIME_IS_VALID (below_limits_) || time_ < below_limits_;
  if (is_new || thresholds.depth < rate_.max_depth_threshold ||
      thresholds.colour < rate_.max_colour_threshold)
    below_limits_ = time_;
  settings.depth_threshold = thresholds.depth;
  settings.colour_threshold = thresholds.colour;
  return settings;
}

void
NeighbourCodeRate::record (const rangecast::CodedFrame &frame)
{
  meter_.add (time_, frame.bytes);
  if (is_on_)
    control_.coded (frame);
}

bool
NeighbourCodeRate::misses_target () const
{
  constexpr double kTolerance = 1.25;
  return is_on_ && !rate_.adaptive && time_ >= below_limits_ + 2 * GST_SECOND &&
         bits_per_s () > kTolerance * rate_.target_bitrate;
}

GstMessage *
NeighbourCodeRate::make_message (GstObject *source)
{
  constexpr double kMinChange = 0.1;
  const double now = rate_.adaptive ? receivers.bits_per_s () : 0;
  if (reported_bits_per_s_ < 0)
    reported_bits_per_s_ = now;
  if (std::abs (now - reported_bits_per_s_) <= kMinChange * reported_bits_per_s_ &&
      thinning_.one_of () == reported_one_of_)
    return nullptr;
  reported_bits_per_s_ = now;
  reported_one_of_ = thinning_.one_of ();
  GstStructure *structure = gst_structure_new (
      "neighbourcodeenc-adaptive-bitrate", "one-of", G_TYPE_INT, reported_one_of_, nullptr);
  receivers.add_stats (structure);
  return gst_message_new_element (source, structure);
}
