/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Any bytes as RTCP packets from some hosts: rtcpreports hands them on as they are or drops them,
 * has no error whatever they are, and keeps no more receivers than it is told. Each packet is one
 * byte of host and time, two of size, packet. It lies right before memory that nobody may read. */
#include <gst/check/gstharness.h>
#include <gst/net/gstnet.h>
#include <gst/rtp/rtp.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <span>
#include <string>

#include "guarded_bytes.hpp"

using Bytes = std::span<const guint8>;

static constexpr guint kMax = 8;
static constexpr guint32 kStream = 1; /* few bits, so that reports about it are found */

struct Session {
  GstElement *element = nullptr;
  GstHarness *rtp = nullptr, *rtcp = nullptr;
  std::array<GSocketAddress *, 8> hosts = {}; /* the last one is not known */
  GstClockTime time = 0;
  GuardedBytes memory{16};

  Session ();
  void push (Bytes packet, guint8 flags);
  guint64 receivers () const;
};

static void
push_stream_packet (GstHarness *h)
{
  GstBuffer *packet = gst_rtp_buffer_new_allocate (10, 0, 0);
  GstRTPBuffer rtp = GST_RTP_BUFFER_INIT;
  gst_rtp_buffer_map (packet, GST_MAP_WRITE, &rtp);
  gst_rtp_buffer_set_ssrc (&rtp, kStream);
  gst_rtp_buffer_unmap (&rtp);
  gst_harness_push (h, packet);
}

/* An event upstream: a report, or what every pad says of itself. Nobody else takes them. */
static GstPadProbeReturn
check_event (GstPad *, GstPadProbeInfo *info, gpointer)
{
  const GstStructure *report = gst_event_get_structure (GST_PAD_PROBE_INFO_EVENT (info));
  if (!report || !gst_structure_has_name (report, "RangecastReceiverReport"))
    return GST_PAD_PROBE_OK;
  double lost = -1;
  guint64 trip = GST_CLOCK_TIME_NONE;
  if (!gst_structure_get_double (report, "fraction-lost", &lost) || lost < 0 || lost >= 1 ||
      !gst_structure_get_uint64 (report, "round-trip-time", &trip) || trip > 10 * GST_SECOND)
    std::abort ();
  return GST_PAD_PROBE_DROP;
}

Session::Session ()
{
  gst_init (nullptr, nullptr);
  element = gst_element_factory_make ("rtcpreports", nullptr);
  if (!element)
    std::abort ();
  g_object_set (element, "max-receivers", kMax, nullptr);
  rtp = gst_harness_new_with_element (element, "sink", "src");
  rtcp = gst_harness_new_with_element (element, "rtcp_sink", "rtcp_src");
  gst_harness_set_src_caps_str (
      rtp, "application/x-rtp, media=video, clock-rate=90000, payload=96");
  gst_harness_set_src_caps_str (rtcp, "application/x-rtcp");
  gst_harness_set_drop_buffers (rtp, TRUE);
  gst_harness_set_drop_buffers (rtcp, TRUE);
  for (std::size_t i = 0; i + 1 < hosts.size (); i++)
    hosts[i] =
        g_inet_socket_address_new_from_string (("10.0.0." + std::to_string (i)).c_str (), 5000);
  GstPad *sink = gst_element_get_static_pad (element, "sink");
  gst_pad_add_probe (sink, GST_PAD_PROBE_TYPE_EVENT_UPSTREAM, check_event, nullptr, nullptr);
  gst_object_unref (sink);
  push_stream_packet (rtp);
}

void
Session::push (Bytes packet, guint8 flags)
{
  const std::span<guint8> bytes = memory.copy (packet);
  GstBuffer *buffer = gst_buffer_new_wrapped_full (
      GST_MEMORY_FLAG_READONLY, bytes.data (), bytes.size (), 0, bytes.size (), nullptr, nullptr);
  if (GSocketAddress *from = hosts[flags & 7])
    gst_buffer_add_net_address_meta (buffer, from);
  time += (flags >> 3) * GST_SECOND; /* up to 31 s: who was there is forgotten */
  GST_BUFFER_PTS (buffer) = time;
  if (gst_harness_push (rtcp, buffer) != GST_FLOW_OK)
    std::abort ();
}

guint64
Session::receivers () const
{
  GstStructure *stats = nullptr;
  guint64 receivers = G_MAXUINT64;
  g_object_get (element, "stats", &stats, nullptr);
  gst_structure_get_uint64 (stats, "receivers", &receivers);
  gst_structure_free (stats);
  return receivers;
}

extern "C" int
LLVMFuzzerTestOneInput (const std::uint8_t *data, std::size_t size)
{
  static Session session;
  for (Bytes rest (data, size); rest.size () >= 3;) {
    const gsize length = std::min<gsize> (rest[1] | rest[2] << 8, rest.size () - 3);
    session.push (rest.subspan (3, length), rest[0]);
    rest = rest.subspan (3 + length);
  }
  if (session.receivers () > kMax)
    std::abort ();
  return 0;
}
