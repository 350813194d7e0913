/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "bitrate.hpp"

#include <algorithm>
#include <cmath>
#include <gstrange/gstrange.h>

using rangecast::EncoderSettings;
using rangecast::PacketReport;
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

guint64
now_ns ()
{
  return guint64 (g_get_monotonic_time ()) * 1000;
}

/* One RTPTWCCPacket of rtpsession. @return false if a field that is needed is missing */
bool
read_packet (const GstStructure *structure, PacketReport &packet)
{
  guint sequence = 0, size = 0;
  guint64 sent = GST_CLOCK_TIME_NONE, arrival = GST_CLOCK_TIME_NONE;
  gboolean lost = FALSE;
  if (!gst_structure_get (structure, "seqnum", G_TYPE_UINT, &sequence, "local-ts", G_TYPE_UINT64,
          &sent, "lost", G_TYPE_BOOLEAN, &lost, nullptr) ||
      !GST_CLOCK_TIME_IS_VALID (sent))
    return false;
  gst_structure_get (structure, "size", G_TYPE_UINT, &size, nullptr);
  gst_structure_get (structure, "remote-ts", G_TYPE_UINT64, &arrival, nullptr);
  if (!lost && !GST_CLOCK_TIME_IS_VALID (arrival))
    return false;
  packet = {guint16 (sequence), sent, lost ? 0 : arrival, size, lost != FALSE};
  return true;
}

} // namespace

void
NeighbourCodeRate::reset ()
{
  control_.reset ();
  meter_.reset ();
  thinning_.reset ();
  is_on_ = false;
  time_ = interval_ = 0;
  std::lock_guard guard (lock_);
  network_.reset ();
  reports_ = 0;
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
  double bits_per_s = 0; /* 0: no limit is known */
  {
    std::lock_guard guard (lock_);
    network_.configure ({double (rate.min_bitrate), double (rate.target_bitrate)});
    network_.tick (meter_.bits_per_s (interval), now_ns ());
    bits_per_s = network_.bits_per_s ();
  }
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

void
NeighbourCodeRate::handle_packets (const GstStructure *structure)
{
  const GType array_type = g_type_from_name ("GValueArray");
  const GValue *packets = gst_structure_get_value (structure, "packets");
  if (!packets || array_type == 0 || !G_VALUE_HOLDS (packets, array_type))
    return;
  G_GNUC_BEGIN_IGNORE_DEPRECATIONS /* what rtpsession sends */
      const auto array = static_cast<const GValueArray *> (g_value_get_boxed (packets));
  std::lock_guard guard (lock_);
  packets_.clear ();
  for (guint i = 0; array && i < array->n_values; i++) {
    const GValue *value = &array->values[i];
    PacketReport packet;
    if (GST_VALUE_HOLDS_STRUCTURE (value) && read_packet (gst_value_get_structure (value), packet))
      packets_.push_back (packet);
  }
  G_GNUC_END_IGNORE_DEPRECATIONS
  reports_++;
  network_.packets (packets_, now_ns ());
}

bool
NeighbourCodeRate::handle_event (GstEvent *event)
{
  if (GST_EVENT_TYPE (event) != GST_EVENT_CUSTOM_UPSTREAM)
    return false;
  const GstStructure *structure = gst_event_get_structure (event);
  if (!structure || !gst_structure_has_name (structure, "RTPTWCCPackets"))
    return false;
  handle_packets (structure);
  return true;
}

void
NeighbourCodeRate::add_stats (GstStructure *structure) const
{
  std::lock_guard guard (lock_);
  gst_structure_set (structure, "estimated-bitrate", G_TYPE_UINT64,
      guint64 (network_.bits_per_s () + 0.5), "receiver-reports", G_TYPE_UINT64, reports_,
      "receiver-loss", G_TYPE_DOUBLE, network_.lost (), "receiver-queue", G_TYPE_UINT64,
      guint64 (std::max (network_.queue_s (), 0.0) * 1e9), nullptr);
}
