/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* neighbourcodeparse with damaged, truncated and foreign streams: what is kept, and what is posted.
 */
#include <rangecast/neighbourcode/bitstream/byte_stream.hpp>

#include "parse-check.hpp"

using namespace rangecast;
using namespace rangecast::testing;

GST_START_TEST (test_garbage_before_and_between_costs_nothing_else)
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
  for (gsize got : {gsize{8}, gsize{27}, gsize{28}, gsize{29}, bytes.size () - begin - 500,
           bytes.size () - begin - 1}) {
    const auto texts = warnings_of_stream (bytes.first (begin + got));
    const bool header = got < kAccessUnitHeaderSize;
    const std::string expected =
        "The stream ends within the access unit at byte " + std::to_string (begin) + ": needs " +
        std::to_string (header ? kAccessUnitHeaderSize : bytes.size () - begin) + " bytes, got " +
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
  for (const int i : {7, 4}) /* the magic of access-unit units */
    bytes[recording.offsets[std::size_t (i)] + 5] ^= 1;
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

GST_START_TEST (test_file_that_is_no_recording_is_an_error)
{
  const Recording recording (2, 16);
  const std::span<const guint8> bytes (recording.bytes);
  const std::vector<guint8> units (bytes.begin () + kAccessUnitHeaderSize,
      bytes.begin () + std::ptrdiff_t (recording.offsets[1]));
  auto future = recording.bytes;
  for (gsize offset : recording.offsets)
    future[offset] = (kBitstreamVersion + 1) << 4 | 3;
  for (const auto &content : {std::vector<guint8> (50000, 'x'), units, future,
           std::vector<guint8> (bytes.begin (), bytes.begin () + 100)})
    for (const char *between : {"", "queue !"}) {
      const TemporaryFile file (content);
      Player player (file, between);
      GstBus *bus = gst_element_get_bus (player.pipeline);
      GstMessage *message = gst_bus_timed_pop_filtered (
          bus, 30 * GST_SECOND, GstMessageType (GST_MESSAGE_ERROR | GST_MESSAGE_ASYNC_DONE));
      GError *error = nullptr;
      fail_unless (message && GST_MESSAGE_TYPE (message) == GST_MESSAGE_ERROR);
      gst_message_parse_error (message, &error, nullptr);
      fail_unless (g_error_matches (error, GST_STREAM_ERROR, GST_STREAM_ERROR_WRONG_TYPE));
      g_error_free (error);
      gst_message_unref (message);
      gst_object_unref (bus);
    }
}
GST_END_TEST;

GST_START_TEST (test_rig_beyond_the_limit_is_a_warning_that_names_it_and_an_error)
{
  std::vector<guint8> units, bytes (kAccessUnitHeaderSize);
  write_rig_units ({ring_rig (64, 16384, 16384), 25, 1}, units);
  AccessUnitHeader header;
  header.size = guint32 (units.size ());
  write_access_unit_header (header, bytes.data ());
  bytes.insert (bytes.end (), units.begin (), units.end ());
  int errors = 0;
  const auto texts = warnings_of_stream (bytes, &errors);
  fail_unless_equals_int (texts.size (), 1);
  fail_unless_contains (texts[0], "134217728");
  fail_unless_equals_int (errors, 1);
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

static Suite *
neighbourcodeparsefaults_suite (void)
{
  Suite *suite = suite_create ("neighbourcodeparsefaults");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_garbage_before_and_between_costs_nothing_else);
  tcase_add_test (tc, test_every_truncated_prefix_keeps_the_whole_access_units_before_it);
  tcase_add_test (tc, test_stream_that_ends_within_an_access_unit_is_one_warning);
  tcase_add_test (tc, test_bytes_between_access_units_are_one_warning);
  tcase_add_test (tc, test_every_flipped_bit_costs_its_own_access_unit_only);
  tcase_add_test (tc, test_lost_header_of_a_long_access_unit_is_no_error);
  tcase_add_test (tc, test_end_without_any_data_is_no_error);
  tcase_add_test (tc, test_file_that_is_no_recording_is_an_error);
  tcase_add_test (tc, test_rig_beyond_the_limit_is_a_warning_that_names_it_and_an_error);
  return suite;
}

GST_CHECK_MAIN (neighbourcodeparsefaults);
