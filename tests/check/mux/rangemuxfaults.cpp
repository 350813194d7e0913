/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* rangemux in a live pipeline when hosts fail: clocks out of sync, hosts that stand still or are
 * gone, two hosts with one view-id, a host with another rig. */
#include <glib/gstdio.h>

#include <map>
#include <rangecast/rigfile/rig_file.hpp>
#include <utility>

#include "mux-check.hpp"

using namespace rangecast;
using namespace rangecast::testing;

static constexpr GstClockTime kLatency = 20 * GST_MSECOND;
static constexpr GstClockTime kHour = 3600 * GST_SECOND;
static constexpr int kSecond = 26; /* frames, and one more */

struct Told {
  std::string pad, state;
  int view_id;
  gint64 offset;
};

/* A live rangemux of which every stream sends one buffer a frame unless told otherwise. */
struct LiveMux : Mux {
  explicit LiveMux (int views, const std::string &properties = "", bool coded = false)
      : Mux (views, coded, true, ("latency=20000000 " + properties).c_str ())
  {
  }

  /* One frame period: each stream sends what was captured `ahead[stream]` from now; those in
   * `dead` send nothing. @return the views of the frame set as bits, 0 if there is none */
  int frame ()
  {
    const GstClockTime now = kHour * 2 + kFrame * frames;
    for (std::size_t i = 0; i < in.size (); i++)
      if (!(dead >> i & 1))
        push (int (i), now + ahead[int (i)], now);
    frames++;
    go_to (now + kLatency);
    return pull ();
  }
  /* Moves the clock, and waits until something came of it. A test clock wakes only those that it is
   * told to. */
  void go_to (GstClockTime time, bool until_output = true)
  {
    GstTestClock *clock = gst_harness_get_testclock (out);
    gst_test_clock_set_time (clock, time);
    for (int tries = 0; tries < 10000; tries++) {
      GstClockID woken = gst_test_clock_process_next_clock_id (clock);
      if (woken)
        gst_clock_id_unref (woken);
      if (until_output ? gst_harness_buffers_in_queue (out) > 0 : tries > 100)
        break;
      g_usleep (500);
    }
    gst_object_unref (clock);
  }
  /* So many frame periods. @return the views that were in all of their frame sets */
  int always (int periods)
  {
    int views = ~0;
    for (int i = 0; i < periods; i++)
      views &= frame ();
    return views;
  }
  /* @return the views that were in any of their frame sets */
  int ever (int periods)
  {
    int views = 0;
    for (int i = 0; i < periods; i++)
      views |= frame ();
    return views;
  }
  /* What was told since the last call. */
  std::vector<Told> told ()
  {
    read_bus ();
    return std::exchange (told_, {});
  }
  /* The warnings since the last call. */
  std::string warnings ()
  {
    read_bus ();
    return std::exchange (warnings_, {});
  }

  std::map<int, GstClockTimeDiff> ahead;
  unsigned dead = 0;
  int frames = 0;

private:
  void read_bus ()
  {
    while (GstMessage *message = gst_bus_pop (bus)) {
      if (gst_message_has_name (message, "rangemux-stream")) {
        const GstStructure *s = gst_message_get_structure (message);
        Told one;
        one.pad = gst_structure_get_string (s, "pad");
        one.state = gst_structure_get_string (s, "state");
        gst_structure_get (
            s, "view-id", G_TYPE_INT, &one.view_id, "offset", G_TYPE_INT64, &one.offset, nullptr);
        told_.push_back (one);
      } else if (GST_MESSAGE_TYPE (message) == GST_MESSAGE_WARNING) {
        GError *error = nullptr;
        gst_message_parse_warning (message, &error, nullptr);
        warnings_ += std::string (error->message) + "\n";
        g_error_free (error);
      }
      gst_message_unref (message);
    }
  }

  std::vector<Told> told_;
  std::string warnings_;
};

static bool
contains (const std::string &text, const char *part)
{
  return text.find (part) != std::string::npos;
}

/* ---- clocks ---- */

GST_START_TEST (test_a_clock_that_jumps_is_reported_and_ignored_until_it_is_synchronised)
{
  for (const GstClockTimeDiff offset : {GstClockTimeDiff (kHour), -GstClockTimeDiff (kHour)}) {
    LiveMux mux (3);
    fail_unless_equals_int (mux.always (3), 0b111);
    mux.ahead[1] = offset;
    fail_unless_equals_int (mux.ever (2 * kSecond), 0b101);
    const std::vector<Told> told = mux.told ();
    fail_unless_equals_int (told.size (), 1);
    fail_unless_equals_string (told[0].state.c_str (), "out-of-sync");
    fail_unless_equals_string (told[0].pad.c_str (), "sink_1");
    fail_unless_equals_int (told[0].view_id, 1);
    fail_unless_equals_int64 (told[0].offset, offset);
    const std::string warnings = mux.warnings ();
    fail_unless (contains (warnings, "view 1") && contains (warnings, "3600.0"), warnings.c_str ());
    mux.ahead[1] = 0;
    fail_unless_equals_int (mux.always (3), 0b111);
    fail_unless_cmp (mux.told ().at (0).state, ==, "in");
    fail_unless_equals_uint64 (mux.stat ("out-of-sync"), 2 * kSecond);
  }
}
GST_END_TEST;

GST_START_TEST (test_a_capture_time_at_the_end_of_time_does_no_harm)
{
  LiveMux mux (1);
  mux.push (0, GST_CLOCK_TIME_NONE - 1, 0);
  mux.go_to (kLatency);
  fail_unless_equals_int (mux.pull (), 1);
  mux.go_to (kLatency, false);
  fail_unless (gst_harness_try_pull (mux.out) == nullptr);
  fail_unless_equals_uint64 (mux.stat ("frames"), 1);
}
GST_END_TEST;

/* ---- hosts that stand still or are gone ---- */

GST_START_TEST (test_a_host_that_is_gone_is_told_once_and_when_it_is_back)
{
  LiveMux mux (2);
  mux.always (3);
  mux.dead = 0b10;
  fail_unless_equals_int (mux.ever (5 * kSecond), 0b01);
  mux.dead = 0;
  fail_unless_equals_int (mux.always (3), 0b11);
  const std::vector<Told> told = mux.told ();
  fail_unless_equals_int (told.size (), 2);
  fail_unless_equals_string (told[0].state.c_str (), "silent");
  fail_unless_equals_int (told[0].view_id, 1);
  fail_unless_equals_string (told[1].state.c_str (), "in");
}
GST_END_TEST;

GST_START_TEST (test_a_host_that_always_comes_too_late_is_told)
{
  LiveMux mux (3);
  mux.always (3);
  mux.ahead[2] = -GstClockTimeDiff (10 * kFrame);
  fail_unless_equals_int (mux.ever (2 * kSecond), 0b011);
  const std::vector<Told> told = mux.told ();
  fail_unless_equals_int (told.size (), 1);
  fail_unless_equals_string (told[0].state.c_str (), "late");
  fail_unless_equals_int64 (told[0].offset, -GstClockTimeDiff (10 * kFrame));
}
GST_END_TEST;

/* ---- two hosts with one view-id, other rigs, other formats ---- */

GST_START_TEST (
    test_of_two_hosts_with_one_view_the_second_is_told_and_left_out_until_the_first_is_gone)
{
  LiveMux mux (3);
  mux.always (3);
  gst_harness_set_src_caps (
      mux.in[2], gstrange::make_range_caps (gstrange::make_info (mux.one (0), 25, 1)));
  mux.rig.views[2] = mux.rig.views[0];
  for (int i = 0; i < kSecond; i++)
    fail_unless_equals_int (mux.frame (), 0b011);
  const std::string warnings = mux.warnings ();
  fail_unless (contains (warnings, "sink_0 and sink_2"), warnings.c_str ());
  fail_unless (contains (warnings, "view-id 0"), warnings.c_str ());
  fail_unless_equals_int (mux.told ().size (), 1);
  fail_unless_equals_uint64 (mux.stat ("skipped"), kSecond);

  mux.dead = 0b001;
  mux.ever (3 * kSecond);
  fail_unless_equals_int (mux.always (3), 0b011);
  mux.dead = 0; /* the first one comes back: now that one is left out */
  const guint64 before = mux.stat ("skipped");
  fail_unless_equals_int (mux.always (kSecond), 0b011);
  fail_unless_equals_uint64 (mux.stat ("skipped"), before + kSecond);
}
GST_END_TEST;

GST_START_TEST (test_a_host_of_the_other_format_does_not_stop_the_others)
{
  LiveMux mux (3);
  mux.always (3);
  gst_harness_set_src_caps (
      mux.in[0], gstrange::make_neighbour_code_caps (gstrange::make_info (mux.one (0), 25, 1)));
  fail_unless_equals_int (mux.ever (kSecond), 0b110);
  fail_unless (contains (mux.warnings (), "all raw or all coded"));
}
GST_END_TEST;

/* A rig file that lasts as long as this. */
struct RigFile {
  std::string path;
  explicit RigFile (const Rig &rig)
  {
    gchar *folder = g_dir_make_tmp ("rangemux-XXXXXX", nullptr);
    path = std::string (folder) + "/rig.yaml";
    g_free (folder);
    fail_unless_ok (save_rig (path, rig));
  }
  ~RigFile ()
  {
    g_remove (path.c_str ());
    g_rmdir (path.substr (0, path.rfind ('/')).c_str ());
  }
};

GST_START_TEST (test_a_host_with_another_rig_is_told_and_left_out)
{
  Rig rig = ring_rig (3, 64, 48); /* the same cameras, larger pictures */
  const RigFile same (rig);
  LiveMux all (3, "rig=" + same.path);
  fail_unless_equals_int (all.always (3), 0b111);

  rig.views[1].world_from_view.translation.x += 0.01;
  const RigFile other (rig);
  LiveMux mux (3, "rig=" + other.path);
  fail_unless_equals_int (mux.always (kSecond), 0b101);
  const std::string warnings = mux.warnings ();
  fail_unless (contains (warnings, "view 1") && contains (warnings, "0.01"), warnings.c_str ());
  fail_unless_cmp (mux.told ().at (0).state, ==, "other-rig");
}
GST_END_TEST;

static Suite *
rangemuxfaults_suite ()
{
  Suite *suite = suite_create ("rangemuxfaults");
  TCase *tc = tcase_create ("general");
  suite_add_tcase (suite, tc);
  tcase_add_test (tc, test_a_clock_that_jumps_is_reported_and_ignored_until_it_is_synchronised);
  tcase_add_test (tc, test_a_capture_time_at_the_end_of_time_does_no_harm);
  tcase_add_test (tc, test_a_host_that_is_gone_is_told_once_and_when_it_is_back);
  tcase_add_test (tc, test_a_host_that_always_comes_too_late_is_told);
  tcase_add_test (
      tc, test_of_two_hosts_with_one_view_the_second_is_told_and_left_out_until_the_first_is_gone);
  tcase_add_test (tc, test_a_host_of_the_other_format_does_not_stop_the_others);
  tcase_add_test (tc, test_a_host_with_another_rig_is_told_and_left_out);
  return suite;
}

GST_CHECK_MAIN (rangemuxfaults);
