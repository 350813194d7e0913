/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "adaptiverate.hpp"

#include <algorithm>

using rangecast::PacketReport;

namespace {

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
AdaptiveRate::reset ()
{
  std::lock_guard guard (lock_);
  control_.reset ();
  reports_ = 0;
}

void
AdaptiveRate::handle_packets (const GstStructure *structure)
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
  control_.packets (packets_, now_ns ());
}

bool
AdaptiveRate::handle_event (GstEvent *event)
{
  if (GST_EVENT_TYPE (event) != GST_EVENT_CUSTOM_UPSTREAM)
    return false;
  const GstStructure *structure = gst_event_get_structure (event);
  if (!structure || !gst_structure_has_name (structure, "RTPTWCCPackets"))
    return false;
  handle_packets (structure);
  return true;
}

double
AdaptiveRate::update (const AdaptiveRateLimits &limits, double sent_bits_per_s)
{
  std::lock_guard guard (lock_);
  control_.configure ({limits.min_bits_per_s, limits.max_bits_per_s});
  control_.tick (sent_bits_per_s, now_ns ());
  return control_.bits_per_s ();
}

double
AdaptiveRate::bits_per_s () const
{
  std::lock_guard guard (lock_);
  return control_.bits_per_s ();
}

void
AdaptiveRate::add_stats (GstStructure *structure) const
{
  std::lock_guard guard (lock_);
  gst_structure_set (structure, "estimated-bitrate", G_TYPE_UINT64,
      guint64 (control_.bits_per_s () + 0.5), "receiver-reports", G_TYPE_UINT64, reports_,
      "receiver-loss", G_TYPE_DOUBLE, control_.lost (), "receiver-queue", G_TYPE_UINT64,
      guint64 (std::max (control_.queue_s (), 0.0) * 1e9), nullptr);
}
