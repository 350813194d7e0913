/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* rangemux with recordings: not live, each with PTS from 0, that begin, pause and end at different
 * times. */
#include <algorithm>

#include "mux-check.hpp"

using namespace rangecast;
using namespace rangecast::testing;

static constexpr GstClockTime kHour = 3600 * GST_SECOND;

struct FrameSet {
  GstClockTime pts, capture;
  guint views;
};

/* One that was recorded: its capture times, one period after another, as often as it is played. */
struct Recording {
  GstClockTime begin;
  int frames;
  GstClockTime period = kFrame;
  int rounds = 1;
  bool pts_go_on = false;      /* where capture times go back */
  std::vector<int> order = {}; /* of the frames; empty: as they were captured */
  int damaged = -1;            /* a frame of which the capture time has a bit cleared */
  int bit = 0;
  int total () const { return frames * rounds; }
  GstClockTime time (int i) const
  {
    return GstClockTime (order.empty () ? i % frames : order[i % frames]) * period;
  }
  GstClockTime capture (int i) const
  {
    const GstClockTime right = begin + time (i);
    return i == damaged ? right & ~(GstClockTime (1) << bit) : right;
  }
  GstClockTime pts (int i) const { return pts_go_on ? GstClockTime (i) * period : time (i); }
};

/* A rangemux that is given recordings. */
struct Recordings : Mux {
  explicit Recordings (std::vector<Recording> list)
      : Mux (int (list.size ())), list_ (std::move (list))
  {
  }

  /* Gives all that the element takes, as files do, until all have ended. */
  std::vector<FrameSet> play ()
  {
    std::vector<int> next (list_.size (), 0);
    std::vector<bool> ended (list_.size (), false);
    std::size_t left = list_.size ();
    while (left > 0)
      for (std::size_t i = 0; i < list_.size (); i++) {
        if (!ended[i] && takes (int (i), next[i])) {
          if (next[i] < list_[i].total ()) {
            push (int (i), list_[i].capture (next[i]), list_[i].pts (next[i]));
            next[i]++;
          } else {
            gst_harness_push_event (in[i], gst_event_new_eos ());
            ended[i] = true;
            left--;
          }
        }
        settle ();
      }
    while (!ended_)
      settle ();
    return got_;
  }

  std::vector<std::string> states; /* told: "sink_0 apart" */
  std::vector<gint64> offsets;
  std::string warnings;
  int n_warnings = 0;

private:
  /* Whether it has taken all so far: a buffer more would block. */
  bool takes (int i, int pushed)
  {
    GstStructure *stats, *of_pad;
    guint64 received = 0;
    g_object_get (out->element, "stats", &stats, nullptr);
    const std::string name = "sink_" + std::to_string (i);
    gst_structure_get (stats, name.c_str (), GST_TYPE_STRUCTURE, &of_pad, nullptr);
    gst_structure_get_uint64 (of_pad, "received", &received);
    gst_structure_free (of_pad);
    gst_structure_free (stats);
    return received == guint64 (pushed);
  }
  /* The element's thread has its turn. */
  void settle ()
  {
    g_usleep (300);
    while (GstBuffer *buffer = gst_harness_try_pull (out)) {
      FrameSet set = {GST_BUFFER_PTS (buffer), gst_range_buffer_get_capture_time (buffer), 0};
      gpointer state = nullptr;
      while (GstRangeMeta *meta = gst_buffer_iterate_range_meta (buffer, &state))
        set.views |= 1U << meta->view_id;
      gst_buffer_unref (buffer);
      got_.push_back (set);
    }
    while (GstEvent *event = gst_harness_try_pull_event (out)) {
      ended_ = ended_ || GST_EVENT_TYPE (event) == GST_EVENT_EOS;
      gst_event_unref (event);
    }
    while (GstMessage *message = gst_bus_pop (bus)) {
      note (message);
      gst_message_unref (message);
    }
  }
  void note (GstMessage *message)
  {
    const GstStructure *s = gst_message_get_structure (message);
    if (gst_message_has_name (message, "rangemux-stream")) {
      states.push_back (std::string (gst_structure_get_string (s, "pad")) + " " +
                        gst_structure_get_string (s, "state"));
      offsets.push_back (0);
      gst_structure_get_int64 (s, "offset", &offsets.back ());
    } else if (GST_MESSAGE_TYPE (message) == GST_MESSAGE_WARNING) {
      GError *error = nullptr;
      gst_message_parse_warning (message, &error, nullptr);
      warnings += std::string (error->message) + "\n";
      n_warnings++;
      g_error_free (error);
    }
  }

  std::vector<Recording> list_;
  std::vector<FrameSet> got_;
  bool ended_ = false;
};

/* PTS rise, and are as far from each other as capture times are. */
static void
check_distances (const std::vector<FrameSet> &sets)
{
  for (std::size_t i = 1; i < sets.size (); i++) {
    const FrameSet &a = sets[i - 1], &b = sets[i];
    fail_unless (b.pts > a.pts && b.pts - a.pts == b.capture - a.capture,
        "frame set %d: PTS %" GST_TIME_FORMAT " then %" GST_TIME_FORMAT
        ", captured at %" GST_TIME_FORMAT " then %" GST_TIME_FORMAT,
        int (i), GST_TIME_ARGS (a.pts), GST_TIME_ARGS (b.pts), GST_TIME_ARGS (a.capture),
        GST_TIME_ARGS (b.capture));
  }
}

static int
count_views (const std::vector<FrameSet> &sets, guint views)
{
  return int (std::ranges::count (sets, views, &FrameSet::views));
}

/* ---- times ---- */

GST_START_TEST (test_pts_are_as_far_apart_as_capture_times_where_one_began_later)
{
  /* begun 1.5 s later, and not in the same phase; which pad that is does not matter */
  const Recording early = {7 * kHour, 60}, late = {7 * kHour + 37 * kFrame + kFrame / 4, 60};
  for (const bool first_is_late : {false, true}) {
    Recordings mux (first_is_late ? std::vector{late, early} : std::vector{early, late});
    const std::vector<FrameSet> sets = mux.play ();
    fail_unless_equals_int (sets.size (), 97);
    fail_unless_equals_int (count_views (sets, 0b11), 23);
    fail_unless_equals_uint64 (sets[0].pts, 0);
    check_distances (sets);
    fail_unless_equals_int (mux.n_warnings, 0);
    fail_unless_equals_uint64 (mux.stat ("dropped-late"), 0);
  }
}
GST_END_TEST;

GST_START_TEST (test_pts_are_as_far_apart_as_capture_times_of_three_that_begin_and_end_as_they_like)
{
  Recordings mux ({{kHour + 10 * kFrame, 5}, {kHour, 30}, {kHour + 20 * kFrame, 40}});
  const std::vector<FrameSet> sets = mux.play ();
  fail_unless_equals_int (sets.size (), 60);
  check_distances (sets);
}
GST_END_TEST;

GST_START_TEST (test_pts_keep_a_pause_of_less_than_a_minute_between_recordings)
{
  Recordings mux ({{kHour, 10}, {kHour + 50 * GST_SECOND, 10}});
  const std::vector<FrameSet> sets = mux.play ();
  fail_unless_equals_int (sets.size (), 20);
  check_distances (sets);
}
GST_END_TEST;

GST_START_TEST (test_hours_between_recordings_are_one_frame)
{
  for (const bool later_first : {false, true}) {
    const Recording a = {kHour, 10}, b = {5 * kHour, 10};
    Recordings mux (later_first ? std::vector{b, a} : std::vector{a, b});
    const std::vector<FrameSet> sets = mux.play ();
    fail_unless_equals_int (sets.size (), 20);
    for (std::size_t i = 0; i < sets.size (); i++)
      fail_unless_equals_uint64 (sets[i].pts, i * kFrame);
  }
}
GST_END_TEST;

GST_START_TEST (test_a_pause_of_minutes_that_the_stream_itself_has_stays)
{
  Mux mux (1);
  for (const GstClockTime time : {GstClockTime (0), kFrame, GstClockTime (300 * GST_SECOND)}) {
    mux.push (0, kHour + time, time);
    GstBuffer *buffer = gst_harness_pull (mux.out);
    fail_unless_equals_uint64 (GST_BUFFER_PTS (buffer), time);
    gst_buffer_unref (buffer);
  }
}
GST_END_TEST;

GST_START_TEST (test_pts_rise_where_capture_times_begin_again)
{
  Mux mux (2);
  GstClockTime last = 0;
  for (int i = 0; i < 40; i++) {
    for (const int stream : {0, 1}) /* a loop of 10 s, of which PTS know nothing */
      mux.push (
          stream, kHour + GstClockTime (i % 10) * GST_SECOND, GstClockTime (i % 10) * GST_SECOND);
    GstBuffer *buffer = gst_harness_pull (mux.out);
    const GstClockTime pts = GST_BUFFER_PTS (buffer);
    if (i > 0)
      fail_unless_equals_uint64 (pts - last, i % 10 ? GST_SECOND : kFrame);
    last = pts;
    gst_buffer_unref (buffer);
  }
}
GST_END_TEST;

GST_START_TEST (test_twice_the_speed_is_half_the_running_time)
{
  Mux mux (2);
  GstSegment segment;
  gst_segment_init (&segment, GST_FORMAT_TIME);
  segment.rate = 2;
  for (const int i : {0, 1})
    gst_harness_push_event (mux.in[i], gst_event_new_segment (&segment));
  mux.push (1, kHour + 5 * kFrame, 0);
  for (int i = 0; i < 10; i++) {
    if (i > 5)
      mux.push (1, kHour + i * kFrame, (i - 5) * kFrame);
    mux.push (0, kHour + i * kFrame, i * kFrame);
    GstBuffer *buffer = gst_harness_pull (mux.out);
    fail_unless_equals_uint64 (GST_BUFFER_PTS (buffer), i * kFrame / 2);
    gst_buffer_unref (buffer);
  }
}
GST_END_TEST;

GST_START_TEST (test_without_capture_times_running_times_stay_at_any_speed)
{
  for (const double rate : {1.0, 1.25}) {
    Mux mux (2);
    GstSegment segment;
    gst_segment_init (&segment, GST_FORMAT_TIME);
    segment.rate = rate;
    for (const int i : {0, 1})
      gst_harness_push_event (mux.in[i], gst_event_new_segment (&segment));
    for (int i = 0; i < 5; i++) {
      for (const int stream : {0, 1})
        mux.push (stream, GST_CLOCK_TIME_NONE, i * kFrame);
      GstBuffer *buffer = gst_harness_pull (mux.out);
      fail_unless_equals_uint64 (GST_BUFFER_PTS (buffer), GstClockTime (i * kFrame / rate));
      gst_buffer_unref (buffer);
    }
  }
}
GST_END_TEST;

GST_START_TEST (test_after_a_seek_for_another_speed_downstream_gets_the_same_running_times)
{
  for (const double rate : {0.5, 1.0, 2.0}) {
    Mux mux (2);
    GstEvent *seek = gst_event_new_seek (rate, GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH,
        GST_SEEK_TYPE_SET, GST_SECOND, GST_SEEK_TYPE_NONE, 0);
    const guint32 seqnum = gst_event_get_seqnum (seek);
    fail_unless (gst_harness_push_upstream_event (mux.out, seek));
    GstSegment segment;
    gst_segment_init (&segment, GST_FORMAT_TIME);
    segment.rate = rate;
    segment.start = segment.time = segment.position = GST_SECOND;
    GstEvent *const events[] = {gst_event_new_flush_start (), gst_event_new_flush_stop (TRUE),
        gst_event_new_segment (&segment)};
    for (GstEvent *event : events) {
      gst_event_set_seqnum (event, seqnum);
      for (const int stream : {0, 1})
        gst_harness_push_event (mux.in[stream], gst_event_ref (event));
      gst_event_unref (event);
    }
    for (int i = 0; i < 5; i++) {
      for (const int stream : {0, 1})
        mux.push (stream, kHour + i * kFrame, GST_SECOND + i * kFrame);
      GstBuffer *buffer = gst_harness_pull (mux.out);
      GstEvent *sent = gst_pad_get_sticky_event (mux.out->sinkpad, GST_EVENT_SEGMENT, 0);
      const GstSegment *out;
      gst_event_parse_segment (sent, &out);
      fail_unless_equals_uint64 (
          gst_segment_to_running_time (out, GST_FORMAT_TIME, GST_BUFFER_PTS (buffer)),
          GstClockTime (i * kFrame / rate));
      gst_event_unref (sent);
      gst_buffer_unref (buffer);
    }
  }
}
GST_END_TEST;

GST_START_TEST (test_after_a_flush_times_are_those_of_the_streams)
{
  Mux mux (2);
  for (const int round : {0, 1}) {
    for (int i = 0; i < 3; i++) {
      for (const int stream : {0, 1})
        mux.push (stream, kHour + (i + 100 * round) * kFrame, (i + 7) * kFrame);
      GstBuffer *buffer = gst_harness_pull (mux.out);
      fail_unless_equals_uint64 (GST_BUFFER_PTS (buffer), (i + 7) * kFrame);
      gst_buffer_unref (buffer);
    }
    const guint32 seqnum = gst_util_seqnum_next (); /* as of one seek */
    for (GstEvent *(*make) () : {+[] { return gst_event_new_flush_start (); },
             +[] { return gst_event_new_flush_stop (TRUE); }})
      for (const int stream : {0, 1}) {
        GstEvent *event = make ();
        gst_event_set_seqnum (event, seqnum);
        gst_harness_push_event (mux.in[stream], event);
      }
    GstSegment segment;
    gst_segment_init (&segment, GST_FORMAT_TIME);
    for (const int stream : {0, 1})
      gst_harness_push_event (mux.in[stream], gst_event_new_segment (&segment));
  }
}
GST_END_TEST;

/* ---- recordings that begin again ---- */

GST_START_TEST (test_a_second_round_of_any_length_loses_nothing)
{
  for (const int streams : {1, 2, 3})
    for (const int frames : {1, 3, 10, 45, 60})
      for (const bool pts_go_on : {false, true}) {
        Recordings mux (std::vector<Recording> (streams, {kHour, frames, kFrame, 3, pts_go_on}));
        const std::vector<FrameSet> sets = mux.play ();
        fail_unless_equals_int (sets.size (), 3 * frames);
        fail_unless_equals_int (count_views (sets, (1U << streams) - 1), 3 * frames);
        for (std::size_t i = 0; i < sets.size (); i++)
          fail_unless_equals_uint64 (sets[i].pts, i * kFrame);
        fail_unless (mux.n_warnings == 0, mux.warnings.c_str ());
      }
}
GST_END_TEST;

GST_START_TEST (test_pts_of_a_second_take_at_another_frame_rate_go_on)
{
  Mux mux (1);
  for (const int take : {0, 1}) {
    const GstClockTime period = kFrame * (take + 1), begin = take * 10 * kFrame;
    gst_harness_set_src_caps (
        mux.in[0], gstrange::make_range_caps (gstrange::make_info (mux.one (0), 25, take + 1)));
    for (GstClockTime i = 0; i < 10; i++) {
      mux.push (0, kHour + i * period, begin + i * period);
      GstBuffer *buffer = gst_harness_pull (mux.out);
      fail_unless_equals_uint64 (GST_BUFFER_PTS (buffer), begin + i * period);
      gst_buffer_unref (buffer);
    }
  }
}
GST_END_TEST;

GST_START_TEST (test_recordings_of_different_lengths_begin_each_round_together)
{
  for (const bool pts_go_on : {false, true}) {
    Recordings two ({{kHour, 10, kFrame, 3, pts_go_on}, {kHour, 14, kFrame, 3, pts_go_on}});
    const std::vector<FrameSet> of_two = two.play ();
    fail_unless_equals_int (of_two.size (), 42);
    fail_unless_equals_int (count_views (of_two, 0b11), 30);
    fail_unless (two.n_warnings == 0, two.warnings.c_str ());
    Recordings three ({{kHour, 14, kFrame, 2, pts_go_on}, {kHour, 10, kFrame, 2, pts_go_on},
        {kHour + kFrame, 11, kFrame, 2, pts_go_on}});
    const std::vector<FrameSet> of_three = three.play ();
    fail_unless_equals_int (of_three.size (), 28);
    fail_unless_equals_int (count_views (of_three, 0b111), 18);
    fail_unless (three.n_warnings == 0, three.warnings.c_str ());
  }
}
GST_END_TEST;

GST_START_TEST (test_a_recording_that_begins_again_waits_for_a_longer_one)
{
  Recordings mux ({{kHour, 10, kFrame, 3}, {kHour, 100}});
  const std::vector<FrameSet> sets = mux.play ();
  fail_unless_equals_int (sets.size (), 100 + 20);
  for (std::size_t i = 0; i < sets.size (); i++)
    fail_unless_equals_int (sets[i].views, i < 10 ? 0b11 : i < 100 ? 0b10 : 0b01);
  fail_unless (mux.n_warnings == 0, mux.warnings.c_str ());
}
GST_END_TEST;

GST_START_TEST (test_a_recording_of_another_clock_stays_left_out_when_the_others_begin_again)
{
  Recordings mux (
      {{kHour, 10, kFrame, 2}, {kHour, 10, kFrame, 2}, {5 * kHour, 40, kFrame, 2, true}});
  const std::vector<FrameSet> sets = mux.play ();
  fail_unless_equals_int (count_views (sets, 0b011), 20);
  fail_unless_equals_int (sets.size (), 20);
  fail_unless_equals_uint64 (mux.stat ("out-of-step"), 80);
}
GST_END_TEST;

GST_START_TEST (test_a_gap_at_the_end_of_a_round_does_not_reach_into_the_next)
{
  Mux mux (2);
  for (int i = 0; i < 10; i++) {
    mux.push (0, kHour + i * kFrame, i * kFrame);
    if (i < 8)
      mux.push (1, kHour + i * kFrame, i * kFrame);
    if (i == 8)
      gst_harness_push_event (mux.in[1], gst_event_new_gap (8 * kFrame, 5 * kFrame));
    fail_unless_equals_int (mux.pull (), i < 8 ? 0b11 : 0b01);
  }
  for (int i = 0; i < 10; i++) {
    for (const int stream : {0, 1})
      mux.push (stream, kHour + i * kFrame, (10 + i) * kFrame);
    fail_unless_equals_int (mux.pull (), 0b11);
  }
}
GST_END_TEST;

GST_START_TEST (test_a_reordered_buffer_is_late_and_no_restart)
{
  const Recording reordered = {kHour, 6, kFrame, 1, false, {0, 1, 3, 2, 4, 5}};
  Recordings one ({reordered});
  fail_unless_equals_int (one.play ().size (), 5);
  fail_unless_equals_uint64 (one.stat ("dropped-late"), 1);
  for (const std::vector<int> &order : {reordered.order, std::vector{1, 0, 2, 3, 4, 5}}) {
    Recordings two ({{kHour, 6}, {kHour, 6, kFrame, 1, false, order}});
    const std::vector<FrameSet> sets = two.play ();
    fail_unless_equals_int (sets.size (), 6);
    fail_unless_equals_int (count_views (sets, 0b11), 5);
    fail_unless_equals_uint64 (two.stat ("dropped-late"), 1);
  }
}
GST_END_TEST;

GST_START_TEST (test_one_damaged_capture_time_is_late_and_no_restart)
{
  constexpr GstClockTime kBegin = (1ULL << 60) | (1ULL << 40) | (1ULL << 31);
  for (const int streams : {2, 3})
    for (const int at : {0, streams - 1})
      for (const int bit : {60, 40, 31})
        for (const int frame : {7, 10, 38}) {
          std::vector<Recording> list (streams, {kBegin, 40});
          list[at].damaged = frame;
          list[at].bit = bit;
          Recordings mux (list);
          const std::vector<FrameSet> sets = mux.play ();
          fail_unless_equals_int (sets.size (), 40);
          fail_unless_equals_int (count_views (sets, (1U << streams) - 1), 39);
          check_distances (sets);
          fail_unless_equals_uint64 (mux.stat ("dropped-late"), 1);
          fail_unless (mux.n_warnings == 0, mux.warnings.c_str ());
        }
}
GST_END_TEST;

GST_START_TEST (test_an_earlier_take_loses_nothing_beside_a_longer_recording)
{
  Recording takes = {kHour, 20, kFrame, 1, true};
  for (int i = 0; i < 20; i++) /* one of 12 frames, and one of 8 captured 5 s before */
    takes.order.push_back (i < 12 ? 125 + i : i - 12);
  Recordings mux ({takes, {kHour + 125 * kFrame, 30}});
  const std::vector<FrameSet> sets = mux.play ();
  fail_unless_equals_int (sets.size (), 38);
  for (int i = 0; i < 38; i++)
    fail_unless_equals_int (sets[i].views, i < 12 ? 0b11 : i < 30 ? 0b10 : 0b01);
  fail_unless_equals_uint64 (mux.stat ("dropped-late"), 0);
}
GST_END_TEST;

/* 100 frames; after 60 of them the clock is set back by as many. */
static Recording
with_clock_set_back (int frames)
{
  Recording recording = {kHour, 100, kFrame, 1, true};
  for (int i = 0; i < 100; i++)
    recording.order.push_back (i < 60 ? i : i - frames);
  return recording;
}

GST_START_TEST (test_clocks_set_back_together_lose_nothing)
{
  for (const int frames : {5, 30, 55}) {
    Recordings mux ({with_clock_set_back (frames), with_clock_set_back (frames)});
    fail_unless_equals_int (count_views (mux.play (), 0b11), 100);
    fail_unless (mux.n_warnings == 0, mux.warnings.c_str ());
  }
}
GST_END_TEST;

GST_START_TEST (test_a_clock_set_back_alone_is_late_until_it_is_where_it_was)
{
  for (const int frames : {5, 35}) {
    Recordings mux ({{kHour, 100}, with_clock_set_back (frames)});
    fail_unless_equals_int (count_views (mux.play (), 0b11), 100 - frames);
    fail_unless_equals_uint64 (mux.stat ("dropped-late"), frames);
  }
}
GST_END_TEST;

/* ---- what is told ---- */

static bool
contains (const std::string &text, const char *part)
{
  return text.find (part) != std::string::npos;
}

GST_START_TEST (test_of_two_recordings_of_other_clocks_one_is_told_once)
{
  Recordings mux ({{kHour, 10}, {5 * kHour, 10}});
  fail_unless_equals_int (mux.play ().size (), 20);
  fail_unless_equals_int (mux.n_warnings, 1);
  fail_unless (contains (mux.warnings, "pad sink_1 (view 1)"), mux.warnings.c_str ());
  fail_unless (contains (mux.warnings, "14400.0"), mux.warnings.c_str ());
  fail_unless_equals_int (mux.states.size (), 2);
  fail_unless_equals_string (mux.states[0].c_str (), "sink_1 apart");
  fail_unless_equals_int64 (mux.offsets[0], 4 * gint64 (kHour));
  fail_unless_equals_string (mux.states[1].c_str (), "sink_1 in"); /* when it goes alone */
  fail_unless_equals_uint64 (mux.stat ("out-of-step"), 0);
  fail_unless_equals_uint64 (mux.stat ("dropped-late"), 0);
}
GST_END_TEST;

GST_START_TEST (test_two_that_take_turns_of_minutes_are_told_once_each)
{
  constexpr GstClockTime kLong = 300 * GST_SECOND;
  Recordings mux ({{kHour, 6, 2 * kLong}, {kHour + kLong, 6, 2 * kLong}});
  fail_unless_equals_int (mux.play ().size (), 12);
  fail_unless_equals_int (mux.n_warnings, 2);
  fail_unless_equals_uint64 (mux.stat ("dropped-late"), 0);
}
GST_END_TEST;

GST_START_TEST (test_a_recording_that_ends_before_the_other_begins_is_told_once)
{
  Recordings mux ({{kHour + 20 * GST_SECOND, 10}, {kHour, 10}});
  fail_unless_equals_int (mux.play ().size (), 20);
  fail_unless_equals_int (mux.n_warnings, 1);
  fail_unless (contains (mux.warnings, "pad sink_1 (view 1)"), mux.warnings.c_str ());
  fail_unless_equals_int (mux.states.size (), 1);
  fail_unless_equals_string (mux.states[0].c_str (), "sink_1 apart");
}
GST_END_TEST;

GST_START_TEST (test_the_one_of_three_that_never_matched_is_told_wherever_it_ends)
{
  for (const GstClockTime begin : {kHour, kHour + 10 * GST_SECOND, kHour + 20 * GST_SECOND}) {
    Recordings mux ({{kHour + 10 * GST_SECOND, 30}, {kHour + 10 * GST_SECOND, 40},
        {begin + (begin == kHour + 10 * GST_SECOND ? kFrame * 3 / 5 : 0), 20}});
    g_object_set (mux.out->element, "max-skew", guint64 (kFrame / 8), nullptr);
    mux.play ();
    fail_unless_equals_int (mux.n_warnings, 1);
    fail_unless (contains (mux.warnings, "pad sink_2 (view 2)"), mux.warnings.c_str ());
  }
}
GST_END_TEST;

GST_START_TEST (test_a_recording_alone_or_beside_an_empty_one_tells_nothing)
{
  for (const auto &list :
      {std::vector<Recording>{{kHour, 10}}, std::vector<Recording>{{kHour, 10}, {kHour, 0}},
          std::vector<Recording>{{kHour, 10}, {kHour + 9 * kFrame, 10}}}) {
    Recordings mux (list);
    mux.play ();
    fail_unless (mux.n_warnings == 0, mux.warnings.c_str ());
    fail_unless (mux.states.empty ());
  }
}
GST_END_TEST;

GST_START_TEST (test_a_recording_left_out_among_three_is_told_with_its_offset)
{
  Recordings mux ({{kHour, 60}, {kHour, 60}, {2 * kHour, 60}});
  mux.play ();
  fail_unless_equals_uint64 (mux.stat ("out-of-step"), 60);
  fail_unless_equals_int (mux.n_warnings, 1);
  fail_unless (contains (mux.warnings, "3600.0") || contains (mux.warnings, "3599.") ||
                   contains (mux.warnings, "3601."),
      mux.warnings.c_str ());
}
GST_END_TEST;

GST_START_TEST (test_what_is_late_among_recordings_is_told_without_advice_for_hosts_and_networks)
{
  Recordings mux ({{kHour, 100}, with_clock_set_back (35)});
  mux.play ();
  fail_unless_equals_int (mux.n_warnings, 1);
  fail_unless (contains (mux.warnings, "pad sink_1 (view 1)"), mux.warnings.c_str ());
  fail_unless (contains (mux.warnings, " s before the last frame set"), mux.warnings.c_str ());
  fail_unless (!contains (mux.warnings, "latency"), mux.warnings.c_str ());
  fail_unless_equals_string (mux.states.at (0).c_str (), "sink_1 late");
  fail_unless (mux.offsets[0] < 0 && mux.offsets[0] > -35 * gint64 (kFrame));
}
GST_END_TEST;

GST_START_TEST (test_a_recording_of_which_all_is_dropped_is_told_however_short_it_is)
{
  Recordings mux ({{kHour, 60}, {kHour, 60}, {2 * kHour, 3}});
  mux.play ();
  fail_unless_equals_uint64 (mux.stat ("out-of-step"), 3);
  fail_unless_equals_int (mux.n_warnings, 1);
  fail_unless_equals_string (mux.states.at (0).c_str (), "sink_2 out-of-step");
}
GST_END_TEST;

GST_START_TEST (test_a_recording_that_waits_for_minutes_to_begin_again_is_told_once)
{
  constexpr GstClockTime kLong = 30 * GST_SECOND;
  Recordings mux ({{kHour, 3, kLong, 2}, {kHour, 10, kLong}});
  fail_unless_equals_int (mux.play ().size (), 13);
  fail_unless_equals_int (mux.n_warnings, 1);
  fail_unless (
      contains (mux.warnings, "pad sink_0 (view 0): it has begun again"), mux.warnings.c_str ());
  fail_unless_equals_string (mux.states.at (0).c_str (), "sink_0 apart");
  fail_unless_equals_int64 (mux.offsets[0], -5 * gint64 (kLong));
}
GST_END_TEST;

/* ---- gaps ---- */

GST_START_TEST (test_a_gap_is_as_long_as_its_own_times_say_where_pts_are_the_streams_own)
{
  Mux mux (2);
  mux.push (1, kHour + 10 * kFrame, 0); /* begun 10 frames later */
  for (int i = 0; i < 10; i++) {
    mux.push (0, kHour + i * kFrame, i * kFrame);
    fail_unless_equals_int (mux.pull (), 0b01);
  }
  mux.push (0, kHour + 10 * kFrame, 10 * kFrame);
  fail_unless_equals_int (mux.pull (), 0b11);
  /* The first one has nothing for two frames: captured as the second one's 1 and 2 are. */
  gst_harness_push_event (mux.in[0], gst_event_new_gap (11 * kFrame, 2 * kFrame));
  for (const int i : {1, 2}) {
    mux.push (1, kHour + (10 + i) * kFrame, i * kFrame);
    fail_unless_equals_int (mux.pull (), 0b10);
  }
  mux.push (1, kHour + 13 * kFrame, 3 * kFrame);
  mux.push (0, kHour + 13 * kFrame, 13 * kFrame);
  fail_unless_equals_int (mux.pull (), 0b11);
  fail_unless_equals_uint64 (mux.stat ("dropped-late"), 0);
}
GST_END_TEST;

static Suite *
rangemuxrecordings_suite ()
{
  Suite *suite = suite_create ("rangemuxrecordings");
  TCase *tc = tcase_create ("general");
  tcase_set_timeout (tc, 120);
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_pts_are_as_far_apart_as_capture_times_where_one_began_later);
  tcase_add_test (
      tc, test_pts_are_as_far_apart_as_capture_times_of_three_that_begin_and_end_as_they_like);
  tcase_add_test (tc, test_pts_keep_a_pause_of_less_than_a_minute_between_recordings);
  tcase_add_test (tc, test_hours_between_recordings_are_one_frame);
  tcase_add_test (tc, test_a_pause_of_minutes_that_the_stream_itself_has_stays);
  tcase_add_test (tc, test_pts_rise_where_capture_times_begin_again);
  tcase_add_test (tc, test_twice_the_speed_is_half_the_running_time);
  tcase_add_test (tc, test_without_capture_times_running_times_stay_at_any_speed);
  tcase_add_test (tc, test_after_a_seek_for_another_speed_downstream_gets_the_same_running_times);
  tcase_add_test (tc, test_after_a_flush_times_are_those_of_the_streams);
  tcase_add_test (tc, test_a_second_round_of_any_length_loses_nothing);
  tcase_add_test (tc, test_pts_of_a_second_take_at_another_frame_rate_go_on);
  tcase_add_test (tc, test_recordings_of_different_lengths_begin_each_round_together);
  tcase_add_test (tc, test_a_recording_that_begins_again_waits_for_a_longer_one);
  tcase_add_test (tc, test_a_recording_of_another_clock_stays_left_out_when_the_others_begin_again);
  tcase_add_test (tc, test_a_gap_at_the_end_of_a_round_does_not_reach_into_the_next);
  tcase_add_test (tc, test_a_reordered_buffer_is_late_and_no_restart);
  tcase_add_test (tc, test_one_damaged_capture_time_is_late_and_no_restart);
  tcase_add_test (tc, test_an_earlier_take_loses_nothing_beside_a_longer_recording);
  tcase_add_test (tc, test_clocks_set_back_together_lose_nothing);
  tcase_add_test (tc, test_a_clock_set_back_alone_is_late_until_it_is_where_it_was);
  tcase_add_test (tc, test_of_two_recordings_of_other_clocks_one_is_told_once);
  tcase_add_test (tc, test_two_that_take_turns_of_minutes_are_told_once_each);
  tcase_add_test (tc, test_a_recording_that_ends_before_the_other_begins_is_told_once);
  tcase_add_test (tc, test_the_one_of_three_that_never_matched_is_told_wherever_it_ends);
  tcase_add_test (tc, test_a_recording_alone_or_beside_an_empty_one_tells_nothing);
  tcase_add_test (tc, test_a_recording_left_out_among_three_is_told_with_its_offset);
  tcase_add_test (
      tc, test_what_is_late_among_recordings_is_told_without_advice_for_hosts_and_networks);
  tcase_add_test (tc, test_a_recording_of_which_all_is_dropped_is_told_however_short_it_is);
  tcase_add_test (tc, test_a_recording_that_waits_for_minutes_to_begin_again_is_told_once);
  tcase_add_test (tc, test_a_gap_is_as_long_as_its_own_times_say_where_pts_are_the_streams_own);
  return suite;
}

GST_CHECK_MAIN (rangemuxrecordings);
