/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Any fmtp of a session description, as caps of the depayloader and then of the decoder. The bytes
 * are three strings (version, framerate, rig), each ended by 0; of the first byte, a sum of Kind,
 * depends which are there. */
#include <gst/check/gstharness.h>

#include <algorithm>
#include <cstdlib>
#include <gstrange/gstrangeinfo.hpp>
#include <span>
#include <string>

using Bytes = std::span<const guint8>;

enum Kind { kVersion = 1, kRate = 2, kRig = 4, kBlob = 8 }; /* blob: the rig is not yet base64 */

static std::string
take_string (Bytes &bytes)
{
  const auto end = std::ranges::find (bytes, 0);
  const std::string text (bytes.begin (), end);
  bytes = bytes.subspan (std::min (text.size () + 1, bytes.size ()));
  return text;
}

static void
add (GstCaps *caps, const char *field, const char *text)
{
  if (g_utf8_validate (text, -1, nullptr)) /* an SDP that is not is refused before */
    gst_caps_set_simple (caps, field, G_TYPE_STRING, text, nullptr);
}

static GstCaps *
make_caps (int kind, Bytes bytes)
{
  GstCaps *caps = gst_caps_new_simple ("application/x-rtp", "media", G_TYPE_STRING, "video",
      "clock-rate", G_TYPE_INT, 90000, "encoding-name", G_TYPE_STRING, "X-NEIGHBOUR-CODE", nullptr);
  if (kind & kVersion)
    add (caps, "version", take_string (bytes).c_str ());
  if (kind & kRate)
    add (caps, "framerate", take_string (bytes).c_str ());
  if (kind & kBlob) {
    gchar *rig = g_base64_encode (bytes.data (), bytes.size ());
    add (caps, "rig", rig);
    g_free (rig);
  } else if (kind & kRig) {
    add (caps, "rig", std::string (bytes.begin (), bytes.end ()).c_str ());
  }
  return caps;
}

extern "C" int
LLVMFuzzerTestOneInput (const std::uint8_t *data, std::size_t size)
{
  static GstHarness *h = nullptr;
  if (!h) {
    gst_init (nullptr, nullptr);
    h = gst_harness_new_parse ("rtpneighbourcodedepay ! neighbourcodedec");
    gst_harness_play (h);
    gst_harness_push_event (h, gst_event_new_stream_start ("fuzz"));
  }
  if (size == 0)
    return 0;
  GstCaps *caps = make_caps (data[0], {data + 1, size - 1});
  gst_harness_push_event (h, gst_event_new_caps (caps)); /* refused or not */
  gst_caps_unref (caps);
  GstCaps *out = gst_pad_get_current_caps (h->sinkpad);
  gstrange::RangeInfo info;
  if (out && !gstrange::parse_caps (out, info).ok ())
    std::abort ();
  gst_clear_caps (&out);
  while (GstEvent *event = gst_harness_try_pull_event (h))
    gst_event_unref (event);
  return 0;
}
