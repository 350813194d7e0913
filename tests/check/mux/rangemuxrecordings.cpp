/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* rangemux with recordings: not live, each with PTS from 0, that begin, pause and end at different
 * times. */
#include <algorithm>
#include <iterator>
#include <thread>

#include "mux-check.hpp"

using namespace rangecast;
using namespace rangecast::testing;

static constexpr GstClockTime kHour = 3600 * GST_SECOND;

struct FrameSet {
  GstClockTime pts, capture;
  guint views;
};

/* Capture times of a recording, whose PTS are times since its first frame. */
using Recording = std::vector<GstClockTime>;

static Recording
recording (GstClockTime begin, int frames)
{
  Recording times;
  for (int i = 0; i < frames; i++)
    times.push_back (begin + GstClockTime (i) * kFrame);
  return times;
}

/* Plays recordings as files are, each from a thread of its own, until all have ended. */
static std::vector<FrameSet>
play (Mux &mux, const std::vector<Recording> &recordings)
{
  std::vector<std::thread> files;
  for (int stream = 0; stream < int (recordings.size ()); stream++)
    files.emplace_back ([&, stream] {
      const Recording &times = recordings[std::size_t (stream)];
      for (std::size_t i = 0; i < times.size (); i++)
        mux.push (stream, times[i], i * kFrame);
      gst_harness_push_event (mux.in[stream], gst_event_new_eos ());
    });
  std::vector<FrameSet> sets;
  for (bool ended = false; !ended;) {
    while (GstBuffer *buffer = gst_harness_try_pull (mux.out)) {
      FrameSet set = {GST_BUFFER_PTS (buffer), gst_range_buffer_get_capture_time (buffer), 0};
      gpointer state = nullptr;
      while (GstRangeMeta *meta = gst_buffer_iterate_range_meta (buffer, &state))
        set.views |= 1U << meta->view_id;
      gst_buffer_unref (buffer);
      sets.push_back (set);
    }
    GstEvent *event = gst_harness_try_pull_event (mux.out);
    if (!event) {
      g_usleep (500);
      continue;
    }
    ended = GST_EVENT_TYPE (event) == GST_EVENT_EOS;
    gst_event_unref (event);
  }
  for (std::thread &file : files)
    file.join ();
  fail_unless (gst_harness_try_pull (mux.out) == nullptr);
  return sets;
}

static int
count_views (const std::vector<FrameSet> &sets, guint views)
{
  return int (std::ranges::count (sets, views, &FrameSet::views));
}

/* PTS rise, and are as far from each other as capture times are. */
static void
check_distances (const std::vector<FrameSet> &sets)
{
  for (std::size_t i = 1; i < sets.size (); i++) {
    const FrameSet &a = sets[i - 1], &b = sets[i];
    fail_unless (b.pts > a.pts && b.pts - a.pts == b.capture - a.capture, "frame set %d", int (i));
  }
}

GST_START_TEST (test_recordings_that_begin_later_or_pause_lose_no_frame)
{
  /* 1.5 s later, and not in the same phase; a pause of 20 s */
  Recording early = recording (7 * kHour, 60);
  const Recording late = recording (7 * kHour + 37 * kFrame + kFrame / 4, 60);
  for (const GstClockTime time : recording (7 * kHour + 20 * GST_SECOND, 10))
    early.push_back (time);
  for (const bool first_is_late : {false, true}) {
    Mux mux (2);
    const auto sets =
        play (mux, first_is_late ? std::vector{late, early} : std::vector{early, late});
    fail_unless_equals_int (sets.size (), 107);
    fail_unless_equals_int (count_views (sets, 0b11), 23);
    fail_unless_equals_uint64 (sets[0].pts, 0);
    check_distances (sets);
    fail_unless_equals_uint64 (mux.stat ("dropped-late"), 0);
  }
}
GST_END_TEST;

GST_START_TEST (test_recordings_of_other_hours_follow_one_another_by_one_frame)
{
  Mux mux (2);
  const auto sets = play (mux, {recording (5 * kHour, 10), recording (kHour, 10)});
  fail_unless_equals_int (sets.size (), 20);
  for (std::size_t i = 0; i < sets.size (); i++) {
    fail_unless_equals_uint64 (sets[i].pts, i * kFrame);
    fail_unless_equals_int (sets[i].views, i < 10 ? 0b10 : 0b01);
  }
}
GST_END_TEST;

GST_START_TEST (test_loops_of_equal_recordings_lose_nothing)
{
  for (const int streams : {1, 3})
    for (const int frames : {1, 3, 40}) {
      Recording loop;
      for (int round = 0; round < 3; round++)
        for (const GstClockTime time : recording (kHour, frames))
          loop.push_back (time);
      Mux mux (streams);
      const auto sets = play (mux, std::vector<Recording> (std::size_t (streams), loop));
      fail_unless_equals_int (count_views (sets, (1U << streams) - 1), 3 * frames);
      for (std::size_t i = 0; i < sets.size (); i++)
        fail_unless_equals_uint64 (sets[i].pts, i * kFrame);
    }
}
GST_END_TEST;

GST_START_TEST (test_shorter_loops_do_not_stop_longer_ones)
{
  const struct {
    int frames, rounds; /* as many as are played with three rounds of the other */
  } loops[] = {{40, 9}, {1, 711}};
  for (const auto &[frames, rounds] : loops) {
    Recording loop, shorter;
    for (int round = 0; round < 3; round++)
      std::ranges::copy (recording (kHour, 60), std::back_inserter (loop));
    for (int round = 0; round < rounds; round++)
      std::ranges::copy (recording (kHour, frames), std::back_inserter (shorter));
    for (const bool first_is_shorter : {false, true}) {
      Mux mux (2);
      const auto sets =
          play (mux, first_is_shorter ? std::vector{shorter, loop} : std::vector{loop, shorter});
      fail_unless_equals_int (sets.size (), 180);
      fail_unless_equals_int (count_views (sets, 0b11), 3 * frames);
      fail_unless_equals_uint64 (mux.stat ("dropped-late"), frames * (rounds - 3));
    }
  }
}
GST_END_TEST;

GST_START_TEST (test_what_matches_nothing_is_dropped_and_counted_and_the_rest_plays)
{
  const Recording whole = recording (kHour, 20);
  Recording damaged = whole;
  damaged[7] &= ~(GstClockTime (1) << 40); /* a bit of a capture time */
  std::swap (damaged[12], damaged[13]);    /* and two frames in wrong order */
  Mux mux (2);
  const auto sets = play (mux, {whole, damaged});
  fail_unless_equals_int (sets.size (), 20);
  fail_unless_equals_int (count_views (sets, 0b11), 18);
  check_distances (sets);
  fail_unless_equals_uint64 (mux.stat ("dropped-late"), 2);
}
GST_END_TEST;

static Suite *
rangemuxrecordings_suite ()
{
  Suite *suite = suite_create ("rangemuxrecordings");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_recordings_that_begin_later_or_pause_lose_no_frame);
  tcase_add_test (tc, test_recordings_of_other_hours_follow_one_another_by_one_frame);
  tcase_add_test (tc, test_loops_of_equal_recordings_lose_nothing);
  tcase_add_test (tc, test_shorter_loops_do_not_stop_longer_ones);
  tcase_add_test (tc, test_what_matches_nothing_is_dropped_and_counted_and_the_rest_plays);
  return suite;
}

GST_CHECK_MAIN (rangemuxrecordings);
