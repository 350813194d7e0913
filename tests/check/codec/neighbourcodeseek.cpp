/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Seeks, durations and times of files in neighbourcodeparse. */
#include <array>
#include <cstring>

#include "../scene-check.hpp"
#include "parse-check.hpp"

using namespace rangecast;
using namespace rangecast::testing;

GST_START_TEST (test_file_tells_its_duration_before_it_plays)
{
  const Recording recording (50, 16);
  const TemporaryFile file (recording.bytes);
  Player player (file);
  fail_unless (player.wait ());
  fail_unless_equals_int64 (player.duration (), 50 * kFrame);
  fail_unless_equals_int64 (player.position (), 0);
}
GST_END_TEST;

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
    fail_unless_equals_uint64 (player.shown (), 5 * kFrame);
    fail_unless_equals_int64 (player.position (), 5 * kFrame);
    fail_unless (player.seek_part (8 * kFrame, flags, GST_SEEK_TYPE_NONE, 0)); /* the stop stays */
    fail_unless_equals_uint64 (player.shown (), 5 * kFrame);
  }
}
GST_END_TEST;

/* With times that begin at `first`. */
static std::vector<guint8>
with_times_from (const Recording &recording, guint64 first)
{
  auto bytes = recording.bytes;
  for (gsize i = 0; i < recording.offsets.size (); i++) {
    const guint64 time = GUINT64_TO_LE (first + i * kFrame);
    std::memcpy (&bytes[recording.offsets[i] + 4 + 8], &time, sizeof time);
  }
  return bytes;
}

GST_START_TEST (test_seek_beyond_the_latest_time_there_is_lands_on_the_last_access_unit)
{
  const Recording recording (10, 16);
  const TemporaryFile file (with_times_from (recording, G_MAXUINT64 - 10 * kFrame));
  Player player (file);
  fail_unless (player.seek (12 * kFrame, GST_SEEK_FLAG_KEY_UNIT)); /* 2 frames behind 2^64 ns */
  fail_unless_equals_uint64 (player.shown (), 9 * kFrame);
}
GST_END_TEST;

GST_START_TEST (test_accurate_seek_decodes_from_the_key_access_unit_and_shows_the_time)
{
  const Recording recording (20, 16);
  const TemporaryFile file (with_delta_units (recording));
  Player player (file);
  for (GstClockTime frame : {18, 2, 9, 5}) {
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
    bytes[recording.offsets[i] + 4 + 4 + 2] ^= 0x80; /* sizes that lie by 8 MiB */
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

GST_START_TEST (test_seek_uses_the_rig_of_the_place)
{
  const Recording first (40, 64), second (40, 32, GST_SECOND + 40 * kFrame);
  auto bytes = first.bytes;
  bytes.insert (bytes.end (), second.bytes.begin (), second.bytes.end ());
  const TemporaryFile file (bytes);
  Player player (file);
  fail_unless (player.seek (50 * kFrame, GST_SEEK_FLAG_KEY_UNIT)); /* which has no rig itself */
  fail_unless_equals_uint64 (player.shown (), 50 * kFrame);
  fail_unless_equals_int (player.widths.back (), 32);
  fail_unless (player.seek (10 * kFrame, GST_SEEK_FLAG_KEY_UNIT));
  fail_unless_equals_uint64 (player.shown (), 10 * kFrame);
  fail_unless_equals_int (player.widths.back (), 64);
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

GST_START_TEST (test_reverse_playback_is_refused)
{
  const Recording recording (20, 16);
  const TemporaryFile file (recording.bytes);
  Player player (file);
  fail_unless (player.wait ());
  fail_if (gst_element_seek (player.pipeline, -1.0, GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH,
      GST_SEEK_TYPE_SET, 0, GST_SEEK_TYPE_SET, 10 * kFrame));
}
GST_END_TEST;

GST_START_TEST (test_error_after_a_seek_in_a_file_is_posted_too)
{
  const Recording first (40, 64), second (40, 32, GST_SECOND + 40 * kFrame);
  auto bytes = first.bytes;
  bytes.insert (bytes.end (), second.bytes.begin (), second.bytes.end ());
  const TemporaryFile file (bytes);
  Player player (file, "", "video/x-neighbour-code,width=64 !");
  GstBus *bus = gst_element_get_bus (player.pipeline);
  for (int round = 0; round < 2; round++) {
    fail_unless (player.seek (0, GST_SEEK_FLAG_KEY_UNIT));
    gst_element_set_state (player.pipeline, GST_STATE_PLAYING);
    fail_unless (next_message_text (bus, GST_MESSAGE_ERROR) != "", "round %d", round);
    gst_element_set_state (player.pipeline, GST_STATE_PAUSED);
  }
  gst_object_unref (bus);
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

GST_START_TEST (test_takes_of_a_file_follow_each_other)
{
  const Recording first (30, 16), second (20, 16, 3 * GST_SECOND), third (1, 16, 0);
  const auto bytes = join (join (join (first.bytes, first.bytes), with_times_from (second, 0)),
      join (third.bytes, third.bytes));
  const TemporaryFile file (bytes);
  for (const char *between : {"", "queue !"}) {
    Player player (file, between);
    fail_unless (player.wait ());
    if (!*between)
      fail_unless_equals_int64 (player.duration (), 82 * kFrame);
    fail_unless (player.finish ());
    fail_unless (came_evenly (player.seen, 82), "%s", between);
  }
}
GST_END_TEST;

GST_START_TEST (test_seek_finds_its_take_and_the_rig_there)
{
  const Recording first (40, 64), second (40, 32);
  const TemporaryFile file (join (first.bytes, second.bytes));
  Player player (file);
  for (const int flags : {int (GST_SEEK_FLAG_KEY_UNIT), int (GST_SEEK_FLAG_ACCURATE)})
    for (const GstClockTime frame : {50, 10, 39, 40, 79, 0}) { /* which 50 and 79 have no rig */
      fail_unless (player.seek (frame * kFrame, flags));
      fail_unless_equals_uint64 (player.shown (), frame * kFrame);
      fail_unless_equals_int64 (player.position (), frame * kFrame);
      fail_unless_equals_int (player.widths.back (), frame < 40 ? 64 : 32);
    }
  fail_unless (player.finish ());
  fail_unless_equals_int (player.seen.size (), 80);
  fail_unless_equals_uint64 (player.seen.back (), 79 * kFrame);
}
GST_END_TEST;

GST_START_TEST (test_seek_snaps_across_the_end_of_a_take)
{
  const Recording recording (20, 16);
  const auto take = with_delta_units (recording); /* the last key one is 15 */
  const TemporaryFile file (join (take, take));
  Player player (file);
  const int after = GST_SEEK_FLAG_KEY_UNIT | GST_SEEK_FLAG_SNAP_AFTER;
  const int nearest = GST_SEEK_FLAG_KEY_UNIT | GST_SEEK_FLAG_SNAP_NEAREST;
  const std::pair<int, std::array<GstClockTime, 2>> seeks[] = {
      {after, {16, 20}}, {nearest, {16, 15}}, {nearest, {19, 20}}, {after, {39, 35}}};
  for (const auto &[flags, frames] : seeks) {
    fail_unless (player.seek (frames[0] * kFrame, flags));
    fail_unless_equals_uint64 (player.shown (), frames[1] * kFrame);
  }
  fail_unless (player.seek_part (18 * kFrame, after, GST_SEEK_TYPE_SET, 19 * kFrame));
  fail_unless_equals_uint64 (player.shown (), 15 * kFrame); /* not behind the stop */
}
GST_END_TEST;

/* 30 seconds of 1.2 MB each: longer than what is searched access unit by access unit. */
GST_START_TEST (test_seek_in_a_long_file_of_two_takes_finds_its_take)
{
  const Recording recording (100, 160);
  auto take = recording.bytes;
  for (int i = 1; take.size () < (6 << 20); i++)
    take = join (take, with_times_from (recording, GST_SECOND + i * 100 * kFrame));
  const auto frames = GstClockTime (take.size () / recording.bytes.size () * 100);
  const TemporaryFile file (join (take, take));
  Player player (file);
  fail_unless (player.wait ());
  fail_unless_equals_int64 (player.duration (), 2 * frames * kFrame);
  for (const GstClockTime frame :
      {frames - 1, frames, frames + 1, 2 * frames - 1, frames / 2, frames * 3 / 2}) {
    fail_unless (player.seek (frame * kFrame, GST_SEEK_FLAG_KEY_UNIT));
    fail_unless_equals_uint64 (player.shown (), frame * kFrame);
  }
}
GST_END_TEST;

GST_START_TEST (test_damaged_time_moves_no_other_access_unit)
{
  const Recording recording (20, 16);
  for (const char *between : {"", "queue !"})
    for (const gsize damaged : {9, 10, 18})
      for (const int bit : {29, 30, 32, 40, 60, 63}) {
        auto bytes = recording.bytes;
        bytes[recording.offsets[damaged] + 12 + gsize (bit / 8)] ^= guint8 (1 << bit % 8);
        const TemporaryFile file (bytes);
        Player player (file, between);
        fail_unless (player.finish ());
        fail_unless_equals_int (player.seen.size (), 20);
        player.seen[damaged] = damaged * kFrame;
        fail_unless (came_evenly (player.seen, 20), "bit %d of %d", bit, int (damaged));
      }
}
GST_END_TEST;

/* The byte stream of a person who moves, temporal, with a key access unit every fifth. */
static std::vector<guint8>
temporal_stream (const Scene &scene, const char *profile)
{
  /* 5 frames of 1/15 s are 333 ms and a bit */
  GstHarness *h = gst_harness_new_parse (
      (std::string ("neighbourcodeenc temporal=true key-interval=334 profile=") + profile +
          " ! neighbourcodeparse ! capsfilter caps=" + kStreamCaps)
          .c_str ());
  gst_harness_set_src_caps (h, gst_caps_ref (scene.caps));
  std::vector<guint8> bytes;
  for (GstBuffer *frame_set : scene.frame_sets) {
    gst_harness_push (h, gst_buffer_ref (frame_set));
    for (GstBuffer *written : pull_all (h)) {
      const auto part = bytes_of (written);
      bytes.insert (bytes.end (), part.begin (), part.end ());
      gst_buffer_unref (written);
    }
  }
  gst_harness_teardown (h);
  return bytes;
}

/* Pixels of what reaches the player's sink, by PTS. */
struct Shown {
  std::map<GstClockTime, Pixels> pixels;

  explicit Shown (Player &player)
  {
    GstPad *pad = gst_element_get_static_pad (player.sink, "sink");
    gst_pad_add_probe (
        pad, GST_PAD_PROBE_TYPE_BUFFER,
        [] (GstPad *, GstPadProbeInfo *info, gpointer data) {
          GstBuffer *buffer = GST_PAD_PROBE_INFO_BUFFER (info);
          static_cast<Shown *> (data)->pixels[GST_BUFFER_PTS (buffer)] =
              pixels_of (buffer, 160, 120);
          return GST_PAD_PROBE_OK;
        },
        this, nullptr);
    gst_object_unref (pad);
  }
};

GST_START_TEST (test_seek_in_a_temporal_file_shows_all_pixels_right_from_there_on)
{
  const Scene scene (2, 160, 120, 20);
  for (const char *profile : {"plain", "packed", "entropy"}) {
    const TemporaryFile file (temporal_stream (scene, profile));
    Player player (file, "", "neighbourcodedec name=dec !");
    fail_unless (player.wait ());
    Shown shown (player);
    fail_unless (player.seek (0, GST_SEEK_FLAG_KEY_UNIT));
    fail_unless (player.finish ());
    const auto whole = shown.pixels;
    fail_unless_equals_int (int (whole.size ()), 20);
    for (const int frame : {13, 4, 17, 10}) {
      const GstClockTime time = whole.begin ()->first + GstClockTime (frame) * Scene::kInterval;
      gst_element_set_state (player.pipeline, GST_STATE_PAUSED);
      fail_unless (player.wait ());
      shown.pixels.clear ();
      fail_unless (player.seek (time + Scene::kInterval / 2, GST_SEEK_FLAG_KEY_UNIT));
      fail_unless (player.finish ());
      fail_unless_equals_int (int (shown.pixels.size ()), 20 - frame / 5 * 5);
      for (const auto &[pts, pixels] : shown.pixels)
        fail_unless (pixels == whole.at (pts), "%s: after a seek to %d", profile, frame);
    }
  }
}
GST_END_TEST;

static Suite *
neighbourcodeseek_suite ()
{
  Suite *suite = suite_create ("neighbourcodeseek");
  TCase *tc = tcase_create ("general");
  tcase_set_timeout (tc, 60);
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_file_tells_its_duration_before_it_plays);
  tcase_add_test (tc, test_key_unit_seek_lands_on_the_key_access_unit_at_or_before);
  tcase_add_test (tc, test_seek_can_snap_to_the_key_access_unit_after_or_nearest);
  tcase_add_test (tc, test_seek_snaps_to_no_key_access_unit_behind_its_stop);
  tcase_add_test (tc, test_seek_beyond_the_latest_time_there_is_lands_on_the_last_access_unit);
  tcase_add_test (tc, test_accurate_seek_decodes_from_the_key_access_unit_and_shows_the_time);
  tcase_add_test (tc, test_seek_in_a_long_file_finds_its_place_by_bisection);
  tcase_add_test (tc, test_seek_beyond_the_end_ends);
  tcase_add_test (tc, test_seek_finds_its_place_in_spite_of_damage);
  tcase_add_test (tc, test_seek_uses_the_rig_of_the_place);
  tcase_add_test (tc, test_times_that_are_missing_are_right_after_a_seek);
  tcase_add_test (tc, test_pushed_file_is_sought_by_time_too);
  tcase_add_test (tc, test_reverse_playback_is_refused);
  tcase_add_test (tc, test_error_after_a_seek_in_a_file_is_posted_too);
  tcase_add_test (tc, test_takes_of_a_file_follow_each_other);
  tcase_add_test (tc, test_seek_finds_its_take_and_the_rig_there);
  tcase_add_test (tc, test_seek_snaps_across_the_end_of_a_take);
  tcase_add_test (tc, test_seek_in_a_long_file_of_two_takes_finds_its_take);
  tcase_add_test (tc, test_damaged_time_moves_no_other_access_unit);
  tcase_add_test (tc, test_seek_in_a_temporal_file_shows_all_pixels_right_from_there_on);
  return suite;
}

GST_CHECK_MAIN (neighbourcodeseek);
