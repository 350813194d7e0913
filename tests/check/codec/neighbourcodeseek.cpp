/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Seeks, durations and times of files in neighbourcodeparse. */
#include "parse-check.hpp"

using namespace rangecast;
using namespace rangecast::testing;

GST_START_TEST (test_key_unit_seek_lands_on_the_key_access_unit_at_or_before)
{
  const Recording recording (20, 16);
  const TemporaryFile file (with_delta_units (recording));
  Player player (file);
  for (GstClockTime frame : {17, 3, 10, 4, 19, 0}) {
    fail_unless (player.seek (frame * kFrame + kFrame / 2, GST_SEEK_FLAG_KEY_UNIT));
    const GstClockTime key = frame / 5 * 5 * kFrame;
    fail_unless_equals_uint64 (player.seen[0], key);
    fail_unless_equals_uint64 (player.shown (), key);
    fail_unless_equals_int64 (player.position (), key);
  }
}
GST_END_TEST;

GST_START_TEST (test_seek_can_snap_to_the_key_access_unit_after_or_nearest)
{
  const Recording recording (20, 16);
  const TemporaryFile file (with_delta_units (recording));
  Player player (file);
  const int after = GST_SEEK_FLAG_KEY_UNIT | GST_SEEK_FLAG_SNAP_AFTER;
  const int nearest = GST_SEEK_FLAG_KEY_UNIT | GST_SEEK_FLAG_SNAP_NEAREST;
  fail_unless (player.seek (6 * kFrame, after));
  fail_unless_equals_uint64 (player.shown (), 10 * kFrame);
  fail_unless (player.seek (6 * kFrame, nearest));
  fail_unless_equals_uint64 (player.shown (), 5 * kFrame);
  fail_unless (player.seek (9 * kFrame, nearest));
  fail_unless_equals_uint64 (player.shown (), 10 * kFrame);
}
GST_END_TEST;

GST_START_TEST (test_seek_snaps_to_no_key_access_unit_behind_its_stop)
{
  const Recording recording (20, 16);
  const TemporaryFile file (with_delta_units (recording));
  Player player (file);
  for (const int snap : {int (GST_SEEK_FLAG_SNAP_AFTER), int (GST_SEEK_FLAG_SNAP_NEAREST)}) {
    const int flags = GST_SEEK_FLAG_KEY_UNIT | snap;
    fail_unless (player.seek_part (9 * kFrame, flags, GST_SEEK_TYPE_SET, 10 * kFrame));
    fail_unless_equals_uint64 (player.shown (), 10 * kFrame);
    fail_unless (player.seek_part (8 * kFrame, flags, GST_SEEK_TYPE_SET, 9 * kFrame));
    fail_unless_equals_uint64 (player.shown (), 8 * kFrame);
  }
}
GST_END_TEST;

GST_START_TEST (test_accurate_seek_decodes_from_the_key_access_unit_and_shows_the_time)
{
  const Recording recording (20, 16);
  const TemporaryFile file (with_delta_units (recording));
  Player player (file);
  fail_unless (player.finish ()); /* the base class notes access units that were played */
  gst_element_set_state (player.pipeline, GST_STATE_PAUSED);
  for (GstClockTime frame : {18, 2, 9, 5, 4}) {
    const GstClockTime time = frame * kFrame + kFrame / 4;
    fail_unless (player.seek (time, GST_SEEK_FLAG_ACCURATE));
    fail_unless_equals_uint64 (player.seen[0], frame / 5 * 5 * kFrame);
    fail_unless_equals_uint64 (player.shown (), frame * kFrame);
    fail_unless_equals_int64 (player.position (), time);
  }
}
GST_END_TEST;

GST_START_TEST (test_seek_in_a_long_file_finds_its_place_by_bisection)
{
  const Recording recording (250, 64);
  ck_assert_uint_gt (recording.bytes.size (), 1000000);
  const TemporaryFile file (recording.bytes);
  Player player (file);
  for (GstClockTime frame : {249, 1, 125, 200, 51, 248}) {
    fail_unless (player.seek (frame * kFrame + 1, GST_SEEK_FLAG_KEY_UNIT));
    fail_unless_equals_uint64 (player.seen[0], frame * kFrame);
  }
  fail_unless (player.finish ());
  fail_unless_equals_int (player.seen.size (), 2);
}
GST_END_TEST;

GST_START_TEST (test_seek_beyond_the_end_ends)
{
  const Recording recording (20, 16);
  const TemporaryFile file (recording.bytes);
  Player player (file);
  fail_unless (player.wait ());
  gst_element_seek_simple (player.pipeline, GST_FORMAT_TIME,
      GstSeekFlags (GST_SEEK_FLAG_FLUSH | GST_SEEK_FLAG_ACCURATE), 100 * GST_SECOND);
  fail_unless (player.finish ());
}
GST_END_TEST;

GST_START_TEST (test_seek_finds_its_place_in_spite_of_damage)
{
  const Recording recording (250, 64);
  auto bytes = recording.bytes;
  for (gsize i = 60; i < 70; i++)
    bytes[recording.offsets[i]] ^= 0x10;
  for (gsize i = 170; i < 180; i++)
    bytes[recording.offsets[i] + 8 + 2] ^= 0x80; /* sizes that lie by 8 MiB */
  const TemporaryFile file (bytes);
  Player player (file);
  for (GstClockTime frame : {200, 100, 175, 20}) {
    fail_unless (player.seek (frame * kFrame + 1, GST_SEEK_FLAG_KEY_UNIT));
    fail_unless_equals_uint64 (player.seen[0], frame * kFrame);
  }
  fail_unless (player.seek (65 * kFrame, GST_SEEK_FLAG_KEY_UNIT));
  fail_unless_equals_uint64 (player.seen[0], 59 * kFrame);
}
GST_END_TEST;

GST_START_TEST (test_times_that_are_missing_are_right_after_a_seek)
{
  const Recording recording (50, 16);
  const TemporaryFile file (without_times (recording));
  Player player (file);
  for (GstClockTime frame : {30, 7, 45}) {
    fail_unless (player.seek (frame * kFrame + 1, GST_SEEK_FLAG_ACCURATE));
    fail_unless_equals_uint64 (player.shown (), frame * kFrame);
    fail_unless_equals_int64 (player.position (), frame * kFrame + 1);
  }
  fail_unless (player.finish ());
  fail_unless_equals_uint64 (player.seen.back (), 49 * kFrame);
}
GST_END_TEST;

GST_START_TEST (test_pushed_file_is_sought_by_time_too)
{
  const Recording recording (100, 64);
  const TemporaryFile file (recording.bytes);
  Player player (file, "queue !");
  fail_unless (player.wait ());
  for (GstClockTime frame : {40, 0}) {
    fail_unless (player.seek (frame * kFrame, GST_SEEK_FLAG_ACCURATE));
    fail_unless_equals_uint64 (player.shown (), frame * kFrame);
  }
  fail_unless (player.finish ());
  fail_unless_equals_uint64 (player.seen.back (), 99 * kFrame);
  ck_assert_int_lt (ABS (player.duration () - gint64 (100 * kFrame)), gint64 (10 * kFrame));
}
GST_END_TEST;

GST_START_TEST (test_trick_mode_decodes_key_frame_sets_only)
{
  const Recording recording (20, 16);
  const TemporaryFile file (with_delta_units (recording));
  Player player (file, "", "neighbourcodedec !");
  fail_unless (player.seek (0, GST_SEEK_FLAG_TRICKMODE | GST_SEEK_FLAG_TRICKMODE_KEY_UNITS));
  fail_unless (player.finish ());
  const std::vector<GstClockTime> keys = {0, 5 * kFrame, 10 * kFrame, 15 * kFrame};
  fail_unless (player.seen == keys);
  fail_unless (player.seek (0, GST_SEEK_FLAG_ACCURATE));
  fail_unless (player.finish ());
  fail_unless_equals_int (player.seen.size (), 20);
}
GST_END_TEST;

GST_START_TEST (test_reverse_playback_is_refused)
{
  const Recording recording (20, 16);
  const TemporaryFile file (recording.bytes);
  for (const char *between : {"", "queue !"}) {
    Player player (file, between);
    GstBus *bus = gst_element_get_bus (player.pipeline);
    fail_unless (player.wait ());
    fail_if (gst_element_seek (player.pipeline, -1.0, GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH,
        GST_SEEK_TYPE_SET, 0, GST_SEEK_TYPE_SET, 10 * kFrame));
    fail_unless_contains (next_message_text (bus, GST_MESSAGE_WARNING), "Reverse playback");
    gst_object_unref (bus);
  }
}
GST_END_TEST;

static std::vector<guint8>
join (std::vector<guint8> bytes, const std::vector<guint8> &more)
{
  bytes.insert (bytes.end (), more.begin (), more.end ());
  return bytes;
}

/* Whether all access units came, one frame after another. */
static bool
came_evenly (const std::vector<GstClockTime> &seen, gsize frames)
{
  for (gsize i = 0; i < seen.size (); i++)
    if (seen[i] != i * kFrame)
      return false;
  return seen.size () == frames;
}

GST_START_TEST (test_joined_recordings_follow_each_other)
{
  const Recording first (30, 16), second (20, 16), third (1, 16, 0);
  const auto bytes =
      join (join (join (first.bytes, first.bytes), second.bytes), join (third.bytes, third.bytes));
  const TemporaryFile file (bytes);
  for (const char *between : {"", "queue !"}) {
    Player player (file, between);
    fail_unless (player.wait ());
    fail_unless (player.finish ());
    fail_unless (came_evenly (player.seen, 82), "%s", between);
  }
}
GST_END_TEST;

GST_START_TEST (test_seek_in_joined_recordings_shows_that_time_of_one)
{
  const Recording first (40, 64), second (40, 32);
  const TemporaryFile file (join (first.bytes, second.bytes));
  Player player (file);
  for (const int flags : {int (GST_SEEK_FLAG_KEY_UNIT), int (GST_SEEK_FLAG_ACCURATE)})
    for (const GstClockTime frame : {20, 10, 39, 0}) {
      fail_unless (player.seek (frame * kFrame, flags));
      fail_unless_equals_uint64 (player.shown (), frame * kFrame);
      fail_unless_equals_int64 (player.position (), frame * kFrame);
    }
  fail_unless (player.finish ());
}
GST_END_TEST;

static Suite *
neighbourcodeseek_suite ()
{
  Suite *suite = suite_create ("neighbourcodeseek");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_key_unit_seek_lands_on_the_key_access_unit_at_or_before);
  tcase_add_test (tc, test_seek_can_snap_to_the_key_access_unit_after_or_nearest);
  tcase_add_test (tc, test_seek_snaps_to_no_key_access_unit_behind_its_stop);
  tcase_add_test (tc, test_accurate_seek_decodes_from_the_key_access_unit_and_shows_the_time);
  tcase_add_test (tc, test_seek_in_a_long_file_finds_its_place_by_bisection);
  tcase_add_test (tc, test_seek_beyond_the_end_ends);
  tcase_add_test (tc, test_seek_finds_its_place_in_spite_of_damage);
  tcase_add_test (tc, test_times_that_are_missing_are_right_after_a_seek);
  tcase_add_test (tc, test_pushed_file_is_sought_by_time_too);
  tcase_add_test (tc, test_trick_mode_decodes_key_frame_sets_only);
  tcase_add_test (tc, test_reverse_playback_is_refused);
  tcase_add_test (tc, test_joined_recordings_follow_each_other);
  tcase_add_test (tc, test_seek_in_joined_recordings_shows_that_time_of_one);
  return suite;
}

GST_CHECK_MAIN (neighbourcodeseek);
