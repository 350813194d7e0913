/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "rangecast-check.hpp"

#include <gst/base/base.h>

#include <vector>

using namespace rangecast;
using namespace rangecast::testing;

static constexpr GstClockTime kFrame = GST_SECOND / 25;
static constexpr const char *kStreamCaps =
    "application/x-neighbour-code,version=1,alignment=byte-stream";

/* Ten coded frame sets as access units and as the byte stream that the parser makes of them. */
struct Recording {
  Rig rig = ring_rig (2, 64, 48);
  std::vector<GstBuffer *> access_units;
  std::vector<guint8> bytes;

  Recording ()
  {
    GstHarness *encoder = gst_harness_new ("neighbourcodeenc");
    GstHarness *writer = gst_harness_new ("neighbourcodeparse");
    const auto info = gstrange::make_info (rig, 25, 1);
    gst_harness_set_src_caps (encoder, gstrange::make_range_caps (info));
    gst_harness_set_sink_caps_str (writer, kStreamCaps);
    gst_harness_set_src_caps (writer, gstrange::make_neighbour_code_caps (info, "access-unit"));
    for (int i = 0; i < 10; i++) {
      GstBuffer *coded =
          gst_harness_push_and_pull (encoder, make_frame_set (rig, GST_SECOND + i * kFrame));
      access_units.push_back (gst_buffer_ref (coded));
      GstBuffer *written = gst_harness_push_and_pull (writer, coded);
      const std::size_t begin = bytes.size ();
      bytes.resize (begin + gst_buffer_get_size (written));
      gst_buffer_extract (written, 0, bytes.data () + begin, bytes.size () - begin);
      gst_buffer_unref (written);
    }
    gst_harness_teardown (encoder);
    gst_harness_teardown (writer);
  }
  ~Recording ()
  {
    for (GstBuffer *buffer : access_units)
      gst_buffer_unref (buffer);
  }
};

/* What the parser gives for a file of these bytes, read in pieces. */
static std::vector<GstBuffer *>
parse (const std::vector<guint8> &bytes, gsize piece)
{
  GstHarness *h = gst_harness_new ("neighbourcodeparse");
  gst_harness_set_src_caps_str (h, kStreamCaps);
  GstSegment segment; /* as filesrc has it */
  gst_segment_init (&segment, GST_FORMAT_BYTES);
  gst_harness_push_event (h, gst_event_new_segment (&segment));
  for (gsize at = 0; at < bytes.size (); at += piece)
    gst_harness_push (
        h, gst_buffer_new_memdup (bytes.data () + at, std::min (piece, bytes.size () - at)));
  gst_harness_push_event (h, gst_event_new_eos ());
  std::vector<GstBuffer *> parsed;
  while (GstBuffer *buffer = gst_harness_try_pull (h))
    parsed.push_back (buffer);
  gst_harness_teardown (h);
  return parsed;
}

static bool
same_bytes (GstBuffer *a, GstBuffer *b)
{
  GstMapInfo map;
  gst_buffer_map (a, &map, GST_MAP_READ);
  const bool same =
      map.size == gst_buffer_get_size (b) && gst_buffer_memcmp (b, 0, map.data, map.size) == 0;
  gst_buffer_unmap (a, &map);
  return same;
}

static void
unref_all (const std::vector<GstBuffer *> &buffers)
{
  for (GstBuffer *buffer : buffers)
    gst_buffer_unref (buffer);
}

GST_START_TEST (test_what_is_written_reads_the_same_in_pieces_of_any_size)
{
  const Recording recording;
  for (gsize piece : {gsize{1000}, gsize{4096}, recording.bytes.size ()}) {
    const auto parsed = parse (recording.bytes, piece);
    fail_unless_equals_int (parsed.size (), 10);
    for (std::size_t i = 0; i < parsed.size (); i++) {
      fail_unless (same_bytes (parsed[i], recording.access_units[i]));
      fail_unless_equals_uint64 (GST_BUFFER_PTS (parsed[i]), i * kFrame);
      fail_unless_equals_uint64 (
          gst_range_buffer_get_capture_time (parsed[i]), GST_SECOND + i * kFrame);
    }
    unref_all (parsed);
  }
}
GST_END_TEST;

GST_START_TEST (test_rubbish_before_and_between_costs_nothing_else)
{
  const Recording recording;
  std::vector<guint8> bytes (777, 0x52);
  bytes.insert (bytes.end (), recording.bytes.begin (), recording.bytes.end ());
  bytes.insert (bytes.end (), 333, 0x00);
  bytes.insert (bytes.end (), recording.bytes.begin (), recording.bytes.end ());
  const auto parsed = parse (bytes, 5000);
  fail_unless_equals_int (parsed.size (), 20);
  fail_unless (same_bytes (parsed[0], recording.access_units[0]));
  fail_unless (same_bytes (parsed[19], recording.access_units[9]));
  unref_all (parsed);
}
GST_END_TEST;

GST_START_TEST (test_every_cut_keeps_the_whole_access_units_before_it)
{
  const Recording recording;
  for (gsize size = 50; size < recording.bytes.size (); size += 997) {
    const std::vector<guint8> cut (recording.bytes.begin (), recording.bytes.begin () + size);
    const auto parsed = parse (cut, 100000);
    fail_unless (parsed.size () + 1 >= size * 10 / recording.bytes.size ());
    unref_all (parsed);
  }
}
GST_END_TEST;

GST_START_TEST (test_size_field_that_lies_costs_no_later_access_unit)
{
  const Recording recording;
  auto bytes = recording.bytes;
  bytes[4 + 4 + 2] = 0xff; /* the first one claims to be 16 MB long */
  const auto parsed = parse (bytes, 8000);
  fail_unless_equals_int (parsed.size (), 10);
  fail_unless (same_bytes (parsed[1], recording.access_units[1]));
  unref_all (parsed);
}
GST_END_TEST;

GST_START_TEST (test_typefinder_knows_the_stream)
{
  const Recording recording;
  GstTypeFindProbability probability;
  GstCaps *caps = gst_type_find_helper_for_data (
      nullptr, recording.bytes.data (), recording.bytes.size (), &probability);
  fail_unless (caps != nullptr);
  fail_unless (
      gst_structure_has_name (gst_caps_get_structure (caps, 0), "application/x-neighbour-code"));
  fail_unless_equals_int (probability, GST_TYPE_FIND_MAXIMUM);
  gst_caps_unref (caps);
}
GST_END_TEST;

static Suite *
neighbourcodeparse_suite ()
{
  Suite *suite = suite_create ("neighbourcodeparse");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_what_is_written_reads_the_same_in_pieces_of_any_size);
  tcase_add_test (tc, test_rubbish_before_and_between_costs_nothing_else);
  tcase_add_test (tc, test_every_cut_keeps_the_whole_access_units_before_it);
  tcase_add_test (tc, test_size_field_that_lies_costs_no_later_access_unit);
  tcase_add_test (tc, test_typefinder_knows_the_stream);
  return suite;
}

GST_CHECK_MAIN (neighbourcodeparse);
