/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Any bytes through neighbourcodeparse and its typefinder: as a byte stream that comes in pieces,
 * or as access units. The first byte says which, and how large the pieces are. */
#include <gst/base/gsttypefindhelper.h>
#include <gst/check/gstharness.h>

#include <algorithm>
#include <cstdlib>
#include <gstrange/gstrange.h>
#include <gstrange/gstrangeinfo.hpp>
#include <rangecast/neighbourcode/bitstream/byte_stream.hpp>
#include <rangecast/neighbourcode/bitstream/unit.hpp>
#include <span>

using namespace rangecast;
using Bytes = std::span<const guint8>;

enum Kind { kAccessUnits = 1 }; /* of the first byte; bits 1 to 7: size of the pieces */

static void
expect (bool fact)
{
  if (!fact)
    std::abort ();
}

/* What comes out is whole, whatever went in. */
static GstPadProbeReturn
check_access_unit (GstPad *, GstPadProbeInfo *info, gpointer)
{
  GstMapInfo map;
  expect (gst_buffer_map (GST_PAD_PROBE_INFO_BUFFER (info), &map, GST_MAP_READ) && map.size > 0);
  UnitReader units ({map.data, map.size});
  UnitHeader header;
  gsize total = 0;
  while (const auto unit = units.next (header))
    total += unit->size ();
  expect (total == map.size);
  gst_buffer_unmap (GST_PAD_PROBE_INFO_BUFFER (info), &map);
  return GST_PAD_PROBE_OK;
}

static GstHarness *
make_harness (GstCaps *caps)
{
  GstHarness *h = gst_harness_new ("neighbourcodeparse");
  gst_harness_set_drop_buffers (h, TRUE);
  gst_harness_set_src_caps (h, caps);
  return h;
}

static GstHarness *
parser_of_bytes ()
{
  GstHarness *h = make_harness (gst_caps_from_string (GST_NEIGHBOUR_CODE_STREAM_CAPS));
  gst_pad_add_probe (h->sinkpad, GST_PAD_PROBE_TYPE_BUFFER, check_access_unit, nullptr, nullptr);
  return h;
}

static GstHarness *
parser_of_access_units ()
{
  View view;
  view.width = 80;
  view.height = 60;
  view.intrinsics = {60, 60, 39.5, 29.5};
  return make_harness (gstrange::make_neighbour_code_caps (gstrange::make_info ({{view}}, 30, 1)));
}

static void
push_all (GstHarness *h, Bytes bytes, gsize piece)
{
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_TIME);
  gst_harness_push_event (h, gst_event_new_segment (&segment));
  for (GstClockTime time = 0; !bytes.empty (); time += GST_SECOND / 30) {
    const Bytes part = bytes.first (std::min (piece, bytes.size ()));
    GstBuffer *buffer = gst_buffer_new_memdup (part.data (), part.size ());
    GST_BUFFER_PTS (buffer) = time;
    if (gst_harness_push (h, buffer) != GST_FLOW_OK)
      break; /* it has posted why */
    bytes = bytes.subspan (part.size ());
  }
  gst_harness_push_event (h, gst_event_new_eos ());
  gst_harness_push_event (h, gst_event_new_flush_start ());
  gst_harness_push_event (h, gst_event_new_flush_stop (TRUE));
  while (GstEvent *event = gst_harness_try_pull_event (h))
    gst_event_unref (event);
}

static void
find_type (Bytes bytes)
{
  static GstTypeFindFactory *factory = [] {
    auto feature = gst_registry_find_feature (
        gst_registry_get (), "video/x-neighbour-code", GST_TYPE_TYPE_FIND_FACTORY);
    expect (feature != nullptr);
    return GST_TYPE_FIND_FACTORY (gst_plugin_feature_load (feature));
  }();
  GstTypeFind find{};
  find.data = &bytes;
  find.peek = [] (gpointer data, gint64 offset, guint size) -> const guint8 * {
    const Bytes &all = *static_cast<Bytes *> (data);
    return offset >= 0 && guint64 (offset) + size <= all.size () ? all.data () + offset : nullptr;
  };
  find.suggest = [] (gpointer, guint, GstCaps *) {};
  gst_type_find_factory_call_function (factory, &find);
}

extern "C" int
LLVMFuzzerTestOneInput (const std::uint8_t *data, std::size_t size)
{
  static GstHarness *of_bytes = nullptr, *of_access_units = nullptr;
  if (!of_bytes) {
    gst_init (nullptr, nullptr);
    of_bytes = parser_of_bytes ();
    of_access_units = parser_of_access_units ();
  }
  if (size == 0)
    return 0;
  const Bytes bytes (data + 1, size - 1);
  const gsize piece = 1 + (data[0] >> 1) * 16;
  find_type (bytes);
  push_all (data[0] & kAccessUnits ? of_access_units : of_bytes, bytes,
      std::max<gsize> (piece, size / 64));
  return 0;
}
