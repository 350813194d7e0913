/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Any bytes as RTP packets: through depayloader and decoder, no error whatever they are. Each
 * packet is one byte of marker and time, two of size, payload. */
#include <gst/check/gstharness.h>
#include <gst/rtp/rtp.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <gstrange/gstrangeinfo.hpp>
#include <span>

using namespace rangecast;

using Bytes = std::span<const guint8>;

static GstHarness *
make_harness ()
{
  gst_init (nullptr, nullptr);
  View view;
  view.width = 80;
  view.height = 60;
  view.intrinsics = {60, 60, 39.5, 29.5};
  const auto blob = encode_rig ({{view}});
  gchar *rig = g_base64_encode (blob.data (), blob.size ());
  GstHarness *h = gst_harness_new_parse ("rtpneighbourcodedepay ! neighbourcodedec");
  gst_harness_set_drop_buffers (h, TRUE);
  gst_harness_set_src_caps (
      h, gst_caps_new_simple ("application/x-rtp", "media", G_TYPE_STRING, "video", "clock-rate",
             G_TYPE_INT, 90000, "encoding-name", G_TYPE_STRING, "X-NEIGHBOUR-CODE", "rig",
             G_TYPE_STRING, rig, nullptr));
  g_free (rig);
  return h;
}

static GstBuffer *
make_packet (Bytes payload, guint8 flags, guint16 number)
{
  GstBuffer *packet = gst_rtp_buffer_new_allocate (guint (payload.size ()), 0, 0);
  GstRTPBuffer rtp = GST_RTP_BUFFER_INIT;
  gst_rtp_buffer_map (packet, GST_MAP_WRITE, &rtp);
  gst_rtp_buffer_set_marker (&rtp, flags & 1);
  gst_rtp_buffer_set_timestamp (&rtp, (flags >> 1 & 7) * 3000u);
  gst_rtp_buffer_set_seq (&rtp, number);
  gst_rtp_buffer_set_payload_type (&rtp, 96);
  std::copy (
      payload.begin (), payload.end (), static_cast<guint8 *> (gst_rtp_buffer_get_payload (&rtp)));
  gst_rtp_buffer_unmap (&rtp);
  GST_BUFFER_PTS (packet) = (flags >> 1 & 7) * GST_MSECOND;
  return packet;
}

extern "C" int
LLVMFuzzerTestOneInput (const std::uint8_t *data, std::size_t size)
{
  static GstHarness *h = make_harness ();
  static guint16 number = 0;
  for (Bytes rest (data, size); rest.size () >= 3;) {
    const guint8 flags = rest[0];
    const gsize length = std::min<gsize> (rest[1] | rest[2] << 8, rest.size () - 3);
    number = guint16 (number + 1 + (flags >> 6)); /* some are lost */
    if (gst_harness_push (h, make_packet (rest.subspan (3, length), flags, number)) != GST_FLOW_OK)
      std::abort ();
    rest = rest.subspan (3 + length);
  }
  return 0;
}
