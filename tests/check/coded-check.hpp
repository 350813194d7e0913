/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What the tests of elements that handle coded frame sets share. */
#pragma once

/* Before gstcheck.h, whose macro fail() is not for the standard library. */
#include <rangecast/neighbourcode/access_unit.hpp>
#include <vector>

#include "rangecast-check.hpp"

namespace rangecast::testing {

inline GstCaps *
range_caps (const Rig &rig)
{
  return gstrange::make_range_caps (gstrange::make_info (rig, 30, 1));
}

inline GstCaps *
coded_caps (const Rig &rig)
{
  return gstrange::make_neighbour_code_caps (gstrange::make_info (rig, 30, 1));
}

inline std::vector<guint8>
bytes_of (GstBuffer *buffer)
{
  std::vector<guint8> bytes (gst_buffer_get_size (buffer));
  gst_buffer_extract (buffer, 0, bytes.data (), bytes.size ());
  return bytes;
}

/** The units that some bytes hold; they must be sound to the end. */
inline std::vector<std::vector<guint8>>
units_of (std::span<const guint8> bytes)
{
  std::vector<std::vector<guint8>> units;
  UnitReader reader (bytes);
  UnitHeader header;
  while (const auto unit = reader.next (header))
    units.emplace_back (unit->begin (), unit->end ());
  fail_unless_ok (reader.status ());
  return units;
}

/** The slices of a coded buffer. */
inline std::vector<std::vector<guint8>>
slices_of (GstBuffer *buffer)
{
  auto units = units_of (bytes_of (buffer));
  std::erase_if (units, [] (const auto &unit) { return (unit[0] & 15) != int (UnitType::kSlice); });
  return units;
}

inline GstBuffer *
buffer_of (const std::vector<std::vector<guint8>> &units, GstClockTime time = 0)
{
  std::vector<guint8> bytes;
  for (const auto &unit : units)
    bytes.insert (bytes.end (), unit.begin (), unit.end ());
  GstBuffer *buffer = gst_buffer_new_memdup (bytes.data (), bytes.size ());
  GST_BUFFER_PTS (buffer) = time;
  gst_range_buffer_set_capture_time (buffer, time);
  return buffer;
}

/** One element with its properties, which gst_harness_new_parse() would hide in a bin. */
inline GstHarness *
harness_of (const std::string &launch)
{
  GstElement *element = gst_parse_launch (launch.c_str (), nullptr);
  fail_unless (element != nullptr);
  GstHarness *h = gst_harness_new_with_element (element, "sink", "src");
  gst_object_unref (element);
  return h;
}

/** A frame set's slices, as neighbourcodeenc with these properties makes them; of profile plain, so
 * that small pictures have many. */
inline std::vector<std::vector<guint8>>
encoded_units (const Rig &rig, GstBuffer *frame_set,
    const char *properties = "depth-bits=16 depth-threshold=0 colour-threshold=0")
{
  GstHarness *h = harness_of (std::string ("neighbourcodeenc profile=plain ") + properties);
  gst_harness_set_src_caps (h, range_caps (rig));
  GstBuffer *coded = gst_harness_push_and_pull (h, frame_set);
  const auto slices = slices_of (coded);
  gst_buffer_unref (coded);
  gst_harness_teardown (h);
  return slices;
}

inline SliceHeader
header_of (std::span<const guint8> slice)
{
  SliceHeader header;
  fail_unless_ok (read_slice_header (slice, header));
  return header;
}

/** Takes the harness's output as buffers. */
inline std::vector<GstBuffer *>
pull_all (GstHarness *h)
{
  std::vector<GstBuffer *> buffers;
  while (GstBuffer *buffer = gst_harness_try_pull (h))
    buffers.push_back (buffer);
  return buffers;
}

inline void
unref_all (std::vector<GstBuffer *> &buffers)
{
  for (GstBuffer *buffer : buffers)
    gst_buffer_unref (buffer);
  buffers.clear ();
}

inline void
flush (GstHarness *h)
{
  fail_unless (gst_harness_push_event (h, gst_event_new_flush_start ()));
  fail_unless (gst_harness_push_event (h, gst_event_new_flush_stop (TRUE)));
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_TIME);
  fail_unless (gst_harness_push_event (h, gst_event_new_segment (&segment)));
}

/** Whether an event of that type has come out. Takes all events. */
inline bool
pulls_event (GstHarness *h, GstEventType type)
{
  bool found = false;
  while (GstEvent *event = gst_harness_try_pull_event (h)) {
    found |= GST_EVENT_TYPE (event) == type;
    gst_event_unref (event);
  }
  return found;
}

/** Gives the harness's element a bus to count errors on. */
struct ErrorCounter {
  GstHarness *h;
  GstBus *bus = gst_bus_new ();

  explicit ErrorCounter (GstHarness *harness) : h (harness)
  {
    gst_element_set_bus (h->element, bus);
  }
  ErrorCounter (const ErrorCounter &) = delete;
  ErrorCounter &operator= (const ErrorCounter &) = delete;
  ~ErrorCounter ()
  {
    gst_element_set_bus (h->element, nullptr);
    gst_object_unref (bus);
  }
  /** Errors since the last call. */
  int take ()
  {
    int n = 0;
    while (GstMessage *message = gst_bus_pop_filtered (bus, GST_MESSAGE_ERROR)) {
      gst_message_unref (message);
      n++;
    }
    return n;
  }
};

} // namespace rangecast::testing
