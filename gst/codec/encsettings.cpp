/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "encsettings.hpp"

using rangecast::NeighbourChoice;
using rangecast::Profile;

static const GEnumValue kProfiles[] = {
    {int (Profile::kPlain), "Fixed-length codes, no entropy coding", "plain"},
    {int (Profile::kPacked), "Run lengths and fixed prefix codes", "packed"},
    {int (Profile::kEntropy), "Adaptive context model, rANS", "entropy"}, {}};

static const GEnumValue kChoices[] = {
    {int (NeighbourChoice::kFirst),
        "First neighbour in the order left, upper-left, upper, upper-right", "first"},
    {int (NeighbourChoice::kBest), "Neighbour with the least cost in error and bits; slower",
        "best"},
    {}};

/* Profile, bits and references are not controllable: a change of them rebuilds tables, which a
 * controller might cause with every frame set. */
PropertyTable<NeighbourCodeEncSettings> &
encoder_properties ()
{
  using S = NeighbourCodeEncSettings;
  using Coding = rangecast::EncoderSettings;
  using Rate = NeighbourCodeRateSettings;
  using P = PropertyTable<S>;
  static constexpr guint kMaxPeriod_ms = 3600000;
  static P table = {
      P::enumeration<&S::coding, &Coding::profile> ("profile", "Profile", "Coding profile",
          "GstNeighbourCodeProfile", kProfiles, kMutablePlaying),
      P::enumeration<&S::coding, &Coding::choice> ("choice", "Neighbour choice",
          "Which neighbour within the thresholds replaces a pixel (the plain profile always uses "
          "the first)",
          "GstNeighbourCodeChoice", kChoices, kControllable),
      P::number<&S::coding, &Coding::depth_bits> ("depth-bits", "Depth bits",
          "Bits of a quantised depth between the view's near and far limits", 6, 16,
          kMutablePlaying),
      P::number<&S::coding, &Coding::colour_bits> (
          "colour-bits", "Colour bits", "Bits of each colour channel", 4, 8, kMutablePlaying),
      P::number<&S::coding, &Coding::depth_threshold> ("depth-threshold", "Depth threshold",
          "Maximum depth difference, in quantisation steps, at which a neighbour replaces a pixel "
          "(0 together with colour-threshold=0 = lossless after quantisation)",
          0, 65535, kControllable),
      P::number<&S::coding, &Coding::colour_threshold> ("colour-threshold", "Colour threshold",
          "Maximum difference of each of R, G and B, in quantisation steps, at which a neighbour "
          "replaces a pixel",
          0, 255, kControllable),
      P::number<&S::coding, &Coding::max_slice_size> ("max-slice-size", "Maximum slice size",
          "Maximum size of a slice in bytes, including its header", 256,
          int (rangecast::kMaxUnitSize), kControllable),
      P::boolean<&S::coding, &Coding::temporal> ("temporal", "Temporal",
          "Predict pixels from the previous frame set (false = frame sets decode independently)",
          kMutablePlaying),
      P::Row{g_param_spec_uint ("refresh-period", "Refresh period",
                 "Period in milliseconds within which every pixel is coded without temporal "
                 "prediction (0 = only in key frame sets)",
                 0, kMaxPeriod_ms, guint (Coding{}.refresh_period_ns / GST_MSECOND), kControllable),
          [] (S &s, const GValue *value) {
            s.coding.refresh_period_ns = g_value_get_uint (value) * GST_MSECOND;
          },
          [] (const S &s, GValue *value) {
            g_value_set_uint (value, guint (s.coding.refresh_period_ns / GST_MSECOND));
          }},
      P::number<&S::key_interval_ms> ("key-interval", "Key interval",
          "Maximum interval between key frame sets in milliseconds with temporal=true (0 = only "
          "the first frame set and on request)",
          0, kMaxPeriod_ms, kControllable),
      P::number<&S::n_threads> ("n-threads", "Threads",
          "Number of threads that encode tiles; the output does not depend on it (0 = one per CPU "
          "core)",
          0, 64, kMutablePlaying),
      P::number<&S::rate, &Rate::target_bitrate> ("target-bitrate", "Target bit rate",
          "Target bit rate in bits per second, kept by raising the thresholds up to their max- "
          "limits (0 = constant thresholds)",
          0, G_MAXUINT, kControllable),
      P::number<&S::rate, &Rate::max_depth_threshold> ("max-depth-threshold",
          "Maximum depth threshold",
          "Upper limit of the depth threshold with target-bitrate, in quantisation steps (at least "
          "depth-threshold)",
          0, 65535, kControllable),
      P::number<&S::rate, &Rate::max_colour_threshold> ("max-colour-threshold",
          "Maximum colour threshold",
          "Upper limit of the colour threshold with target-bitrate, in quantisation steps (at "
          "least colour-threshold)",
          0, 255, kControllable),
      P::boolean<&S::rate, &Rate::adaptive> ("adaptive-bitrate", "Adaptive bit rate",
          "Adapt the bit rate between min-bitrate and target-bitrate to the receiver's "
          "transport-wide feedback (RTPTWCCPackets events)",
          kMutablePlaying),
      P::number<&S::rate, &Rate::min_bitrate> ("min-bitrate", "Minimum bit rate",
          "Lower limit of the bit rate with adaptive-bitrate, in bits per second (at most "
          "target-bitrate)",
          1000, G_MAXUINT, kControllable),
      P::Row{
          gst_param_spec_fraction ("min-framerate", "Minimum frame rate",
              "Minimum number of frame sets per second to keep when adaptive-bitrate drops frame "
              "sets",
              0, 1, G_MAXINT, 1, Rate{}.min_fps_n, Rate{}.min_fps_d, kMutablePlaying),
          [] (S &s, const GValue *value) {
            s.rate.min_fps_n = gst_value_get_fraction_numerator (value);
            s.rate.min_fps_d = gst_value_get_fraction_denominator (value);
          },
          [] (const S &s, GValue *value) {
            gst_value_set_fraction (value, s.rate.min_fps_n, s.rate.min_fps_d);
          }},
  };
  return table;
}
