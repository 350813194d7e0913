/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "neighbourcoderate.hpp"

#include <cmath>
#include <gstrange/gstrange.h>

using rangecast::EncoderSettings;
using rangecast::Profile;

enum { PROP_0, PROP_TARGET_BITRATE, PROP_MAX_DEPTH_THRESHOLD, PROP_MAX_COLOUR_THRESHOLD, N_PROPS };
static_assert (N_PROPS <= NeighbourCodeRateSettings::kFirstFreeId);

void
NeighbourCodeRateSettings::install (GObjectClass *klass)
{
  const NeighbourCodeRateSettings defaults;
  const auto live = GParamFlags (G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS |
                                 GST_PARAM_MUTABLE_PLAYING | GST_PARAM_CONTROLLABLE);
  g_object_class_install_property (klass, PROP_TARGET_BITRATE,
      g_param_spec_uint ("target-bitrate", "Target bit rate",
          "Bits per second of coded frame sets, which thresholds between those configured and the "
          "max- ones are steered to (0 to 4294967295, default 0: thresholds are as configured)",
          0, G_MAXUINT, defaults.target_bitrate, live));
  g_object_class_install_property (klass, PROP_MAX_DEPTH_THRESHOLD,
      g_param_spec_int ("max-depth-threshold", "Maximum depth threshold",
          "With target-bitrate the depth threshold is at most so many codes, or depth-threshold if "
          "that is more (0 to 65535, default 32)",
          0, 65535, defaults.max_depth_threshold, live));
  g_object_class_install_property (klass, PROP_MAX_COLOUR_THRESHOLD,
      g_param_spec_int ("max-colour-threshold", "Maximum colour threshold",
          "With target-bitrate the colour threshold is at most so many codes, or colour-threshold "
          "if that is more (0 to 255, default 32)",
          0, 255, defaults.max_colour_threshold, live));
}

bool
NeighbourCodeRateSettings::set (guint id, const GValue *value)
{
  switch (id) {
    case PROP_TARGET_BITRATE:
      target_bitrate = g_value_get_uint (value);
      return true;
    case PROP_MAX_DEPTH_THRESHOLD:
      max_depth_threshold = g_value_get_int (value);
      return true;
    case PROP_MAX_COLOUR_THRESHOLD:
      max_colour_threshold = g_value_get_int (value);
      return true;
    default:
      return false;
  }
}

bool
NeighbourCodeRateSettings::get (guint id, GValue *value) const
{
  switch (id) {
    case PROP_TARGET_BITRATE:
      g_value_set_uint (value, target_bitrate);
      return true;
    case PROP_MAX_DEPTH_THRESHOLD:
      g_value_set_int (value, max_depth_threshold);
      return true;
    case PROP_MAX_COLOUR_THRESHOLD:
      g_value_set_int (value, max_colour_threshold);
      return true;
    default:
      return false;
  }
}

void
NeighbourCodeRate::reset ()
{
  *this = NeighbourCodeRate ();
}

/* What a point of noisy cameras comes to, about, and how that falls with the colour threshold. The
 * first frame set then tells. */
static double
usual_bits_per_point (Profile profile, int colour_threshold)
{
  const EncoderSettings defaults;
  const double finer = (defaults.colour_threshold + 0.5) / (colour_threshold + 0.5);
  switch (profile) {
    case Profile::kPlain:
      return 13 * std::cbrt (finer);
    case Profile::kPacked:
      return 3.5 * std::sqrt (finer);
    default:
      return 2.5 * std::sqrt (finer);
  }
}

EncoderSettings
NeighbourCodeRate::next (const EncoderSettings &configured, const NeighbourCodeRateSettings &rate,
    GstBuffer *input, guint64 pixels, GstClockTime interval)
{
  const GstClockTime capture = gst_range_buffer_get_capture_time (input),
                     time = GST_CLOCK_TIME_IS_VALID (capture) ? capture : GST_BUFFER_PTS (input);
  time_ = GST_CLOCK_TIME_IS_VALID (time) ? time : time_ + interval;
  interval_ = interval;
  if (rate.target_bitrate == 0) {
    if (is_on_)
      control_.reset ();
    is_on_ = false;
    return configured;
  }
  is_on_ = true;
  control_.configure (
      {double (rate.target_bitrate), {configured.depth_threshold, configured.colour_threshold},
          {rate.max_depth_threshold, rate.max_colour_threshold},
          usual_bits_per_point (configured.profile, configured.colour_threshold),
          double (interval) / GST_SECOND});
  EncoderSettings settings = configured;
  const rangecast::Thresholds thresholds = control_.next (time_, pixels);
  settings.depth_threshold = thresholds.depth;
  settings.colour_threshold = thresholds.colour;
  return settings;
}

void
NeighbourCodeRate::coded (const rangecast::CodedFrame &frame)
{
  meter_.add (time_, frame.bytes);
  if (is_on_)
    control_.coded (frame);
}
