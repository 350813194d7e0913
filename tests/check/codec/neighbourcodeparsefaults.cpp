/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* neighbourcodeparse with damaged, truncated and foreign streams: what is kept, and what is posted.
 */
#include <rangecast/neighbourcode/bitstream/byte_stream.hpp>

#include "parse-check.hpp"

using namespace rangecast;
using namespace rangecast::testing;

GST_START_TEST (test_rubbish_before_and_between_costs_nothing_else)
{
  const Recording recording;
  std::vector<guint8> bytes (777, 0x52);
  bytes.insert (bytes.end (), recording.bytes.begin (), recording.bytes.end ());
  bytes.insert (bytes.end (), 333, 0x00);
  bytes.insert (bytes.end (), recording.bytes.begin (), recording.bytes.end ());
  auto parsed = parse (bytes, 5000);
  fail_unless_equals_int (parsed.size (), 20);
  fail_unless (same_bytes (parsed[0], recording.access_units[0]));
  fail_unless (same_bytes (parsed[19], recording.access_units[9]));
  unref_all (parsed);
}
GST_END_TEST;

GST_START_TEST (test_every_truncated_prefix_keeps_the_whole_access_units_before_it)
{
  const Recording recording (3, 8);
  const auto &ends = recording.offsets;
  for (gsize size = 0; size < recording.bytes.size (); size++) {
    /* exact: reading on would be seen */
    const std::vector<guint8> cut (recording.bytes.begin (), recording.bytes.begin () + size);
    auto parsed = parse (cut, G_MAXINT);
    const auto whole = gsize (size >= ends[1]) + gsize (size >= ends[2]);
    ck_assert_uint_ge (parsed.size (), whole);
    ck_assert_uint_le (parsed.size (), whole + 1);
    for (gsize i = 0; i < whole; i++)
      fail_unless (same_bytes (parsed[i], recording.access_units[i]));
    unref_all (parsed);
  }
}
GST_END_TEST;

/* Warnings of streams that end after these bytes, one after another; in `errors` how many errors
 * there were. */
static std::vector<std::string>
warnings_of_streams (int streams, std::span<const guint8> bytes, int *errors = nullptr)
{
  GstHarness *h = new_parser ();
  std::vector<std::string> texts;
  {
    ErrorCounter counter (h);
    for (int i = 0; i < streams; i++) {
      GstSegment segment;
      gst_segment_init (&segment, GST_FORMAT_BYTES);
      gst_harness_push_event (h, gst_event_new_stream_start (std::to_string (i).c_str ()));
      gst_harness_push_event (h, gst_event_new_segment (&segment));
      push_bytes (h, bytes, 5000);
      gst_harness_push_event (h, gst_event_new_eos ());
    }
    while (GstMessage *message = gst_bus_pop_filtered (
               counter.bus, GstMessageType (GST_MESSAGE_WARNING | GST_MESSAGE_ERROR))) {
      GError *error = nullptr;
      if (GST_MESSAGE_TYPE (message) == GST_MESSAGE_WARNING) {
        gst_message_parse_warning (message, &error, nullptr);
        texts.emplace_back (error->message);
        g_error_free (error);
      } else if (errors) {
        ++*errors;
      }
      gst_message_unref (message);
    }
  }
  auto parsed = pull_all (h);
  unref_all (parsed);
  gst_harness_teardown (h);
  return texts;
}

static std::vector<std::string>
warnings_of_stream (std::span<const guint8> bytes, int *errors = nullptr)
{
  return warnings_of_streams (1, bytes, errors);
}

GST_START_TEST (test_stream_that_ends_within_an_access_unit_is_one_warning)
{
  const Recording recording;
  const std::span<const guint8> bytes (recording.bytes);
  const gsize begin = recording.offsets[9];
  fail_unless_equals_int (warnings_of_stream (bytes).size (), 0);
  fail_unless_equals_int (warnings_of_stream (bytes.first (begin)).size (), 0);
  for (gsize got : {gsize{4}, gsize{27}, gsize{28}, gsize{29}, bytes.size () - begin - 500,
           bytes.size () - begin - 1}) {
    const auto texts = warnings_of_stream (bytes.first (begin + got));
    const bool header = got < kStreamPrefixSize;
    const std::string expected =
        "The stream ends at byte " + std::to_string (begin + got) + ", within the access unit " +
        (header ? "header " : "") + "at byte " + std::to_string (begin) + ": expected " +
        std::to_string (header ? kStreamPrefixSize : bytes.size () - begin) + " bytes, got " +
        std::to_string (got);
    fail_unless_equals_int (texts.size (), 1);
    fail_unless (texts[0] == expected, "%s", texts[0].c_str ());
  }
}
GST_END_TEST;

GST_START_TEST (test_bytes_between_access_units_are_one_warning)
{
  const Recording recording;
  std::vector<guint8> bytes = recording.bytes;
  for (const int i : {7, 4}) /* start codes */
    bytes[recording.offsets[std::size_t (i)] + 1] ^= 1;
  const auto texts = warnings_of_stream (bytes);
  fail_unless_equals_int (texts.size (), 1);
  fail_unless_contains (
      texts[0], "at byte " + std::to_string (recording.offsets[4]) + " are not an access unit");
  fail_unless_equals_int (warnings_of_streams (3, bytes).size (), 3);
  bytes = recording.bytes; /* one may begin to listen in the middle of a stream */
  bytes.erase (bytes.begin (), bytes.begin () + 100);
  fail_unless_equals_int (warnings_of_stream (bytes).size (), 0);
}
GST_END_TEST;

GST_START_TEST (test_stream_that_ends_before_its_first_slice_is_one_error_and_no_warning)
{
  const Recording recording (1, 16);
  for (gsize size : {1, 10, 28, 40, 100}) {
    int errors = 0;
    const auto texts = warnings_of_stream (std::span (recording.bytes).first (size), &errors);
    fail_unless_equals_int (texts.size (), 0);
    fail_unless_equals_int (errors, 1);
  }
}
GST_END_TEST;

GST_START_TEST (test_trailing_bytes_cost_nothing)
{
  const Recording recording;
  for (gsize extra : {1, 3, 4, 27, 28, 1000}) {
    auto bytes = recording.bytes;
    for (gsize i = 0; i < extra; i++) /* the beginning of one more access unit, for the first */
      bytes.push_back (i < 4 ? kStartCode[i] : 0x77);
    auto parsed = parse (bytes, 5000);
    fail_unless_equals_int (parsed.size (), 10);
    fail_unless (same_bytes (parsed[9], recording.access_units[9]));
    unref_all (parsed);
  }
}
GST_END_TEST;

GST_START_TEST (test_size_field_that_lies_costs_no_later_access_unit)
{
  const Recording recording;
  auto bytes = recording.bytes;
  bytes[4 + 4 + 2] = 0xff; /* the first one claims to be 16 MB long */
  auto parsed = parse (bytes, 8000);
  fail_unless_equals_int (parsed.size (), 10);
  fail_unless (same_bytes (parsed[1], recording.access_units[1]));
  unref_all (parsed);
}
GST_END_TEST;

/* Whether all later access units came as they were, whatever became of the first `damaged`. */
static bool
ends_with (const std::vector<GstBuffer *> &parsed, const Recording &recording, gsize damaged)
{
  const gsize sound = recording.access_units.size () - damaged;
  if (parsed.size () < sound || parsed.size () > recording.access_units.size ())
    return false;
  for (gsize i = 0; i < sound; i++)
    if (!same_bytes (parsed[parsed.size () - sound + i], recording.access_units[damaged + i]))
      return false;
  return true;
}

GST_START_TEST (test_every_flipped_bit_costs_its_own_access_unit_only)
{
  const Recording recording (4, 8);
  for (gsize bit = 8 * recording.offsets[1]; bit < 8 * recording.offsets[2]; bit++) {
    auto bytes = recording.bytes;
    bytes[bit / 8] ^= guint8 (1 << bit % 8);
    auto parsed = parse (bytes, G_MAXINT);
    fail_unless (ends_with (parsed, recording, 2), "bit %" G_GSIZE_FORMAT, bit);
    fail_unless (same_bytes (parsed[0], recording.access_units[0]));
    unref_all (parsed);
  }
}
GST_END_TEST;

GST_START_TEST (test_lost_bytes_cost_their_own_access_unit_only)
{
  const Recording recording (4, 16);
  for (gsize lost : {1, 5, 28, 200})
    for (gsize at = recording.offsets[2] - lost; at > recording.offsets[1]; at -= lost) {
      auto bytes = recording.bytes;
      bytes.erase (bytes.begin () + at, bytes.begin () + at + lost);
      auto parsed = parse (bytes, G_MAXINT);
      fail_unless (ends_with (parsed, recording, 2), "%d lost at %d", int (lost), int (at));
      unref_all (parsed);
      if (at < lost)
        break;
    }
}
GST_END_TEST;

GST_START_TEST (test_damage_is_told_by_discont)
{
  const Recording recording;
  auto bytes = recording.bytes;
  bytes[recording.offsets[4]] ^= 1;
  auto parsed = parse (bytes, 5000);
  fail_unless_equals_int (parsed.size (), 9);
  for (gsize i = 0; i < 9; i++)
    fail_unless_equals_int (GST_BUFFER_IS_DISCONT (parsed[i]), i == 0 || i == 4);
  unref_all (parsed);
}
GST_END_TEST;

GST_START_TEST (test_lost_header_of_a_long_access_unit_is_no_error)
{
  const Recording recording;
  std::vector<guint8> bytes (recording.bytes);
  bytes.insert (bytes.end (), 5 << 20, 0x55); /* the base class would give up after 2 MiB */
  bytes.insert (bytes.end (), recording.bytes.begin (), recording.bytes.end ());
  auto parsed = parse (bytes, 100000);
  fail_unless_equals_int (parsed.size (), 20);
  unref_all (parsed);
}
GST_END_TEST;

/* The errors that the parser posts for a file, in pull or in push mode. */
static std::vector<std::string>
errors_of (std::span<const guint8> bytes, const char *between)
{
  const TemporaryFile file (bytes);
  Player player (file, between);
  GstBus *bus = gst_element_get_bus (player.pipeline);
  GstMessage *end = nullptr;
  std::vector<std::string> texts;
  player
      .finish (); /* its first error, if any, is gone with it: so look at those of the next time */
  gst_element_set_state (player.pipeline, GST_STATE_NULL);
  gst_bus_set_flushing (bus, FALSE);
  gst_element_set_state (player.pipeline, GST_STATE_PLAYING);
  while ((end = gst_bus_timed_pop_filtered (bus, texts.empty () ? 5 * GST_SECOND : GST_SECOND / 5,
              GstMessageType (GST_MESSAGE_EOS | GST_MESSAGE_ERROR)))) {
    GError *error = nullptr;
    if (GST_MESSAGE_TYPE (end) == GST_MESSAGE_ERROR &&
        g_str_has_prefix (GST_MESSAGE_SRC_NAME (end), "neighbourcodeparse")) {
      gst_message_parse_error (end, &error, nullptr);
      ck_assert_int_eq (error->domain, GST_STREAM_ERROR);
      texts.emplace_back (error->message);
      g_error_free (error);
    }
    const bool eos = GST_MESSAGE_TYPE (end) == GST_MESSAGE_EOS;
    gst_message_unref (end);
    if (eos)
      break;
  }
  gst_object_unref (bus);
  return texts;
}

static void
expect_one_error (std::span<const guint8> bytes, const char *expected)
{
  for (const char *between : {"", "queue !"}) {
    const auto texts = errors_of (bytes, between);
    fail_unless_equals_int (texts.size (), 1);
    fail_unless (texts[0].find (expected) != std::string::npos, "%s", texts[0].c_str ());
  }
}

GST_START_TEST (test_empty_file_is_one_error)
{
  expect_one_error ({}, "No data arrived");
}
GST_END_TEST;

/* As with udpsrc, a jitter buffer and a depayloader that nobody sends to. */
GST_START_TEST (test_end_without_any_data_is_no_error)
{
  for (const bool has_segment : {false, true}) {
    GstHarness *h = harness_of ("neighbourcodeparse");
    {
      ErrorCounter counter (h);
      gst_harness_push_event (h, gst_event_new_stream_start ("none"));
      GstSegment segment;
      gst_segment_init (&segment, GST_FORMAT_TIME);
      if (has_segment)
        gst_harness_push_event (h, gst_event_new_segment (&segment));
      gst_harness_push_event (h, gst_event_new_eos ());
      fail_unless_equals_int (counter.take (), 0);
    }
    gst_harness_teardown (h);
  }
}
GST_END_TEST;

GST_START_TEST (test_access_units_in_a_file_are_one_error_with_a_hint)
{
  const Recording recording (2, 64);
  expect_one_error (bytes_of (recording.access_units[0]), "written without neighbourcodeparse");
  std::vector<guint8> rig;
  write_rig_units ({recording.rig, 25, 1}, rig);
  expect_one_error (rig, "written without neighbourcodeparse");
  for (const std::string other : {"1. A list\n2. of two", "2021"}) {
    const auto texts =
        errors_of ({reinterpret_cast<const guint8 *> (other.data ()), other.size ()}, "");
    fail_unless_equals_int (texts.size (), 1);
    fail_unless (texts[0].find ("filesink") == std::string::npos, "%s", texts[0].c_str ());
  }
}
GST_END_TEST;

GST_START_TEST (test_other_file_is_one_error)
{
  std::vector<guint8> noise (50000);
  guint32 state = 1;
  for (guint8 &byte : noise)
    byte = guint8 ((state = state * 1664525 + 1013904223) >> 24);
  expect_one_error (noise, "start code 00 52 43 55");
  expect_one_error (std::vector<guint8> (3 << 20, 'x'), "start code 00 52 43 55");
}
GST_END_TEST;

GST_START_TEST (test_future_version_is_one_error)
{
  const Recording recording (2, 16);
  auto bytes = recording.bytes;
  for (gsize offset : recording.offsets)
    bytes[offset + 4] = (kBitstreamVersion + 1) << 4 | 3;
  expect_one_error (bytes, ("version " + std::to_string (kBitstreamVersion)).c_str ());
}
GST_END_TEST;

GST_START_TEST (test_file_cut_before_its_first_slice_is_one_error)
{
  const Recording recording (1, 16);
  expect_one_error ({recording.bytes.data (), 100}, "rig");
  const auto rig = recording.bytes.size () - gst_buffer_get_size (recording.access_units[0]);
  expect_one_error ({recording.bytes.data (), rig + 20}, "first whole slice");
}
GST_END_TEST;

GST_START_TEST (test_rig_beyond_the_limit_is_one_error_that_names_it)
{
  std::vector<guint8> units, bytes = {0x00, 0x52, 0x43, 0x55};
  write_rig_units ({ring_rig (64, 16384, 16384), 25, 1}, units);
  AccessUnitHeader header;
  header.size = guint32 (units.size ());
  bytes.resize (4 + kAccessUnitHeaderSize);
  write_access_unit_header (header, bytes.data () + 4);
  bytes.insert (bytes.end (), units.begin (), units.end ());
  expect_one_error (bytes, "134217728");
}
GST_END_TEST;

GST_START_TEST (test_cut_file_that_plays_is_no_error)
{
  const Recording recording (3, 16);
  const std::span<const guint8> bytes (recording.bytes);
  for (const char *between : {"", "queue !"})
    fail_unless (errors_of (bytes.first (bytes.size () - 50), between).empty ());
}
GST_END_TEST;

/* A parser that writes the byte stream of access units. */
static GstHarness *
new_writer (const Rig &rig)
{
  GstHarness *h = gst_harness_new ("neighbourcodeparse");
  gst_harness_set_sink_caps_str (h, kStreamCaps);
  gst_harness_set_src_caps (h, coded_caps (rig));
  return h;
}

GST_START_TEST (test_access_unit_that_no_reader_would_take_is_one_error)
{
  const Rig rig = ring_rig (2);
  std::vector<guint8> rig_units;
  write_rig_units ({rig, 30, 1}, rig_units);
  const gsize longest = kMaxAccessUnitSize - rig_units.size ();
  GstHarness *h = new_writer (rig);
  {
    ErrorCounter errors (h);
    GstBuffer *fits = gst_buffer_new_allocate (nullptr, longest, nullptr);
    gst_buffer_memset (fits, 0, 0, longest);
    fail_unless_equals_int (gst_harness_push (h, fits), GST_FLOW_OK);
    fail_unless_equals_int (errors.take (), 0);
    GstBuffer *longer = gst_buffer_new_allocate (nullptr, longest + 1, nullptr);
    gst_buffer_memset (longer, 0, 0, longest + 1);
    fail_unless_equals_int (gst_harness_push (h, longer), GST_FLOW_ERROR);
    const std::string text = next_message_text (errors.bus, GST_MESSAGE_ERROR);
    fail_unless_contains (text, "32 MiB");
    fail_unless_equals_int (errors.take (), 0);
  }
  fail_unless_equals_int (gst_harness_buffers_received (h), 1);
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_error_after_a_flush_is_posted_too)
{
  const Rig rig = ring_rig (2);
  GstHarness *h = new_writer (rig);
  {
    ErrorCounter errors (h);
    for (int round = 0; round < 2; round++) {
      GstBuffer *longer = gst_buffer_new_allocate (nullptr, kMaxAccessUnitSize + 1, nullptr);
      gst_buffer_memset (longer, 0, 0, kMaxAccessUnitSize + 1);
      fail_unless_equals_int (gst_harness_push (h, longer), GST_FLOW_ERROR);
      fail_unless_equals_int (errors.take (), 1);
      flush (h);
    }
  }
  gst_harness_teardown (h);
}
GST_END_TEST;

GST_START_TEST (test_error_that_is_put_better_keeps_its_seqnum_and_details)
{
  GstHarness *h = new_parser ();
  GstBus *bus = gst_bus_new ();
  gst_element_set_bus (h->element, bus);
  GError *error = g_error_new (GST_STREAM_ERROR, GST_STREAM_ERROR_WRONG_TYPE, "No valid frames");
  GstMessage *message = gst_message_new_error_with_details (GST_OBJECT (h->element), error, "why",
      gst_structure_new ("details", "n", G_TYPE_INT, 7, nullptr));
  g_error_free (error);
  gst_message_set_seqnum (message, 4711);
  fail_unless (gst_element_post_message (h->element, message));
  message = gst_bus_pop_filtered (bus, GST_MESSAGE_ERROR);
  fail_unless (message != nullptr);
  fail_unless_equals_int (gst_message_get_seqnum (message), 4711);
  const GstStructure *details = nullptr;
  gst_message_parse_error_details (message, &details);
  fail_unless (details && gst_structure_has_field_typed (details, "n", G_TYPE_INT));
  gst_message_parse_error (message, &error, nullptr);
  fail_unless (g_str_has_prefix (error->message, "No data arrived"));
  g_error_free (error);
  gst_message_unref (message);
  gst_element_set_bus (h->element, nullptr);
  gst_object_unref (bus);
  gst_harness_teardown (h);
}
GST_END_TEST;

static Suite *
neighbourcodeparsefaults_suite (void)
{
  Suite *suite = suite_create ("neighbourcodeparsefaults");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_rubbish_before_and_between_costs_nothing_else);
  tcase_add_test (tc, test_every_truncated_prefix_keeps_the_whole_access_units_before_it);
  tcase_add_test (tc, test_stream_that_ends_within_an_access_unit_is_one_warning);
  tcase_add_test (tc, test_bytes_between_access_units_are_one_warning);
  tcase_add_test (tc, test_stream_that_ends_before_its_first_slice_is_one_error_and_no_warning);
  tcase_add_test (tc, test_trailing_bytes_cost_nothing);
  tcase_add_test (tc, test_size_field_that_lies_costs_no_later_access_unit);
  tcase_add_test (tc, test_every_flipped_bit_costs_its_own_access_unit_only);
  tcase_add_test (tc, test_lost_bytes_cost_their_own_access_unit_only);
  tcase_add_test (tc, test_damage_is_told_by_discont);
  tcase_add_test (tc, test_lost_header_of_a_long_access_unit_is_no_error);
  tcase_add_test (tc, test_empty_file_is_one_error);
  tcase_add_test (tc, test_end_without_any_data_is_no_error);
  tcase_add_test (tc, test_access_units_in_a_file_are_one_error_with_a_hint);
  tcase_add_test (tc, test_other_file_is_one_error);
  tcase_add_test (tc, test_future_version_is_one_error);
  tcase_add_test (tc, test_file_cut_before_its_first_slice_is_one_error);
  tcase_add_test (tc, test_rig_beyond_the_limit_is_one_error_that_names_it);
  tcase_add_test (tc, test_cut_file_that_plays_is_no_error);
  tcase_add_test (tc, test_access_unit_that_no_reader_would_take_is_one_error);
  tcase_add_test (tc, test_error_after_a_flush_is_posted_too);
  tcase_add_test (tc, test_error_that_is_put_better_keeps_its_seqnum_and_details);
  return suite;
}

GST_CHECK_MAIN (neighbourcodeparsefaults);
