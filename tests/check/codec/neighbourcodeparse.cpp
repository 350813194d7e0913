/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include <rangecast/neighbourcode/bitstream/byte_stream.hpp>

#include "parse-check.hpp"

using namespace rangecast;
using namespace rangecast::testing;

GST_START_TEST (test_what_is_written_reads_the_same_in_pieces_of_any_size)
{
  const Recording recording;
  for (gsize piece : {gsize{1000}, gsize{4096}, recording.bytes.size ()}) {
    auto parsed = parse (recording.bytes, piece);
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

/* An access unit of units of an unknown type, ahead of its own slices. */
static std::vector<guint8>
pad_first_access_unit (const Recording &recording, std::vector<guint8> padding)
{
  AccessUnitHeader header;
  const auto &bytes = recording.bytes;
  fail_unless_ok (read_access_unit_header (std::span (bytes).first (28), header));
  header.size += guint32 (padding.size ());
  std::vector<guint8> padded (bytes.begin (), bytes.begin () + 28);
  write_access_unit_header (header, padded.data ());
  padded.insert (padded.end (), padding.begin (), padding.end ());
  padded.insert (padded.end (), bytes.begin () + 28, bytes.end ());
  return padded;
}

static std::vector<guint8>
unknown_unit (const std::vector<guint8> &content)
{
  const gsize size = content.size () + 4;
  std::vector<guint8> unit = {0x49, 0, guint8 (size & 255), guint8 (size >> 8)};
  unit.insert (unit.end (), content.begin (), content.end ());
  return unit;
}

GST_START_TEST (test_access_unit_inside_a_unit_does_not_end_the_access_unit)
{
  const Recording recording;
  std::vector<guint8> inner (recording.bytes.begin (), recording.bytes.begin () + 200);
  const auto bytes = pad_first_access_unit (recording, unknown_unit (inner));
  for (gsize piece : {100, 5000, G_MAXINT}) {
    auto parsed = parse (bytes, piece);
    fail_unless_equals_int (parsed.size (), 10);
    fail_unless (same_bytes (parsed[9], recording.access_units[9]));
    unref_all (parsed);
  }
}
GST_END_TEST;

GST_START_TEST (test_longest_access_unit_takes_linear_time)
{
  const Recording recording;
  std::vector<guint8> padding;
  const auto unit = unknown_unit (std::vector<guint8> (8000, 0));
  while (padding.size () + unit.size () < (31 << 20))
    padding.insert (padding.end (), unit.begin (), unit.end ());
  const auto bytes = pad_first_access_unit (recording, padding);
  const gint64 begin = g_get_monotonic_time ();
  auto parsed = parse (bytes, 4096);
  fail_unless_equals_int (parsed.size (), 10);
  unref_all (parsed);
  /* Looking at it all again with each piece would copy 120 GB. */
  ck_assert_int_lt (g_get_monotonic_time () - begin, 15 * G_USEC_PER_SEC);
}
GST_END_TEST;

GST_START_TEST (test_access_unit_goes_on_as_soon_as_it_is_whole)
{
  const Recording recording;
  GstHarness *h = new_parser ();
  for (gsize i = 0; i < 9; i++) {
    const gsize begin = recording.offsets[i], end = recording.offsets[i + 1];
    push_bytes (h, {recording.bytes.data () + begin, end - begin}, 1000);
    fail_unless_equals_int (gst_harness_buffers_received (h), i + 1);
  }
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_access_units_that_came_in_one_buffer_share_its_memory)
{
  const Recording recording;
  GstHarness *h = new_parser ();
  GstBuffer *input = gst_buffer_new_memdup (recording.bytes.data (), recording.bytes.size ());
  GstMemory *memory = gst_buffer_get_memory (input, 0);
  gst_harness_push (h, input);
  auto parsed = pull_all (h);
  fail_unless_equals_int (parsed.size (), 10);
  for (GstBuffer *buffer : parsed) {
    fail_unless_equals_int (gst_buffer_n_memory (buffer), 1);
    ck_assert_ptr_eq (gst_buffer_peek_memory (buffer, 0)->parent, memory);
  }
  unref_all (parsed);
  gst_memory_unref (memory);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_delta_unit_is_set_where_the_header_says_no_key)
{
  const Recording recording;
  auto parsed = parse (with_delta_units (recording), 5000);
  fail_unless_equals_int (parsed.size (), 10);
  for (gsize i = 0; i < 10; i++)
    fail_unless_equals_int (
        GST_BUFFER_FLAG_IS_SET (parsed[i], GST_BUFFER_FLAG_DELTA_UNIT), i % 5 != 0);
  unref_all (parsed);
}
GST_END_TEST;

static GstHarness *
parser_of_access_units (const Recording &recording)
{
  GstHarness *h = harness_of ("neighbourcodeparse");
  gst_harness_set_src_caps (
      h, gstrange::make_neighbour_code_caps (gstrange::make_info (recording.rig, 25, 1)));
  return h;
}

static bool
is_passed_as_key (const Recording &recording, GstBuffer *coded)
{
  GstHarness *h = parser_of_access_units (recording);
  GstBuffer *passed = gst_harness_push_and_pull (h, coded);
  const bool key = !GST_BUFFER_FLAG_IS_SET (passed, GST_BUFFER_FLAG_DELTA_UNIT);
  gst_buffer_unref (passed);
  gst_harness_teardown (h);
  return key;
}

GST_START_TEST (test_access_unit_that_lacks_slices_is_a_delta_unit)
{
  const Recording recording (1, 160);
  const auto units = slices_of (recording.access_units[0]);
  ck_assert_uint_gt (units.size (), 4); /* of two views */
  fail_unless (is_passed_as_key (recording, buffer_of (units)));
  for (std::size_t lost = 0; lost < units.size (); lost++) {
    auto rest = units;
    rest.erase (rest.begin () + std::ptrdiff_t (lost));
    fail_if (is_passed_as_key (recording, buffer_of (rest)));
    rest.push_back (rest[0]); /* one that comes twice is none that is missing */
    fail_if (is_passed_as_key (recording, buffer_of (rest)));
  }
  GstBuffer *coded = gst_buffer_copy_deep (recording.access_units[0]);
  GST_BUFFER_FLAG_SET (coded, GST_BUFFER_FLAG_DELTA_UNIT); /* upstream knows of a loss */
  fail_if (is_passed_as_key (recording, coded));
}
GST_END_TEST;

GST_START_TEST (test_rig_that_changes_gives_new_caps)
{
  const Recording first (10, 64), second (10, 32);
  auto bytes = first.bytes;
  bytes.insert (bytes.end (), second.bytes.begin (), second.bytes.end ());
  GstHarness *h = new_parser ();
  push_bytes (h, bytes, 5000);
  int widths[2] = {}, caps_events = 0;
  while (GstEvent *event = gst_harness_try_pull_event (h)) {
    GstCaps *caps = nullptr;
    if (GST_EVENT_TYPE (event) == GST_EVENT_CAPS && caps_events < 2) {
      gst_event_parse_caps (event, &caps);
      gst_structure_get_int (gst_caps_get_structure (caps, 0), "width", &widths[caps_events++]);
    }
    gst_event_unref (event);
  }
  fail_unless_equals_int (caps_events, 2);
  fail_unless_equals_int (widths[0], 64);
  fail_unless_equals_int (widths[1], 32);
  fail_unless_equals_int (gst_harness_buffers_received (h), 20);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_flush_forgets_what_was_half_there)
{
  const Recording recording;
  GstHarness *h = new_parser ();
  auto lying = recording.bytes;
  lying[8 + 3] = 0x01;
  push_bytes (h, {lying.data (), recording.offsets[1] - 10}, 500);
  gst_harness_push_event (h, gst_event_new_flush_start ());
  gst_harness_push_event (h, gst_event_new_flush_stop (TRUE));
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_BYTES);
  gst_harness_push_event (h, gst_event_new_segment (&segment));
  push_bytes (h, {recording.bytes.data (), recording.offsets[1]}, 500);
  auto parsed = pull_all (h);
  fail_unless_equals_int (parsed.size (), 1);
  fail_unless (same_bytes (parsed[0], recording.access_units[0]));
  unref_all (parsed);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_file_plays_again_after_all_state_changes)
{
  const Recording recording (20, 16);
  const TemporaryFile file (recording.bytes);
  Player player (file);
  for (int i = 0; i < 2; i++) {
    fail_unless (player.finish ());
    fail_unless_equals_int (player.seen.size (), 20);
    fail_unless_equals_uint64 (player.seen.back (), 19 * kFrame);
    gst_element_set_state (player.pipeline, GST_STATE_READY);
    gst_element_set_state (player.pipeline, GST_STATE_NULL);
    player.seen.clear ();
  }
}
GST_END_TEST;

/* As uridecodebin3 of GStreamer 1.22 starts its source, in its own state change. */
GST_START_TEST (test_nothing_is_sent_to_elements_whose_state_change_comes_later)
{
  const Recording recording (20, 16);
  const TemporaryFile file (recording.bytes);
  Player player (file);
  fail_unless (player.wait ());
  gst_element_set_state (player.pipeline, GST_STATE_READY);
  player.seen.clear ();
  GST_STATE_LOCK (player.pipeline);
  gst_element_set_locked_state (player.sink, TRUE);
  gst_element_set_state (player.pipeline, GST_STATE_PAUSED);
  g_usleep (200000);
  gst_element_set_locked_state (player.sink, FALSE);
  gst_element_sync_state_with_parent (player.sink);
  GST_STATE_UNLOCK (player.pipeline);
  fail_unless (player.finish ());
  fail_unless_equals_int (player.seen.size (), 20);
}
GST_END_TEST;

GST_START_TEST (test_access_units_pass_as_they_are)
{
  const Recording recording;
  GstHarness *h = parser_of_access_units (recording);
  std::vector<guint8> written;
  for (GstBuffer *coded : recording.access_units) {
    GstBuffer *buffer = gst_harness_push_and_pull (h, gst_buffer_ref (coded));
    const auto bytes = bytes_of (buffer);
    written.insert (written.end (), bytes.begin (), bytes.end ());
    gst_buffer_unref (buffer);
  }
  fail_unless (written == recording.bytes);
  gst_harness_teardown (h);
}
GST_END_TEST;

/* The time in the header of an access unit of a byte stream. */
static guint64
written_time (GstBuffer *written)
{
  const auto bytes = bytes_of (written);
  AccessUnitHeader header;
  fail_unless (begins_access_unit (bytes, header));
  return header.pts_ns;
}

GST_START_TEST (test_access_unit_gets_the_time_of_its_buffer)
{
  const Recording recording (1);
  GstHarness *h = parser_of_access_units (recording);
  GstBuffer *later = gst_buffer_copy (recording.access_units[0]);
  GST_BUFFER_PTS (later) = 7 * GST_SECOND;
  GstBuffer *passed = gst_harness_push_and_pull (h, later);
  fail_unless_equals_uint64 (written_time (passed), 7 * GST_SECOND);
  fail_unless_equals_uint64 (written_time (recording.access_units[0]), GST_SECOND);
  gst_buffer_unref (passed);
  gst_harness_teardown (h);
}
GST_END_TEST;

/* The segments are those of concat. */
GST_START_TEST (test_written_times_go_on_in_a_new_segment)
{
  const Rig rig = ring_rig (2, 64, 48);
  GstHarness *h = harness_of ("neighbourcodeenc");
  gst_harness_set_src_caps (h, range_caps (rig));
  for (const GstClockTime base : {0, 7, 2}) {
    GstSegment segment;
    gst_segment_init (&segment, GST_FORMAT_TIME);
    segment.base = base * GST_SECOND;
    segment.start = segment.time = GST_SECOND + kFrame / 2;
    gst_harness_push_event (h, gst_event_new_segment (&segment));
    for (gsize i = 0; i < 2; i++) {
      const GstClockTime pts = GST_SECOND + i * kFrame;
      GstBuffer *written = gst_harness_push_and_pull (h, make_frame_set (rig, pts));
      fail_unless_equals_uint64 (GST_BUFFER_PTS (written), pts);
      const GstClockTime begin = base * GST_SECOND; /* where the first one is not yet */
      fail_unless_equals_uint64 (written_time (written),
          i > 0 ? begin + kFrame / 2 : begin - std::min (begin, kFrame / 2));
      gst_buffer_unref (written);
    }
  }
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_byte_stream_in_segments_of_time_keeps_upstreams_times)
{
  const Recording recording;
  GstHarness *h = gst_harness_new ("neighbourcodeparse");
  gst_harness_set_src_caps_str (h, kStreamCaps);
  for (const GstClockTime base : {0, 3}) {
    GstSegment segment;
    gst_segment_init (&segment, GST_FORMAT_TIME);
    segment.base = base * GST_SECOND;
    gst_harness_push_event (h, gst_event_new_segment (&segment));
    for (gsize i = 0; i < 10; i++) {
      const gsize begin = recording.offsets[i],
                  end = i < 9 ? recording.offsets[i + 1] : recording.bytes.size ();
      GstBuffer *buffer = gst_buffer_new_memdup (&recording.bytes[begin], end - begin);
      GST_BUFFER_PTS (buffer) = 5 * GST_SECOND + i * kFrame;
      GstBuffer *parsed = gst_harness_push_and_pull (h, buffer);
      fail_unless_equals_uint64 (GST_BUFFER_PTS (parsed), 5 * GST_SECOND + i * kFrame);
      gst_buffer_unref (parsed);
    }
  }
  gst_harness_teardown (h);
}
GST_END_TEST;

/* A file of two takes and one of one take, as concat pushes them. */
GST_START_TEST (test_takes_and_streams_follow_each_other_and_begin_with_discont)
{
  const Recording recording (20, 16);
  auto twice = recording.bytes;
  twice.insert (twice.end (), recording.bytes.begin (), recording.bytes.end ());
  GstHarness *h = new_parser ();
  push_bytes (h, twice, 5000);
  gst_harness_push_event (h, gst_event_new_stream_start ("another"));
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_BYTES);
  gst_harness_push_event (h, gst_event_new_segment (&segment));
  push_bytes (h, recording.bytes, 5000);
  gst_harness_push_event (h, gst_event_new_eos ());
  auto parsed = pull_all (h);
  fail_unless_equals_int (parsed.size (), 60);
  for (gsize i = 0; i < 60; i++) {
    fail_unless_equals_uint64 (GST_BUFFER_PTS (parsed[i]), i * kFrame);
    fail_unless_equals_int (GST_BUFFER_IS_DISCONT (parsed[i]), i % 20 == 0);
  }
  unref_all (parsed);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_typefinder_knows_the_stream)
{
  const Recording recording;
  GstTypeFindProbability probability;
  GstCaps *caps = gst_type_find_helper_for_data (
      nullptr, recording.bytes.data (), recording.bytes.size (), &probability);
  fail_unless (caps != nullptr);
  fail_unless (gst_structure_has_name (gst_caps_get_structure (caps, 0), "video/x-neighbour-code"));
  fail_if (gst_structure_has_field (gst_caps_get_structure (caps, 0), "alignment"));
  fail_unless_equals_int (probability, GST_TYPE_FIND_MAXIMUM);
  gst_caps_unref (caps);
}
GST_END_TEST;

GST_START_TEST (test_typefinder_leaves_what_it_does_not_know)
{
  const Recording recording (1, 8);
  auto future = recording.bytes;
  future[0] = 0x53;
  for (const std::span<const guint8> bytes :
      {std::span (recording.bytes).first (27), std::span<const guint8> (future)}) {
    GstCaps *caps = gst_type_find_helper_for_data (nullptr, bytes.data (), bytes.size (), nullptr);
    fail_if (caps &&
             gst_structure_has_name (gst_caps_get_structure (caps, 0), "video/x-neighbour-code"));
    gst_clear_caps (&caps);
  }
}
GST_END_TEST;

static Suite *
neighbourcodeparse_suite ()
{
  Suite *suite = suite_create ("neighbourcodeparse");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_what_is_written_reads_the_same_in_pieces_of_any_size);
  tcase_add_test (tc, test_access_unit_inside_a_unit_does_not_end_the_access_unit);
  tcase_add_test (tc, test_longest_access_unit_takes_linear_time);
  tcase_add_test (tc, test_access_unit_goes_on_as_soon_as_it_is_whole);
  tcase_add_test (tc, test_access_units_that_came_in_one_buffer_share_its_memory);
  tcase_add_test (tc, test_delta_unit_is_set_where_the_header_says_no_key);
  tcase_add_test (tc, test_access_unit_that_lacks_slices_is_a_delta_unit);
  tcase_add_test (tc, test_rig_that_changes_gives_new_caps);
  tcase_add_test (tc, test_flush_forgets_what_was_half_there);
  tcase_add_test (tc, test_file_plays_again_after_all_state_changes);
  tcase_add_test (tc, test_nothing_is_sent_to_elements_whose_state_change_comes_later);
  tcase_add_test (tc, test_access_units_pass_as_they_are);
  tcase_add_test (tc, test_access_unit_gets_the_time_of_its_buffer);
  tcase_add_test (tc, test_written_times_go_on_in_a_new_segment);
  tcase_add_test (tc, test_byte_stream_in_segments_of_time_keeps_upstreams_times);
  tcase_add_test (tc, test_takes_and_streams_follow_each_other_and_begin_with_discont);
  tcase_add_test (tc, test_typefinder_knows_the_stream);
  tcase_add_test (tc, test_typefinder_leaves_what_it_does_not_know);
  return suite;
}

GST_CHECK_MAIN (neighbourcodeparse);
